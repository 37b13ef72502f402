# SPDX-License-Identifier: GPL-3.0-or-later
"""Select Problem Vertices: selects, in Edit Mode, all vertices that a sentence is about."""

import bpy
import numpy as np
import pytest

from conftest import activate, add_empty, add_handle, bind, group, make_strip, own, refusal, update
from test_refusals import assert_refused

SELECT = bpy.ops.object.detail_deform_select_problem
MIDDLE = 12 * 25 + 12


def selected(ob):
    assert ob.mode == 'EDIT' and bpy.context.scene.tool_settings.mesh_select_mode[0]
    ob.update_from_editmode()
    return [v.index for v in ob.data.vertices if v.select]


def extended(positions, faces=()):
    """The strip with more vertices and faces, which are in no group, two handles and no region."""
    ob = make_strip()
    old = [tuple(p.vertices) for p in ob.data.polygons]
    right = [v.index for v in ob.data.vertices if v.index >= 22 * 25]
    mesh = bpy.data.meshes.new('Extended')
    mesh.from_pydata(own(ob).tolist() + [list(p) for p in positions], [], old + list(faces))
    ob.data = mesh
    ob.vertex_groups.clear()
    group(ob, 'right', right)
    group(ob, 'left', range(50))
    ob.detail_deform.region = ''
    add_handle(ob, 'left', add_empty("Left", (0, 0.5, 0)))
    update()
    return ob


@pytest.mark.parametrize('value', [float('nan'), 1e35])
def test_all_vertices_of_a_refusal_are_selected(value):
    ob = make_strip()
    wrong = [7, 311, 600]
    for vertex in wrong:
        ob.data.vertices[vertex].co.y = value
    assert not SELECT.poll()
    assert "Vertex 7 " in refusal(bpy.ops.object.detail_deform_bind, wait=True)
    assert "Vertex 7 " in ob.detail_deform.status
    assert SELECT() == {'FINISHED'}
    assert selected(ob) == wrong
    bpy.ops.object.mode_set(mode='OBJECT')
    for vertex in wrong:
        ob.data.vertices[vertex].co.y = 0.5
    bind(ob)
    assert not SELECT.poll()


def test_a_hidden_vertex_is_selected_in_place_of_the_old_selection():
    ob = make_strip()
    ob.data.vertices[7].co.y = float('nan')
    ob.data.vertices[7].hide = True
    ob.data.vertices.foreach_set('select', np.ones(625, bool))
    bpy.context.scene.tool_settings.mesh_select_mode = (False, False, True)
    refusal(bpy.ops.object.detail_deform_bind, wait=True)
    SELECT()
    assert selected(ob) == [7]


def test_a_face_with_a_corner_twice():
    ob = make_strip()
    loop = ob.data.polygons[100].loop_start
    ob.data.loops[loop].vertex_index = ob.data.loops[loop + 1].vertex_index
    ob.data.update()
    assert "uses one vertex twice" in refusal(bpy.ops.object.detail_deform_bind, wait=True)
    SELECT()
    assert set(selected(ob)) <= set(ob.data.polygons[100].vertices) and selected(ob)


def test_the_region_that_no_handle_reaches():
    ob = make_strip()
    mesh = bpy.data.meshes.new('Parts')
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0), (5, 0, 0), (6, 0, 0), (5, 1, 0)], [], [(0, 1, 2), (3, 4, 5)])
    ob.data = mesh
    ob.vertex_groups.clear()
    group(ob, 'region', [3, 4, 5])
    group(ob, 'right', [0, 1, 2])
    update()
    assert_refused(ob, "on other loose parts of the mesh than the handles")
    SELECT()
    assert selected(ob) == [3, 4, 5]


def test_all_warnings_of_a_bound_mesh_are_selected_at_once():
    """Loose vertices, a part without a handle, and faces without area."""
    ob = extended([(0, 0, 3), (0, 0, 4), (3, 0, 0), (4, 0, 0), (3, 1, 0), own(make_strip())[MIDDLE]],
                  [(627, 628, 629), (MIDDLE, MIDDLE + 1, 630)])
    bind(activate(ob))
    status = ob.detail_deform.status
    assert "loose part" in status and "without faces" in status and "next to no area" in status
    assert SELECT() == {'FINISHED'}
    assert selected(ob) == [MIDDLE, MIDDLE + 1, *range(625, 631)]


def test_a_harmless_remark_is_not_in_the_panels_status(part):
    """A face without area does no harm: it is reported under Advanced and in the status for scripts."""
    ob = extended([own(make_strip())[MIDDLE]], [(MIDDLE, MIDDLE + 1, 625)])
    bind(activate(ob))
    status = part('follow.status')
    assert "next to no area" in status.harmless(ob) and "next to no area" in ob.detail_deform.status
    assert "next to no area" not in status.urgent(ob) and not part('follow.problem_vertices').need_a_look(ob)
    assert SELECT() == {'FINISHED'}
    bpy.ops.object.mode_set(mode='OBJECT')
    ob.data.vertices[0].co.x += 1
    ob.data.update()
    update()
    assert status.harmless(ob) == "" and "Re-bind" in status.urgent(ob)


def test_the_operator_works_while_an_empty_is_active():
    ob = extended([(0, 0, 3)])
    bind(activate(ob))
    activate(ob.detail_deform.handles[0].target)
    assert SELECT() == {'FINISHED'}
    assert bpy.context.active_object == ob and selected(ob) == [625]


def test_the_operator_is_disabled_where_no_sentence_is_about_vertices():
    ob = bind(make_strip())
    assert not SELECT.poll()
    ob.detail_deform.handles[0].target = None
    update()
    assert "lost their empties" in ob.detail_deform.status and not SELECT.poll()


def test_the_operator_is_disabled_below_a_problem_without_vertices():
    """The mesh's loose vertices, of which it would warn otherwise, don't matter then."""
    ob = extended([(0, 0, 3), own(make_strip())[MIDDLE]], [(MIDDLE, MIDDLE + 1, 626)])
    bind(activate(ob))
    assert SELECT.poll()
    ob.vertex_groups.remove(ob.vertex_groups['right'])
    ob.detail_deform.handles[0].target.location.z += 0.1
    update()
    assert "does not have" in ob.detail_deform.status and not SELECT.poll()


def test_vertices_of_a_refusal_are_not_selected_in_another_mesh():
    """The refused mesh was replaced."""
    ob = make_strip()
    ob.data.vertices[7].co.y = float('nan')
    refusal(bpy.ops.object.detail_deform_bind, wait=True)
    assert SELECT.poll()
    mesh = bpy.data.meshes.new('Another')
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    ob.data = mesh
    assert not SELECT.poll()
