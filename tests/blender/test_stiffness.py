# SPDX-License-Identifier: GPL-3.0-or-later
"""Painted stiffness: parts that are rigid or bend less, by a vertex group."""

import math

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from conftest import activate, bind, choose, evaluated, group, members, own, refusal, rigid_motion, update
from test_own_reach import by_itself, pose, two_pulls
from test_solidity import LENGTH, lead_down, make_tentacle, sections, twist

PLATE = 0.2 * LENGTH  # its length


def plate_of(ob):
    """The vertices of a plate on the limb's side."""
    x, y, z = own(ob).T
    return np.flatnonzero((np.abs(z - 0.4 * LENGTH) < PLATE / 2) & (np.abs(np.arctan2(y, x)) < 1))


def off_rigid(ob, vertices):
    """How far these vertices are off the rigid motion that fits them best, over the plate's length."""
    return np.linalg.norm(rigid_motion(own(ob)[vertices], evaluated(ob)[vertices])[1], axis=1).max() / PLATE


def bend(ob, degrees=90):
    """Turns the tip about a place beside the limb's middle."""
    about = Matrix.Translation(Vector((0.19 * LENGTH, 0, 0.5 * LENGTH)))
    empty = ob.detail_deform.handles[0].target
    empty.matrix_world = (about @ Matrix.Rotation(math.radians(degrees), 4, 'Y') @ about.inverted()
                          @ Matrix.Translation((0, 0, LENGTH)))
    update()


def put_back(ob):
    """Unbinds, and puts the empty where it was."""
    bpy.ops.object.detail_deform_unbind()
    ob.detail_deform.handles[0].target.matrix_world = Matrix.Translation((0, 0, LENGTH))
    update()


def paint(ob, name, vertices, weight=1.0):
    painted = ob.vertex_groups.get(name) or ob.vertex_groups.new(name=name)
    painted.add([int(v) for v in vertices], weight, 'REPLACE')
    ob.data.update()
    update()


@pytest.fixture
def limb():
    ob = make_tentacle()
    group(ob, 'armour', plate_of(ob))
    return ob


@pytest.mark.parametrize('move', [bend, lambda ob: twist(ob, 90), lead_down])
def test_a_plate_keeps_its_shape_while_its_limb_is_bent_twisted_or_led_aside(limb, move):
    plate, rest = plate_of(limb), sections(evaluated(bind(limb)))
    move(limb)
    assert off_rigid(limb, plate) > 0.02
    put_back(limb)
    limb.detail_deform.stiff_parts = 'armour'
    move(bind(limb))
    assert limb.detail_deform.is_bound, limb.detail_deform.status
    assert off_rigid(limb, plate) < 1e-3
    assert (sections(evaluated(limb)) / rest).min() > 0.85


def test_more_weight_bends_less(limb):
    plate, found = plate_of(limb), []
    limb.detail_deform.stiff_parts = 'armour'
    for weight in (0.0, 0.25, 0.5, 0.75, 1.0):
        paint(limb, 'armour', plate, weight)
        bend(bind(limb))
        found.append(off_rigid(limb, plate))
        put_back(limb)
    assert all(more < 0.6 * less for less, more in zip(found, found[1:])), found


def test_what_is_repainted_is_told_and_a_new_bind_has_it(limb):
    settings = limb.detail_deform
    settings.stiff_parts = 'armour'
    bind(limb)
    assert settings.stale == "" and settings.is_bound
    paint(limb, 'armour', plate_of(limb), 0.5)
    assert "Stiff Parts, or the weights of its group, were changed since Bind." in settings.status
    assert not settings.is_bound
    paint(limb, 'armour', plate_of(limb), 1)  # as it was
    assert settings.is_bound, settings.status
    settings.stiff_parts = ""
    assert "Stiff Parts, or the" in settings.status
    assert bpy.ops.object.detail_deform_bind(keep_rest=True) == {'FINISHED'}
    assert settings.is_bound


def test_a_renamed_group_is_followed_and_a_missing_one_is_told(limb):
    settings = limb.detail_deform
    settings.stiff_parts = 'nothing'
    told = "'Tentacle' has no vertex group 'nothing', by which parts are to be stiff: choose another one in Stiff Parts"
    assert told in refusal(bpy.ops.object.detail_deform_bind)
    settings.stiff_parts = 'armour'
    bind(limb)
    limb.vertex_groups['armour'].name = "Shell"
    limb.data.update()
    update()
    assert settings.stiff_parts == "Shell" and settings.is_bound, settings.status
    limb.vertex_groups.remove(limb.vertex_groups["Shell"])
    limb.data.update()
    update()
    assert "has no vertex group 'Shell'" in settings.status


def test_weights_that_change_nothing_are_told(limb):
    settings = limb.detail_deform
    settings.stiff_parts = 'region'
    bind(limb)
    told = "Vertex group 'region' has one weight on all that may deform, so Stiff Parts changes nothing"
    assert told in settings.status
    bend(limb)
    even = evaluated(limb)
    settings.stiff_parts = ""
    put_back(limb)
    bend(bind(limb))
    assert np.abs(evaluated(limb) - even).max() < 1e-6


def test_it_is_saved_and_copied_with_the_object(limb, tmp_path):
    limb.detail_deform.stiff_parts = 'armour'
    bend(bind(limb))
    expected = evaluated(limb)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'limb.blend'))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / 'limb.blend'))
    ob = bpy.data.objects["Tentacle"]
    bend(ob, 60)
    bend(ob)
    assert ob.detail_deform.is_bound and np.abs(evaluated(ob) - expected).max() < 1e-6
    other = ob.copy()
    other.data = ob.data.copy()
    bpy.context.scene.collection.objects.link(other)
    update()
    assert other.detail_deform.is_bound and np.abs(evaluated(other) - expected).max() < 1e-6


def test_a_handle_that_is_removed_leaves_its_group_if_it_is_the_stiffness(limb):
    handle = limb.detail_deform.handles[0]
    handle.own_group = handle.vertex_group
    limb.detail_deform.stiff_parts = handle.vertex_group
    activate(limb)
    bpy.ops.object.detail_deform_handle_remove()
    assert limb.detail_deform.stiff_parts in limb.vertex_groups


def test_within_a_reach_of_its_own():
    """As the same in a region of its own."""
    ob, _, small, reach = two_pulls()
    p, core = own(ob), members(ob, "Handle.001")
    patch = np.flatnonzero(reach & ~core & (p[:, 1] > 0))
    group(ob, 'armour', patch)
    ob.detail_deform.stiff_parts = 'armour'
    bind(ob)
    motion = {'z': 0.15, 'turn': -0.4, 'about': (0.45, 0, 0)}
    pose(small, **motion)
    stiff = evaluated(ob) - p
    soft = by_itself(reach, [(core, motion)])
    assert np.abs(stiff - soft).max() > 0.01
    alone = by_itself(reach, [(core, motion)], [('armour', patch)], stiff_parts='armour')
    assert np.abs(stiff - alone).max() < 2e-4 * np.sqrt(8)


@pytest.mark.parametrize('settings, is_rigid', [
    ({}, True), ({'refine': 16}, True), ({'solidity': 0, 'refine': 8}, True), ({'method': 'GRADIENT'}, True),
    ({'refine': 0}, False), ({'rotation_only': False}, False), ({'formulation': 'FOURTH_POINTS'}, False),
    ({'method': 'VARIATIONAL'}, False), ({'method': 'NORMAL'}, False)])
def test_where_parts_are_not_rigid_it_is_told(limb, settings, is_rigid):
    choose(limb, stiff_parts='armour', **settings)
    bend(bind(limb))
    assert (off_rigid(limb, plate_of(limb)) < 1e-3) == is_rigid
    assert ("Stiff Parts are not rigid as it is set now" in limb.detail_deform.status) != is_rigid


def test_a_changed_base_is_not_taken_for_a_changed_stiffness(limb):
    choose(limb, stiff_parts='armour')
    bind(limb)
    limb.detail_deform.smoothness = 3
    assert "Settings or examples that need a new Bind were changed" in limb.detail_deform.status
