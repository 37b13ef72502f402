# SPDX-License-Identifier: GPL-3.0-or-later
"""Set Origin and Apply on a bound and posed object change its local space but move nothing in the world, neither at
once nor with the next Re-bind: everything that the add-on keeps in local space is transformed along."""

import math

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix

from conftest import activate, add_empty, add_handle, bind, evaluated, group, make_strip, own, symmetric, update
from shapes import tube

TILTED = Matrix.LocRotScale((3, 1, -2), Euler((0.3, 0, 0.8)), (2, 2, 2))


def seen(ob):
    """(n, 3): the evaluated positions in the world."""
    world = np.array(ob.matrix_world)
    return evaluated(ob) @ world[:3, :3].T + world[:3, 3]


def size(positions):
    return np.linalg.norm(np.ptp(positions, axis=0))


def set_origin(ob, kind='ORIGIN_GEOMETRY'):
    bpy.context.scene.cursor.location = (1, -4, 2)
    activate(ob)
    assert bpy.ops.object.origin_set(type=kind) == {'FINISHED'}


def apply(ob, *what):
    activate(ob)
    chosen = {name: name in what for name in ('location', 'rotation', 'scale')}
    assert bpy.ops.object.transform_apply(**chosen) == {'FINISHED'}


CHANGES = {
    'origin to geometry': set_origin,
    'origin to the cursor': lambda ob: set_origin(ob, 'ORIGIN_CURSOR'),
    'apply location': lambda ob: apply(ob, 'location'),
    'apply rotation': lambda ob: apply(ob, 'rotation'),
    'apply scale': lambda ob: apply(ob, 'scale'),
    'apply all': lambda ob: apply(ob, 'location', 'rotation', 'scale'),
    'two of them': lambda ob: (set_origin(ob), update(), apply(ob, 'rotation', 'scale')),
    'two of them at once': lambda ob: (apply(ob, 'rotation', 'scale'), set_origin(ob)),
}


def check_nothing_moves(ob, change, empty=None, exact=1e-5):
    update()
    before = seen(ob)
    assert np.abs(evaluated(ob) - own(ob)).max() > 0.1  # posed
    change(ob)
    update()
    assert np.abs(seen(ob) - before).max() < exact * size(before), "at once"
    bind(ob, keep_rest=True)
    assert np.abs(seen(ob) - before).max() < exact * size(before), "bound again"
    if empty:  # the surface still follows its handle
        empty.location.z += 0.1
        update()
        assert np.abs(seen(ob) - before).max() > 0.05
        empty.location.z -= 0.1
        update()
        assert np.abs(seen(ob) - before).max() < exact * size(before), "moved and back"


@pytest.mark.parametrize('name', CHANGES)
@pytest.mark.parametrize('parented', [False, True])
def test_nothing_moves(name, parented):
    ob = make_strip(world=TILTED)
    empty = ob.detail_deform.handles[0].target
    if parented:
        empty.parent = ob
        empty.matrix_parent_inverse = ob.matrix_world.inverted()
        update()
    bind(ob)
    empty.location.z += 0.5
    empty.rotation_euler.y = 0.4
    check_nothing_moves(ob, CHANGES[name], empty)


@pytest.mark.parametrize('name', CHANGES)
def test_at_rest_it_stays_at_rest(name):
    ob = bind(make_strip(world=TILTED))
    CHANGES[name](ob)
    update()
    bind(ob, keep_rest=True)
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-5


@pytest.mark.parametrize('name', CHANGES)
def test_a_handle_that_came_to_the_deformed_surface(name):
    """The shape at which the second handle was bound is transformed along, and so are the handles' rest places."""
    ob = bind(make_strip(world=TILTED))
    rest = seen(ob)
    empty = ob.detail_deform.handles[0].target
    empty.location.z += 0.5
    update()
    members = np.flatnonzero(np.abs(own(ob)[:, 0] - 0.5) < 0.03)
    group(ob, 'middle', members)
    add_handle(ob, 'middle', add_empty("Middle", seen(ob)[members].mean(0)))
    update()
    bind(ob, keep_rest=True)
    ob.detail_deform.handles[1].target.location.z += 0.2
    check_nothing_moves(ob, CHANGES[name], empty)
    activate(ob)
    bpy.ops.object.detail_deform_handle_reset(everything=True)
    update()
    assert np.abs(seen(ob) - rest).max() < 1e-5 * size(rest)


@pytest.mark.parametrize('name', CHANGES)
def test_a_handle_that_mirrors_another(name):
    """Its mirror plane is transformed along."""
    ob = symmetric()
    ob.matrix_world = TILTED
    x = own(ob)[:, 0]
    group(ob, 'region', np.flatnonzero(np.abs(x) > 0.05))
    ob.detail_deform.region = 'region'
    for side, chosen in (('left', x < -0.45), ('right', x > 0.45)):
        group(ob, side, np.flatnonzero(chosen))
    update()
    empty = add_empty("Right", TILTED @ Matrix.Translation((0.5, 0, 0)).translation)
    add_handle(ob, 'right', empty)
    mirroring = add_handle(ob, 'left', None)
    mirroring.mirrors, mirroring.mirror_axis = 'right', 'X'
    update()
    bind(ob)
    empty.location.z += 0.4
    empty.rotation_euler = (0.2, 0.5, 0.1)
    check_nothing_moves(ob, CHANGES[name], empty)


@pytest.mark.parametrize('name', CHANGES)
@pytest.mark.parametrize('levels', [0, 2])
def test_a_base_object(name, levels):
    """A base object that is a copy of the surface, or one whose modifiers make vertices."""
    ob = make_strip(world=TILTED)
    base = ob.copy()
    base.data = ob.data.copy()
    bpy.context.scene.collection.objects.link(base)
    for level in ('levels', 'render_levels') * bool(levels):
        modifier = base.modifiers.get("Subdivision") or base.modifiers.new("Subdivision", 'SUBSURF')
        setattr(modifier, level, levels)
    bend = base.modifiers.new("Bend", 'SIMPLE_DEFORM')
    bend.deform_method, bend.angle, bend.deform_axis = 'BEND', 0, 'Y'
    ob.detail_deform.base, ob.detail_deform.base_object = 'OBJECT', base
    ob.detail_deform.handles.clear()
    update()
    bind(ob)
    bend.angle = math.radians(70)
    check_nothing_moves(ob, CHANGES[name], exact=2e-5)


@pytest.mark.parametrize('change', [
    Matrix.Translation((0.3, 0, 0.2)), Matrix.Scale(1.5, 4), Matrix.Rotation(0.4, 4, 'Y')])
def test_all_vertices_moved_by_hand_are_an_edit(change):
    """An edit that moves all vertices alike is not taken for a change of the local space: the handles' motions stay as
    they are in the object's space."""
    ob = bind(make_strip())
    empty = ob.detail_deform.handles[0].target
    empty.location.z += 0.5
    update()
    ob.data.transform(change)
    ob.data.update()
    update()
    bind(ob, keep_rest=True)
    assert np.abs(evaluated(ob)[-25:] - own(ob)[-25:] - (0, 0, 0.5)).max() < 1e-5


def test_what_a_file_holds_goes_along(tmp_path):
    """Saved between Apply and Re-bind."""
    ob = make_strip(world=TILTED)
    bind(ob)
    ob.detail_deform.handles[0].target.location.z += 0.5
    update()
    before = seen(ob)
    apply(ob, 'rotation', 'scale')
    update()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'applied.blend'))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / 'applied.blend'))
    ob = bind(bpy.data.objects['Strip'], keep_rest=True)
    assert np.abs(seen(ob) - before).max() < 1e-5 * size(before)


def test_undone_and_redone():
    ob = make_strip(world=TILTED)
    bind(ob)
    ob.detail_deform.handles[0].target.location.z += 0.5
    update()
    before = seen(ob)
    bpy.ops.ed.undo_push(message="posed")
    apply(ob, 'location', 'rotation', 'scale')
    update()
    bpy.ops.ed.undo_push(message="applied")
    for step in (bpy.ops.ed.undo, bpy.ops.ed.redo):
        step()
        ob = bpy.data.objects['Strip']
        update()
        bind(ob, keep_rest=True)
        assert np.abs(seen(ob) - before).max() < 1e-5 * size(before)
        if step == bpy.ops.ed.undo:
            bpy.ops.ed.undo_push(message="bound")
            apply(ob, 'location', 'rotation', 'scale')
            update()
            bpy.ops.ed.undo_push(message="applied")
            bpy.ops.ed.undo()


def test_a_flat_mesh():
    """A plane's vertices don't determine the change of space along its normal; it is completed as a rotation and a
    scale."""
    ob = make_strip(world=TILTED)
    flat = own(ob) * (1, 1, 0)
    ob.data.vertices.foreach_set('co', flat.astype(np.float32).ravel())
    ob.data.update()
    update()
    bind(ob)
    empty = ob.detail_deform.handles[0].target
    empty.location.z += 0.5
    check_nothing_moves(ob, CHANGES['apply all'], empty)


# ---- garments

@pytest.mark.parametrize('whose', ['Body', 'Shirt', 'both'])
@pytest.mark.parametrize('name', CHANGES)
def test_a_garment_that_follows(name, whose):
    """The follower's place relative to its source is kept in the local spaces of both."""
    body, shirt = tube("Body", 1, -4, 4, 40, 60), tube("Shirt", 1.1, -2, 2, 32, 24)
    for ob, place in ((body, TILTED), (shirt, Matrix.LocRotScale((-1, 2, 0), Euler((0, 0.5, 0.2)), (0.5, 0.5, 0.5)))):
        ob.data.transform(place.inverted())
        ob.matrix_world = place
    update()
    p = own(body)
    body.shape_key_add(name="Basis", from_mix=False)
    key = body.shape_key_add(name="belly", from_mix=False)
    world = np.array(TILTED)
    share = np.exp(-(p @ world[:3, :3].T + world[:3, 3])[:, 2:] ** 2)
    middle = np.array(TILTED.inverted() @ Matrix.Translation((0, 0, 0)))[:3, 3]
    key.data.foreach_set('co', (p + 0.4 * share * (p - middle)).astype(np.float32).ravel())
    key.value = 0
    shirt.detail_deform.transfer.source, shirt.detail_deform.transfer.correspondence = body, 'NEAREST'
    update()
    activate(shirt)
    assert bpy.ops.object.detail_deform_transfer_live() == {'FINISHED'}
    key.value = 1
    update()
    before = seen(shirt)
    assert np.abs(evaluated(shirt) - own(shirt)).max() > 0.1
    for ob in (body, shirt):
        if whose in {ob.name, 'both'}:
            CHANGES[name](ob)
            update()
    update()
    assert shirt.detail_deform.transfer.state == "Follows 'Body'."
    # Not to rounding: the nearest point of a vertex over an edge may fall on either face beside it.
    assert np.abs(seen(shirt) - before).max() < 1e-3 * size(before)
