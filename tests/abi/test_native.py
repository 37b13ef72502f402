# SPDX-License-Identifier: GPL-3.0-or-later
import ctypes
import os
import shutil
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from conftest import ADDON, IDENTITY, Strip, part, rotation, sheet


def bound(native, mesh, handles=1, **options):
    return native.Bind(mesh.positions, mesh.triangles, mesh.roles, handles, **options).finish()


def update(native, deformer, motion, out, options=None):
    """The status of one frame."""
    points = part('library.structs').points_out(out)
    return native.library().dd_deformer_update(deformer, motion, len(motion), options, points)


def test_version_and_instruction_set(native, structs):
    assert native.library().dd_abi_version() == structs.ABI_VERSION
    assert native.version().count('.') == 2
    assert native.instruction_set() in ('avx2', 'baseline')


def test_wide_kernels_are_chosen_where_the_machine_has_them(native):
    try:
        flags = open('/proc/cpuinfo').read()
    except OSError:
        pytest.skip("no /proc/cpuinfo to compare with")
    wide = ' avx2 ' in flags and ' fma ' in flags
    assert native.instruction_set() == ('avx2' if wide else 'baseline')


def test_identity_gives_exactly_nothing(native, strip):
    offsets = bound(native, strip).offsets(IDENTITY)
    assert np.abs(offsets).max() <= 1e-9 * np.ptp(strip.positions)


def test_handles_move_and_fixed_stay(native, strip):
    motion = rotation(0.4, (0.5, 1, 3))
    offsets = bound(native, strip).offsets(motion).reshape(-1, 3)
    assert (offsets[strip.roles == -2] == 0).all()
    members = strip.positions[strip.roles == 0].astype(float)
    expected = members @ motion[0, :, :3].T + motion[0, :, 3] - members
    assert np.allclose(offsets[strip.roles == 0], expected, atol=1e-5)
    assert np.abs(offsets[strip.roles == -1]).max() > 0.5


@pytest.mark.parametrize('options', [{}, {'metric_smoothing': 2.0}])
@pytest.mark.parametrize('gradients', ['ROTATIONS', 'WHOLE'])
def test_everything_held_by_one_handle_moves_rigidly(native, strip, options, gradients):
    strip.roles[strip.roles == -2] = 0
    motion = rotation(0.9, (1, -2, 3))
    offsets = bound(native, strip, **options).offsets(motion, gradients=gradients).reshape(-1, 3)
    p = strip.positions.astype(float)
    assert np.allclose(p + offsets, p @ motion[0, :, :3].T + motion[0, :, 3], atol=1e-5)


def test_single_precision_is_close_to_double_and_threads_change_nothing(native):
    wide = Strip(3000)  # large enough for several domains
    motion = rotation(0.9, (1, -2, 3))
    box = np.linalg.norm(np.ptp(wide.positions, axis=0))
    double = bound(native, wide, precision='DOUBLE').offsets(motion).copy()
    single = bound(native, wide, threads=1).offsets(motion).copy()
    assert 0 < np.abs(single - double).max() < 1e-5 * box
    for threads in (None, 2, 5):
        assert (bound(native, wide, threads=threads).offsets(motion) == single).all()


def test_metrics_differ(native, strip):
    motion = rotation(0.9, (1, -2, 3))
    results = [bound(native, strip, base_metric=metric).offsets(motion).copy()
               for metric in ('SURFACE', 'BASE')]
    assert np.abs(results[0] - results[1]).max() > 1e-3


def test_positions_output_is_rest_plus_offsets(native, strip):
    deformer = bound(native, strip)
    motion = rotation(0.3, (0, 0, 2))
    offsets = deformer.offsets(motion).copy()
    positions = np.zeros_like(offsets)
    assert update(native, deformer._handle, motion, positions) == 0
    assert np.allclose(positions, strip.positions.ravel() + offsets, atol=1e-6)


def test_info(native, strip):
    info = bound(native, strip).info
    assert (info.vertex_count, info.triangle_count) == (len(strip.positions), len(strip.triangles))
    assert info.handle_count == 1
    assert info.free_count == (strip.roles == -1).sum()
    assert (info.resting_example, info.loose_example, info.degenerate_example) == (-1, -1, -1)
    assert (info.idle_handle_count, info.idle_handle_example) == (0, -1)
    assert info.bind_seconds > 0 and info.bytes > 1000


def test_progress_rises_and_ends(native):
    bind = native.Bind(*(lambda m: (m.positions, m.triangles, m.roles))(Strip(3000)), 1)
    fractions, running = [], True
    while running:
        running, fraction, stage = bind.progress()
        fractions.append(fraction)
        assert stage
    assert fractions == sorted(fractions) and fractions[-1] == 1
    bind.finish()


def test_cancel(native):
    mesh = Strip(12000)
    bind = native.Bind(mesh.positions, mesh.triangles, mesh.roles, 1)
    bind.cancel()
    with pytest.raises(native.NativeError, match='cancelled') as caught:
        bind.finish()
    assert caught.value.cancelled


def test_a_bind_dropped_while_it_runs_is_cleaned_up(native):
    def threads():
        return len(os.listdir('/proc/self/task')) if sys.platform.startswith('linux') else 0

    before = threads()
    mesh = Strip(4000)
    for _ in range(3):
        native.Bind(mesh.positions, mesh.triangles, mesh.roles, 1, threads=2).close()
    del mesh
    unfinished = native.Bind(*(lambda m: (m.positions, m.triangles, m.roles))(Strip(4000)), 1, threads=2)
    del unfinished
    # What one made would keep its threads. The system lists a thread for a moment after its end.
    for _ in range(1000):
        if threads() <= before:
            break
        time.sleep(0.01)
    assert threads() <= before


@pytest.mark.parametrize('change, sentence', [
    (lambda m: m.positions.__setitem__((7, 1), np.nan), 'Vertex 7 .*not a finite number'),
    (lambda m: m.triangles.__setitem__((3, 0), 9999), 'Triangle 3 refers to vertex 9999'),
    (lambda m: m.triangles.__setitem__((3, 0), -1), 'Triangle 3 refers to vertex -1'),
    (lambda m: m.triangles.__setitem__((3, 0), m.triangles[3, 1]), 'Triangle 3 uses one vertex twice'),
    (lambda m: m.positions.fill(1), 'at one point'),
    (lambda m: m.roles.fill(-1), 'Handle 0 has no vertices'),
    (lambda m: m.roles.fill(0), 'No vertex is free'),
    (lambda m: m.roles.__setitem__(5, 4), 'Vertex 5 has the role 4'),
    (lambda m: setattr(m, 'triangles', m.triangles[:0]), 'no faces'),
    (lambda m: (setattr(m, 'positions', m.positions[:0]), setattr(m, 'roles', m.roles[:0]),
                setattr(m, 'triangles', m.triangles[:0])), 'no vertices'),
    (lambda m: setattr(m, 'roles', m.roles[:-1]), 'roles is for 191 vertices, not 192'),
    (lambda m: setattr(m, 'positions', m.positions.ravel()[:-1]), 'positions has the shape .*not 3 for each'),
])
def test_bad_input_gets_a_sentence(native, strip, change, sentence):
    change(strip)
    with pytest.raises(native.NativeError, match=sentence):
        bound(native, strip)


@pytest.mark.parametrize('options', [{'metric_smoothing': -1.0}, {'metric_smoothing': float('nan')}])
def test_bad_options(native, strip, options):
    with pytest.raises(native.NativeError, match='metric_smoothing'):
        bound(native, strip, **options)


def test_no_handles(native, strip):
    with pytest.raises(native.NativeError, match='no handle'):
        bound(native, strip, handles=0)


def test_bad_matrices(native, strip):
    deformer = bound(native, strip)
    with pytest.raises(native.NativeError, match='matrices is for 2 handles, not 1'):
        deformer.offsets(np.concatenate([IDENTITY, IDENTITY]))
    bad = IDENTITY.copy()
    bad[0, 1, 1] = np.inf
    with pytest.raises(native.NativeError, match='Handle 0 has a matrix that is not finite'):
        deformer.offsets(bad)
    bad[0, 1, 1] = 1e39
    with pytest.raises(native.NativeError, match='Handle 0 is moved so far'):
        deformer.offsets(bad)
    assert np.isfinite(deformer.offsets(IDENTITY)).all()


def test_of_two_handles_the_one_that_is_too_far_is_named(native, strip):
    strip.roles[:4] = 1
    deformer = native.Bind(strip.positions, strip.triangles, strip.roles, 2).finish()
    for far in (0, 1):
        matrices = np.concatenate([IDENTITY, IDENTITY])
        matrices[far, 0, 3] = 1e39
        with pytest.raises(native.NativeError, match=f'Handle {far} is moved so far'):
            deformer.offsets(matrices)


def test_null_pointers_and_unset_sizes_are_refused(native, structs, strip):
    lib = native.library()
    deformer, handle = bound(native, strip), ctypes.c_void_p()
    out = np.zeros(strip.positions.size, np.float32)
    argument_error, count = 1, len(strip.positions)
    surface = structs.mesh(strip.positions, strip.triangles)
    whole, less = structs.points_out(out), structs.points_out(out)
    unset, short, motion = structs.Info(), native.filled(structs.UpdateOptions, gradients=2), IDENTITY.copy()
    unset.struct_size, short.struct_size = 0, 12
    wild, less.count = native.filled(structs.UpdateOptions, values=7), count - 1
    overlapping, odd = structs.points_out(out), structs.points_out(out)
    overlapping.stride, odd.stride = 8, 13
    nested = native.filled(structs.UpdateOptions, normal=structs.NormalOptions(levels=1))
    ctypes.cast(nested.normal, ctypes.POINTER(structs.NormalOptions)).contents.struct_size = 0
    calls = [
        lib.dd_job_poll(None, structs.Progress()),
        lib.dd_job_cancel(None),
        lib.dd_job_finish(None),
        lib.dd_job_take_deformer(None, handle),
        lib.dd_job_take_draft(None, handle),
        lib.dd_draft_update(None, motion, 1, None, whole),
        lib.dd_deformer_bind_start(None, strip.roles, count, 1, None, handle),
        lib.dd_deformer_bind_start(structs.Mesh(), None, count, 1, None, handle),
        lib.dd_deformer_bind_start(surface, None, count, 1, None, handle),
        lib.dd_deformer_bind_start(surface, strip.roles, count, 1, None, None),
        lib.dd_deformer_get_info(deformer._handle, None),
        lib.dd_deformer_get_info(deformer._handle, unset),
        lib.dd_deformer_get_info(None, structs.Info()),
        lib.dd_deformer_update_start(None, motion, 1, None, handle),
        lib.dd_deformer_update_start(deformer._handle, None, 1, None, handle),
        lib.dd_deformer_update_start(deformer._handle, motion, 1, None, None),
        lib.dd_deformer_update(None, motion, 1, None, whole),
        lib.dd_deformer_update(deformer._handle, None, 1, None, whole),
        lib.dd_deformer_update(deformer._handle, motion, 1, None, None),
        lib.dd_deformer_update(deformer._handle, motion, 1, None, less),
        lib.dd_deformer_update(deformer._handle, motion, 1, None, overlapping),
        lib.dd_deformer_update(deformer._handle, motion, 1, None, odd),
        lib.dd_deformer_update(deformer._handle, motion, 1, short, whole),
        lib.dd_deformer_update(deformer._handle, motion, 1, nested, whole),
        lib.dd_last_error(None),
        lib.dd_update_options_init(None, 99),
        lib.dd_update_options_init(short, 2),
        lib.dd_deformer_update(deformer._handle, motion, 1, wild, whole),
    ]
    assert calls == [argument_error] * len(calls)
    assert lib.dd_last_message().decode() == 'options.values is 7, not between 0 and 1.'
    assert (out == 0).all() and not handle
    lib.dd_job_free(None)
    lib.dd_deformer_free(None)
    lib.dd_draft_free(None)


def test_a_deformer_is_taken_once_and_a_job_finished_any_number_of_times(native, strip):
    lib = native.library()
    bind = native.Bind(strip.positions, strip.triangles, strip.roles, 1)
    first, second = ctypes.c_void_p(), ctypes.c_void_p()
    assert lib.dd_job_finish(bind._handle) == lib.dd_job_finish(bind._handle) == 0
    assert lib.dd_job_take_deformer(bind._handle, first) == 0
    assert lib.dd_job_take_deformer(bind._handle, second) == 1
    assert not second and b'taken already' in lib.dd_last_message()
    assert lib.dd_job_finish(bind._handle) == 0
    lib.dd_deformer_free(first)
    strip.roles[5] = 4
    failing = native.Bind(strip.positions, strip.triangles, strip.roles, 1)
    for _ in range(2):
        assert lib.dd_job_finish(failing._handle) == 3 and b'Vertex 5' in lib.dd_last_message()
    assert lib.dd_job_take_deformer(failing._handle, second) == 3 and b'Vertex 5' in lib.dd_last_message()
    assert lib.dd_job_take_match(failing._handle, second) == 1 and not second
    assert lib.dd_last_message() == b'This job is a bind, which gives no match.'


def test_structs_of_older_and_newer_callers_are_understood(native, structs, strip):
    lib, deformer = native.library(), bound(native, strip)

    class OldInfo(ctypes.Structure):
        _fields_ = [('struct_size', ctypes.c_uint32), ('vertex_count', ctypes.c_int32),
                    ('guard', ctypes.c_int32)]

    old = OldInfo(8, 0, 77)
    lib.dd_deformer_get_info.argtypes = [ctypes.c_void_p, ctypes.c_void_p]
    assert lib.dd_deformer_get_info(deformer._handle, ctypes.byref(old)) == 0
    assert (old.vertex_count, old.guard) == (len(strip.positions), 77)
    lib.dd_deformer_get_info.argtypes = [ctypes.c_void_p, ctypes.POINTER(structs.Info)]


def test_messages_belong_to_their_thread(native, strip):
    lib = native.library()
    with pytest.raises(native.NativeError):
        bound(native, strip, handles=0)
    mine = lib.dd_last_message()
    others = []

    def other():
        lib.dd_job_cancel(None)
        others.append(lib.dd_last_message())

    thread = threading.Thread(target=other)
    thread.start()
    thread.join()
    assert b'job is null' in others[0] and lib.dd_last_message() == mine


def test_one_deformer_is_used_by_one_thread_at_a_time(native):
    mesh = Strip(4000)
    deformer = bound(native, mesh)
    statuses = []

    def frames():
        out = np.zeros(mesh.positions.size, np.float32)
        for _ in range(40):
            statuses.append(update(native, deformer._handle, IDENTITY.copy(), out))

    threads = [threading.Thread(target=frames) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert set(statuses) == {0, 7}  # done, or busy


def test_a_result_stays_what_it_was_when_others_are_computed(native):
    """A render and the window may compute at once: neither gets the other's pose, or parts of it."""
    deformer = bound(native, Strip(400))
    motions = [rotation(0.1 * k, (0, 0, k)) for k in range(4)]
    alone = [deformer.offsets(motion).copy() for motion in motions]
    first = deformer.offsets(motions[1])
    deformer.offsets(motions[2])
    assert (first == alone[1]).all()
    differing = []

    def update(motion, expected):
        for _ in range(100):
            if (deformer.offsets(motion) != expected).any():
                differing.append(motion)

    threads = [threading.Thread(target=update, args=pair) for pair in zip(motions, alone)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not differing


def test_different_deformers_at_once_give_what_they_give_alone(native):
    meshes = [Strip(n) for n in (300, 500, 700)]
    deformers = [bound(native, mesh) for mesh in meshes]
    motion = rotation(0.5, (0, 0, 4))
    alone = [deformer.offsets(motion).copy() for deformer in deformers]
    together = [None] * 3

    def run(k):
        for _ in range(50):
            together[k] = deformers[k].offsets(motion).copy()

    threads = [threading.Thread(target=run, args=(k,)) for k in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for k in range(3):
        assert (alone[k] == together[k]).all()


def load_elsewhere(path):
    """native.version(), or why it is refused, in a fresh Python with DETAIL_DEFORM_LIBRARY set."""
    program = ("import sys; sys.path.insert(0, %r); from library import native as n\n"
               "try: print(n.version())\nexcept n.NativeError as e: print('refused:', e)" % str(ADDON))
    return subprocess.run([sys.executable, '-c', program], capture_output=True, text=True,
                          env={**os.environ, 'DETAIL_DEFORM_LIBRARY': str(path)}).stdout


def test_the_environment_overrides_the_library(native):
    assert load_elsewhere(native.library_path()).strip() == native.version()


def test_missing_or_foreign_library(native, tmp_path):
    assert 'refused: The Detail Deform library is missing' in load_elsewhere(tmp_path / 'none.so')
    text = tmp_path / 'text.so'
    text.write_text("not a library")
    assert "can't be loaded" in load_elsewhere(text)


def test_a_library_of_another_version_is_refused(tmp_path):
    if not shutil.which('cc'):
        pytest.skip("no C compiler")
    source = tmp_path / 'other.c'
    source.write_text("int dd_abi_version(void) { return 99; }")
    other = tmp_path / 'other.so'
    subprocess.run(['cc', '-shared', '-fPIC', '-o', str(other), str(source)], check=True)
    answer = load_elsewhere(other)
    assert 'of another version' in answer and '99' in answer


METHODS = ('DETAIL', 'VARIATIONAL', 'NORMAL', 'GRADIENT', 'VOLUMES', 'EXAMPLES')


def test_methods_differ_and_switch_on_one_deformer(native, strip):
    motion = rotation(0.8, (0.5, 0, 3))
    deformer = bound(native, strip)
    results = {method: deformer.offsets(motion, method=method).copy() for method in METHODS}
    for method, offsets in results.items():
        assert np.isfinite(offsets).all()
        assert (offsets == deformer.offsets(motion, method=method)).all()
        assert (offsets == bound(native, strip).offsets(motion, method=method)).all()
        for other in METHODS:
            assert method == other or np.abs(offsets - results[other]).max() > 1e-3, (method, other)
        assert np.abs(deformer.offsets(IDENTITY, method=method)).max() <= 1e-5


def test_refine_output_levels_and_smoothness_do_something(native, strip):
    motion = rotation(0.8, (0.5, 0, 3))
    deformer = bound(native, strip)
    plain = deformer.offsets(motion, refine=0).copy()
    assert np.abs(deformer.offsets(motion, refine=2) - plain).max() > 1e-3
    base = deformer.offsets(IDENTITY, output='BASE').reshape(-1, 3)
    assert np.abs(base[strip.roles == -1]).max() > 0.1 and (base[strip.roles != -1] == 0).all()
    one = deformer.offsets(motion, method='NORMAL').copy()
    assert np.abs(deformer.offsets(motion, method='NORMAL', levels=3) - one).max() > 1e-4
    for smoothness in (1, 3):
        other = bound(native, strip, smoothness=smoothness).offsets(IDENTITY, output='BASE')
        assert np.abs(other.reshape(-1, 3) - base).max() > 1e-3


@pytest.mark.parametrize('field, value, named', [
    ('method', 7, 'method'), ('method', -1, 'method'), ('refine', -1, 'refinement.iterations'),
    ('refine', 10**6, 'refinement.iterations'), ('output', 2, 'output'), ('levels', 21, 'normal.levels'),
    ('levels', 0, 'normal.levels'), ('gradients', 2, 'gradients'),
    ('formulation', 3, 'formulation'), ('steps', 0, 'steps'), ('steps', 1001, 'steps'),
    ('rim_smoothing', 1.5, 'refinement.rim_smoothing'), ('rotation_smoothing', -1, 'refinement.rotation_smoothing'),
    ('solidity', 2, 'refinement.solidity'), ('solidity', float('nan'), 'refinement.solidity'),
    ('example_stiffness', -1, 'examples.stiffness'), ('volume_iterations', -1, 'volumes.iterations'),
    ('volume_tolerance', float('nan'), 'volumes.tolerance')])
def test_unknown_update_options_are_refused(native, strip, field, value, named):
    deformer = bound(native, strip)
    out = np.zeros(strip.positions.size, np.float32)
    how = part('library.deformer').update_options(**{field: value})
    status = update(native, deformer._handle, np.ascontiguousarray(IDENTITY), out, how)
    assert status == 1 and f'options.{named}' in native.library().dd_last_message().decode()


def test_unknown_smoothness_is_refused(native, strip):
    with pytest.raises(native.NativeError, match='smoothness'):
        bound(native, strip, smoothness=4)


def split(native, mesh, motion, steps, options=None, **look):
    """An update in steps, whose job is the deformer's only owner."""
    return native.Update(bound(native, mesh, len(motion), **options or {}), motion, steps=steps, **look)


def test_a_split_of_one_step_is_the_update_and_more_steps_differ(native, strip):
    motion = rotation(1.5, (-4, 0, 9))
    plain = bound(native, strip).offsets(motion).copy()
    assert np.abs(split(native, strip, motion, 1).finish()[0] - plain).max() < 1e-6
    stepped = split(native, strip, motion, 5).finish()[0]
    assert np.isfinite(stepped).all() and np.abs(stepped - plain).max() > 0.05
    # The handle arrives where it was sent all the same.
    members = np.repeat(strip.roles >= 0, 3)
    assert np.allclose(stepped[members], plain[members], atol=1e-4)


def test_a_whole_turn_differs_from_none_though_its_matrix_is_the_identity(native, strip):
    assert np.abs(split(native, strip, IDENTITY, 6).finish()[0]).max() < 1e-4
    turned = split(native, strip, IDENTITY, 6, turns=np.array([[2 * np.pi, 0, 0]])).finish()[0]
    assert np.abs(turned).max() > 1


def test_a_split_reports_progress_and_can_be_cancelled(native):
    job = split(native, Strip(400), rotation(1.5, (-4, 0, 9)), 400)
    job.cancel()
    with pytest.raises(native.NativeError) as caught:
        job.finish()
    assert caught.value.cancelled


@pytest.mark.parametrize('change, sentence', [
    (dict(steps=0), 'steps is 0'), (dict(turns=np.zeros((2, 3))), 'turns is for 2 handles, not 1'),
    (dict(motion=np.zeros((1, 3, 4))), 'Handle 0 flattens'),
    (dict(method='DETAIL', refine=-1), 'options.refinement.iterations')])
def test_unusable_splits_are_refused(native, strip, change, sentence):
    arguments = {'motion': rotation(1, (0, 0, 0)), 'steps': 3, **change}
    with pytest.raises(native.NativeError, match=sentence):
        split(native, strip, **arguments).finish()


def test_a_handle_that_only_places_takes_its_turn_from_the_surface(native, strip):
    deformer = bound(native, strip)
    held = strip.roles == 0
    lift = np.eye(4)[None, :3].copy()
    lift[0, 2, 3] = 0.3
    told = deformer.offsets(lift).reshape(-1, 3)[held]
    assert np.abs(told - (0, 0, 0.3)).max() < 1e-6
    free = deformer.offsets(lift, handle_turns=[1]).reshape(-1, 3)[held]
    assert np.abs(free.mean(0) - (0, 0, 0.3)).max() < 1e-5 and np.ptp(free[:, 2]) > 0.01
    pivot = strip.positions[held][0].astype(np.float64)
    there = deformer.offsets(lift, handle_turns=[1], pivots=[pivot]).reshape(-1, 3)[held][0]
    assert np.abs(there - (0, 0, 0.3)).max() < 1e-5
    for change, sentence in ((dict(handle_turns=[2]), 'handle_turns is 2'),
                             (dict(handle_turns=[1, 0]), 'for 2 handles'),
                             (dict(handle_turns=[1], pivots=[(0, np.nan, 0)]), 'Handle 0 has a pivot that is not f'),
                             (dict(handle_turns=[1], pivots=[(0, 1e30, 0)]), 'too far from its vertices'),
                             (dict(handle_turns=[1], pivots=[(0, 1e7, 0)]), 'too far from its vertices'),
                             (dict(handle_turns=[1], pivots=np.zeros((2, 3))), 'for 2 handles')):
        with pytest.raises(native.NativeError, match=sentence):
            deformer.offsets(lift, **change)


def test_a_dense_surface_is_refined_on_a_coarse_one(native):
    motion = rotation(0.9, (1, 0.5, 0))
    found = []
    for threads in (1, 2):
        deformer = native.Bind(*sheet(170), 1, threads=threads).finish()
        deformer.offsets(motion, refine=0)
        assert deformer.info.coarse_vertex_count == 0
        found.append(deformer.offsets(motion))
        assert 1000 < deformer.info.coarse_vertex_count < 0.6 * deformer.info.free_count
        still = deformer.offsets(np.eye(4)[None, :3])
        assert np.abs(still).max() < 1e-7
    assert (found[0] == found[1]).all()


def test_a_base_of_its_own_topology_carries_the_details(native, strip):
    corners = np.array([(-1, -1, 0), (25, -1, 0), (25, 9, 0), (-1, 9, 0)], np.float32)
    roles = np.full(len(strip.positions), native.ROLE_FREE, np.int32)
    asked = {'base': corners, 'base_triangles': [(0, 1, 2), (0, 2, 3)]}
    deformer = native.Bind(strip.positions, strip.triangles, roles, 0, **asked).finish()
    assert deformer.info.proxy_vertex_count == 4
    none, motion = np.zeros((0, 3, 4)), rotation(0.9, (1, 2, 3))[0]
    moved = corners @ motion[:, :3].T + motion[:, 3]
    expected = strip.positions @ motion[:, :3].T + motion[:, 3]
    assert np.abs(strip.positions + deformer.offsets(none, base=moved).reshape(-1, 3) - expected).max() < 1e-3
    for change, sentence in (({'base_triangles': np.zeros((0, 3))}, 'no triangles'),
                             ({'base_triangles': [(0, 1, 9)]}, 'of the base '),
                             ({'base': np.zeros((0, 3))}, 'no vertices'), ({'base': None}, 'no options.base')):
        with pytest.raises(native.NativeError, match=sentence):
            native.Bind(strip.positions, strip.triangles, roles, 0, **{**asked, **change}).finish()


def test_a_base_from_outside_moves_the_details(native, strip):
    flat = strip.positions.copy()
    flat[:, 2] = 0
    roles = np.full(len(flat), native.ROLE_FREE, np.int32)
    deformer = native.Bind(strip.positions, strip.triangles, roles, 0, base=flat).finish()
    none = np.zeros((0, 3, 4))
    assert np.abs(deformer.offsets(none, base=flat)).max() < 1e-5
    motion = rotation(0.9, (1, 2, 3))[0]
    moved = (flat @ motion[:, :3].T + motion[:, 3]).astype(np.float32)
    expected = strip.positions @ motion[:, :3].T + motion[:, 3] - strip.positions
    assert np.allclose(deformer.offsets(none, base=moved).reshape(-1, 3), expected, atol=1e-4)
    with pytest.raises(native.NativeError, match='deformed base'):
        deformer.offsets(none)
    with pytest.raises(native.NativeError, match='options.base is for 191 vertices, not 192'):
        deformer.offsets(none, base=moved[1:])
    with pytest.raises(native.NativeError, match='options.base is for 191 vertices, not 192'):
        native.Bind(strip.positions, strip.triangles, roles, 0, base=flat[1:])


def test_volumes_are_kept_and_their_error_is_told(native, strip):
    motion = rotation(0.8, (0.5, 0, 3))
    offsets, info = split(native, strip, motion, 1, method='VOLUMES').finish()
    assert (offsets == bound(native, strip).offsets(motion, method='VOLUMES')).all()
    assert info.volumes_converged and 0 < info.volume_error < 0.2
    _, hurried = split(native, strip, motion, 1, method='VOLUMES', volume_iterations=1).finish()
    assert not hurried.volumes_converged and hurried.volume_error > info.volume_error


def test_a_split_takes_a_base_from_outside_in_one_step_only(native, strip):
    flat = strip.positions.copy()
    flat[:, 2] = 0
    moved = flat + np.float32([1, 2, 3])
    none = np.zeros((0, 3, 4))
    strip.roles[:] = native.ROLE_FREE
    offsets, _ = split(native, strip, none, 1, options={'base': flat}, base=moved,
                       method='VOLUMES').finish()
    assert np.allclose(offsets.reshape(-1, 3), [1, 2, 3], atol=1e-4)
    with pytest.raises(native.NativeError, match='no motion that could be split'):
        split(native, strip, none, 2, options={'base': flat}, base=moved).finish()


class Sheets:
    """A strip with a stem on its middle column, whose edges have three faces each: a T. The ends of the strip are
    fixed, the stem's far border is handle 0."""

    def __init__(self, n=15, rows=8, levels=6):
        i, j = np.meshgrid(np.arange(n), np.arange(rows), indexing='ij')
        bar = np.stack([i, j, 0.2 * np.sin(1.1 * i) * np.cos(j)], -1).reshape(-1, 3)
        level, k = np.meshgrid(np.arange(1, levels + 1), np.arange(rows), indexing='ij')
        stem = np.stack([n // 2 + 0.2 * np.sin(level + k), k, level], -1).reshape(-1, 3)
        self.positions = np.concatenate([bar, stem]).astype(np.float32)
        numbers = np.arange(len(bar)).reshape(n, rows)
        raised = np.concatenate([numbers[n // 2][None], len(bar) + np.arange(len(stem)).reshape(levels, rows)])

        def faces(grid):
            a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
            return np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])

        self.triangles = np.concatenate([faces(numbers), faces(raised)]).astype(np.int32)
        self.roles = np.full(len(self.positions), -1, np.int32)
        self.roles[numbers[[0, 1, -2, -1]].ravel()] = -2
        self.roles[raised[-1]] = 0
        self.seam = numbers[n // 2]


@pytest.mark.parametrize('method', METHODS)
@pytest.mark.parametrize('triangulation', ['DELAUNAY', 'GIVEN'])
def test_edges_of_three_faces_bind_and_deform(native, method, triangulation):
    sheets = Sheets()
    p = sheets.positions.astype(float)
    examples = (p + 0.3 * np.sin(p[:, [1, 2, 0]]))[None].astype(np.float32)

    def deformer():
        return bound(native, sheets, triangulation=triangulation, examples=examples)

    lift = rotation(0.1, (-0.6, 0, 2))
    assert np.abs(deformer().offsets(IDENTITY, method=method)).max() <= 1e-5
    moved = deformer().offsets(lift, method=method).reshape(-1, 3)
    assert np.isfinite(moved).all() and np.linalg.norm(moved, axis=1).max() < 6
    assert moved[sheets.seam, 2].min() > 0.05 and (moved[sheets.roles == -2] == 0).all()
    if method in ('VARIATIONAL', 'EXAMPLES'):
        return  # they don't follow a rotation of all handles exactly
    sheets.roles[sheets.roles == -2] = 0
    motion = rotation(0.9, (1, -2, 3))
    moved = deformer().offsets(motion, method=method).reshape(-1, 3)
    assert np.allclose(p + moved, p @ motion[0, :, :3].T + motion[0, :, 3], atol=2e-5)



def test_slivers_in_a_plane_change_nothing_unless_they_are_asked_for(native):
    strip = Strip(31)
    strip.positions[:, 2] = 0
    motion = rotation(0.4, (1, 0, 3))
    expected = {way: bound(native, strip, triangulation=way, precision='DOUBLE').offsets(motion).copy()
                for way in ('DELAUNAY', 'GIVEN')}
    assert (expected['DELAUNAY'] == expected['GIVEN']).all()  # a regular grid stays as it is
    corners = np.arange(31 * 8).reshape(31, 8)
    sheared = []  # slivers: edges lead from each line to the next one, two and three columns farther on
    for low, high in zip(corners.T[:-1], corners.T[1:]):
        sheared += [(low[0], high[1], high[0]), (low[0], high[2], high[1])]
        sheared += [(low[i], high[i + 3], high[i + 2]) for i in range(28)]
        sheared += [(low[i], low[i + 1], high[i + 3]) for i in range(28)]
        sheared += [(low[28], low[29], high[30]), (low[29], low[30], high[30])]
    strip.triangles = np.array(sheared, np.int32)
    result = {way: bound(native, strip, triangulation=way, precision='DOUBLE').offsets(motion).copy()
              for way in ('DELAUNAY', 'GIVEN')}
    assert np.abs(result['DELAUNAY'] - expected['DELAUNAY']).max() < 1e-5
    assert np.abs(result['GIVEN'] - expected['GIVEN']).max() > 0.01


def lengths_between(positions, chosen):
    points = positions[chosen].astype(float)
    return np.linalg.norm(points[:, None] - points, axis=2)


def test_a_stiff_part_keeps_its_lengths(native, strip):
    part = np.flatnonzero(np.abs(strip.positions[:, 0] - 12) < 3)
    weights = np.zeros(len(strip.positions))  # of another type than the library's
    weights[part] = 1
    motion, rest = rotation(1.0, (-4, 0, -3)), lengths_between(strip.positions, part)
    changes = []
    for stiffness in (None, weights, np.ones_like(weights)):
        bound = native.Bind(strip.positions, strip.triangles, strip.roles, 1, stiffness=stiffness).finish()
        moved = strip.positions + bound.offsets(motion).reshape(-1, 3)
        changes.append(np.abs(lengths_between(moved, part) - rest).max())
    assert changes[1] < 1e-3 * rest.max() < 0.1 * changes[0]
    assert changes[2] == changes[0]  # only differences matter


@pytest.mark.parametrize('weights, sentence', [
    (np.zeros(5), "options.stiffness is for 5 vertices, not 192"),
    (np.where(np.arange(192) == 7, 1.5, 0), "Vertex 7 has a stiffness that is not between 0 and 1"),
    (np.where(np.arange(192) == 9, np.nan, 0), "Vertex 9 has a stiffness that is not between 0 and 1"),
    (np.where(np.arange(192) == 3, -0.1, 0), "Vertex 3 has a stiffness")])
def test_a_stiffness_that_is_none_is_refused(native, strip, weights, sentence):
    with pytest.raises(native.NativeError, match=sentence):
        native.Bind(strip.positions, strip.triangles, strip.roles, 1, stiffness=weights)
