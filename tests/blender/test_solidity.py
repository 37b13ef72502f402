# SPDX-License-Identifier: GPL-3.0-or-later
"""Solidity: limbs keep their cross-sections, live, without a new bind, by every method that is refined."""

import math

import bpy
import numpy as np
import pytest

from conftest import activate, add_empty, add_handle, bind, evaluated, group, own, update

RINGS, SIDES, LENGTH = 60, 28, 4.0


def make_tentacle():
    """A closed tapered tube along z, its first tenth fixed, its last tenth a handle with an empty at the tip."""
    u, v = np.meshgrid(np.linspace(0, 1, RINGS), np.arange(SIDES) * 2 * math.pi / SIDES, indexing='ij')
    radius = 0.5 - 0.44 * u
    points = np.stack([radius * np.cos(v), radius * np.sin(v), LENGTH * u], -1).reshape(-1, 3)
    points = np.concatenate([points, [(0, 0, 0), (0, 0, LENGTH)]])
    count, faces = RINGS * SIDES, []
    for j in range(SIDES):
        k = (j + 1) % SIDES
        faces += [(i + j, i + k, i + k + SIDES, i + j + SIDES) for i in range(0, count - SIDES, SIDES)]
        faces += [(count, k, j), (count + 1, count - SIDES + j, count - SIDES + k)]
    mesh = bpy.data.meshes.new("Tentacle")
    mesh.from_pydata(points.tolist(), [], faces)
    ob = bpy.data.objects.new("Tentacle", mesh)
    bpy.context.scene.collection.objects.link(ob)
    z = points[:, 2] / LENGTH
    group(ob, 'region', np.flatnonzero(z > 0.1))
    group(ob, 'tip', np.flatnonzero(z > 0.9))
    ob.detail_deform.region = 'region'
    add_handle(ob, 'tip', add_empty("Tip", (0, 0, LENGTH)))
    update()
    return activate(ob)


def sections(positions):
    """The areas of the rings."""
    rings = positions[:RINGS * SIDES].reshape(RINGS, SIDES, 3)
    arms = rings - rings.mean(axis=1, keepdims=True)
    return np.linalg.norm(np.cross(arms, np.roll(arms, -1, axis=1)).sum(axis=1), axis=1) / 2


def turns(ob):
    """The rings' turns about z, continuous from the first one."""
    rest, now = (p[:RINGS * SIDES, :2].reshape(RINGS, SIDES, 2) @ (1, 1j) for p in (own(ob), evaluated(ob)))
    return np.unwrap(np.angle((now * rest.conj()).sum(axis=1)))


@pytest.fixture
def tentacle():
    return bind(make_tentacle())


def lead_down(ob):
    ob.detail_deform.handles[0].target.location = (0, 0.7 * LENGTH, 0.3 * LENGTH)
    update()


def twist(ob, degrees):
    ob.detail_deform.handles[0].target.rotation_euler.z = math.radians(degrees)
    update()


def least(ob, rest):
    return (sections(evaluated(ob)) / rest).min()


@pytest.mark.parametrize('pose, solid, hollow', [(lead_down, 0.95, 0.5), (lambda ob: twist(ob, 720), 0.93, 0.5)])
def test_a_solid_limb_keeps_its_sections_and_a_hollow_one_does_not(tentacle, pose, solid, hollow):
    rest, settings = sections(evaluated(tentacle)), tentacle.detail_deform
    assert settings.solidity == 1  # by default
    settings.solidity = 0
    pose(tentacle)
    before = evaluated(tentacle)
    assert least(tentacle, rest) < hollow
    settings.solidity = 1
    update()
    assert settings.is_bound and not settings.stale  # live, without a new bind
    assert least(tentacle, rest) > solid
    settings.solidity = 0
    update()
    assert np.array_equal(evaluated(tentacle), before)


@pytest.mark.parametrize('pose', [lambda ob: None, lead_down, lambda ob: twist(ob, 720)])
def test_smooth_preview_shows_a_limb_and_a_hollow_one_as_a_thread(tentacle, pose):
    rest, settings = sections(own(tentacle)), tentacle.detail_deform
    settings.output = 'BASE'
    pose(tentacle)
    assert settings.is_bound and least(tentacle, rest) > 0.6
    settings.solidity = 0
    update()
    assert least(tentacle, rest) < 0.05


def test_a_base_object_is_what_smooth_preview_shows_at_rest(tentacle):
    rest, settings = sections(own(tentacle)), tentacle.detail_deform
    settings.output = 'BASE'
    update()
    shown = evaluated(tentacle)
    settings.output = 'RESULT'
    assert bpy.ops.object.detail_deform_base_make() == {'FINISHED'}
    base = settings.base_object
    assert np.abs(own(base) - shown).max() < 1e-5
    assert (sections(own(base)) / rest).min() > 0.8
    bind(activate(tentacle))  # to it; bent by a modifier, the limb follows with its sections
    modifier = base.modifiers.new("Bend", 'SIMPLE_DEFORM')
    modifier.deform_method, modifier.deform_axis, modifier.angle = 'BEND', 'X', math.radians(60)
    update()
    assert least(tentacle, rest) > 0.8


@pytest.mark.parametrize('place, down', [((0, 0.2), 0.05), ((0, 0.5), 0.3), ((0.7, 0), 0.7)])
def test_a_tip_that_turns_freely_stays_in_the_plane_of_its_pull(tentacle, place, down):
    tentacle.detail_deform.handles[0].turns = 'FREE'
    tentacle.detail_deform.handles[0].target.location = (*(LENGTH * p for p in place), (1 - down) * LENGTH)
    update()
    rings = evaluated(tentacle)[:RINGS * SIDES].reshape(RINGS, SIDES, 3).mean(axis=1)
    across = 1 if place[0] else 0
    assert np.abs(rings[:, across]).max() < 3e-6 * LENGTH  # a few roundings of single precision
    # It bends along its whole length: every sixth of its free part turns.
    along = np.diff(rings[6:54], axis=0)
    directions = along[::8] / np.linalg.norm(along[::8], axis=1, keepdims=True)
    turned = np.degrees(np.arccos((directions[1:] * directions[:-1]).sum(axis=1)))
    assert (turned > 1).all() and turned.sum() > 20


@pytest.mark.parametrize('degrees', [90, 720])
def test_a_tapered_limb_is_twisted_evenly_along_its_length(tentacle, degrees):
    twist(tentacle, degrees)
    z = np.arange(RINGS) / (RINGS - 1)
    first, last = np.flatnonzero(z <= 0.1)[-1], np.flatnonzero(z > 0.9)[0]  # rings that hold the free ones
    even = np.interp(np.arange(RINGS), (first, last), (0, math.radians(degrees)))
    assert np.abs(turns(tentacle) - even).max() < 0.04 * math.radians(degrees)
    tentacle.detail_deform.solidity = 0
    update()
    assert np.abs(turns(tentacle) - even).max() > 0.15 * math.radians(degrees)


def test_solidity_survives_a_bind_a_copy_and_a_file(tentacle, tmp_path):
    tentacle.detail_deform.solidity = 0.75
    lead_down(tentacle)
    shown = evaluated(tentacle)
    path = str(tmp_path / 'solid.blend')
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path, load_ui=False)
    ob = activate(bpy.data.objects["Tentacle"])
    bpy.ops.object.detail_deform_update()
    assert ob.detail_deform.solidity == 0.75
    assert np.abs(evaluated(ob) - shown).max() < 1e-6


def test_examples_are_solid_too(tentacle):
    """Poses by example, with the tip led beyond the example."""
    ob, settings = tentacle, tentacle.detail_deform
    lead_down(ob)
    ob.shape_key_add(name="Basis")
    key = ob.shape_key_add(name="Down", from_mix=False)
    key.data.foreach_set('co', evaluated(ob).ravel())
    key.value = 0
    settings.handles[0].target.location = (0, 0, LENGTH)
    settings.examples.add().name = "Down"
    settings.method = 'EXAMPLES'
    bpy.ops.object.detail_deform_bind(wait=True)
    assert settings.is_bound, settings.status
    rest = sections(evaluated(ob))
    settings.handles[0].target.location = (0.5, 0.5 * LENGTH, 0.6 * LENGTH)
    update()
    assert least(ob, rest) > 0.9


@pytest.mark.parametrize('setting, value, why', [('refine', 0, "Quality of large bends is 0"),
                                                 ('rotation_only', False, None),
                                                 ('formulation', 'FOURTH_POINTS', None)])
def test_without_the_settings_it_needs_it_has_no_effect_and_a_reason_or_no_row(tentacle, part, setting, value, why):
    options, settings = part('library.options'), tentacle.detail_deform
    solidity = next(option for option in options.SETTINGS if option.name == 'solidity')
    lead_down(tentacle)
    setattr(settings, setting, value)
    update()
    before = evaluated(tentacle)
    settings.solidity = 0
    update()
    assert np.array_equal(evaluated(tentacle), before)
    if why:
        assert why in options.why_not(solidity, settings)
    else:
        assert not options.is_shown(solidity, settings)
