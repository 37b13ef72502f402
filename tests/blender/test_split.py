# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes that are split along seams, with several vertices in one place, as by importers, deform like unsplit ones."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from conftest import activate, bind, evaluated, group, members, own, pull, update
from test_transfer import add_key

SIZE = 31


def grid(n=SIZE):
    """(points, quads) of a bumpy square of size 1."""
    x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n), indexing='ij')
    points = np.stack([x, y, 0.03 * np.sin(17 * x) * np.cos(13 * y)], -1).reshape(-1, 3)
    faces = [(i * n + j, (i + 1) * n + j, (i + 1) * n + j + 1, i * n + j + 1)
             for i in range(n - 1) for j in range(n - 1)]
    return points, np.array(faces)


def along(points, faces):
    """The parts of faces: two halves."""
    return (points[faces].mean(axis=1)[:, 0] > 0.5).astype(int)


def quarters(points, faces):
    """The parts of faces: four, which meet at one place."""
    middle = points[faces].mean(axis=1)
    return (middle[:, 0] > 0.5) + 2 * (middle[:, 1] > 0.5)


def slit(points, faces):
    """The parts of faces: two, which are only split along a slit; each end of the slit is one vertex."""
    middle = points[faces].mean(axis=1)
    return ((middle[:, 0] > 0.5) & (np.abs(middle[:, 1] - 0.5) < 0.3)).astype(int)


def every(points, faces):
    """The parts of faces: each face is one."""
    return np.arange(len(faces))


SPLITS = {f.__name__: f for f in (along, quarters, slit, every)}


def split(points, faces, parts):
    """(points, faces, for each vertex its number in the unsplit mesh)."""
    if parts is slit:
        of_face = slit(points, faces)
        inside = np.zeros(len(points), bool)
        inside[faces[of_face == 1]] = True
        x, y = points[:, 0], points[:, 1]
        inside &= (np.abs(x - 0.5) < 1e-6) & (np.abs(y - 0.5) < 0.25)
        corner_part = np.where(inside[faces], of_face[:, None], 0)
    else:
        corner_part = np.repeat(parts(points, faces)[:, None], 4, axis=1)
    keys = faces * len(faces) + corner_part
    unique, numbers = np.unique(keys, return_inverse=True)
    origin = unique // len(faces)
    return points[origin], numbers.reshape(faces.shape), origin


def add(name, points, faces):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points.tolist(), [], faces.tolist())
    ob = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(ob)
    update()
    return activate(ob)


@pytest.fixture(params=SPLITS)
def pair(request):
    """(unsplit object, split object, for each vertex of the second its number in the first)."""
    points, faces = grid()
    parted, own_faces, origin = split(points, faces, SPLITS[request.param])
    assert len(parted) > len(points)
    return add("Whole", points, faces), add("Split", parted, own_faces), origin


def turned(empty):
    """Moves an empty by a motion of the whole world, which doesn't depend on the empty's place."""
    about = Matrix.Translation((0.42, 0.5, 0))
    empty.matrix_world = (Matrix.Translation((0.05, 0, 0.2)) @ about @ Matrix.Rotation(0.5, 4, 'Y') @ about.inverted()
                          @ empty.matrix_world)
    update()


@pytest.mark.parametrize('method', ['TRANSFER', 'VARIATIONAL', 'NORMAL', 'GRADIENT'])
def test_a_split_mesh_is_pulled_as_the_whole_one(pair, method):
    whole, parted, origin = pair
    chosen = np.linalg.norm(own(whole)[:, :2] - (0.42, 0.5), axis=1) < 0.09
    for ob, handle in ((whole, chosen), (parted, chosen[origin])):
        empty = pull(ob, handle, radius=0.3)
        ob.detail_deform.method = method
        bind(activate(ob), keep_rest=True)
        turned(empty)
    size = np.ptp(own(whole), axis=0).max()
    of_parted, of_whole = (members(ob, ob.detail_deform.region) for ob in (parted, whole))
    assert np.array_equal(of_parted, of_whole[origin])
    assert np.abs(evaluated(parted) - evaluated(whole)[origin]).max() < 1e-4 * size
    assert np.abs(evaluated(whole) - own(whole)).max() > 0.1
    assert parted.detail_deform.is_bound


def test_one_copy_of_a_vertex_in_a_stiff_part_is_enough(pair):
    """As where an island of UVs is painted: its border has copies in the next island."""
    whole, parted, origin = pair
    x, y = own(whole)[:, :2].T
    chosen, stiff = np.hypot(x - 0.42, y - 0.5) < 0.09, (np.abs(x - 0.6) < 0.08) & (np.abs(y - 0.5) < 0.12)
    last = np.zeros(len(origin), bool)
    last[len(origin) - 1 - np.unique(origin[::-1], return_index=True)[1]] = True
    for ob, handle, plate in ((whole, chosen, stiff), (parted, chosen[origin], stiff[origin] & last)):
        empty = pull(ob, handle, radius=0.3)
        group(ob, 'plate', np.flatnonzero(plate))
        ob.detail_deform.stiff_parts = 'plate'
        bind(activate(ob), keep_rest=True)
        turned(empty)
    assert np.abs(evaluated(parted) - evaluated(whole)[origin]).max() < 1e-4 * np.ptp(own(whole), axis=0).max()


def test_one_side_of_a_seam_in_a_handle_takes_the_other_along(pair):
    _, parted, origin = pair
    first = np.zeros(len(origin), bool)
    first[np.unique(origin, return_index=True)[1]] = True
    chosen = first & (np.linalg.norm(own(parted)[:, :2] - (0.5, 0.5), axis=1) < 0.07)
    turned(pull(parted, chosen, radius=0.3))
    shown = evaluated(parted)
    for vertex in np.unique(origin[chosen]):
        places = shown[origin == vertex]
        assert np.abs(places - places[0]).max() < 1e-6


def test_a_seam_with_one_fixed_side_is_fixed(pair):
    """Where the region ends at a seam no gap opens, and the vertices outside of it don't move."""
    _, parted, origin = pair
    if len(np.unique(origin)) * 2 < len(origin):
        pytest.skip("each face is a part")
    inside = own(parted)[:, 0] < 0.5 - 1e-6
    group(parted, "region", np.flatnonzero(inside))
    group(parted, "handle", np.flatnonzero(np.linalg.norm(own(parted)[:, :2] - (0.3, 0.5), axis=1) < 0.08))
    parted.detail_deform.region = "region"
    handle = parted.detail_deform.handles.add()
    handle.name = handle.vertex_group = "handle"
    handle.target = bpy.data.objects.new("Empty", None)
    bpy.context.scene.collection.objects.link(handle.target)
    update()
    bind(activate(parted))
    turned(handle.target)
    assert np.abs((evaluated(parted) - own(parted))[~inside]).max() == 0


def test_without_join_split_the_seam_opens(pair):
    whole, parted, origin = pair
    parted.detail_deform.join_split = False
    chosen = np.linalg.norm(own(whole)[:, :2] - (0.42, 0.5), axis=1) < 0.09
    turned(pull(parted, chosen[origin], radius=0.3))
    shown = evaluated(parted)
    assert max(np.ptp(shown[origin == vertex], axis=0).max() for vertex in np.unique(origin)) > 0.01


def test_the_choice_takes_effect_with_the_next_bind():
    points, faces = grid()
    parted, own_faces, origin = split(points, faces, along)
    ob = add("Split", parted, own_faces)
    empty = pull(ob, np.linalg.norm(parted[:, :2] - (0.42, 0.5), axis=1) < 0.09, radius=0.3)
    ob.detail_deform.join_split = False
    assert "changed since Bind" in ob.detail_deform.status
    bind(activate(ob), keep_rest=True)
    turned(empty)
    assert max(np.ptp(evaluated(ob)[origin == vertex], axis=0).max() for vertex in np.unique(origin)) > 0.01


def test_vertices_that_a_shape_key_separates_are_not_joined():
    """Such as of lips, which touch along a line and open in a key."""
    points, faces = grid()
    parted, own_faces, origin = split(points, faces, slit)
    ob = add("Lips", parted, own_faces)
    second = np.zeros(len(origin), bool)
    second[np.setdiff1d(np.arange(len(origin)), np.unique(origin, return_index=True)[1])] = True
    add_key(ob, "Open", own(ob) + np.where(second[:, None], (0.05, 0, 0), 0))
    near = np.linalg.norm(own(ob)[:, :2] - (0.42, 0.5), axis=1) < 0.07
    turned(pull(ob, near, radius=0.3))
    assert max(np.ptp(evaluated(ob)[origin == vertex], axis=0).max() for vertex in np.unique(origin)) > 0.01


def test_a_key_that_is_sculpted_apart_later_counts_with_the_next_bind():
    points, faces = grid()
    parted, own_faces, origin = split(points, faces, slit)
    ob = add("Lips", parted, own_faces)
    second = np.setdiff1d(np.arange(len(origin)), np.unique(origin, return_index=True)[1])
    key = add_key(ob, "Open", own(ob))
    near = np.linalg.norm(own(ob)[:, :2] - (0.42, 0.5), axis=1) < 0.07
    empty = pull(ob, near, radius=0.3)
    for vertex in second.tolist():
        key.data[vertex].co.x += 0.05
    bind(activate(ob), keep_rest=True)
    turned(empty)
    assert max(np.ptp(evaluated(ob)[origin == vertex], axis=0).max() for vertex in np.unique(origin)) > 0.01


def test_a_card_with_two_faces_is_not_sewn_up():
    """All vertices of its front and back are in the same places."""
    points, faces = grid(11)
    ob = add("Card", np.concatenate([points, points]), np.concatenate([faces, faces[:, ::-1] + len(points)]))
    front = np.arange(2 * len(points)) < len(points)
    chosen = front & (own(ob)[:, 0] > 0.95)
    turned(pull(ob, chosen, radius=0.5))
    moved = np.abs(evaluated(ob) - own(ob)).max(axis=1)
    assert moved[chosen].min() > 0.02 and moved[~front].max() == 0


def test_bodies_that_touch_at_one_vertex_are_two():
    points, faces = grid(11)
    other = points + (1, 1, 0)
    other[0] = points[-1]
    ob = add("Two", np.concatenate([points, other]), np.concatenate([faces, faces + len(points)]))
    turned(pull(ob, np.linalg.norm(own(ob) - points[-1], axis=1) < 0.15, radius=0.3))
    shown = evaluated(ob)
    assert np.array_equal(shown[len(points) - 1], shown[len(points)])  # both vertices are in the handle
    assert np.abs(shown - own(ob)).max(axis=1)[len(points):].max() > 0.1


def test_small_cracks_of_transfers_are_closed_and_real_openings_kept(part):
    """A transfer finds the offsets of both sides of a seam separately."""
    points, faces = grid()
    parted, own_faces, origin = split(points, faces, along)
    ob = add("Split", parted, own_faces)
    joined = part('scene.split').WeldedMesh(ob)
    side = parted[own_faces[along(points, faces) == 1]]
    is_second = np.isin(np.arange(len(parted)), own_faces[along(points, faces) == 1])
    moved = np.tile((0.1, 0.2, 0.3), (len(parted), 1)) + 0.002 * is_second[:, None]
    closed = joined.closed(moved.astype(np.float32).ravel()).reshape(-1, 3)
    assert side.size and max(np.ptp(closed[origin == v], axis=0).max() for v in np.unique(origin)) < 1e-6
    apart = np.where(is_second[:, None], (0.0, 0, 0.1), (0, 0, 0)).astype(np.float32)
    assert np.array_equal(joined.closed(apart.ravel()).reshape(-1, 3), apart)
