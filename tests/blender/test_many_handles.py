# SPDX-License-Identifier: GPL-3.0-or-later
"""A handle for each vertex or island of a selection, and a surface with hundreds of handles."""

import bpy
import numpy as np
import pytest

from conftest import activate, bind, data_blocks, evaluated, group, members, own, pull, refusal, select, update
from test_stack import rigged


@pytest.fixture
def plane():
    """A flat grid in the xy plane of 61 × 61 vertices, 2 wide, about the origin; its left edge is fixed."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=60, y_subdivisions=60, size=2)
    ob = bpy.context.active_object
    ob.detail_deform.region = group(ob, 'region', np.flatnonzero(own(ob)[:, 0] > -0.95)).name
    return ob


def every(ob, step):
    """(n,) bool: the vertices in every step-th row and column of the plane, without the leftmost columns."""
    places = np.round((own(ob)[:, :2] + 1) * 30).astype(int)
    return (places % step == 0).all(axis=1) & (places[:, 0] > 3)


def add_each(ob, each, chosen):
    """Adds handles, for each 'VERTEX' or 'ISLAND' of the chosen vertices; returns them."""
    count = len(ob.detail_deform.handles)
    select(ob, chosen)
    assert bpy.ops.object.detail_deform_handle_add(each=each) == {'FINISHED'}
    bpy.ops.object.mode_set(mode='OBJECT')
    update()
    return ob.detail_deform.handles[count:]


def seen(ob, empty):
    return np.array(ob.matrix_world.inverted() @ empty.matrix_world.translation)


def test_a_handle_for_each_vertex(plane):
    plane.location = 1, 2, 3
    update()
    before, chosen = data_blocks(), every(plane, 10)
    vertices = np.flatnonzero(chosen)
    handles = add_each(plane, 'VERTEX', chosen)
    assert len(handles) == len(vertices) > 30
    assert [h.name for h in handles] == ["Handle"] + [f"Handle.{k:03}" for k in range(1, len(vertices))]
    for handle, vertex in zip(handles, vertices):
        assert np.flatnonzero(members(plane, handle.vertex_group)).tolist() == [vertex]
        assert handle.target.parent == plane
        assert np.abs(seen(plane, handle.target) - own(plane)[vertex]).max() < 1e-6
        assert (handle.target.matrix_world.to_3x3().col[2] - plane.matrix_world.to_3x3().col[2]).length < 1e-5
        assert handle.target.empty_display_size < 0.06
    while plane.detail_deform.handles:
        bpy.ops.object.detail_deform_handle_remove()
    assert data_blocks() == before and list(plane.vertex_groups.keys()) == ['region']


def test_a_handle_for_each_island(plane):
    p = own(plane)
    squares = [(np.abs(p[:, :2] - middle) < 0.15).all(axis=1) for middle in ((0.6, -0.5), (0, 0.4), (0.7, 0.7))]
    alone = np.zeros(len(p), bool)
    alone[np.linalg.norm(p[:, :2] - (-0.5, -0.5), axis=1).argmin()] = True
    parts = [*squares, alone]
    handles = add_each(plane, 'ISLAND', np.any(parts, axis=0))
    assert len(handles) == 4
    parts.sort(key=lambda part: part.argmax())  # by their first vertices
    for handle, part in zip(handles, parts):
        assert (members(plane, handle.vertex_group) == part).all()
        assert np.abs(seen(plane, handle.target) - p[part].mean(0)).max() < 1e-6


def test_islands_are_those_of_a_search_from_vertex_to_vertex(part):
    """Of random graphs."""
    random = np.random.default_rng(5)
    for edge_count in (0, 200, 450):
        edges = random.integers(0, 600, (edge_count, 2))
        chosen = random.random(600) < 0.9
        found = part('scene.selection').islands(chosen, edges)
        island_of = {}
        for first in np.flatnonzero(chosen).tolist():
            if first in island_of:
                continue
            todo = [first]
            while todo:
                vertex = todo.pop()
                if vertex in island_of:
                    continue
                island_of[vertex] = first
                ends = edges[(edges == vertex).any(axis=1)].ravel()
                todo += [v for v in ends.tolist() if chosen[v]]
        expected = [[v for v in sorted(island_of) if island_of[v] == first]
                    for first in sorted(set(island_of.values()))]
        assert [island.tolist() for island in found] == expected


def test_refusals_add_no_handles(plane):
    before = data_blocks()
    assert "not in Edit Mode" in refusal(bpy.ops.object.detail_deform_handle_add, each='VERTEX')
    select(plane, np.zeros(len(own(plane)), bool))
    assert "No vertex is selected" in refusal(bpy.ops.object.detail_deform_handle_add, each='ISLAND')
    bpy.ops.object.mode_set(mode='OBJECT')
    select(plane, np.ones(len(own(plane)), bool))
    assert "3,721 handles at once" in refusal(bpy.ops.object.detail_deform_handle_add, each='VERTEX')
    bpy.ops.object.mode_set(mode='OBJECT')
    assert data_blocks() == before and not plane.detail_deform.handles
    assert list(plane.vertex_groups.keys()) == ['region']


def test_five_hundred_handles_hold_and_move_their_vertices(plane):
    chosen = every(plane, 1) & (np.arange(3721) % 7 == 0)
    vertices = np.flatnonzero(chosen)
    handles = add_each(plane, 'VERTEX', chosen)
    assert len(handles) > 480
    bind(plane)
    assert np.abs(evaluated(plane) - own(plane)).max() < 1e-6
    for number, handle in enumerate(handles):
        handle.target.location.z += 0.05 * np.sin(number)
        handle.target.rotation_euler.x += 0.3 * (number % 3)
    update()
    result = evaluated(plane)
    assert plane.detail_deform.status.startswith("Bound"), plane.detail_deform.status
    expected = own(plane)[vertices] + np.outer(0.05 * np.sin(np.arange(len(vertices))), (0, 0, 1))
    assert np.abs(result[vertices] - expected).max() < 1e-6
    assert np.isfinite(result).all() and np.abs(result[:, 2]).max() < 0.1
    fixed = ~members(plane, 'region')
    assert np.abs(result[fixed] - own(plane)[fixed]).max() < 1e-6


def test_handles_added_to_a_deformed_surface_move_nothing(plane):
    chosen = np.linalg.norm(own(plane)[:, :2] - (0.5, 0), axis=1) < 0.15
    pull(plane, chosen, radius=0.8).location.z += 0.5
    update()
    before = evaluated(plane)
    spots = every(plane, 6) & (np.linalg.norm(own(plane)[:, :2] - (0.5, 0), axis=1) > 0.2) & members(
        plane, plane.detail_deform.region)
    handles = add_each(plane, 'VERTEX', spots)
    for handle, vertex in zip(handles, np.flatnonzero(spots)):
        assert np.abs(seen(plane, handle.target) - before[vertex]).max() < 1e-5
    bind(plane, keep_rest=True)
    assert np.abs(evaluated(plane) - before).max() < 1e-5
    bpy.ops.object.detail_deform_handle_reset(everything=True)
    update()
    assert np.abs(evaluated(plane) - own(plane)).max() < 1e-5


def test_handles_on_a_posed_mesh_have_bones_as_parents():
    ob, rig = rigged(bend=1.2)
    activate(ob)
    chosen = (np.abs(own(ob)[:, 2] - 3.5) < 0.15) & (own(ob)[:, 1] < -0.2)
    shown = evaluated(ob)
    handles = add_each(ob, 'VERTEX', chosen)
    assert len(handles) == chosen.sum() > 1
    for handle, vertex in zip(handles, np.flatnonzero(chosen)):
        assert handle.target.parent == rig and handle.target.parent_bone == 'upper'
        assert np.linalg.norm(shown[vertex] - np.array(handle.target.matrix_world.translation)) < 0.02


def updates_of(action):
    """Runs an action; returns how often the scene was evaluated meanwhile."""
    seen = []
    bpy.app.handlers.depsgraph_update_post.append(lambda scene, depsgraph: seen.append(scene))
    try:
        assert action() in ({'FINISHED'}, None)
    finally:
        bpy.app.handlers.depsgraph_update_post.pop()
    return len(seen)


def delete_empties(ob):
    for handle in ob.detail_deform.handles:
        bpy.data.objects.remove(handle.target)
    update()


BACK_TO_REST = {'handle_reset': lambda: bpy.ops.object.detail_deform_handle_reset(everything=True),
                'save_key': lambda: bpy.ops.object.detail_deform_save_key()}


def test_the_scene_is_evaluated_as_often_for_many_as_for_few(plane):
    counts = []
    for step in (20, 7):
        bpy.ops.object.select_all(action='DESELECT')
        activate(plane)
        select(plane, every(plane, step))
        these = {'add': updates_of(lambda: bpy.ops.object.detail_deform_handle_add(each='VERTEX'))}
        bpy.ops.object.mode_set(mode='OBJECT')
        bind(plane)
        handles = plane.detail_deform.handles
        for reset, run in BACK_TO_REST.items():
            for number, handle in enumerate(handles):
                handle.target.location.z += 0.05 * np.sin(number)
            update()
            these[reset] = updates_of(run)
            assert np.abs(evaluated(plane) - own(plane)).max() < 1e-6
        delete_empties(plane)
        these['bring_back'] = updates_of(bpy.ops.object.detail_deform_bring_back)
        assert np.abs(evaluated(plane) - own(plane)).max() < 1e-6 and all(handle.target for handle in handles)
        bpy.ops.object.duplicate()
        these['own_empties'] = updates_of(bpy.ops.object.detail_deform_own_empties)
        counts.append((len(handles), these))
        bpy.data.objects.remove(bpy.context.active_object)
        activate(plane)
        while plane.detail_deform.handles:
            bpy.ops.object.detail_deform_handle_remove()
    (few, of_few), (many, of_many) = counts
    assert many > 4 * few and of_many == of_few


def test_exchanging_one_of_many_empties_keeps_the_drivers_variables(plane, part):
    add_each(plane, 'VERTEX', every(plane, 10))
    bind(plane)
    handles = plane.detail_deform.handles
    variables = plane.animation_data.drivers[0].driver.variables
    before, needed = [variable.as_pointer() for variable in variables], part('scene.dependency')._needed
    other = bpy.data.objects.new("Other", None)
    bpy.context.collection.objects.link(other)
    handles[3].target = other
    assert [variable.as_pointer() for variable in variables] == before
    assert needed(plane) == [('TRANSFORMS', handle.target, '') for handle in handles]
    plane.detail_deform.handle_index = 2
    bpy.ops.object.detail_deform_handle_remove()
    bind(plane)
    assert needed(plane) == [('TRANSFORMS', handle.target, '') for handle in handles]
    assert len(handles) == len(before) - 1
    delete_empties(plane)
    bpy.ops.object.detail_deform_bring_back()
    assert needed(plane) == [('TRANSFORMS', handle.target, '') for handle in handles]
    assert plane.animation_data.drivers[0].driver.is_valid
