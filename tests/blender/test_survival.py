# SPDX-License-Identifier: GPL-3.0-or-later
"""Users' other actions on a bound and posed object: undo, modes, modifiers, shape keys, other files and scenes."""

import bpy
import numpy as np
import pytest

from conftest import activate, bind, evaluated, group, make_strip, members, own, update


def handle(ob):
    return ob.detail_deform.handles[0].target


@pytest.fixture
def posed():
    ob = bind(make_strip())
    handle(ob).location.z += 0.4
    update()
    return ob


def moves(ob, empty=None):
    """Whether the handle's vertices follow it when it is moved by 0.1; it is moved back."""
    before = evaluated(ob)
    empty = empty or handle(ob)
    empty.location.z += 0.1
    update()
    step = evaluated(ob) - before
    empty.location.z -= 0.1
    update()
    assert np.abs(evaluated(ob) - before).max() < 1e-6
    return np.allclose(step[own(ob)[:, 0] > 0.95], (0, 0, 0.1), atol=1e-5)


def test_undo_and_redo_of_a_bind():
    """After undo it isn't bound; after redo it is bound and follows."""
    ob = make_strip()
    bpy.ops.ed.undo_push(message="before")
    bind(ob)
    bpy.ops.ed.undo_push(message="bound")
    bpy.ops.ed.undo()
    ob = bpy.data.objects['Strip']
    update()
    assert not ob.detail_deform.signature and ob.detail_deform.status == "Not bound."
    bpy.ops.ed.redo()
    ob = bpy.data.objects['Strip']
    update()
    assert moves(ob) and ob.detail_deform.is_bound


def test_modes(posed):
    """The shape stays through every mode, and the surface follows its handle afterwards."""
    shown = evaluated(posed)
    for mode in ('EDIT', 'SCULPT', 'WEIGHT_PAINT', 'VERTEX_PAINT', 'TEXTURE_PAINT'):
        bpy.ops.object.mode_set(mode=mode)
        update()
        bpy.ops.object.mode_set(mode='OBJECT')
        update()
        assert posed.detail_deform.is_bound, posed.detail_deform.status
        assert np.abs(evaluated(posed) - shown).max() < 1e-6, mode
    assert moves(posed)


def test_a_handle_moved_in_edit_mode_is_followed_afterwards(posed):
    bpy.ops.object.mode_set(mode='EDIT')
    handle(posed).location.z += 0.2
    update()
    bpy.ops.object.mode_set(mode='OBJECT')
    update()
    assert posed.detail_deform.is_bound, posed.detail_deform.status
    assert np.abs((evaluated(posed) - own(posed))[members(posed, 'right')] - (0, 0, 0.6)).max() < 1e-5


def test_the_modifier_muted(posed):
    """While the modifier is hidden, the rest shape is shown and nothing is computed; shown again, it has the handle's
    present pose."""
    modifier = posed.modifiers['Detail Deform']
    modifier.show_viewport = False
    update()
    assert np.abs(evaluated(posed) - own(posed)).max() < 1e-7
    assert "hidden, so nothing is computed" in posed.detail_deform.status
    handle(posed).location.z += 0.2
    update()
    modifier.show_viewport = True
    update()
    assert np.allclose(evaluated(posed)[-1] - own(posed)[-1], (0, 0, 0.6), atol=1e-5)


def test_the_modifier_removed_by_hand(posed):
    """The rest shape is shown, and the status says why; Update or Bind adds the modifier again."""
    posed.modifiers.remove(posed.modifiers['Detail Deform'])
    handle(posed).location.z += 0.1
    update()
    assert np.abs(evaluated(posed) - own(posed)).max() < 1e-7
    assert "modifier was removed, so nothing is shown: press Update" in posed.detail_deform.status
    assert bpy.ops.object.detail_deform_update() == {'FINISHED'}
    assert np.allclose(evaluated(posed)[-1] - own(posed)[-1], (0, 0, 0.5), atol=1e-5)
    assert "removed" not in posed.detail_deform.status
    posed.modifiers.remove(posed.modifiers['Detail Deform'])
    bind(posed, keep_rest=True)
    assert np.allclose(evaluated(posed)[-1] - own(posed)[-1], (0, 0, 0.5), atol=1e-5)


def test_the_modifier_applied_by_hand(posed):
    """Like the add-on's Apply: the mesh has the result, is no longer bound, and has no attributes of the add-on."""
    shown = evaluated(posed)
    bpy.ops.object.modifier_apply(modifier='Detail Deform')
    update()
    assert np.abs(own(posed) - shown).max() < 1e-6 and np.abs(evaluated(posed) - shown).max() < 1e-6
    assert not posed.detail_deform.signature and "applied" in posed.detail_deform.status
    assert 'detail_deform_offset' not in posed.data.attributes
    bind(posed)
    assert moves(posed)


@pytest.mark.parametrize('first', [False, True])
def test_subdivision(posed, first):
    """Before or behind Detail Deform: the subdivided surface follows the handle."""
    posed.modifiers.new("Subdivision", 'SUBSURF')
    if first:
        bpy.ops.object.modifier_move_to_index(modifier="Subdivision", index=0)
    update()
    shown = evaluated(posed)
    assert len(shown) > 2 * len(own(posed)) and posed.detail_deform.is_bound
    assert abs(shown[:, 2].max() - 0.4) < 0.05
    handle(posed).location.z += 0.1
    update()
    assert abs(evaluated(posed)[:, 2].max() - shown[:, 2].max() - 0.1) < 1e-3


def test_mirror_behind(posed):
    """Both halves are deformed."""
    shown = evaluated(posed)
    mirror = posed.modifiers.new("Mirror", 'MIRROR')
    mirror.use_axis = (False, True, False)
    mirror.use_mirror_merge = False
    update()
    n = len(shown)
    both = evaluated(posed)
    assert np.abs(both[:n] - shown).max() < 1e-6
    assert np.abs(both[n:] - shown * (1, -1, 1)).max() < 1e-6


@pytest.mark.parametrize('first', [False, True])
def test_armature(posed, first):
    """Before Detail Deform: the offsets are added to the pose. Behind it: the offsets are posed too."""
    data = bpy.data.armatures.new("Rig")
    rig = bpy.data.objects.new("Rig", data)
    bpy.context.scene.collection.objects.link(rig)
    activate(rig)
    bpy.ops.object.mode_set(mode='EDIT')
    bone = data.edit_bones.new("Bone")
    bone.tail = (0, 0, 1)
    bpy.ops.object.mode_set(mode='OBJECT')
    group(posed, "Bone", range(len(posed.data.vertices)))
    offsets = evaluated(posed) - own(posed)
    modifier = posed.modifiers.new("Armature", 'ARMATURE')
    modifier.object = rig
    activate(posed)
    if first:
        bpy.ops.object.modifier_move_to_index(modifier="Armature", index=0)
    rig.pose.bones["Bone"].rotation_mode = 'XYZ'
    rig.pose.bones["Bone"].rotation_euler = (0, np.pi / 2, 0)  # about its own Y axis, which is the world's Z
    update()
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    if first:
        expected = own(posed) @ quarter.T + offsets
    else:
        expected = (own(posed) + offsets) @ quarter.T
    assert np.abs(evaluated(posed) - expected).max() < 1e-5
    assert posed.detail_deform.is_bound


def test_shape_keys(posed):
    """Offsets are added to the shape by keys; changing a key's value is no edit of the mesh."""
    offsets = evaluated(posed) - own(posed)
    posed.shape_key_add(name="Basis")
    key = posed.shape_key_add(name="Wide")
    for point, rest in zip(key.data, posed.data.vertices):
        point.co = rest.co + rest.co.x * rest.co / 2
    key.value = 0.5
    update()
    moved = own(posed) * (1 + own(posed)[:, :1] / 4)
    assert np.abs(evaluated(posed) - moved - offsets).max() < 1e-5
    assert posed.detail_deform.is_bound and moves(posed)


def test_append_and_link(posed, tmp_path):
    """Appended with its collection it follows; the object alone keeps its shape and its status names the missing
    empties; linked it shows the saved result."""
    shown = evaluated(posed)
    collection = bpy.data.collections.new("Asset")
    bpy.context.scene.collection.children.link(collection)
    for ob in (posed, handle(posed)):
        collection.objects.link(ob)
    blend = str(tmp_path / 'asset.blend')
    bpy.ops.wm.save_as_mainfile(filepath=blend)

    def fetched(kind, name, link):
        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
        with bpy.data.libraries.load(blend, link=link) as (_, wanted):
            setattr(wanted, kind, [name])
        into = bpy.context.scene.collection
        (into.children if kind == 'collections' else into.objects).link(getattr(bpy.data, kind)[name])
        update()
        ob = bpy.data.objects['Strip']
        assert np.abs(evaluated(ob) - shown).max() < 1e-6
        return ob

    ob = fetched('collections', "Asset", link=False)
    assert moves(ob) and ob.detail_deform.is_bound
    ob = fetched('objects', "Strip", link=False)
    bpy.context.view_layer.objects.active = ob
    ob.detail_deform.steps = 1
    bpy.context.scene.frame_set(2)
    assert "lost their empties" in ob.detail_deform.status
    assert np.abs(evaluated(ob) - shown).max() < 1e-6
    ob = fetched('collections', "Asset", link=True)
    bpy.context.scene.frame_set(2)
    assert np.abs(evaluated(ob) - shown).max() < 1e-6


def status_after_a_move():
    bpy.context.scene.frame_set(2)
    return bpy.data.objects['Strip'].detail_deform.status


def test_a_linked_object_that_is_made_local_follows(posed, tmp_path):
    shown = evaluated(posed)
    blend = str(tmp_path / 'asset.blend')
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    with bpy.data.libraries.load(blend, link=True) as (_, wanted):
        wanted.objects = ['Strip', 'Right']
    for name in ('Strip', 'Right'):
        bpy.context.scene.collection.objects.link(bpy.data.objects[name])
    update()
    update()
    assert "is linked from another file" in status_after_a_move()
    for ob in bpy.context.scene.objects:
        ob.select_set(True)
    bpy.ops.object.make_local(type='ALL')
    update()
    ob = bpy.data.objects['Strip']
    assert np.abs(evaluated(ob) - shown).max() < 1e-6
    assert moves(ob)


@pytest.mark.parametrize('kind', ['LINK_COPY', 'FULL_COPY'])
def test_a_copy_of_the_scene(posed, kind):
    """A linked copy has the same objects; a full copy has its own object and empties."""
    first = bpy.context.window.scene
    bpy.ops.scene.new(type=kind)
    second = bpy.context.window.scene
    assert second != first
    ob = next(o for o in second.objects if o.type == 'MESH')
    update()
    assert (ob == posed) == (kind == 'LINK_COPY')
    assert (handle(ob) == handle(posed)) == (kind == 'LINK_COPY')
    assert moves(ob)
    bpy.context.window.scene = first
    update()
    assert moves(posed)


def test_several_scenes_play_each_their_own(posed):
    """An object isn't updated while another scene is shown, and has the present pose when its own is."""
    other = bpy.data.scenes.new("Other")
    window = bpy.context.window
    home = window.scene
    window.scene = other
    handle(posed).location.z += 0.3
    other.frame_set(5)
    window.scene = home
    home.frame_set(5)
    assert np.allclose(evaluated(posed)[-1] - own(posed)[-1], (0, 0, 0.7), atol=1e-5)


def test_the_object_deleted_and_brought_back_by_undo(posed):
    bpy.ops.ed.undo_push(message="posed")
    bpy.data.objects.remove(posed)
    update()
    bpy.context.scene.frame_set(3)
    bpy.ops.ed.undo_push(message="deleted")
    bpy.ops.ed.undo()
    ob = bpy.data.objects['Strip']
    update()
    assert moves(ob)


def test_purging_orphans_leaves_a_bound_object_whole(posed):
    bpy.data.orphans_purge(do_recursive=True)
    update()
    assert moves(posed)
