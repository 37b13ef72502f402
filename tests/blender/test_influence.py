# SPDX-License-Identifier: GPL-3.0-or-later
"""Influence: a vertex group whose weights scale the displayed offsets."""

import bpy
import numpy as np
import pytest

from conftest import activate, bind, evaluated, group, make_strip, own, update


@pytest.fixture
def lifted():
    """A bound and lifted strip, with a group "soft" whose weights rise from 0 to 1 across it."""
    ob = bind(make_strip())
    soft = ob.vertex_groups.new(name='soft')
    for vertex, y in enumerate(own(ob)[:, 1]):
        soft.add([vertex], float(y), 'REPLACE')
    ob.detail_deform.handles[0].target.location.z += 0.4
    update()
    return ob


def shown(ob):
    update()
    return evaluated(ob) - own(ob)


def test_weights_scale_the_offsets(lifted):
    whole, y = shown(lifted), own(lifted)[:, 1:2]
    assert np.abs(whole).max() > 0.3
    lifted.detail_deform.influence = 'soft'
    assert np.abs(shown(lifted) - y * whole).max() < 1e-6
    lifted.detail_deform.invert_influence = True
    assert np.abs(shown(lifted) - (1 - y) * whole).max() < 1e-6
    # Changed weights apply without a new Bind.
    lifted.vertex_groups['soft'].add(range(len(y)), 0.25, 'REPLACE')
    assert np.abs(shown(lifted) - 0.75 * whole).max() < 1e-6
    lifted.detail_deform.influence = ''
    assert np.abs(shown(lifted) - whole).max() < 1e-6 and lifted.detail_deform.is_bound


def test_an_influence_chosen_before_bind_applies(part):
    ob = make_strip()
    ob.detail_deform.influence = 'right'
    bind(ob)
    ob.detail_deform.handles[0].target.location.z += 0.4
    moved = np.linalg.norm(shown(ob), axis=1)
    assert (moved > 0.39).sum() == 75 and (moved == 0).sum() == len(moved) - 75


def test_without_its_group_nothing_is_shown_and_the_status_says_so(lifted):
    lifted.detail_deform.influence = 'soft'
    assert "Influence refers" not in lifted.detail_deform.status
    lifted.vertex_groups.remove(lifted.vertex_groups['soft'])
    assert np.abs(shown(lifted)).max() == 0
    assert "'soft', which 'Strip' does not have, so that nothing" in lifted.detail_deform.status
    lifted.detail_deform.invert_influence = True
    assert np.abs(shown(lifted)).max() > 0.3 and "so that all of" in lifted.detail_deform.status


def test_a_follower_whose_group_is_gone_says_so():
    source, target = make_strip(name="Source"), make_strip(name="Target")
    target.detail_deform.handles.clear()
    target.detail_deform.transfer.source = source
    target.detail_deform.influence = 'right'
    activate(target)
    assert bpy.ops.object.detail_deform_transfer_live() == {'FINISHED'}
    assert "Influence" not in target.detail_deform.transfer.state
    target.vertex_groups.remove(target.vertex_groups['right'])
    assert "Influence refers to the vertex group 'right'" in target.detail_deform.transfer.state


@pytest.mark.parametrize('bound', [False, True])
def test_offsets_of_a_joined_object_are_not_shown(bound):
    """Join brings the attributes of the joined mesh along, and with them its offsets. bound: also the offsets of the
    binding before, from which its present one started."""
    joined, ob = bind(make_strip(name="Joined")), make_strip()
    joined.detail_deform.handles[0].target.location.z += 0.4
    update()
    if bound:
        group(joined, 'middle', np.flatnonzero(np.abs(own(joined)[:, 0] - 0.5) < 0.03))
        empty = bpy.data.objects.new("Middle", None)
        bpy.context.scene.collection.objects.link(empty)
        handle = joined.detail_deform.handles.add()
        handle.name = handle.vertex_group = 'middle'
        handle.target = empty
        update()
        bind(joined, keep_rest=True)
    activate(ob)
    joined.select_set(True)
    assert bpy.ops.object.join() == {'FINISHED'}
    assert ob.data.attributes.get('detail_deform_offset')
    bind(ob, keep_rest=True)
    assert np.abs(shown(ob)).max() < 1e-6
    ob.detail_deform.handles[0].target.location.z += 0.2
    assert np.abs(shown(ob)).max() == pytest.approx(0.2, abs=1e-3)


@pytest.mark.parametrize('mode', ['MESH', 'SHAPE_KEY'])
def test_apply_takes_what_is_shown(lifted, mode):
    lifted.detail_deform.influence, lifted.detail_deform.invert_influence = 'soft', True
    before = evaluated_now(lifted)
    activate(lifted)
    bpy.ops.object.detail_deform_apply(mode=mode)
    assert np.abs(evaluated_now(lifted) - before).max() < 1e-6


def evaluated_now(ob):
    update()
    return evaluated(ob)


def test_baked_shape_keys_hold_what_is_shown(lifted):
    lifted.detail_deform.influence = 'soft'
    before = evaluated_now(lifted)
    bpy.ops.object.detail_deform_bake(mode='SHAPE_KEYS', frame_start=1, frame_end=1)
    assert np.abs(evaluated_now(lifted) - before).max() < 1e-6


def test_an_influence_group_named_like_an_attribute_is_told():
    ob = bind(make_strip())
    group(ob, 'position', [0])
    ob.detail_deform.influence = 'position'
    assert "'position' has the name of an attribute" in ob.detail_deform.status
    ob.detail_deform.influence = 'right'
    assert "attribute" not in ob.detail_deform.status
