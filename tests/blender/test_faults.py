# SPDX-License-Identifier: GPL-3.0-or-later
"""Failures around the add-on: of its library, the disk, memory and threads. Each costs one sentence and no data,
Blender doesn't crash, and the add-on works again when the cause is gone."""

import contextlib
import os
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import bpy
import numpy as np
import pytest

from conftest import activate, bind, can_start_programs, evaluated, make_strip, members, moved, refusal, update
from test_bake import command

HERE = Path(__file__).resolve().parent


@pytest.fixture
def in_child(module, tmp_path):
    """in_child(function, *arguments): runs a function of a test file in another Blender, with a copy of the add-on that
    it may damage; returns its output."""
    copies = tmp_path / 'copy'
    shutil.copytree(Path(module.__file__).parent, copies / 'detail_deform')

    def run(function, *arguments):
        script = tmp_path / f'{function.__name__}.py'
        script.write_text(f"""
import os, sys, traceback
sys.path[:0] = [{str(copies)!r}, {str(HERE)!r}]
import detail_deform
detail_deform.register()
import {function.__module__} as tests
try:
    tests.{function.__name__}(*{arguments!r})
    print('DONE')
except BaseException:
    traceback.print_exc()
sys.stdout.flush()
sys.stderr.flush()
os._exit(0)
""", encoding='utf-8')
        ended = subprocess.run(command(script), capture_output=True, text=True, timeout=300, check=False)
        output = ended.stdout + ended.stderr
        assert ended.returncode == 0 and 'DONE' in ended.stdout and 'Traceback' not in output, output
        return output
    return run


# ---- the library

def put(path, content):
    """Replaces a file by a new one, not in place: the old one may be loaded. None: by a folder; b'nothing': by none."""
    if os.path.isdir(path):
        os.rmdir(path)
    elif os.path.exists(path):
        os.remove(path)
    if content is None:
        os.mkdir(path)
    elif content != b'nothing':
        Path(path).write_bytes(content)


def sentence_of_all(blend):
    """Opens a file with a bound object while the library can't be loaded; returns the sentence, which is the same in
    the status and in the refusals of Bind and Update."""
    bpy.ops.wm.open_mainfile(filepath=blend, load_ui=False)
    ob = activate(bpy.data.objects['Strip'])
    before = evaluated(ob)
    assert moved(ob) > 0.3
    bpy.context.scene.frame_set(2)
    ob.detail_deform.handles[0].target.location.z += 0.1
    update()
    sentence = ob.detail_deform.status
    assert sentence == ob.detail_deform.problem and not ob.detail_deform.is_bound
    for operator in ('bind', 'update'):
        with pytest.raises(RuntimeError) as refused:
            getattr(bpy.ops.object, f'detail_deform_{operator}')()
        assert sentence in str(refused.value)
    other = make_strip(name="Other")
    for operator in ('bind', 'add', 'update', 'handle_reset', 'save_key', 'bake', 'transfer', 'transfer_live', 'apply'):
        try:
            getattr(bpy.ops.object, f'detail_deform_{operator}')()
        except RuntimeError:
            pass  # refused by a sentence; in_child() finds tracebacks in the output
    bpy.data.objects.remove(other)
    bpy.ops.wm.save_as_mainfile(filepath=f'{blend}.again.blend')
    bpy.ops.wm.open_mainfile(filepath=f'{blend}.again.blend', load_ui=False)
    ob = bpy.data.objects['Strip']
    assert ob.detail_deform.signature and np.array_equal(evaluated(ob), before)
    return sentence


def check_libraries_that_cannot_be_loaded(blend):
    """Runs in a child process."""
    import detail_deform
    from detail_deform.library import native, structs
    path = native.library_path()
    whole, record = Path(path).read_bytes(), Path(f'{path}.sha256').read_text(encoding='ascii')
    size = len(whole)
    cut = [whole[:length] for length in (0, 3, 64, 4096, size // 3, size - 70000, size - 1)]
    holes = [whole[:start] + bytes(size - start) for start in (4096, size // 2, size - 100000)]
    one_bit = bytearray(whole)
    one_bit[size // 2] ^= 1
    for content in (*cut, *holes, bytes(one_bit)):
        put(path, content)
        assert "damaged or of another version" in sentence_of_all(blend)
    # A zip for another system, or one packed with a wrong file, has the right checksum for the file in it.
    import hashlib
    for content in (b'MZ' + bytes(5000), b'\xcf\xfa\xed\xfe' + bytes(5000), b'not a library\n'):
        put(path, content)
        Path(f'{path}.sha256').write_text(hashlib.sha256(content).hexdigest(), encoding='ascii')
        assert "can't be loaded" in sentence_of_all(blend)
    Path(f'{path}.sha256').write_text(record, encoding='ascii')
    put(path, None)
    why = "Permission denied" if sys.platform == 'win32' else "Is a directory"
    assert "can't be loaded" in sentence_of_all(blend) and why in sentence_of_all(blend)
    put(path, b'nothing')
    assert "is missing" in sentence_of_all(blend)
    put(path, whole)
    structs.ABI_VERSION += 1
    assert "interface" in sentence_of_all(blend)
    structs.ABI_VERSION -= 1
    detail_deform.unregister()
    detail_deform.register()
    bpy.ops.wm.open_mainfile(filepath=blend, load_ui=False)
    ob = bpy.data.objects['Strip']
    before = evaluated(ob)
    ob.detail_deform.handles[0].target.location.z += 0.1
    update()
    assert ob.detail_deform.is_bound, ob.detail_deform.status
    assert np.abs(evaluated(ob)[-1] - before[-1] - (0, 0, 0.1)).max() < 1e-5


def save_posed(folder):
    ob = bind(make_strip())
    ob.detail_deform.handles[0].target.location.z += 0.4
    update()
    blend = str(folder / 'posed.blend')
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    return blend


def test_a_library_that_cannot_be_loaded_costs_a_sentence_and_nothing_else(in_child, tmp_path):
    """Without the check of the checksum, the system's loader crashes Blender by a bus error."""
    in_child(check_libraries_that_cannot_be_loaded, save_posed(tmp_path))


# ---- memory and threads

def limit_memory(to):
    """Limits the process's addresses to those it has and so many bytes more; 0 takes the limit away."""
    import resource
    with open('/proc/self/statm') as file:
        present = int(file.read().split()[0]) * os.sysconf('SC_PAGE_SIZE')
    resource.setrlimit(resource.RLIMIT_AS, (present + to if to else resource.RLIM_INFINITY, resource.RLIM_INFINITY))


def check_memory_that_runs_out():
    """Runs in a child process."""
    # The small bind comes first because numpy's OpenBLAS ends the process where it can't get its buffers, which it then
    # keeps. The bind of 160,000 vertices takes over 300 MB. It has to be so large because threads that have run keep up
    # to 64 MB of addresses each, which the limit doesn't count as new: 40,000 vertices fitted into them now and then.
    # Blender itself takes some 20 MB to evaluate such a mesh, and crashes without them.
    small, ob = bind(make_strip(9, "Small")), make_strip(400)
    limit_memory(100_000_000)
    assert "not enough memory" in refusal(bpy.ops.object.detail_deform_bind, wait=True)
    for empty in (small.detail_deform.handles[0].target, ob.detail_deform.handles[0].target):
        empty.location.z += 0.4
    update()
    limit_memory(0)
    assert not ob.detail_deform.is_bound and moved(ob) == 0
    assert small.detail_deform.is_bound and abs(moved(small) - 0.4) < 1e-4
    bind(ob)
    ob.detail_deform.handles[0].target.location.z += 0.4
    update()
    assert abs(moved(ob) - 0.4) < 1e-4


def check_threads_that_cannot_be_started():
    """Runs in a child process."""
    import resource
    ob = bind(make_strip())
    other = make_strip(40, "Other")
    if os.geteuid() == 0:  # the limit doesn't apply to root
        os.setgid(65534)
        os.setuid(65534)
    resource.setrlimit(resource.RLIMIT_NPROC, (1, 1))
    assert "no thread to spare" in refusal(bpy.ops.object.detail_deform_bind, wait=True)
    assert not other.detail_deform.is_bound and moved(other) == 0
    ob.detail_deform.handles[0].target.location.z += 0.4
    update()
    assert abs(moved(ob) - 0.4) < 1e-4 and ob.detail_deform.is_bound  # an update needs no thread
    ob.detail_deform.steps = 2
    ob.detail_deform.handles[0].target.location.z += 0.1
    update()
    assert "no thread to spare" in ob.detail_deform.status and abs(moved(ob) - 0.5) < 1e-4


linux_only = pytest.mark.skipif(sys.platform != 'linux', reason="limits are Linux's")
removes_open_files = pytest.mark.skipif(sys.platform == 'win32', reason="Windows doesn't remove a file that is open")


@linux_only
@pytest.mark.parametrize('check', [check_memory_that_runs_out, check_threads_that_cannot_be_started])
def test_memory_and_threads_that_run_out(in_child, check):
    in_child(check)


@pytest.mark.parametrize('place', ['scene.mesh_data.group_entries', 'scene.handle_transforms.local_transforms',
                                   'scene.mesh_data.topology_signature'])
def test_an_array_that_python_cannot_allocate(strip, part, monkeypatch, place):
    module, name = place.rsplit('.', 1)

    def fails(*_, **__):
        raise MemoryError("Unable to allocate 923. KiB for an array")
    shown, refine = evaluated(strip), strip.detail_deform.refine
    monkeypatch.setattr(part(module), name, fails)
    strip.detail_deform.refine = 3
    strip.data.update_tag()
    bpy.context.scene.frame_set(5)
    assert "not enough memory" in refusal(bpy.ops.object.detail_deform_bind, wait=True)
    monkeypatch.undo()
    strip.detail_deform.refine = refine
    bpy.context.scene.frame_set(9)
    bind(strip, keep_rest=True)
    assert np.abs(evaluated(strip) - shown).max() < 1e-6
    bpy.context.scene.frame_set(1)
    lowered = (evaluated(strip) - shown)[members(strip, 'right')]
    assert np.abs(lowered - (0, 0, -0.4)).max() < 1e-5


# ---- the disk

@pytest.fixture
def disk(tmp_path):
    """A mounted disk of 400 kB: disk.full() fills it up, disk.read_only() makes it read-only."""
    class Disk:
        folder = tmp_path / 'disk'

        def full(self):
            with open(self.folder / 'filler', 'ab', buffering=0) as filler, contextlib.suppress(OSError):
                while True:
                    filler.write(bytes(4096))

        def read_only(self):
            subprocess.run(['mount', '-o', 'remount,ro', str(self.folder)], check=True)

        def files(self):
            return sorted(name for name in os.listdir(self.folder) if name != 'filler')

    Disk.folder.mkdir()
    mounted = sys.platform == 'linux' and os.geteuid() == 0 and can_start_programs() and subprocess.run(
        ['mount', '-t', 'tmpfs', '-o', 'size=400k', 'tmpfs', str(Disk.folder)], capture_output=True).returncode == 0
    if not mounted:
        pytest.skip("a disk of its own needs root, on Linux, and the right to mount")
    yield Disk()
    subprocess.run(['umount', '-l', str(Disk.folder)], check=True)


@pytest.fixture
def strip():
    """A bound strip with its handle keyed over the frames 1 to 9, whose cache takes 68 kB, at frame 9."""
    ob = bind(make_strip())
    target = ob.detail_deform.handles[0].target
    for frame in (1, 9):
        target.location.z = 0.05 * frame
        target.keyframe_insert('location', frame=frame)
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 9
    bpy.context.scene.frame_set(9)
    return ob


@pytest.fixture
def at_frame():
    """at_frame(number, happens): calls happens() once, when a bake comes to that frame."""
    added = []

    def call(number, happens):
        def handler(scene, depsgraph):
            if scene.frame_current == number and handler in bpy.app.handlers.frame_change_post:
                bpy.app.handlers.frame_change_post.remove(handler)
                happens()
        bpy.app.handlers.frame_change_post.append(handler)
        added.append(handler)
    yield call
    for handler in added:
        if handler in bpy.app.handlers.frame_change_post:
            bpy.app.handlers.frame_change_post.remove(handler)


def follower(ob):
    """Another strip, which is active and has this one as its source."""
    other = make_strip(name="Other")
    other.detail_deform.handles.clear()
    other.detail_deform.transfer.source = ob
    return activate(other)


def bake(ob, path):
    return refusal(bpy.ops.object.detail_deform_bake, filepath=str(path))


def bake_a_part(ob, path):
    return refusal(bpy.ops.object.detail_deform_bake, filepath=str(path), frame_start=3, cache_start=1)


def carry_over(ob, path):
    follower(ob)
    return refusal(bpy.ops.object.detail_deform_transfer, what='ANIMATION', correspondence='TOPOLOGY',
                   cache_path=str(path))


WRITERS = [bake, bake_a_part, carry_over]


@pytest.mark.parametrize('write', WRITERS)
def test_a_disk_that_is_full_before_a_bake(strip, disk, write):
    disk.full()
    shown = evaluated(strip)
    sentence = write(strip, disk.folder / 'strip.pc2')
    assert "the file takes" in sentence and "MB left" in sentence
    assert disk.files() == [] and np.array_equal(evaluated(strip), shown)


@pytest.mark.parametrize('write', WRITERS)
def test_a_disk_that_becomes_full_during_a_bake(strip, disk, at_frame, write):
    """A cache of which only a part is baked is left where it is, as other processes may be writing to it."""
    at_frame(5, disk.full)
    shown = evaluated(strip)
    sentence = write(strip, disk.folder / 'strip.pc2')
    assert "can't be written: No space left on device" in sentence
    assert disk.files() == (['strip.pc2'] if write == bake_a_part else [])
    assert bpy.context.scene.frame_current == 9 and np.array_equal(evaluated(strip), shown)
    assert [m.type for m in strip.modifiers] == ['NODES']


def test_a_bake_leaves_the_cache_that_was_there_where_the_disk_is_full(strip, disk, at_frame):
    path = disk.folder / 'strip.pc2'
    bpy.ops.object.detail_deform_bake(filepath=str(path), use=False)
    before = path.read_bytes()
    at_frame(5, disk.full)
    assert "No space left" in bake(strip, path)
    assert path.read_bytes() == before and disk.files() == ['strip.pc2']


@pytest.mark.parametrize('write', WRITERS)
def test_a_disk_that_may_only_be_read(strip, disk, write):
    disk.read_only()
    assert "can't be written: Read-only file system" in write(strip, disk.folder / 'strip.pc2')


@removes_open_files
@pytest.mark.parametrize('write', [bake, carry_over])
def test_a_folder_that_is_deleted_during_a_bake(strip, tmp_path, at_frame, write):
    folder = tmp_path / 'caches'
    folder.mkdir()
    at_frame(5, lambda: shutil.rmtree(folder))
    shown = evaluated(strip)
    assert "can't be written: No such file or directory" in write(strip, folder / 'strip.pc2')
    assert np.array_equal(evaluated(strip), shown)


@removes_open_files
def test_a_file_that_takes_the_place_of_the_unfinished_cache(strip, tmp_path, at_frame):
    """A leftover that can't be removed doesn't replace the sentence about the failure."""
    path = tmp_path / 'strip.pc2'

    def exchange():
        os.remove(f'{path}.unfinished')
        os.mkdir(f'{path}.unfinished')
        os.mkdir(path)
        (path / 'something').touch()
    at_frame(5, exchange)
    assert "can't be written" in bake(strip, path)


@pytest.mark.skipif(not bpy.app.build_options.alembic, reason="this Blender was built without Alembic")
@pytest.mark.parametrize('how', ['full', 'full, but not seen so', 'read_only', 'deleted'])
def test_alembic_where_it_cannot_be_written(strip, disk, at_frame, part, monkeypatch, how):
    """A disk that becomes full during the export isn't tested: then Blender's exporter crashes Blender."""
    path = disk.folder / 'caches' / 'strip.abc'
    path.parent.mkdir()
    if how == 'deleted':
        at_frame(5, lambda: shutil.rmtree(path.parent))
    elif how == 'read_only':
        disk.read_only()
    else:
        disk.full()
    if how == 'full, but not seen so':
        monkeypatch.setattr(part('scene.pc2'), 'check_room', lambda *_: None)
    shown = evaluated(strip)
    sentence = refusal(bpy.ops.object.detail_deform_bake, filepath=str(path), mode='ALEMBIC')
    why = {'full': "MB left", 'full, but not seen so': "stopped before its end"}
    assert why.get(how, "can't be written") in sentence
    assert np.array_equal(evaluated(strip), shown)
    assert not path.parent.exists() or os.listdir(path.parent) == []


@pytest.mark.parametrize('how', ['full', 'read_only'])
def test_a_list_that_cannot_be_written(strip, disk, how):
    settings = follower(strip).detail_deform.transfer
    numbers = disk.folder.parent / 'pairs.txt'
    numbers.write_text('\n'.join(f'{k} {k}' for k in range(1152)), encoding='ascii')
    settings.correspondence, settings.filepath, settings.pairs_of = 'LIST', str(numbers), 'TRIANGLES'
    bpy.ops.object.detail_deform_transfer_live()
    path = disk.folder / 'list.txt'
    path.write_text("precious", encoding='ascii')
    getattr(disk, how)()
    assert "can't be written" in refusal(bpy.ops.object.detail_deform_transfer_save, filepath=str(path))
    assert path.read_text(encoding='ascii') == "precious" and disk.files() == ['list.txt']


def test_a_file_that_cannot_be_saved_is_still_open_and_can_be_saved_elsewhere(strip, disk, tmp_path):
    disk.full()
    shown = evaluated(strip)
    refusal(bpy.ops.wm.save_as_mainfile, filepath=str(disk.folder / 'file.blend'))
    assert strip.detail_deform.is_bound and np.array_equal(evaluated(strip), shown)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'file.blend'))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / 'file.blend'), load_ui=False)
    ob = bpy.data.objects['Strip']
    bpy.context.scene.frame_set(8)
    bpy.context.scene.frame_set(9)
    assert ob.detail_deform.is_bound and np.abs(evaluated(ob) - shown).max() < 1e-6


REFUSED = "Writing to ID classes in this context is not allowed: Strip, Mesh datablock, error setting Mesh.<UNKNOWN>"


@pytest.mark.parametrize('in_thread, sentence, calls', [(True, REFUSED, 3), (True, "no attribute 'x'", 1),
                                                        (False, REFUSED, 1)])
def test_a_render_waits_while_the_window_forbids_it_to_write(part, in_thread, sentence, calls):
    """Blender's window forbids it while it draws. The window's own walk has such a draw; what this adds is that other
    errors, and those of the main thread, are told at once."""
    repeated = part('scene.render_thread').repeated
    called, results = [], []

    @repeated
    def handler(scene, depsgraph):
        called.append((scene, depsgraph))
        if len(called) < 3:
            raise AttributeError(sentence)
        return "done"

    def call():
        try:
            results.append(handler(1, 2))
        except AttributeError as error:
            results.append(str(error))

    if in_thread:
        thread = threading.Thread(target=call)
        thread.start()
        thread.join()
    else:
        call()
    assert called == calls * [(1, 2)] and results == ["done" if calls == 3 else sentence]
