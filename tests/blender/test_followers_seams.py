# SPDX-License-Identifier: GPL-3.0-or-later
"""A garment modelled as one half with a Mirror modifier: live transfer and transferred shapes leave its seam closed."""

import bpy
import numpy as np
import pytest

from conftest import activate, evaluated, own, update
from shapes import tube
from test_transfer import add_key, transfer


def half(p):
    return p[:, 0] > -1e-6


@pytest.fixture
def dressed():
    """(body, shirt): a body with an animated shape key that moves one side more, and half a shirt."""
    body, shirt = tube("Body", 1, -4, 4, 47, 60), tube("Shirt", 1.1, -2, 2, 48, 30, half)
    p = own(body)
    belly = np.exp(-p[:, 2:] ** 2) * (0.5 * p * (1, 1, 0) + (0.1, 0, 0))
    key = add_key(body, "belly", p + belly)
    key.keyframe_insert('value', frame=1)
    key.value = 1
    key.keyframe_insert('value', frame=4)
    bpy.context.scene.frame_set(1)
    shirt.modifiers.new("Mirror", 'MIRROR').use_clip = True
    shirt.detail_deform.transfer.source, shirt.detail_deform.transfer.correspondence = body, 'NEAREST'
    update()
    return body, activate(shirt)


def check_closed(shirt, count, moves=True):
    update()
    p = evaluated(shirt)
    assert len(p) == count
    seam = np.abs(own(shirt)[:, 0]) == 0
    assert np.abs(p[:len(seam)][seam, 0]).max() < 1e-6
    if moves:
        assert np.abs(p[:len(seam)] - own(shirt)).max() > 0.2


def test_the_seam_is_closed_while_it_follows(dressed):
    _, shirt = dressed
    count = len(evaluated(shirt))
    assert bpy.ops.object.detail_deform_transfer_live() == {'FINISHED'}
    check_closed(shirt, count, moves=False)
    bpy.context.scene.frame_set(4)
    check_closed(shirt, count)
    # Without merging there is no seam to close.
    shirt.modifiers["Mirror"].use_clip = shirt.modifiers["Mirror"].use_mirror_merge = False
    bpy.context.scene.frame_set(3)
    bpy.context.scene.frame_set(4)
    seam = own(shirt)[:, 0] == 0
    assert np.abs(evaluated(shirt)[:len(seam)][seam, 0]).max() > 0.01
    shirt.modifiers["Mirror"].use_clip = shirt.modifiers["Mirror"].use_mirror_merge = True
    bpy.context.scene.frame_set(3)
    bpy.context.scene.frame_set(4)
    check_closed(shirt, count)


@pytest.mark.parametrize('what', ['ALL_KEYS', 'POSE', 'CACHE', 'SHAPE_KEYS'])
def test_the_seam_is_closed_in_transferred_shapes(dressed, what, tmp_path):
    _, shirt = dressed
    count = len(evaluated(shirt))
    if what == 'ALL_KEYS':
        assert transfer(source="Body", what=what, correspondence='NEAREST') == {'FINISHED'}
        shirt.data.shape_keys.key_blocks["belly"].value = 1
    elif what == 'POSE':
        bpy.context.scene.frame_set(4)
        assert transfer(source="Body", what=what, correspondence='NEAREST') == {'FINISHED'}
    else:
        assert transfer(source="Body", what='ANIMATION', bake_as=what, correspondence='NEAREST', frame_start=1,
                        frame_end=4, cache_path=str(tmp_path / 'shirt.pc2')) == {'FINISHED'}
        bpy.context.scene.frame_set(4)
    check_closed(shirt, count)


def test_a_mirror_before_detail_deform_is_named(dressed):
    _, shirt = dressed
    assert bpy.ops.object.detail_deform_transfer_live() == {'FINISHED'}
    assert "modifier stack" not in shirt.detail_deform.transfer.state
    bpy.ops.object.modifier_move_to_index(modifier="Mirror", index=0)
    assert "'Mirror' comes before Detail Deform" in shirt.detail_deform.transfer.state
