# SPDX-License-Identifier: GPL-3.0-or-later
"""The motions of a curve's stations (scene/curve_motion.py) beside closed forms and brute force."""

import numpy as np
import pytest
from conftest import part

curve_motion, rotations = part('scene.curve_motion'), part('scene.rotations')
Samples = curve_motion.Samples
STRAIGHT = np.stack([np.linspace(0, 4, 81), np.zeros(81), np.zeros(81)], axis=1)


def samples(points, tilts=0.0, radii=1.0, is_cyclic=False):
    count = len(points)
    return Samples(np.asarray(points, float), np.broadcast_to(tilts, count), np.broadcast_to(radii, count), is_cyclic)


def some_rotation(seed):
    return rotations.nearest_rotations(np.random.default_rng(seed).normal(size=(3, 3)))


@pytest.mark.parametrize('size', [1e-9, 1, 1e9])
def test_the_nearest_rotations_are_those_of_singular_values(size):
    random = np.random.default_rng(7)
    matrices = size * random.normal(size=(500, 3, 3))
    matrices[:50, :, 2] = matrices[:50, :, 0] + matrices[:50, :, 1]  # flat
    matrices[50:100, :, 1] *= 1e-4  # nearly
    left, _, right = np.linalg.svd(matrices)
    left[:, :, 2] *= np.linalg.det(left @ right)[:, None]
    found = rotations.nearest_rotations(matrices)
    assert np.abs(found - left @ right)[50:].max() < 1e-9
    assert np.abs(found @ np.swapaxes(found, 1, 2) - np.eye(3)).max() < 1e-12
    assert np.abs(rotations.nearest_rotations(matrices[60]) - found[60]).max() < 1e-12


def test_the_nearest_point_is_that_of_a_search():
    random = np.random.default_rng(1)
    for is_cyclic in (False, True):
        curve, points = samples(random.normal(size=(12, 3)), is_cyclic=is_cyclic), random.normal(size=(50, 3))
        fine = np.linspace(0, 12 if is_cyclic else 11, 12_001)
        places = curve_motion.places(curve, fine)
        found = curve_motion.places(curve, curve_motion.parameters(curve, points))
        least = np.linalg.norm(points[:, None] - places, axis=2).min(axis=1)
        assert (np.linalg.norm(points - found, axis=1) <= least + 1e-12).all()


def test_parameters_are_exact_far_from_the_origin():
    points = STRAIGHT[10:20] + (0.02, 0.3, -0.1)
    for shift in (0.0, 1e4):
        found = curve_motion.parameters(samples(STRAIGHT + shift), points + shift)
        assert np.allclose(found, np.arange(10, 20) + 0.4, atol=1e-6)


def test_stations_are_equal_parts_of_the_length():
    uneven = samples(STRAIGHT[[0, 1, 2, 3, 40, 80]])
    every = np.linspace(0, 5, 5001)
    at, numbers = curve_motion.stations(uneven, every, 8), curve_motion.parts(uneven, every, 8)
    lengths = curve_motion.places(uneven, at)[:, 0]
    assert len(at) == 8 and (np.diff(numbers) >= 0).all() and (curve_motion.parts(uneven, at, 8) == range(8)).all()
    for number in range(8):
        inside = curve_motion.places(uneven, every[numbers == number])[:, 0]
        assert 0.5 * number - 1e-3 <= inside.min() and inside.max() <= 0.5 * (number + 1) + 1e-9
        assert inside.min() <= lengths[number] <= inside.max()


@pytest.mark.parametrize('is_cyclic', [False, True])
def test_a_rigid_motion_moves_all_stations_by_it(is_cyclic):
    angles = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    points = np.stack([np.cos(angles), np.sin(angles), 0.3 * np.cos(3 * angles)], axis=1)
    rotation, at = some_rotation(3), np.linspace(0, 39, 17)
    # An open curve begins without a twist: about an axis across its first tangent, there is none.
    if not is_cyclic:
        axis = np.cross(curve_motion._tangents(samples(points))[0], (0.3, 1, 0.2))
        axis /= np.linalg.norm(axis)
        cross = np.cross(np.eye(3), axis).T
        rotation = np.eye(3) + np.sin(1.1) * cross + (1 - np.cos(1.1)) * cross @ cross
    moved = points @ rotation.T + (1, -2, 3)
    motions, rotations = curve_motion.motions(
        samples(points, is_cyclic=is_cyclic), samples(moved, is_cyclic=is_cyclic), at)
    assert np.allclose(motions[:, :3, :3], rotation) and np.allclose(motions[:, :3, 3], (1, -2, 3))
    assert np.allclose(rotations, rotation)


def test_an_arc_turns_by_the_angle_of_its_tangent():
    radius = 0.5  # by 8 radians: more than a turn
    angles = STRAIGHT[:, 0] / radius
    arc = np.stack([radius * np.sin(angles), np.zeros(81), radius * (1 - np.cos(angles))], axis=1)
    at = np.linspace(2, 78, 39)
    motions, rotations = curve_motion.motions(samples(STRAIGHT), samples(arc), at)
    expected = np.stack([np.zeros(39), -at / 80 * 8, np.zeros(39)], axis=1)
    assert np.allclose(curve_motion.turns(rotations, np.zeros(3)), expected, atol=2e-3)
    # And beyond it from a turn of the object on.
    whole = curve_motion.turns(rotations, (0, -2 * np.pi, 0))
    assert np.allclose(whole, expected - (0, 2 * np.pi, 0), atol=2e-3)
    ends = motions @ np.append(curve_motion.places(samples(STRAIGHT), at), np.ones((39, 1)), axis=1)[:, :, None]
    assert np.allclose(ends[:, :3, 0], np.stack([radius * np.sin(at / 10), 0 * at, radius * (1 - np.cos(at / 10))],
                                                axis=1), atol=1e-5)


def test_a_helix_is_followed_by_parallel_transport():
    """Along a helix the transported frame turns about the tangent by -torsion per length against Frenet's."""
    radius, pitch, t = 1.0, 0.5, np.linspace(0, 5, 401)
    helix = np.stack([radius * np.cos(t), radius * np.sin(t), pitch * t], axis=1)
    speed = np.hypot(radius, pitch)
    straight = np.stack([np.zeros(401), np.zeros(401), speed * t], axis=1)
    at = np.array([0.0, 100, 250, 400])
    _, rotations = curve_motion.motions(samples(straight), samples(helix), at)
    tangent = np.stack([-radius * np.sin(t), radius * np.cos(t), np.full(401, pitch)], axis=1) / speed
    normal = np.stack([-np.cos(t), -np.sin(t), np.zeros(401)], axis=1)
    binormal = np.cross(tangent, normal)
    # A vector across the straight line, in Frenet's frame at each place.
    across = rotations @ rotations[0].T @ normal[0]
    angles = [np.arctan2(vector @ binormal[int(k)], vector @ normal[int(k)]) for vector, k in zip(across, at)]
    torsion = pitch / speed**2
    assert np.allclose(np.unwrap(angles), -torsion * speed * t[at.astype(int)], atol=1e-3)


def test_the_twist_of_a_closed_curve_is_shared_evenly():
    """Once around a curve out of the plane a transported frame comes back turned; stations don't jump there."""
    angles = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    flat = np.stack([np.cos(angles), np.sin(angles), np.zeros(200)], axis=1)
    wavy = flat + 0.4 * np.sin(2 * angles + 0.3)[:, None] * (0, 0, 1) + 0.2 * np.cos(angles)[:, None] * (0, 1, 0)
    _, rotations = curve_motion.motions(samples(flat, is_cyclic=True), samples(wavy, is_cyclic=True), np.arange(200.0))
    traces = np.einsum('kij,kij->k', np.roll(rotations, -1, axis=0), rotations)
    steps = np.arccos(np.clip((traces - 1) / 2, -1, 1))
    assert steps[-1] < 2 * steps[:-1].max() and steps[:-1].max() < 0.2


def test_tilt_radius_and_stretch():
    at = np.linspace(3, 77, 20)
    long = samples(STRAIGHT * (1.5, 1, 1), tilts=np.linspace(0, 4 * np.pi, 81), radii=np.linspace(1, 3, 81))
    motions, rotations = curve_motion.motions(samples(STRAIGHT), long, at)
    angle, radius = 4 * np.pi * at / 80, 1 + 2 * at / 80
    for k, motion in enumerate(motions):
        assert np.allclose(motion[:3, 0], (1.5, 0, 0))
        assert np.allclose(motion[:3, 1], radius[k] * np.array([0, np.cos(angle[k]), np.sin(angle[k])]))
    assert np.allclose(curve_motion.turns(rotations, np.zeros(3))[:, 0], angle)


@pytest.mark.parametrize('ratio', [0.34, 0.1, 0.01])
def test_points_at_uneven_distances(ratio):
    """A short first segment neither turns the tangent at the end nor tears the motions beside it."""
    lengths = np.append([ratio, 1], np.ones(6))
    curve = np.stack([np.append(0, np.cumsum(lengths)), np.zeros(9), np.zeros(9)], axis=1)
    noise = 0.02 * np.random.default_rng(4).normal(size=(9, 3)) * np.append([0, ratio], np.ones(7))[:, None]
    motions, rotations = curve_motion.motions(samples(curve), samples(curve + noise), np.linspace(0, 8, 33))
    assert np.abs(curve_motion.turns(rotations, np.zeros(3))).max() < 0.2
    assert np.allclose(np.linalg.det(motions[:, :3, :3]), 1, atol=0.15)


def test_stations_do_not_depend_on_rounding():
    rings = np.linspace(0, 4, 161)  # on the borders of 64 parts, and between
    points = np.stack([rings, np.full(161, 0.3), np.zeros(161)], axis=1)
    expected = curve_motion.parts(samples(STRAIGHT), curve_motion.parameters(samples(STRAIGHT), points), 64)
    for seed in range(20):
        noise = 4e-7 * np.random.default_rng(seed).normal(size=points.shape)
        found = curve_motion.parameters(samples(STRAIGHT), points + noise)
        assert (curve_motion.parts(samples(STRAIGHT), found, 64) == expected).all()
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    ring = samples(np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1), is_cyclic=True)
    poles = np.stack([np.zeros(9), np.zeros(9), np.linspace(-1, 1, 9)], axis=1)  # as far from each segment
    assert len(set(curve_motion.parameters(ring, poles).astype(int))) == 1


def test_a_radius_of_zero_at_rest_has_no_ratio():
    tapered = samples(STRAIGHT, radii=np.linspace(1, 0, 81))
    motions, _ = curve_motion.motions(tapered, tapered._replace(points=STRAIGHT + (0, 0, 1)), np.array([40.0, 80.0]))
    assert np.allclose(motions[:, :3, :3], np.eye(3))


def test_degenerate_curves_give_numbers():
    back = STRAIGHT * (-1, 1, 1)
    for points in (np.zeros((81, 3)), STRAIGHT[:1] + np.eye(3)[0] * (np.arange(81) > 40)[:, None], back):
        motions, rotations = curve_motion.motions(samples(STRAIGHT), samples(points), np.linspace(0, 80, 9))
        assert np.isfinite(motions).all() and np.allclose(np.linalg.det(rotations), 1)
    two = samples(STRAIGHT[[0, 80]])
    motions, _ = curve_motion.motions(two, samples(STRAIGHT[[0, 80]] + (0, 0, 1)), np.array([0.0, 0.5, 1.0]))
    assert np.allclose(motions[:, :3, 3], (0, 0, 1)) and np.allclose(motions[:, :3, :3], np.eye(3))
