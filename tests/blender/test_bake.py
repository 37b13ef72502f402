# SPDX-License-Identifier: GPL-3.0-or-later
"""Baked frames, which play without the add-on: point caches, shape keys and Alembic files."""

import math
import os
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest

from conftest import activate, bind, can_start_programs, evaluated, make_strip, own, refusal, update

FRAMES = range(1, 13)


@pytest.fixture
def strip():
    """A bound strip whose handle is keyed over the frames 1 to 12."""
    ob = bind(make_strip())
    target = ob.detail_deform.handles[0].target
    for frame in FRAMES:
        angle = 0.1 * (frame - 1)
        target.location = (math.cos(angle), 0.5, math.sin(angle))
        target.rotation_euler = (0, -angle, 0)
        for path in ('location', 'rotation_euler'):
            target.keyframe_insert(path, frame=frame)
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = FRAMES[0], FRAMES[-1]
    bpy.context.scene.frame_set(1)
    return ob


def played(ob, frames=FRAMES):
    """(frames, n, 3): the evaluated positions of each frame."""
    result = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        result.append(evaluated(ob))
    return np.array(result)


def test_a_cache_shows_what_was_live(strip, tmp_path):
    live = played(strip)
    assert np.abs(live[-1] - live[0]).max() > 0.5
    bpy.context.scene.frame_set(7)
    path = tmp_path / 'strip.pc2'
    assert bpy.ops.object.detail_deform_bake(filepath=str(path)) == {'FINISHED'}
    assert bpy.context.scene.frame_current == 7
    assert [m.name for m in strip.modifiers] == ["Detail Deform", "Detail Deform Cache"]
    assert [m.show_viewport for m in strip.modifiers] == [False, True]
    assert "baked cache is played" in strip.detail_deform.status
    assert os.listdir(tmp_path) == ['strip.pc2']
    assert np.abs(played(strip) - live).max() < 1e-6

    assert bpy.ops.object.detail_deform_bake_drop() == {'FINISHED'}
    assert [m.name for m in strip.modifiers] == ["Detail Deform"]
    assert np.abs(played(strip) - live).max() < 1e-6
    bpy.ops.object.detail_deform_bake_use(filepath=str(path), frame_start=1)
    assert np.abs(played(strip) - live).max() < 1e-6


def test_nothing_is_computed_while_a_cache_plays(strip, tmp_path, part, monkeypatch):
    bpy.ops.object.detail_deform_bake(filepath=str(tmp_path / 'strip.pc2'))
    computed = []
    monkeypatch.setattr(part('library.native').Deformer, 'offsets', lambda *_, **__: computed.append(1))
    played(strip)
    assert not computed


def test_a_cache_contains_the_effect_of_modifiers_before(strip, tmp_path):
    wave = strip.modifiers.new("Wave", 'WAVE')
    wave.height = 0.2
    bpy.ops.object.modifier_move_to_index(modifier="Wave", index=0)
    smooth = strip.modifiers.new("Subdivision", 'SUBSURF')
    live = played(strip)
    bpy.ops.object.detail_deform_bake(filepath=str(tmp_path / 'strip.pc2'))
    assert [m.name for m in strip.modifiers] == ["Wave", "Detail Deform", "Detail Deform Cache", "Subdivision"]
    assert smooth.show_viewport and np.abs(played(strip) - live).max() < 1e-5


def test_a_baked_file_plays_with_factory_settings(strip, tmp_path):
    """In a Blender without the add-on."""
    live = played(strip)
    blend = str(tmp_path / 'shot.blend')
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    bpy.ops.object.detail_deform_bake()
    assert (tmp_path / 'shot_Strip.pc2').exists()  # by default beside the .blend file
    bpy.ops.wm.save_mainfile()
    np.save(tmp_path / 'live.npy', live)
    code = f"""
import bpy, numpy as np
bpy.ops.wm.read_factory_settings()
bpy.ops.wm.open_mainfile(filepath={blend!r})
live = np.load({str(tmp_path / 'live.npy')!r})
assert not hasattr(bpy.types.Object, 'detail_deform')
for frame, expected in zip({list(FRAMES)}, live):
    bpy.context.scene.frame_set(frame)
    mesh = bpy.data.objects['Strip'].evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    values = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get('co', values)
    assert np.abs(values.reshape(-1, 3) - expected).max() < 1e-6, frame
print('PLAYED')
"""
    assert 'PLAYED' in run_blender(tmp_path, code)


def run_blender(folder, code):
    """Runs this code in a second process of this Blender; returns its output."""
    script = Path(folder) / f'script{len(os.listdir(folder))}.py'
    script.write_text(code, encoding='utf-8')
    return subprocess.run(command(script), capture_output=True, text=True, check=False).stdout


def command(script, *arguments):
    """The command that runs this script in a second process of this Blender."""
    if not can_start_programs():
        pytest.skip("no programs like this one can be started here")
    if bpy.app.binary_path:
        return [bpy.app.binary_path, '--background', '--factory-startup', '--python', str(script), '--', *arguments]
    return [sys.executable, str(script), *arguments]


def test_halves_by_two_processes_equal_the_whole(strip, tmp_path, module):
    """As when a render farm splits a shot."""
    blend = str(tmp_path / 'shot.blend')
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    whole, parts = tmp_path / 'whole.pc2', tmp_path / 'parts.pc2'
    bpy.ops.object.detail_deform_bake(filepath=str(whole), use=False)
    folder = Path(module.__file__).parents[1]
    code = f"""
import sys, bpy
sys.path.insert(0, {str(folder)!r})
import {module.__name__.rsplit('.', 1)[-1]} as add_on
add_on.register()
bpy.ops.wm.open_mainfile(filepath={blend!r})
bpy.context.view_layer.objects.active = bpy.data.objects['Strip']
bpy.ops.object.detail_deform_bake(frame_start=FIRST, frame_end=LAST, cache_start=1, cache_end=12,
                                  filepath={str(parts)!r}, use=False)
"""
    processes = []
    for number, (first, last) in enumerate(((1, 5), (6, 12))):
        script = tmp_path / f'half{number}.py'
        script.write_text(code.replace('FIRST', str(first)).replace('LAST', str(last)), encoding='utf-8')
        processes.append(subprocess.Popen(command(script), stdout=subprocess.PIPE, stderr=subprocess.STDOUT))
    outputs = [process.communicate()[0].decode() for process in processes]
    assert parts.exists(), outputs
    assert parts.read_bytes() == whole.read_bytes(), outputs
    bpy.ops.object.detail_deform_bake_use(filepath=str(parts), frame_start=1)


def test_shape_keys_play_what_was_live(strip):
    live = played(strip)
    strip.shape_key_add(name="Basis")
    assert bpy.ops.object.detail_deform_bake(mode='SHAPE_KEYS', frame_start=3, frame_end=6) == {'FINISHED'}
    keys = strip.data.shape_keys.key_blocks
    assert [k.name for k in keys] == ["Basis", *(f"Detail Deform {frame}" for frame in range(3, 7))]
    assert not strip.modifiers["Detail Deform"].show_viewport
    assert np.abs(played(strip, range(3, 7)) - live[2:6]).max() < 1e-6


def test_shape_keys_are_refused_with_a_modifier_before_detail_deform(strip):
    strip.modifiers.new("Wave", 'WAVE')
    bpy.ops.object.modifier_move_to_index(modifier="Wave", index=0)
    assert "'Wave' stands before" in refusal(bpy.ops.object.detail_deform_bake, mode='SHAPE_KEYS')
    assert not strip.data.shape_keys


def test_alembic(strip, tmp_path):
    live = played(strip)
    path = tmp_path / 'strip.abc'
    if not bpy.app.build_options.alembic:  # such as Debian's Blender
        assert "without Alembic" in refusal(bpy.ops.object.detail_deform_bake, mode='ALEMBIC', filepath=str(path))
        return
    assert bpy.ops.object.detail_deform_bake(mode='ALEMBIC', filepath=str(path)) == {'FINISHED'}
    bpy.ops.wm.alembic_import(filepath=str(path), as_background_job=False)
    imported = next(ob for ob in bpy.data.objects if ob.type == 'MESH' and ob != strip)
    assert np.abs(played(imported) - live).max() < 1e-5


@pytest.mark.skipif(not bpy.app.build_options.alembic, reason="Debian's Blender has no Alembic")
@pytest.mark.parametrize('hidden', ['inner', 'outer', 'both', 'object'])
def test_alembic_contains_an_object_that_is_hidden_in_renders(strip, tmp_path, hidden):
    """Whether the object itself, its collection or an outer collection is hidden: each is as before afterwards."""
    outer, inner = bpy.data.collections.new("Outer"), bpy.data.collections.new("Inner")
    bpy.context.scene.collection.children.link(outer)
    outer.children.link(inner)
    inner.objects.link(strip)
    bpy.context.scene.collection.objects.unlink(strip)
    disabled = {'inner': [inner], 'outer': [outer], 'both': [inner, outer], 'object': [strip]}[hidden]
    for data in disabled:
        data.hide_render = True
    update()
    live = played(activate(strip))
    path = tmp_path / 'strip.abc'
    assert bpy.ops.object.detail_deform_bake(mode='ALEMBIC', filepath=str(path)) == {'FINISHED'}
    assert {data.name for data in (inner, outer, strip) if data.hide_render} == {data.name for data in disabled}
    bpy.ops.wm.alembic_import(filepath=str(path), as_background_job=False)
    imported = next(ob for ob in bpy.data.objects if ob.type == 'MESH' and ob != strip)
    assert np.abs(played(imported) - live).max() < 1e-5


def test_slow_results_are_baked_too(strip, tmp_path):
    strip.detail_deform.steps = 3
    live = played(strip)
    bpy.ops.object.detail_deform_bake(filepath=str(tmp_path / 'strip.pc2'))
    assert np.abs(played(strip) - live).max() < 1e-6


def test_sentences(strip, tmp_path):
    bake = bpy.ops.object.detail_deform_bake
    assert "never saved" in refusal(bake, filepath='//strip.pc2')
    assert "can't be written" in refusal(bake, filepath=str(tmp_path / 'no folder' / 'strip.pc2'))
    assert "before the first" in refusal(bake, filepath=str(tmp_path / 'a.pc2'), frame_start=5, frame_end=4)
    assert "not within" in refusal(bake, filepath=str(tmp_path / 'a.pc2'), cache_start=2, cache_end=20)
    odd = tmp_path / 'odd.pc2'
    odd.write_bytes(b'something else')
    assert "another size" in refusal(bake, filepath=str(odd), cache_start=1, cache_end=20)
    use = bpy.ops.object.detail_deform_bake_use
    assert "not a point cache" in refusal(use, filepath=str(odd))
    assert "can't be read" in refusal(use, filepath=str(tmp_path / 'nowhere.pc2'))
    odd.write_bytes(b'POINTCACHE2\0' + b'\1\0\0\0' * 5)
    assert "not complete" in refusal(use, filepath=str(odd))
    assert [m.name for m in strip.modifiers] == ["Detail Deform"]
    strip.data.vertices[0].co.z += 1
    strip.data.update_tag()
    update()
    assert "were moved since Bind" in refusal(bake, filepath=str(tmp_path / 'a.pc2'))
    assert os.listdir(tmp_path) == ['odd.pc2']


def test_a_failed_frame_is_named_and_the_old_cache_is_left(strip, tmp_path):
    path = tmp_path / 'strip.pc2'
    bpy.ops.object.detail_deform_bake(filepath=str(path), use=False)
    before = path.read_bytes()
    target = strip.detail_deform.handles[0].target
    target.scale = (1, 1, 1)
    target.keyframe_insert('scale', frame=4)
    target.scale = (1e30, 1e30, 1e30)
    target.keyframe_insert('scale', frame=5)
    sentence = refusal(bpy.ops.object.detail_deform_bake, filepath=str(path), use=False)
    assert "Frame 5" in sentence and "moved so far" in sentence
    assert path.read_bytes() == before and os.listdir(tmp_path) == ['strip.pc2']
    assert strip.modifiers["Detail Deform"].show_viewport


def test_a_part_of_a_cache_is_not_played(strip, tmp_path):
    bpy.ops.object.detail_deform_bake(filepath=str(tmp_path / 'strip.pc2'), frame_start=1, frame_end=5,
                                      cache_start=1, cache_end=12)
    assert [m.name for m in strip.modifiers] == ["Detail Deform"]


def test_apply_is_refused_while_the_deformation_is_hidden(strip, tmp_path):
    bpy.ops.object.detail_deform_bake(filepath=str(tmp_path / 'strip.pc2'))
    assert "press Go Live first" in refusal(bpy.ops.object.detail_deform_apply, mode='MESH')
    bpy.ops.object.detail_deform_bake_drop()
    bpy.ops.object.detail_deform_bake(mode='SHAPE_KEYS', frame_start=3, frame_end=4)
    assert "is hidden" in refusal(bpy.ops.object.detail_deform_apply, mode='MESH')
    assert "baked shape keys already" in refusal(bpy.ops.object.detail_deform_bake, mode='SHAPE_KEYS')


def test_a_bake_leaves_frame_and_shape_as_they_were(strip, tmp_path):
    scene = bpy.context.scene
    strip.detail_deform.live = False
    scene.frame_set(7, subframe=0.5)
    bpy.ops.object.detail_deform_update()
    before = evaluated(strip)
    bpy.ops.object.detail_deform_bake(filepath=str(tmp_path / 'strip.pc2'), use=False)
    update()
    assert (scene.frame_current, scene.frame_subframe) == (7, 0.5)
    assert np.abs(evaluated(strip) - before).max() < 1e-6


@pytest.mark.parametrize('mode', ['CACHE', 'SHAPE_KEYS', 'SLIDERS', 'KEY_VALUES'])
def test_stretched_time_is_refused(strip, tmp_path, mode):
    """With Time Stretching, keys and caches would play at other frames than they were taken at."""
    if mode in {'SLIDERS', 'KEY_VALUES'}:
        strip.shape_key_add(name="Basis", from_mix=False)
        key = strip.shape_key_add(name="Lift", from_mix=False)
        key.data.foreach_set('co', (own(strip) + np.outer(own(strip)[:, 0] ** 2, (0, 0, 1))).astype(np.float32).ravel())
        key.value = 0.0
        strip.detail_deform.method = 'EXAMPLES'
        bpy.ops.object.detail_deform_examples_from_keys()
        bind(strip)
    bpy.context.scene.render.frame_map_new = 200
    before = len(strip.data.shape_keys.key_blocks) if strip.data.shape_keys else 0
    assert "remaps its time" in refusal(bpy.ops.object.detail_deform_bake, mode=mode,
                                        filepath=str(tmp_path / 'strip.pc2'))
    assert (len(strip.data.shape_keys.key_blocks) if strip.data.shape_keys else 0) == before


def test_a_full_disk_leaves_nothing_behind(strip, tmp_path, part, monkeypatch):
    class Full:
        def __init__(self, path, mode):
            open(path, mode).close()

        def write(self, data):
            if len(data) > 100:
                raise OSError(28, "No space left on device")

        def close(self):
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(part('scene.pc2'), 'open', Full, raising=False)
    assert "No space left" in refusal(bpy.ops.object.detail_deform_bake, filepath=str(tmp_path / 'strip.pc2'))
    assert os.listdir(tmp_path) == []


def test_other_levels_in_renders_are_refused(strip, tmp_path):
    smooth = strip.modifiers.new("Subdivision", 'SUBSURF')
    smooth.levels, smooth.render_levels = 1, 2
    bpy.ops.object.modifier_move_to_index(modifier="Subdivision", index=0)
    path = str(tmp_path / 'strip.pc2')
    assert "make the levels alike" in refusal(bpy.ops.object.detail_deform_bake, filepath=path)
    smooth.render_levels = 1
    live = played(strip)
    bpy.ops.object.detail_deform_bake(filepath=path)
    assert np.abs(played(strip) - live).max() < 1e-6


def hidden_in_renders(smooth):
    smooth.show_render = False


def driven(smooth):
    smooth.driver_add('show_viewport').driver.expression = "frame % 2"


def simplified(smooth):
    render = bpy.context.scene.render
    render.use_simplify, render.simplify_subdivision_render = True, 0


@pytest.mark.parametrize('change', [hidden_in_renders, driven, simplified])
def test_other_vertices_in_renders_are_refused(strip, tmp_path, change):
    smooth = strip.modifiers.new("Subdivision", 'SUBSURF')
    bpy.ops.object.modifier_move_to_index(modifier="Subdivision", index=0)
    smooth.levels = smooth.render_levels = 1
    change(smooth)
    update()
    path = str(tmp_path / 'strip.pc2')
    assert "and a cache holds one kind" in refusal(bpy.ops.object.detail_deform_bake, filepath=path)
    smooth.driver_remove('show_viewport')
    # A modifier behind Detail Deform may change the number of vertices.
    bpy.ops.object.modifier_move_to_index(modifier="Subdivision", index=len(strip.modifiers) - 1)
    assert bpy.ops.object.detail_deform_bake(filepath=path) == {'FINISHED'}
