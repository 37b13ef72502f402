# SPDX-License-Identifier: GPL-3.0-or-later
"""The C ABI: loose parts that ride on a surface."""

import numpy as np
import pytest


class Plate:
    """The strip with a plate of three vertices that rides on triangles 40 to 47."""

    def __init__(self, strip):
        on = strip.positions[strip.triangles[40:48]].reshape(-1, 3).mean(axis=0)
        self.positions = np.vstack([strip.positions, on + [[0, 0, 1], [1, 0, 1], [0, 1, 1]]]).astype(np.float32)
        self.triangles, self.skin = strip.triangles, len(strip.positions)
        self.riders = [(self.skin + k, 0) for k in range(3)]
        self.contacts = [(0, j) for j in range(40, 48)]

    def made(self, native, **changed):
        given = {'riders': self.riders, 'contacts': self.contacts, 'sizes': [1.0], **changed}
        return native.Riders(self.positions, self.triangles, **given)


@pytest.fixture
def plate(strip):
    return Plate(strip)


def test_a_plate_rides_on_a_rigid_motion(native, plate):
    turn = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]], np.float32)
    wanted = plate.positions @ turn.T + np.float32(5)
    offsets = (wanted - plate.positions).astype(np.float32)
    offsets[plate.skin:] = np.nan  # where it was before is of no matter
    skin = offsets[:plate.skin].copy()
    plate.made(native, threads=2).place(offsets)
    assert np.abs(plate.positions + offsets - wanted).max() < 1e-5
    assert (offsets[:plate.skin] == skin).all()


def test_it_rests_on_what_rests(native, plate):
    offsets = np.full_like(plate.positions, 2)
    offsets[:plate.skin] = 0
    plate.made(native).place(offsets)
    assert not offsets.any()


@pytest.mark.parametrize('changed, sentence', [
    ({'riders': [(9999, 0)]}, "options.riders has a vertex that the mesh lacks"),
    ({'riders': [(0, 3)]}, "riders has a group that has no size"),
    ({'contacts': [(0, 9999)]}, "contacts has a triangle that the mesh lacks"),
    ({'contacts': np.zeros((0, 2), int)}, r"group 0 has no triangle in options\.contacts"),
    ({'riders': [(150, 0), (150, 0)]}, "riders has vertex 150 twice"),
    ({'sizes': [np.nan]}, "sizes has a number that is not zero or more"),
    ({'threads': 0}, r"options\.threads is 0"),
    ({'riders': [(0, 0, 0)]}, "riders has the shape"),
])
def test_refusals(native, plate, changed, sentence):
    with pytest.raises(native.NativeError, match=sentence):
        plate.made(native, **changed)


def test_a_surface_that_rides_is_refused(native, plate):
    corner = int(plate.triangles[41][2])
    with pytest.raises(native.NativeError, match=f"the corner {corner}, which rides"):
        plate.made(native, riders=[(corner, 0)])


def test_places_are_for_the_mesh_and_in_range(native, plate):
    riders = plate.made(native)
    with pytest.raises(native.NativeError, match="offsets is for 3 vertices, not 195"):
        riders.place(np.zeros((3, 3), np.float32))
    offsets = np.full_like(plate.positions, 3e38)
    before = offsets.copy()
    with pytest.raises(native.NativeError, match="The motion is too large"):
        riders.place(offsets)
    assert (offsets == before).all()
    riders.close()
    with pytest.raises(native.NativeError, match="riders is null"):
        riders.place(offsets)
