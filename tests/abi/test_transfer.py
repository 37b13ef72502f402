# SPDX-License-Identifier: GPL-3.0-or-later
"""The C ABI: deformation transfer between meshes, and the search for correspondences."""
import ctypes

import numpy as np
import pytest

from conftest import Strip, rotation


WHOLE = 'WHOLE'


def mesh(strip):
    return strip.positions, strip.triangles


def bent(p):
    """Strips bent about their width, and twisted a little."""
    angle, radius = p[:, 0] / 16, 16 + p[:, 2]
    return np.stack([radius * np.sin(angle), p[:, 1] + 0.02 * p[:, 0] * p[:, 2], radius * np.cos(angle) - 16],
                    -1).astype(np.float32)


def test_onto_itself_a_pose_comes_back(native, strip):
    pose = bent(strip.positions)
    for pairs_of, count in (('TRIANGLES', len(strip.triangles)), ('VERTICES', len(strip.positions))):
        for pairs in (None, np.repeat(np.arange(count)[:, None], 2, axis=1)):
            transfer = native.Transfer(mesh(strip), mesh(strip), pairs, pairs_of=pairs_of, precision='DOUBLE')
            assert np.abs(transfer.apply(pose, WHOLE) - pose).max() < 1e-5
            assert np.allclose(np.reshape(transfer.info.placement, (3, 4)), np.eye(4)[:3], atol=1e-6)
    single = native.Transfer(mesh(strip), mesh(strip), precision='SINGLE')
    assert np.abs(single.apply(pose, WHOLE) - pose).max() < 3e-4
    info = transfer.info
    assert (info.unmatched_count, info.unmatched_example, info.degenerate_count) == (0, -1, 0)
    assert info.unknowns == len(strip.positions) and info.nonzeros > 5 * len(strip.positions)


def test_anchors_go_where_they_are_told(native, strip):
    pose = bent(strip.positions)
    anchors = [3, 80]
    places = strip.positions[anchors] + np.float32([[0, 0, 1], [0, 2, 0]])
    pinned = native.Transfer(mesh(strip), mesh(strip), anchor='PINNED', anchors=anchors)
    assert np.allclose(pinned.apply(pose, WHOLE)[anchors], strip.positions[anchors], atol=1e-5)
    assert np.allclose(pinned.apply(pose, WHOLE, places=places)[anchors], places, atol=1e-5)
    mean = native.Transfer(mesh(strip), mesh(strip), anchor='VERTICES', anchors=anchors)
    assert np.allclose(mean.apply(pose, WHOLE, places=places)[anchors].mean(0), places.mean(0), atol=1e-5)
    centred = native.Transfer(mesh(strip), mesh(strip), anchor='CENTROID')
    assert np.abs(centred.apply(pose + np.float32(100), WHOLE) - centred.apply(pose, WHOLE)).max() < 1e-3


def test_a_gap_that_closes_on_the_source_closes_on_a_wider_target(native):
    """A square with an open slit, whose upper side comes down."""
    side = 21
    x, row = np.meshgrid(np.linspace(0, 1, side), np.arange(2 * side), indexing='ij')
    upper = row >= side
    to_slit = np.where(upper, 2 * side - 1 - row, row) / (side - 1)

    def slit(gap):
        y = to_slit * (0.5 - 0.5 * gap * np.sin(np.pi * x))
        return np.stack([x, np.where(upper, 1 - y, y), 0 * x], -1).reshape(-1, 3).astype(np.float32)

    corner = (np.arange(side - 1)[:, None] * 2 * side + np.arange(2 * side - 1)).ravel()
    corner = corner[corner % (2 * side) != side - 1]  # no cells across the slit
    triangles = np.concatenate([np.stack([corner, corner + 2 * side, corner + 2 * side + 1], -1),
                                np.stack([corner, corner + 2 * side + 1, corner + 1], -1)]).astype(np.int32)
    for end in (0, side - 1):  # both sides of the slit share its ends
        triangles[triangles == end * 2 * side + side] = end * 2 * side + side - 1
    source, target = slit(0.04), slit(0.05)
    pose = source.copy()
    pose[:, 1] -= (0.039 * upper * to_slit * np.sin(np.pi * x)).ravel().astype(np.float32)
    middle = side // 2 * 2 * side + side - 1
    gaps = {}
    for placing in ('COMPONENTS', 'VERTICES'):
        transfer = native.Transfer((source, triangles), (target, triangles), placing=placing)
        found = transfer.apply(pose, WHOLE)
        gaps[placing] = found[middle + 1, 1] - found[middle, 1]
        assert transfer.info.overstretched_count == 0 and transfer.info.overstretched_example == -1
        assert np.abs(transfer.apply(source, WHOLE) - target).max() < 1e-6
    assert gaps['COMPONENTS'] > 0.009 and abs(gaps['VERTICES']) < 0.002


def test_the_volumetric_original_and_a_given_placement(native, strip):
    turn = rotation(0.7, (1, 2, 3))[0]
    moved = (strip.positions @ turn[:, :3].T + turn[:, 3]).astype(np.float32)
    for formulation in ('SURFACE', 'FOURTH_POINTS', 'FOURTH_POINTS_UNWEIGHTED'):
        # With the identity for a placement, the target's rotation isn't fitted.
        as_is = native.Transfer(mesh(strip), (moved, strip.triangles), placement=np.eye(4)[:3],
                                         formulation=formulation)
        spin = rotation(-1.1, (0, 0, 0))[0][:, :3].T
        assert np.abs(as_is.apply(strip.positions @ spin, WHOLE) - moved @ spin).max() < 1e-4
    fitted = native.Transfer(mesh(strip), (moved, strip.triangles))
    pose = bent(strip.positions)
    assert np.abs(fitted.apply(pose, WHOLE) - (pose @ turn[:, :3].T + turn[:, 3])).max() < 1e-4


def test_a_mirror_image_is_deformed_as_one(native):
    strip = waved(24, 2.0)
    mirror = np.diag([-2.0, 2.0, 2.0])
    image, pose = strip.positions @ mirror, bent(strip.positions)
    for placing in ('VERTICES', 'COMPONENTS'):
        for formulation in ('SURFACE', 'FOURTH_POINTS'):
            for placement in (None, np.diag([-2.0, 2.0, 2.0, 0])[:3]):
                transfer = native.Transfer((strip.positions, strip.triangles), (image, strip.triangles),
                                           placing=placing, formulation=formulation, placement=placement,
                                           precision='DOUBLE')
                assert transfer.info.mirrored == 1
                assert np.allclose(np.reshape(transfer.info.placement, (3, 4))[:, :3], mirror, atol=1e-5)
                assert np.abs(transfer.apply(pose, WHOLE) - pose @ mirror).max() < 1e-5 * np.ptp(image, axis=0).max()
    assert native.Transfer(mesh(strip), mesh(strip)).info.mirrored == 0


@pytest.mark.parametrize('change, sentence', [
    (dict(pairs=np.zeros((0, 2))), "There is no pair"),
    (dict(pairs=[[0, 0], [1, 999999]]), "Pair 1 names number 999999 of the target"),
    (dict(pairs=[[-1, 0]]), "Pair 0 names number -1 of the source"),
    (dict(anchor='PINNED'), "There is no anchor"),
    (dict(anchor='VERTICES', anchors=[5, 5]), "named as an anchor more than once"),
    (dict(placement=np.diag([1, 2, 1, 1])[:3]), "not a rotation"),
    (dict(placement=np.zeros((3, 4))), "not a rotation"),
    (dict(threads=-1), "options.threads is -1"),
])
def test_refusals(native, strip, change, sentence):
    with pytest.raises(native.NativeError, match=sentence):
        native.Transfer(mesh(strip), mesh(strip), **change)


def test_refusals_of_meshes_and_poses(native, strip):
    longer = Strip(30)
    with pytest.raises(native.NativeError, match="not of the same topology"):
        native.Transfer(mesh(strip), mesh(longer))
    broken = strip.positions.copy()
    broken[7] = np.nan
    with pytest.raises(native.NativeError, match="Vertex 7 of the target"):
        native.Transfer(mesh(strip), (broken, strip.triangles))
    beyond = strip.triangles.copy()
    beyond[3, 1] = 10**6
    for pairs_of in ('TRIANGLES', 'VERTICES'):
        with pytest.raises(native.NativeError, match="of the target refers to vertex 1000000"):
            native.Transfer(mesh(strip), (strip.positions, beyond), [[0, 0]], pairs_of=pairs_of)
    transfer = native.Transfer(mesh(strip), mesh(strip))
    with pytest.raises(native.NativeError, match="pose is for 240 vertices, not 192"):
        transfer.apply(longer.positions)
    with pytest.raises(native.NativeError, match="Vertex 7 of the source is not finite in the pose"):
        transfer.apply(broken)
    with pytest.raises(native.NativeError, match="options.places is for 2 anchors, not 0"):
        transfer.apply(strip.positions, places=strip.positions[:2])
    with pytest.raises(native.NativeError, match="too large"):
        transfer.apply(strip.positions * np.float32(1e37), WHOLE)


def waved(n, scale):
    """A strip of n columns over the same area, with one wave."""
    strip = Strip(n)
    strip.positions[:, 0] *= 23 / (n - 1)
    strip.positions[:, 2] = scale * np.sin(strip.positions[:, 0] / 4) + 0.1 * strip.positions[:, 1] ** 2
    return strip


def test_matching_by_markers(native):
    source, target = waved(24, 1.0), waved(47, 2.0)
    markers = [[8 * column + row, 16 * column + row] for column in (0, 11, 23) for row in (0, 7)]
    match = native.Match(mesh(source), mesh(target), markers)
    fractions, running = [], True
    while running:
        running, fraction, stage = match.progress()
        fractions.append(fraction)
    assert fractions == sorted(fractions) and stage
    pairs, confidence, fitted = match.finish()
    assert len(confidence) == len(target.triangles) and confidence.min() > 0.5 and confidence.max() <= 1
    assert set(pairs[:, 1]) == set(range(len(target.triangles)))
    for from_vertex, to_vertex in markers:
        assert np.allclose(fitted[from_vertex], target.positions[to_vertex], atol=1e-4)
    # Pairs lie at about the same place along the strip.
    along = [side.positions[side.triangles].mean(1)[:, 0] for side in (source, target)]
    assert np.abs(along[0][pairs[:, 0]] - along[1][pairs[:, 1]]).max() < 2
    # A pose carries over: the target bends as far as the source does.
    posed = native.Transfer(mesh(source), mesh(target), pairs).apply(bent(source.positions), WHOLE)
    end, expected = posed[-1] - posed[0], bent(target.positions)[-1] - bent(target.positions)[0]
    assert np.linalg.norm(end - expected) < 0.1 * np.linalg.norm(expected)


def test_matching_by_shape(native):
    source, target = waved(24, 1.0), waved(47, 1.2)
    turn = rotation(2.0, (30, 0, -7))[0]
    moved = (3 * target.positions @ turn[:, :3].T + turn[:, 3]).astype(np.float32)
    for markers in ((), [[0, 0]], [[0, 0], [23 * 8, 46 * 8]], [[0, 0], [8, 16], [16, 32]]):
        match = native.Match(mesh(source), (moved, target.triangles), markers)
        pairs, confidence, fitted = match.finish()
        along = [side.positions[side.triangles].mean(1)[:, 0] for side in (source, target)]
        assert np.abs(along[0][pairs[:, 0]] - along[1][pairs[:, 1]]).max() < 2
        assert 0.8 < match.info.confidence <= 1 and confidence.min() > 0.5 and np.isfinite(fitted).all()


def test_markers_tell_a_mirror_image(native):
    source, target = waved(24, 2.0), waved(47, 2.0)
    for side in (source, target):  # no rotation takes it to its mirror image
        side.positions[:, 2] += 0.3 * side.positions[:, 1] * np.sin(side.positions[:, 0] / 9)
    markers = [[8 * column + row, 16 * column + row] for column in (0, 6, 13, 23) for row in (0, 7)]
    mirrored = target.positions * np.float32([1, -1, 1])
    turned_over = target.triangles[:, ::-1]
    for positions, triangles, expected in ((target.positions, target.triangles, 0), (mirrored, turned_over, 1)):
        match = native.Match(mesh(source), (positions, triangles), markers)
        pairs, confidence, _ = match.finish()
        assert match.info.mirrored == expected and confidence.min() > 0.5
        transfer = native.Transfer(mesh(source), (positions, triangles), pairs)
        assert transfer.info.mirrored == expected
        posed = transfer.apply(bent(source.positions), WHOLE)
        truth = bent(target.positions) * ([1, -1, 1] if expected else [1, 1, 1])
        assert np.abs(posed - truth).max() < 0.01 * np.ptp(truth, axis=0).max()


def test_a_part_is_found_by_a_given_stance(native):
    whole = waved(48, 2.0)
    is_of_part = whole.positions[whole.triangles, 0].max(1) < 6
    vertices, corners = np.unique(whole.triangles[is_of_part], return_inverse=True)
    stance = 3 * rotation(0.5, (10, -20, 5))[0]
    moved = (whole.positions @ stance[:, :3].T + stance[:, 3]).astype(np.float32)
    part = moved[vertices], corners.reshape(-1, 3).astype(np.int32)
    _, confidence, fitted = native.Match(mesh(whole), part, stance=stance).finish()
    assert np.abs(fitted - moved)[vertices].mean() < 0.03 and confidence.mean() > 0.95
    for wrong in (np.diag([1, 2, 1, 1])[:3], np.full((3, 4), np.nan)):
        with pytest.raises(native.NativeError, match="options.stance is not a rotation"):
            native.Match(mesh(whole), part, stance=wrong)


@pytest.mark.parametrize('mirrored', [False, True])
def test_points_of_a_match_are_on_the_surface_and_carry_displacements(native, mirrored):
    source, target = waved(24, 2.0), waved(47, 2.0)
    for side in (source, target):  # no rotation takes it to its mirror image
        side.positions[:, 2] += 0.3 * side.positions[:, 1] * np.sin(side.positions[:, 0] / 9)
    image = np.float32([1, -1, 1] if mirrored else [1, 1, 1])
    there = target.positions * image, target.triangles[:, ::-1] if mirrored else target.triangles
    markers = [[8 * column + row, 16 * column + row] for column in (0, 6, 13, 23) for row in (0, 7)]
    match = native.Match(mesh(source), there, markers)
    pairs, _, _ = match.finish()
    triangles, weights = match.points
    assert triangles.min() >= 0 and np.allclose(weights.sum(1), 1, atol=1e-6) and weights.min() >= 0

    def at_points(values):
        return (weights[:, :, None] * values[source.triangles[triangles]]).sum(1)

    places, size = at_points(source.positions), np.ptp(target.positions, axis=0).max()
    assert np.abs(places - target.positions).max() < 0.02 * size
    pose = bent(source.positions)
    points = dict(point_triangles=triangles, point_weights=weights)
    displaced = native.Transfer(mesh(source), there, pairs, placing='DISPLACEMENTS', **points)
    expected = there[0] + at_points(pose - source.positions) * image
    assert np.abs(displaced.apply(pose, WHOLE) - expected).max() < 1e-4 * size
    assert np.abs(displaced.apply(pose, WHOLE) - bent(target.positions) * image).max() < 0.03 * size


def test_unusable_points_are_refused(native, strip):
    n, sides = len(strip.positions), (mesh(strip), mesh(strip))
    triangles, weights = np.zeros(n, np.int32), np.full((n, 3), 1 / 3, np.float32)
    native.Transfer(*sides, point_triangles=triangles, point_weights=weights)
    for given, sentence in (
            (dict(point_triangles=triangles), 'options.point_weights is for 0 vertices'),
            (dict(point_weights=weights), 'options.point_triangles is for 0 vertices'),
            (dict(point_triangles=triangles[1:], point_weights=weights), 'point_triangles'),
            (dict(point_triangles=triangles, point_weights=weights[1:]), 'point_weights'),
            (dict(point_triangles=triangles + 10**6, point_weights=weights), 'has its point in triangle 1000000'),
            (dict(point_triangles=triangles, point_weights=weights * np.nan), "don't add up to 1"),
            (dict(point_triangles=triangles, point_weights=weights, pairs_of='NEAREST'), 'which finds the points')):
        with pytest.raises(native.NativeError, match=sentence):
            native.Transfer(*sides, **given)


def test_a_square_is_ambiguous(native):
    square = Strip(8)
    square.positions[:, 2] = 0
    match = native.Match(mesh(square), mesh(square))
    _, _, fitted = match.finish()
    assert match.info.ambiguous == 1 and np.allclose(fitted, square.positions, atol=1e-3)


def test_matching_refuses_and_cancels(native, strip):
    with pytest.raises(native.NativeError, match="is paired by markers"):
        native.Match(mesh(strip), mesh(strip), [[0, 0], [0, 1], [9, 9], [100, 100]]).finish()
    with pytest.raises(native.NativeError, match="options.smoothness must be zero or more"):
        native.Match(mesh(strip), mesh(strip), [[0, 0]], smoothness=-1.0)
    big = Strip(3000)
    match = native.Match(mesh(big), mesh(big), [[0, 0], [7, 7], [20000, 20000]])
    match.cancel()
    with pytest.raises(native.NativeError, match="cancelled") as caught:
        match.finish()
    assert caught.value.cancelled
    native.Match(mesh(big), mesh(big), [[0, 0], [7, 7], [20000, 20000]]).close()  # cancels it


def test_null_pointers_and_jobs_of_another_kind_are_refused(native, structs, strip):
    lib = native.library()
    assert lib.dd_transfer_get_info(None, structs.TransferInfo()) == 1
    assert lib.dd_job_poll(None, structs.Progress()) == 1
    lib.dd_transfer_free(None)
    lib.dd_match_free(None)
    match = native.Match(mesh(Strip(3000)), mesh(Strip(3000)), [[0, 0], [7, 7], [20000, 20000]])
    count, made = ctypes.c_size_t(), ctypes.c_void_p()
    assert lib.dd_match_get_info(None, structs.MatchInfo()) == 1
    assert lib.dd_match_get_pairs(None, None, 0, count) == 1
    assert "match is null" in lib.dd_last_message().decode()
    assert lib.dd_job_take_transfer(match._handle, made) == 1
    assert lib.dd_last_message().decode() == "This job is a match, which gives no transfer."
    assert not made
    # Taking the result waits for the job, which was cancelled (6).
    match.cancel()
    assert lib.dd_job_take_match(match._handle, made) == 6 and not made
    match.close()


def test_a_transfer_tells_its_progress_and_can_be_cancelled(native):
    big = Strip(6000)
    job = native.TransferJob(mesh(big), mesh(big))
    fractions, running = [], True
    while running:
        running, fraction, stage = job.progress()
        fractions.append(fraction)
        assert stage
    assert fractions == sorted(fractions) and fractions[-1] == 1
    assert job.finish().info.unknowns == len(big.positions)
    for formulation in ('SURFACE', 'FOURTH_POINTS'):
        job = native.TransferJob(mesh(big), mesh(big), formulation=formulation)
        job.cancel()
        with pytest.raises(native.NativeError, match='cancelled') as caught:
            job.finish()
        assert caught.value.cancelled


def test_offsets_are_positions_less_those_at_rest(native, structs, strip):
    transfer = native.Transfer(mesh(strip), mesh(strip))
    pose, out = bent(strip.positions), np.empty_like(strip.positions)
    options = native.filled(structs.ApplyOptions, values='OFFSETS')
    assert native.library().dd_transfer_apply(transfer._handle, structs.points('pose', pose), options,
                                              structs.points_out(out)) == 0
    assert np.allclose(strip.positions + out, transfer.apply(pose), atol=1e-5) and np.abs(out).max() > 1


def test_a_worn_sheet_follows_the_surface_below_it(native, strip):
    """A sheet of fewer vertices over the strip."""
    x, y = np.meshgrid(np.linspace(2, 14, 7), np.linspace(0.5, 6.5, 5), indexing='ij')
    low, high = strip.positions.min(0), strip.positions.max(0)
    x = low[0] + (high[0] - low[0]) * (x - 2) / 12
    y = low[1] + (high[1] - low[1]) * (y - 0.5) / 6
    sheet = np.stack([x, y, np.full_like(x, high[2] + 0.2)], -1).reshape(-1, 3).astype(np.float32)
    corner = (np.arange(6)[:, None] * 5 + np.arange(4)).ravel()
    triangles = np.concatenate([np.stack([corner, corner + 5, corner + 6], -1),
                                np.stack([corner, corner + 6, corner + 1], -1)]).astype(np.int32)
    worn = native.Transfer(mesh(strip), (sheet, triangles), pairs_of='NEAREST', precision='DOUBLE')
    assert np.abs(worn.apply(strip.positions, WHOLE) - sheet).max() < 1e-5
    assert worn.info.through_count == 0 and worn.info.through_example == -1
    assert 0 < worn.info.worn_distance < 1
    turn = rotation(0.7, (1, 2, 3))[0]
    spun = (strip.positions @ turn[:, :3].T + turn[:, 3]).astype(np.float32)
    assert np.abs(worn.apply(spun, WHOLE) - (sheet @ turn[:, :3].T + turn[:, 3])).max() < 1e-3
    displaced = native.Transfer(mesh(strip), (sheet, triangles), pairs_of='NEAREST', placing='DISPLACEMENTS')
    assert np.abs(displaced.apply(strip.positions + np.float32([1, 2, 3]), WHOLE) - (sheet + [1, 2, 3])).max() < 1e-4
    rigid = native.Transfer(mesh(strip), (sheet, triangles), pairs_of='NEAREST', placing='PARTS')
    posed = rigid.apply(bent(strip.positions), WHOLE)
    lengths = [np.linalg.norm(p[triangles] - p[np.roll(triangles, 1, axis=1)], axis=2) for p in (sheet, posed)]
    assert np.abs(lengths[0] - lengths[1]).max() < 1e-4
    below = sheet - np.float32([0, 0, 0.4 + high[2] - low[2]]) * (np.arange(len(sheet)) == 17)[:, None]
    through = native.Transfer(mesh(strip), (below.astype(np.float32), triangles), pairs_of='NEAREST')
    assert through.info.through_example == 17
    with pytest.raises(native.NativeError, match="pairs is not null, but options.pairs_of is DD_PAIRS_OF_NEAREST"):
        native.Transfer(mesh(strip), (sheet, triangles), [[0, 0]], pairs_of='NEAREST')
    with pytest.raises(native.NativeError, match="options.gap is not finite"):
        native.Transfer(mesh(strip), (sheet, triangles), pairs_of='NEAREST', gap=float('nan'))
