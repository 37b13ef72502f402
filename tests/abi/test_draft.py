# SPDX-License-Identifier: GPL-3.0-or-later
"""Drafts: previews that a long bind gives before it is done."""

import ctypes
import threading
import time

import numpy as np
import pytest
from conftest import IDENTITY, part, rotation, sheet

MOTION = rotation(0.9, (0.2, 0.5, 0))


@pytest.fixture(scope='module')
def dense():
    return sheet(400)


def draft_of(bind, seconds=60):
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        draft = bind.draft()
        if draft:
            return draft
        time.sleep(0.001)
    raise AssertionError("no draft came")


@pytest.mark.parametrize('threads', [1, None])
def test_a_draft_is_near_the_result_and_outlives_the_bind(native, dense, threads):
    bind = native.Bind(*dense, 1, draft=1, threads=threads)
    draft = draft_of(bind)
    assert bind.draft() is None  # it was taken
    assert draft.vertex_count == len(dense[0])
    meanwhile = draft.offsets(MOTION)
    assert np.abs(draft.offsets(IDENTITY.copy())).max() < 1e-7
    deformer = bind.finish()
    bind.close()
    error = np.linalg.norm((meanwhile - deformer.offsets(MOTION)).reshape(-1, 3), axis=1)
    assert error.mean() < 0.002 and error.max() < 0.01
    assert (draft.offsets(MOTION) == meanwhile).all()  # it outlives its job
    draft.close()


def test_values_may_be_positions(native, structs, dense):
    bind = native.Bind(*dense, 1, draft=1)
    draft = draft_of(bind)
    out = np.empty(dense[0].size, np.float32)
    options = native.filled(structs.UpdateOptions, values='POSITIONS')
    native.library().dd_draft_update(draft._handle, MOTION, 1, options, structs.points_out(out))
    assert np.abs(out - dense[0].ravel() - draft.offsets(MOTION)).max() < 1e-6
    bind.cancel()


def test_there_is_no_draft_unless_asked_for_and_none_of_a_small_mesh(native, strip, dense):
    for mesh, asked in ((dense, 0), ((strip.positions, strip.triangles, strip.roles), 1)):
        bind = native.Bind(*mesh, 1, draft=asked)
        while bind.progress()[0]:
            time.sleep(0.001)
        assert bind.draft() is None
        bind.finish()


def test_a_refused_mesh_gets_the_message_of_a_bind_without_draft(native, dense):
    positions, triangles, roles = dense
    for spoilt, sentence in (((np.full_like(positions, np.nan), triangles, roles), 'not a finite number'),
                             ((positions, triangles + 1, roles), 'refers to vertex'),
                             ((positions, triangles, np.full_like(roles, -1)), 'has no vertices')):
        bind = native.Bind(*spoilt, 1, draft=1)
        with pytest.raises(native.NativeError, match=sentence):
            bind.finish()
    with pytest.raises(native.NativeError, match='options.draft is 2, not between 0 and 1'):
        native.Bind(*dense, 1, draft=2)


def test_bad_calls_get_a_sentence(native, dense):
    call = part('library.loading').call
    bind = native.Bind(*dense, 1, draft=1)
    draft = draft_of(bind)
    for motion, sentence in ((MOTION[:0], 'for 0 handles, not 1'), (MOTION * np.nan, 'Handle 0'),
                             (MOTION * 1e39, 'too large')):
        with pytest.raises(native.NativeError, match=sentence):
            draft.offsets(motion)
    with pytest.raises(native.NativeError, match='has no examples'):
        draft.offsets(MOTION, method='EXAMPLES')
    with pytest.raises(native.NativeError, match='for 3 vertices'):
        call('dd_draft_update', draft, MOTION, 1, None, part('library.structs').points_out(np.empty(9, np.float32)))
    bind.cancel()
    transfer = native.TransferJob(dense[:2], dense[:2], np.array([[0, 0]], np.int32))
    handle = ctypes.c_void_p()
    with pytest.raises(native.NativeError, match='which has no draft'):
        call('dd_job_take_draft', transfer, handle)
    transfer.close()


def test_threads_may_ask_while_the_bind_works(native, dense):
    """One thread gets the draft, and all may compute with it."""
    bind = native.Bind(*dense, 1, draft=1)
    found, results = [], []

    def ask():
        until = time.monotonic() + 60
        while not found and time.monotonic() < until:
            draft = bind.draft()
            if draft:
                found.append(draft)

    askers = [threading.Thread(target=ask) for _ in range(3)]
    for asker in askers:
        asker.start()
    for asker in askers:
        asker.join()
    assert len(found) == 1
    users = [threading.Thread(target=lambda: results.append(found[0].offsets(MOTION))) for _ in range(3)]
    for user in users:
        user.start()
    for user in users:
        user.join()
    assert len(results) == 3 and all((result == results[0]).all() for result in results)
