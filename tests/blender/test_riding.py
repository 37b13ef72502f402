# SPDX-License-Identifier: GPL-3.0-or-later
"""Loose parts without a handle go with the surface on which they lie or in which they stick."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from conftest import activate, add_empty, add_handle, bind, evaluated, group, own, rigid_motion, update

AROUND, RINGS, RADIUS, SLEEVE, LENGTH = 32, 61, 0.5, 0.7, 4.0


class Pieces:
    """A mesh made of named pieces. places: {name: indices of its vertices}."""

    def __init__(self):
        self.points, self.faces, self.edges, self.places = [], [], [], {}

    def add(self, name, points, faces=(), edges=()):
        begin = len(self.points)
        self.points += [tuple(point) for point in points]
        self.faces += [tuple(begin + v for v in face) for face in faces]
        self.edges += [tuple(begin + v for v in edge) for edge in edges]
        self.places[name] = np.arange(begin, len(self.points))

    def tube(self, name, radius, low=0.0, high=LENGTH, rings=RINGS):
        x, angle = np.meshgrid(np.linspace(low, high, rings), np.arange(AROUND) * 2 * np.pi / AROUND, indexing='ij')
        points = np.stack([x, radius * np.cos(angle), radius * np.sin(angle)], -1).reshape(-1, 3)
        self.add(name, points, [(i * AROUND + j, i * AROUND + (j + 1) % AROUND, (i + 1) * AROUND + (j + 1) % AROUND,
                                 (i + 1) * AROUND + j) for i in range(rings - 1) for j in range(AROUND)])

    def box(self, name, middle, size):
        corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * np.array(size) / 2
        self.add(name, corners + middle, [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4),
                                          (1, 5, 7, 3)])

    def are_of(self, name):
        """(n,) bool"""
        return np.isin(np.arange(len(self.points)), self.places[name])

    def object(self, name="Pieces"):
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata(self.points, self.edges, self.faces)
        ob = bpy.data.objects.new(name, mesh)
        bpy.context.scene.collection.objects.link(ob)
        activate(ob)
        update()
        return ob


def limb():
    """A limb along X with a plate, a rivet on the plate, a horn, a whisker, a speck, a wide sleeve with a button, and a
    box far away."""
    pieces = Pieces()
    pieces.tube('limb', RADIUS)
    pieces.box('plate', (2.6, 0, RADIUS + 0.03), (0.4, 0.3, 0.04))
    pieces.box('rivet', (2.7, 0.1, RADIUS + 0.055), (0.04, 0.04, 0.02))
    pieces.add('horn', [(3, 0.05, -RADIUS), (3.1, 0, -RADIUS), (3, -0.05, -RADIUS), (3.1, 0, -1.1)],
               [(0, 1, 3), (1, 2, 3), (2, 0, 3)])
    pieces.add('whisker', [(2, -RADIUS - 0.001, 0), (2, -0.6, 0)], edges=[(0, 1)])
    pieces.add('speck', [(1.8, RADIUS + 0.002, 0)])
    pieces.tube('sleeve', SLEEVE, 1.0, 3.4, 33)
    pieces.box('button', (2.2, 0, SLEEVE + 0.01), (0.08, 0.08, 0.02))
    pieces.box('far', (2, 0, 3), (0.2, 0.2, 0.2))
    return pieces


SMALL = ('plate', 'rivet', 'horn', 'whisker', 'speck', 'button')


def hold(ob, region, held, place=(0, 0, 0)):
    """Binds an object to a handle. region, held: (n,) bool. Returns the empty."""
    ob.detail_deform.region = group(ob, "region", np.flatnonzero(region)).name
    handle = add_handle(ob, group(ob, "held", np.flatnonzero(held)).name, add_empty("Handle", place))
    bind(ob)
    return handle.target


def bound(pieces, region='limb', scale=1):
    """(ob, empty): fixed up to x = 0.5, with a handle from 3.6 on. region: the piece in it, or None: all. scale: of the
    object along x."""
    ob = pieces.object()
    ob.scale.x = scale
    update()
    x, on = scale * own(ob)[:, 0], pieces.are_of('limb')
    inside = on if region else np.ones(len(x), bool)
    return ob, hold(ob, inside & (~on | (x > 0.5)), on & (x > 3.6), (4, 0, 0))


def bend(empty, degrees=70):
    about = Matrix.Translation((2, 0, 1.5))
    empty.matrix_world = about @ Matrix.Rotation(np.radians(-degrees), 4, 'Y') @ about.inverted() @ empty.matrix_world
    update()


def off_rigid(rest, now):
    return np.abs(rigid_motion(rest, now)[1]).max()


def angle_between(one, other):
    return np.degrees(np.arccos(np.clip((np.trace(one.T @ other) - 1) / 2, -1, 1)))


@pytest.mark.parametrize('region', ['limb', None])
def test_small_parts_ride_rigidly_and_a_sleeve_bends(region):
    pieces = limb()
    ob, empty = bound(pieces, region)
    assert "7 loose parts ride along with what is beneath (1 of them bend with it)" in ob.detail_deform.status
    bend(empty)
    rest, now = own(ob), evaluated(ob)
    skin = pieces.places['limb']
    for name in ('plate', 'horn'):
        part = pieces.places[name]
        rotation, off = rigid_motion(rest[part], now[part])
        assert np.abs(off).max() < 1e-5
        middle = rest[part].mean(axis=0)
        near = skin[np.linalg.norm(rest[skin] - middle, axis=1) < 0.35]
        of_skin, _ = rigid_motion(rest[near], now[near])
        assert angle_between(rotation, of_skin) < 6  # the surface bends beneath
        expected = of_skin @ (middle - rest[near].mean(axis=0)) + now[near].mean(axis=0)
        assert np.linalg.norm(now[part].mean(axis=0) - expected) < 0.03
        assert angle_between(rotation, np.eye(3)) > 15
    # A rivet moves as its plate does.
    rotation, _ = rigid_motion(rest[pieces.places['plate']], now[pieces.places['plate']])
    plate, rivet = (pieces.places[name] for name in ('plate', 'rivet'))
    expected = (rest[rivet] - rest[plate].mean(axis=0)) @ rotation.T + now[plate].mean(axis=0)
    assert np.abs(now[rivet] - expected).max() < 1e-5
    # The sleeve keeps its distance from the limb, and is not rigid.
    sleeve = pieces.places['sleeve']
    assert off_rigid(rest[sleeve], now[sleeve]) > 0.1
    nearest = np.linalg.norm(now[sleeve][:, None] - now[skin][None], axis=2).min(axis=1)
    assert np.abs(nearest - (SLEEVE - RADIUS)).max() < 0.05
    # A button stays on it.
    button, near = pieces.places['button'], sleeve[np.linalg.norm(rest[sleeve] - (2.2, 0, SLEEVE), axis=1) < 0.15]
    of_sleeve, _ = rigid_motion(rest[near], now[near])
    expected = (rest[button] - rest[near].mean(axis=0)) @ of_sleeve.T + now[near].mean(axis=0)
    assert off_rigid(rest[button], now[button]) < 1e-5
    assert np.linalg.norm(now[button] - expected, axis=1).max() < 0.01
    whisker, speck = pieces.places['whisker'], pieces.places['speck']
    assert np.linalg.norm(now[whisker[0]] - now[skin], axis=1).min() < 0.06
    assert np.linalg.norm(now[speck[0]] - now[skin], axis=1).min() < 0.06
    assert abs(np.linalg.norm(np.subtract(*now[whisker])) - np.linalg.norm(np.subtract(*rest[whisker]))) < 1e-5
    assert np.abs(now[pieces.places['far']] - rest[pieces.places['far']]).max() < 1e-6
    said = "1 loose part of the region (8 vertices" in ob.detail_deform.status
    assert said == (region is None)


def test_the_setting_is_live_and_needs_no_new_bind():
    pieces = limb()
    ob, empty = bound(pieces)
    bend(empty)
    rest, first = own(ob), evaluated(ob)
    sleeve, plate = pieces.places['sleeve'], pieces.places['plate']
    ob.detail_deform.loose_parts = 'STAY'
    update()
    stays = evaluated(ob)
    for name in (*SMALL, 'sleeve'):
        assert np.abs(stays[pieces.places[name]] - rest[pieces.places[name]]).max() < 1e-6
    assert (stays[pieces.places['limb']] == first[pieces.places['limb']]).all()
    ob.detail_deform.loose_parts = 'RIGID'
    update()
    assert off_rigid(rest[sleeve], evaluated(ob)[sleeve]) < 1e-5
    ob.detail_deform.loose_parts = 'BEND'
    update()
    assert off_rigid(rest[plate], evaluated(ob)[plate]) > 1e-4
    ob.detail_deform.loose_parts = 'AUTO'
    update()
    assert np.abs(evaluated(ob) - first).max() < 1e-6


def test_with_a_rigid_motion_of_all_they_keep_their_places():
    pieces = limb()
    ob, limb_itself = pieces.object(), pieces.are_of('limb')
    held = limb_itself.copy()
    held[40] = False  # one must be free
    empty = hold(ob, limb_itself, held, (1, 2, 0))
    empty.matrix_world = (Matrix.Translation((0.3, -1, 2)) @ Matrix.Rotation(2.5, 4, Vector((1, 2, 3)))
                          @ empty.matrix_world)
    update()
    rest, now = own(ob), evaluated(ob)
    ride = np.concatenate([pieces.places[name] for name in ('limb', 'sleeve', *SMALL)])
    assert off_rigid(rest[ride], now[ride]) < 1e-3


def test_what_is_larger_does_not_ride():
    """A bolt that is pulled leaves the limb in which it sticks where it is."""
    pieces = Pieces()
    pieces.tube('limb', RADIUS)
    pieces.tube('bolt', 0.05, 1.9, 2.2, 13)
    ob = pieces.object()
    x, bolt = own(ob)[:, 0], pieces.are_of('bolt')
    hold(ob, bolt & (x > 1.95), bolt & (x > 2.1), (2.2, 0, 0)).location.z += 0.2
    update()
    assert np.abs(evaluated(ob) - own(ob))[~bolt].max() < 1e-6
    assert np.abs(evaluated(ob) - own(ob))[bolt].max() > 0.1


def test_cards_beside_one_that_is_pulled_and_trousers_below_a_shirt_stay():
    pieces = Pieces()
    for number in range(5):
        y = 0.02 * number
        pieces.add(f'card {number}', [(x, y + z, 0.01 * number) for x in np.linspace(0, 1, 11) for z in (0, 0.2)],
                   [(2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1) for i in range(10)])
    ob = pieces.object()
    p, held = own(ob), pieces.are_of('card 2')
    hold(ob, held & (p[:, 0] > 0.15), held & (p[:, 0] > 0.85), (1, 0, 0)).location.z += 0.3
    update()
    moved = np.linalg.norm(evaluated(ob) - p, axis=1)
    assert moved[held].max() > 0.2
    assert moved[~held].max() < 1e-6

    pieces = Pieces()
    pieces.tube('shirt', RADIUS)
    pieces.tube('trousers', 0.45, 3.7, 6.2, 33)
    ob = pieces.object("Clothes")
    p, held = own(ob), pieces.are_of('shirt')
    hold(ob, held & (p[:, 0] > 0.5), held & (p[:, 0] > 3.8), (4, 0, 0)).location.z += 0.3
    update()
    assert np.linalg.norm(evaluated(ob) - p, axis=1)[~held].max() < 1e-6


def test_an_eye_stays_in_its_socket_while_a_lid_moves():
    pieces = Pieces()
    side = 41
    x, y = np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side), indexing='ij')
    inside = np.hypot(x, y) < 0.3
    z = np.where(inside, -np.sqrt(np.maximum(0.32**2 - x**2 - y**2, 0)), 0.0)
    pieces.add('limb', np.stack([x, y, z], -1).reshape(-1, 3),
               [(i * side + j, (i + 1) * side + j, (i + 1) * side + j + 1, i * side + j + 1)
                for i in range(side - 1) for j in range(side - 1)])
    u, v = np.meshgrid(np.linspace(0.2, np.pi - 0.2, 9), np.arange(16) * np.pi / 8, indexing='ij')
    ball = 0.28 * np.stack([np.sin(u) * np.cos(v), np.sin(u) * np.sin(v), np.cos(u)], -1).reshape(-1, 3)
    pieces.add('eye', ball, [(i * 16 + j, (i + 1) * 16 + j, (i + 1) * 16 + (j + 1) % 16, i * 16 + (j + 1) % 16)
                             for i in range(8) for j in range(16)])
    ob = pieces.object()
    p = own(ob)
    skin = np.arange(len(p)) < side * side
    lid = skin & (np.hypot(p[:, 0], p[:, 1] - 0.34) < 0.07)
    around = skin & (np.hypot(p[:, 0], p[:, 1] - 0.35) < 0.25)
    empty = hold(ob, around, lid, (0, 0.34, 0))
    empty.location += Vector((0, -0.25, 0.1))
    update()
    eye = pieces.places['eye']
    lid_moves = np.linalg.norm(evaluated(ob) - p, axis=1)[lid].max()
    assert lid_moves > 0.2
    assert np.linalg.norm(evaluated(ob) - p, axis=1)[eye].max() < lid_moves / 7
    # With all of its socket it goes.
    ob.detail_deform.region = ""
    ob.vertex_groups["held"].add(np.flatnonzero(skin & (np.hypot(p[:, 0], p[:, 1]) < 0.5)).tolist(), 1.0, 'REPLACE')
    bind(ob)
    empty.location += Vector((0, -0.25, 0.1))
    update()
    assert np.abs(evaluated(ob)[eye] - p[eye] - (0, -0.25, 0.1)).max() < 0.05


def test_the_two_sides_of_a_symmetric_head_ride_alike(part):
    bpy.ops.mesh.primitive_monkey_add()
    ob = bpy.context.active_object
    p = own(ob)
    parts = part('scene.components').labels(len(p), part('scene.mesh_data').edges(ob.data))
    is_eye = parts != parts[p[:, 2].argmin()]
    # Eyes have vertices at the same places as their sockets.
    apart = np.linalg.norm(p[:, None] * (-1, 1, 1) - p, axis=2) + (is_eye[:, None] != is_eye)
    image = apart.argmin(1)
    empty = hold(ob, p[:, 2] < 0.45, p[:, 2] < -0.7, (0, -0.5, -0.9))
    empty.location.z += 0.4
    empty.rotation_euler.x = 0.5
    update()
    moved = evaluated(ob) - p
    assert "2 loose parts ride along" in ob.detail_deform.status
    assert np.linalg.norm(moved[is_eye], axis=1).max() > 0.05
    assert np.abs(moved[image] * (-1, 1, 1) - moved).max() < 1e-4


def test_a_file_and_undo_keep_it(tmp_path):
    pieces = limb()
    ob, empty = bound(pieces)
    bend(empty)
    before = evaluated(ob)
    path = str(tmp_path / "riding.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    ob = bpy.data.objects["Pieces"]
    update()
    assert np.abs(evaluated(ob) - before).max() < 1e-6
    ob.detail_deform.handles[0].target.location.x += 0.1
    update()
    assert np.abs(evaluated(ob) - before)[pieces.places['plate']].max() > 0.01


def test_in_an_object_that_is_scaled_unevenly_they_are_rigid_in_the_scene():
    pieces = limb()
    pieces.points = [(x / 2, y, z) for x, y, z in pieces.points]
    ob, empty = bound(pieces, scale=2)
    bend(empty)
    plate = pieces.places['plate']
    rest, now = (positions[plate] * (2, 1, 1) for positions in (own(ob), evaluated(ob)))
    rotation, off = rigid_motion(rest, now)
    assert np.abs(off).max() < 1e-5 and angle_between(rotation, np.eye(3)) > 15
