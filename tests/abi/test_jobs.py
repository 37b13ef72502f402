# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs beside frames: which of them uses a deformer, and how long."""

import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from conftest import ADDON, IDENTITY, Strip, is_sanitized, part, rotation

MOTION = rotation(0.8, (0.5, 0, 3))
ENDLESS = {'method': 'VOLUMES', 'volume_tolerance': 1e-300, 'volume_iterations': 10**9}


def bound(native, mesh, **options):
    return native.Bind(mesh.positions, mesh.triangles, mesh.roles, 1, **options).finish()


def frame(native, deformer, motion=MOTION):
    """The status of a frame that doesn't wait, and its result."""
    count = deformer.info.vertex_count
    out = np.zeros((count, 3), np.float32)
    points = part('library.structs').points_out(out)
    points.count = count
    return native.library().dd_deformer_update(deformer._handle, motion, 1, None, points), out


def test_two_threads_get_results_of_their_own(native):
    mesh = Strip(400)
    deformer = bound(native, mesh)
    motions = [rotation(angle, (0, 0, 4)) for angle in (0.2, -0.3)]
    alone = [deformer.offsets(motion) for motion in motions]
    assert not np.shares_memory(*alone) and (alone[0] != alone[1]).any()
    wrong = []

    def run(k):
        for _ in range(200):
            found = deformer.offsets(motions[k])
            time.sleep(0)  # lets the other thread run
            wrong.append((found != alone[k]).any())

    threads = [threading.Thread(target=run, args=(k,)) for k in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(wrong) == 400 and not any(wrong)


def test_the_first_step_has_the_deformer_in_use_until_it_is_cancelled(native, structs):
    deformer = bound(native, Strip(400))
    expected = frame(native, bound(native, Strip(400)))[1]
    job = native.Update(deformer, MOTION, **ENDLESS)
    busy = structs.STATUS['ERROR_BUSY']
    assert frame(native, deformer)[0] == busy
    lib, weights = native.library(), np.zeros(0)
    assert lib.dd_deformer_get_info(deformer._handle, structs.Info()) == busy
    assert lib.dd_deformer_get_example_weights(deformer._handle, weights, 0) == busy
    with pytest.raises(native.NativeError, match='in use') as caught:
        native.Update(deformer, MOTION)
    assert caught.value.busy and not caught.value.cancelled
    while job.progress()[2] != 'RESTORING':
        pass
    job.cancel()
    with pytest.raises(native.NativeError, match='cancelled'):
        job.finish()
    status, found = frame(native, deformer)
    assert status == 0 and (found == expected).all()


def test_a_frame_waits_for_the_first_step_and_not_for_the_others(native):
    deformer = bound(native, Strip(60))
    alone = deformer.offsets(MOTION)
    job = native.Update(deformer, MOTION, method='VOLUMES', steps=1000)
    found = deformer.offsets(MOTION)
    running, fraction, _ = job.progress()
    assert running and fraction < 0.5 and (found == alone).all()
    job.close()


def test_a_job_keeps_its_deformer(native):
    mesh = Strip(60)
    expected, facts = native.Update(bound(native, mesh), MOTION, method='VOLUMES', steps=3).finish()
    deformer = bound(native, mesh)
    job = native.Update(deformer, MOTION, method='VOLUMES', steps=3)
    deformer.close()
    found, info = job.finish()
    assert (found == expected).all() and info.volume_error == facts.volume_error > 0
    endless = native.Update(bound(native, mesh), MOTION, **ENDLESS)
    endless.close()


def test_an_update_in_steps_is_the_same_as_a_job_and_as_a_frame(native):
    mesh = Strip(60)
    used = bound(native, mesh)
    for method in ('NORMAL', 'VOLUMES', 'DETAIL'):
        used.offsets(rotation(-0.4, (0, 1, 2)), method=method)
    for method in ('DETAIL', 'VOLUMES'):
        for steps in (1, 3):
            options = {'method': method, 'steps': steps}
            fresh, facts = native.Update(bound(native, mesh), MOTION, **options).finish()
            found, info = native.Update(used, MOTION, **options).finish()
            assert (found == fresh).all() and bytes(info) == bytes(facts)
            assert (used.offsets(MOTION, **options) == found).all()
    # Facts about volumes are those of this update, not of an earlier one.
    assert native.Update(used, MOTION).finish()[1].volume_error == 0


def test_all_kinds_of_work_at_once_give_what_each_gives_alone(native):
    meshes = [Strip(n) for n in (24, 30)]
    (source, from_roles), (target, _) = [((m.positions, m.triangles), m.roles) for m in meshes]
    sources = from_roles == -2
    markers = [[0, 0], [7, 7], [8 * 23, 8 * 29], [8 * 24 - 1, 8 * 30 - 1]]

    def poses():
        deformer = bound(native, meshes[0], threads=2, examples=[source[0] * np.float32(1.2)])
        return [deformer.offsets(MOTION, method=method).copy()
                for method in ('DETAIL', 'NORMAL', 'GRADIENT', 'EXAMPLES', 'DETAIL')]

    def steps():
        deformer = bound(native, meshes[1])
        job = native.Update(deformer, MOTION, method='VOLUMES', steps=2)
        deformer.close()  # the job keeps it
        return [job.finish()[0]]

    def dropped():
        deformer = bound(native, meshes[1], threads=2)
        native.Update(deformer, MOTION, **ENDLESS).close()
        native.Bind(*target, meshes[1].roles, 1).close()
        return [deformer.offsets(MOTION)]

    def transferred():
        pairs, confidence, fitted = native.Match(source, target, markers, stages=2, rounds=1).finish()
        transfer = native.Transfer(source, target, pairs)
        return [confidence, fitted, transfer.apply(source[0] * np.float32(1.5))]

    def looked_at():
        measures = native.measure(source[0], source[0] * np.float32(2), source[1], from_roles)
        return [np.array([measures.stretch])] + [native.distances(*source, sources) for _ in range(50)]

    works = [poses, steps, dropped, transferred, looked_at]
    alone, together = [work() for work in works], [[] for _ in works]

    def run(k):
        for _ in range(2):
            together[k].append(works[k]())

    # Two threads of each kind, so that each runs beside its own, too.
    threads = [threading.Thread(target=run, args=(k % len(works),)) for k in range(2 * len(works))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for one, rounds in zip(alone, together):
        assert len(rounds) == 4
        for found in rounds:
            assert all((a == b).all() for a, b in zip(one, found, strict=True))


def test_a_job_of_another_kind_has_no_update(native, structs):
    mesh = Strip(60)
    deformer, out = bound(native, mesh), np.zeros((480, 3), np.float32)
    lib, bind = native.library(), native.Bind(mesh.positions, mesh.triangles, mesh.roles, 1)
    whole, less = structs.points_out(out), structs.points_out(out)
    less.count = 479
    assert lib.dd_job_get_update(bind._handle, whole) == 1
    assert lib.dd_job_get_update_info(bind._handle, structs.UpdateInfo()) == 1
    assert lib.dd_last_message() == b'This job is a bind, which gives no update.'
    job = native.Update(deformer, IDENTITY.copy())
    assert lib.dd_job_get_update(job._handle, less) == 1 and (out == 0).all()
    for _ in range(2):
        assert lib.dd_job_get_update(job._handle, whole) == 0
    assert np.abs(out).max() < 1e-5


NO_THREADS = """
import resource, sys
sys.path[:0] = [%r, %r]
import numpy as np
from conftest import Strip, IDENTITY
from library import native, structs
mesh = Strip(20)
bind = lambda: native.Bind(mesh.positions, mesh.triangles, mesh.roles, 1, threads=1)
sides = [(mesh.positions, mesh.triangles)] * 2
deformer = bind().finish()
used = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + 2**22, resource.RLIM_INFINITY))
for start in (bind, lambda: native.Update(deformer, IDENTITY.copy()), lambda: native.TransferJob(*sides),
              lambda: native.Match(*sides, [[0, 0], [7, 7], [159, 159]])):
    try:
        start()
    except native.NativeError as error:
        print(error.status, error)
deformer.offsets(IDENTITY.copy())
resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
print('after', bind().finish().info.free_count)
"""


def test_a_thread_that_cannot_start_is_a_status_with_a_sentence(native):
    if not sys.platform.startswith('linux') or is_sanitized():
        pytest.skip("address space can't be limited here")
    here = str(ADDON.parents[1] / 'tests' / 'abi')
    # The C library doesn't keep stacks of this size for the next thread.
    answer = subprocess.run(['sh', '-c', 'ulimit -s 131072; exec "$0" -c "$1"', sys.executable,
                             NO_THREADS % (str(ADDON), here)], capture_output=True, text=True)
    lines = answer.stdout.splitlines()
    assert lines[:4] == [f"5 {lines[0][2:]}"] * 4 and 'no thread to spare' in lines[0], answer
    assert lines[4] == 'after 128'
