# SPDX-License-Identifier: GPL-3.0-or-later
"""A target that is its source's mirror image gets mirror images of the source's deformations."""

import bpy
import numpy as np
import pytest

from conftest import activate, evaluated, group, own, update
from test_transfer import add_key, bent, coordinates, raw_strip

transfer = bpy.ops.object.detail_deform_transfer
FLIP = np.diag([-1.0, 1.0, 1.0])


def glove(name, n=25):
    """A bent sheet that is not its own mirror image."""
    ob = raw_strip(name, n)
    p = own(ob)
    p[:, 2] = 0.4 * p[:, 0] ** 2 + 0.3 * p[:, 1] * p[:, 0] - 0.2 * p[:, 1] ** 2
    set_own(ob, p)
    return ob


def set_own(ob, positions):
    ob.data.vertices.foreach_set('co', np.asarray(positions, np.float32).ravel())
    ob.data.update()


def flipped(ob, flip=FLIP):
    set_own(ob, own(ob) @ flip)
    return ob


def twisted(p):
    return bent(p) + 0.1 * p[:, :1] * p[:, [1, 0, 2]] * (0, 1, 0.5)


@pytest.fixture
def pair():
    source, target = glove("Source"), flipped(glove("Target"))
    add_key(source, "Bend", twisted(own(source)))
    activate(target)
    return source, target


@pytest.mark.parametrize('placing', ['VERTICES', 'COMPONENTS'])
@pytest.mark.parametrize('formulation', ['SURFACE', 'FOURTH_POINTS'])
def test_a_flipped_mesh_gets_mirrored_keys(pair, capfd, placing, formulation):
    source, target = pair
    transfer(source="Source", what='ALL_KEYS', placing=placing, formulation=formulation)
    assert "corresponds to the source's mirror image" in capfd.readouterr().out
    found, truth = coordinates(target.data.shape_keys.key_blocks["Bend"]), twisted(own(source)) @ FLIP
    assert np.abs(found - truth).max() < 1e-5 * np.linalg.norm(np.ptp(truth, axis=0))


def test_a_flipped_mesh_follows_as_a_mirror_image(pair):
    source, target = pair
    target.detail_deform.transfer.source = source
    assert bpy.ops.object.detail_deform_transfer_live() == {'FINISHED'}
    for value in (0.0, 0.3, 1.0):
        source.data.shape_keys.key_blocks["Bend"].value = value
        update()
        assert np.abs(evaluated(target) - evaluated(source) @ FLIP).max() < 1e-4


def test_an_object_mirrored_by_its_scale_is_not_mirrored_again(pair):
    """In local space it deforms like its source, which its scale mirrors in the world."""
    source, _ = pair
    target = activate(glove("Left"))
    target.scale.x = -1
    update()
    transfer(source="Source", what='ALL_KEYS')
    found = coordinates(target.data.shape_keys.key_blocks["Bend"])
    assert np.abs(found - twisted(own(source))).max() < 1e-5
    # With its mesh mirrored too, it looks like the source in the world, and deforms like it.
    flipped(activate(glove("Twice"))).scale.x = -1
    update()
    transfer(source="Source", what='ALL_KEYS')
    twice = bpy.data.objects["Twice"]
    shown = coordinates(twice.data.shape_keys.key_blocks["Bend"]) @ np.array(twice.matrix_world)[:3, :3].T
    assert np.abs(shown - twisted(own(source))).max() < 1e-4


def marked(ob, n):
    for number, (x, y) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1), (0.5, 0.5), (0.5, 0)), 1):
        group(ob, f"Marker {number}", [round(x * (n - 1)) * n + round(y * (n - 1))])


def test_markers_tell_a_mirror_image(pair, capfd):
    source, _ = pair
    target = flipped(glove("Other", 31), np.diag([1.0, -1.0, 1.0]))
    target.data.flip_normals()
    marked(source, 25)
    marked(target, 31)
    activate(target).detail_deform.transfer.source = source
    assert bpy.ops.object.detail_deform_transfer_match() == {'FINISHED'}
    assert "is the mirror image of 'Source', so deformations are mirrored" in capfd.readouterr().out
    transfer(what='ALL_KEYS', correspondence='STORED')
    found = coordinates(target.data.shape_keys.key_blocks["Bend"])
    like_source = own(target) * (1, -1, 1)
    truth = twisted(like_source) * (1, -1, 1)
    assert np.abs(found - truth).max() < 0.02
    assert np.abs(truth - own(target)).max() > 0.3


def test_a_mirrored_plane_is_turned_over_instead(capfd):
    """A plane's mirror image is also its rotation by 180 degrees, which keeps its outside outside."""
    source, target = raw_strip("Source"), raw_strip("Target")
    for ob in (source, target):
        set_own(ob, own(ob) * (1, 1, 0))
    flipped(target)
    add_key(source, "Lift", own(source) + own(source)[:, :1] * (0, 0, 0.2))
    activate(target)
    transfer(source="Source", what='ALL_KEYS')
    found = coordinates(target.data.shape_keys.key_blocks["Lift"])
    truth = coordinates(source.data.shape_keys.key_blocks["Lift"]) * (-1, 1, -1)
    assert np.abs(found - truth).max() < 1e-5
    assert "mirror image" not in capfd.readouterr().out
