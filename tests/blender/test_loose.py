# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertices that are in no face, such as those of whiskers and laces, go along with the mesh's surface."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from conftest import activate, evaluated, pull, update
from test_transfer import add_key, bent, coordinates, transfer

N = 17


def add(name, points, edges, faces):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(np.asarray(points).tolist(), [list(map(int, edge)) for edge in edges], faces)
    ob = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(ob)
    update()
    return activate(ob)


def grid(n=N):
    x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n), indexing='ij')
    points = np.stack([x, y, 0.02 * np.sin(9 * x + 7 * y)], -1).reshape(-1, 3)
    faces = [[i * n + j, (i + 1) * n + j, (i + 1) * n + j + 1, i * n + j + 1]
             for i in range(n - 1) for j in range(n - 1)]
    return points, faces


def chain(first, count):
    return [(first + k, first + k + 1) for k in range(count - 1)]


def whisker(points):
    """A bowed chain of edges from a vertex of the surface into the air."""
    root = 8 * N + 8
    s = np.linspace(0.1, 1, 6)[:, None]
    return points[root] + s * (0.1, 0.05, 0.4) + s**2 * (0, 0.1, 0), [(root, len(points)), *chain(len(points), 6)]


def lace(points):
    """A chain above the surface, joined to nothing."""
    s = np.linspace(0.1, 0.9, 9)[:, None]
    return s * (1, 0.6, 0) + (0, 0.1, 0.04), chain(len(points), 9)


def bridge(points):
    """A chain through the air between two vertices of the surface."""
    ends = 3 * N + 8, 13 * N + 8
    s = np.linspace(0, 1, 9)[1:-1, None]
    over = points[ends[0]] + s * (points[ends[1]] - points[ends[0]]) + np.sin(np.pi * s) * (0, 0, 0.2)
    return over, [(ends[0], len(points)), *chain(len(points), 7), (len(points) + 6, ends[1])]


def dust(points):
    """Single vertices without edges."""
    return np.random.default_rng(1).random((5, 3)) * (1, 1, 0.1), []


THINGS = {f.__name__: f for f in (whisker, lace, bridge, dust)}


@pytest.fixture(params=THINGS)
def dressed(request):
    """(surface, a copy of it with loose vertices, indices of these)."""
    points, faces = grid()
    more, edges = THINGS[request.param](points)
    body = add("Body", points, [], faces)
    target = add("Target", np.concatenate([points, more]), edges, faces)
    return body, target, np.arange(len(points), len(points) + len(more))


def rest(ob):
    return np.array([v.co for v in ob.data.vertices])


def carried(body, target, pose):
    """The target's positions in the key that is transferred from this pose of the body."""
    add_key(body, "Pose", pose)
    body.active_shape_key_index = len(body.data.shape_keys.key_blocks) - 1
    activate(target)
    assert transfer(source=body.name, what='ALL_KEYS', correspondence='NEAREST') == {'FINISHED'}
    return coordinates(target.data.shape_keys.key_blocks["Pose"])


def test_a_rigid_motion_takes_all_along(dressed):
    body, target, _ = dressed
    turn = np.array(Matrix.Rotation(0.8, 3, (1, 2, 3)))
    found = carried(body, target, rest(body) @ turn.T + (0.1, 0.2, 0.3))
    assert np.abs(found - (rest(target) @ turn.T + (0.1, 0.2, 0.3))).max() < 1e-4


def test_a_bend_takes_them_where_the_surface_goes(dressed, request):
    """Compared with bent(), which bends all of space. Only to a third, because chains keep their own shape."""
    body, target, loose = dressed
    found = carried(body, target, bent(rest(body)))
    right = bent(rest(target))
    moved = np.linalg.norm((right - rest(target))[loose], axis=1)
    assert np.linalg.norm((found - right)[loose], axis=1).max() < 0.35 * moved.max()
    size = np.linalg.norm(np.ptp(rest(target)[loose], axis=0))
    if 'whisker' in request.node.name:  # hangs on one vertex, so that it turns as a rigid body
        assert np.linalg.norm(np.ptp(found[loose], axis=0)) == pytest.approx(size, rel=0.35)
        lengths = [np.linalg.norm(np.diff(p[loose], axis=0), axis=1) for p in (found, rest(target))]
        assert np.allclose(*lengths, rtol=1e-3)


def test_live_transfer_gives_the_same_positions(dressed):
    body, target, _ = dressed
    add_key(body, "Pose", bent(rest(body)))
    found = carried(*dressed[:2], bent(rest(body)))
    target.shape_key_clear()
    target.detail_deform.transfer.source = body
    target.detail_deform.transfer.correspondence = 'NEAREST'
    activate(target)
    assert bpy.ops.object.detail_deform_transfer_live() == {'FINISHED'}
    body.data.shape_keys.key_blocks["Pose"].value = 1
    update()
    assert np.abs(evaluated(target) - found).max() < 1e-4
    assert np.abs(evaluated(target)[:N * N] - bent(rest(body))).max() < 1e-3


def test_by_topology_loose_vertices_move_as_the_sources_do(dressed):
    """A key that moves only the loose vertices, transferred to a copy of twice the size."""
    _, source, loose = dressed
    points = rest(source)
    faces = [list(face.vertices) for face in source.data.polygons]
    edges = [tuple(edge.vertices) for edge in source.data.edges]
    target = add("Copy", 2 * points, edges, faces)
    lowered = points.copy()
    lowered[loose] -= (0, 0.02, 0.05)
    found = carried_alike(source, target, lowered)
    assert np.abs(found - 2 * lowered).max() < 1e-4
    assert np.abs(found[loose] - 2 * points[loose]).max() > 0.05


def carried_alike(source, target, pose):
    add_key(source, "Pose", pose)
    source.active_shape_key_index = 1
    activate(target)
    assert transfer(source=source.name, what='ALL_KEYS', correspondence='TOPOLOGY') == {'FINISHED'}
    return coordinates(target.data.shape_keys.key_blocks["Pose"])


def cat():
    """(a surface with a whisker, mask of the whisker's vertices)."""
    points, faces = grid()
    more, edges = whisker(points)
    ob = add("Cat", np.concatenate([points, more]), edges, faces)
    return ob, np.arange(len(ob.data.vertices)) >= len(points)


def middle(points):
    return np.linalg.norm(points[:, :2] - (0.5, 0.5), axis=1) < 0.15


@pytest.mark.parametrize('in_handle', [False, True])
def test_a_whisker_goes_along_with_the_handle_at_its_root(in_handle):
    """Whether some of the whisker's vertices are in the handle or none. Pull measures its reach along the surface, so
    the whisker has no distance of its own."""
    ob, is_loose = cat()
    empty = pull(ob, middle(rest(ob)) & (in_handle | ~is_loose), radius=0.3)
    motion = Matrix.Translation((0.1, 0, 0.2)) @ Matrix.Rotation(0.6, 4, 'Y')
    empty.matrix_world = motion @ empty.matrix_world
    update()
    motion = np.array(motion)
    right = rest(ob) @ motion[:3, :3].T + motion[:3, 3]
    assert np.abs((evaluated(ob) - right)[is_loose]).max() < 1e-4


def test_a_whisker_beside_the_handle_bends_with_the_surface():
    ob, is_loose = cat()
    chosen = ~is_loose & (np.linalg.norm(rest(ob)[:, :2] - (0.7, 0.5), axis=1) < 0.1)
    empty = pull(ob, chosen, radius=0.5)
    empty.matrix_world = Matrix.Translation((0, 0, 0.2)) @ empty.matrix_world
    update()
    shown, root = evaluated(ob), 8 * N + 8
    before, after = ((p[is_loose] - p[root]) for p in (rest(ob), shown))
    assert np.linalg.norm(shown[root] - rest(ob)[root]) > 0.02
    assert np.allclose(np.linalg.norm(before, axis=1), np.linalg.norm(after, axis=1), rtol=0.02)


def test_a_whisker_is_not_reported_as_staying_behind():
    ob, _ = cat()
    pull(ob, middle(rest(ob)), radius=0.3)
    assert "stay" not in ob.detail_deform.status


def test_a_whisker_outside_of_the_region_stays():
    ob, is_loose = cat()
    chosen = ~is_loose & (np.linalg.norm(rest(ob)[:, :2] - (0.9, 0.9), axis=1) < 0.1)
    empty = pull(ob, chosen, radius=0.1)
    empty.matrix_world = Matrix.Translation((0, 0, 0.2)) @ empty.matrix_world
    update()
    assert np.abs((evaluated(ob) - rest(ob))[is_loose]).max() == 0


def test_a_whisker_on_a_face_without_area_only_moves_along():
    points, faces = grid()
    more, edges = whisker(points)
    root = edges[0][0]
    for face in faces:  # move the corners of all faces around the root to one point
        if root in face:
            points[face] = points[root]
    ob = add("Cat", np.concatenate([points, more]), edges, faces)
    is_loose = np.arange(len(ob.data.vertices)) >= len(points)
    empty = pull(ob, middle(rest(ob)) & ~is_loose, radius=0.3)
    assert np.abs(evaluated(ob) - rest(ob)).max() < 1e-6
    empty.matrix_world = Matrix.Translation((0.1, 0, 0.2)) @ empty.matrix_world
    update()
    assert np.allclose((evaluated(ob) - rest(ob))[is_loose], (0.1, 0, 0.2), atol=1e-4)
