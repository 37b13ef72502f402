# SPDX-License-Identifier: GPL-3.0-or-later
"""The meshes of the manual's pictures are closed, and lie on the surfaces that they were made from."""

import sys

import bpy
import numpy as np
import pytest

from conftest import REPOSITORY

sys.path.append(str(REPOSITORY / 'tests' / 'figures'))
import animals
import clothes
import heads
from implicit import Body


def edges_of(faces):
    """{(a, b): number of faces} of directed edges."""
    found = {}
    for face in faces:
        for edge in zip(face, [*face[1:], face[0]]):
            found[edge] = found.get(edge, 0) + 1
    return found


def assert_closed(points, faces):
    """Each edge has two faces, which run through it in opposite directions, and the normals point outwards."""
    edges = edges_of(faces)
    assert set(edges.values()) == {1} and all((b, a) in edges for a, b in edges)
    corners = np.array([points[face[:3]] for face in faces] + [points[[face[0], face[2], face[-1]]] for face in faces
                                                              if len(face) == 4])
    assert np.einsum('ij,ij->', corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) > 0


@pytest.mark.parametrize("turn", (None, [[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]]))
def test_a_ball_is_round_and_closed_on_any_grid(turn):
    body = Body()
    body.ball((0.1, -0.2, 0.3), 0.5)
    points, quads = body.mesh(0.04, turn)
    assert np.abs(np.linalg.norm(points - (0.1, -0.2, 0.3), axis=1) - 0.5).max() < 0.002
    assert_closed(points, quads.tolist())
    assert len(points) - 2 * len(quads) + len(quads) == 2


def test_balls_can_be_carved_out_of_both_sides():
    body = Body()
    body.ball((0, 0, 0), 0.5)
    body.both(body.ball, (0, 0.5, 0), 0.2, 0.02, carve=True)
    assert body.distance(np.array([[0, 0.4, 0], [0, -0.4, 0]])) == pytest.approx([0.1, 0.1], abs=0.01)
    points, quads = body.mesh(0.03)
    assert_closed(points, quads.tolist())
    assert np.abs(points[:, 1]).max() < 0.47


@pytest.mark.large
def test_the_animals_are_whole_and_the_horse_gallops():
    horse, camel = animals.add_horse(0.03), animals.add_camel(0.03)
    for ob in (horse, camel):
        edges = edges_of([list(p.vertices) for p in ob.data.polygons])
        # Not all edges: on so coarse a grid the two sides of thin places, such as the ears' edges, may touch.
        assert sum(edges.get((b, a), 0) != 1 or times != 1 for (a, b), times in edges.items()) < 0.002 * len(edges)
    assert len(horse.data.vertices) != len(camel.data.vertices)
    animals.add_gallop(horse)

    def shape(frame):
        bpy.context.scene.frame_set(frame)
        mesh = horse.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        return np.array([v.co for v in mesh.vertices])

    rest = np.array([v.co for v in horse.data.vertices])
    assert np.abs(shape(0) - rest).max() < 1e-3
    poses = [shape(frame) for frame in range(1, animals.PHASES + 1)]
    assert min(np.abs(a - b).max() for a, b in zip(poses, poses[1:])) > 0.1
    assert np.abs(np.array(animals.swings(0.25)[1]) - animals.swings(1.25)[1]) < 1e-9


@pytest.mark.large
def test_the_first_heads_keys_open_the_mouth_and_close_one_eye():
    f, ob = heads.YOUNG, heads.add_young(0.03)
    points = {key.name: np.array([v.co for v in key.data]) for key in ob.data.shape_keys.key_blocks}
    rest, skin = points["Basis"], ob["skin"]
    for name in heads.KEYS:
        assert (points[name][skin:] == rest[skin:]).all() and np.abs(points[name] - rest).max() > 0.05
    around = np.linalg.norm(rest - np.array(f.eye), axis=1) < f.eyeball + f.lid
    moved = np.linalg.norm(points["Blink Left"] - rest, axis=1)
    assert moved[around].max() > f.opening[1] and moved[rest[:, 1] < -0.1].max() < 1e-6
    lip = np.abs(rest - (f.mouth[0], 0, f.mouth[1])).max(axis=1) < 0.06
    drop = (rest - points["Jaw Open"])[lip, 2]
    assert drop[rest[lip, 2] < f.mouth[1]].min() > 0.1 > drop[rest[lip, 2] > f.mouth[1]].max()


@pytest.mark.large
def test_the_shirt_lies_over_the_body():
    body, shirt = clothes.figure(), clothes.add_shirt()
    points = np.array([v.co for v in shirt.data.vertices])
    assert body.distance(points).min() > 0 and body.distance(points).max() < 0.06
    edges = edges_of([list(p.vertices) for p in shirt.data.polygons])
    border = [edge for edge in edges if edge[::-1] not in edges]
    beginnings = dict(border)
    assert set(edges.values()) == {1} and len(beginnings) == len(border)
    rings = 0
    while beginnings:  # hem, collar and two sleeves
        start, end = beginnings.popitem()
        while end != start:
            end = beginnings.pop(end)
        rings += 1
    assert rings == 4
