# SPDX-License-Identifier: GPL-3.0-or-later
"""The cache of binds and transfers made for followers (follow/job_cache.py), with jobs that only pretend to work."""

import threading

import pytest
from conftest import part

made, session = part('follow.job_cache'), part('session')
NativeError = part('library.native').NativeError


class Job:
    def __init__(self, makes=None, fails=None):
        self.makes, self.fails = makes, fails
        self.running, self.cancelled, self.finished, self.closed = True, False, 0, False

    def progress(self):
        return self.running, 0.5, "Working"

    def cancel(self):
        self.cancelled = True

    def close(self):
        self.closed = True

    def finish(self):
        self.finished += 1
        if self.fails:
            raise NativeError(self.fails)
        return self.makes


@pytest.fixture
def cache():
    return made.Cache(spare=2)


def begin(cache, content, **job):
    job = Job(**job)
    cache.start(content, lambda: job)
    return job


def never():
    raise AssertionError("It is there or on its way.")


def test_content_that_is_made_or_under_way_is_not_begun_again(cache):
    job = begin(cache, 'a', makes=1)
    cache.start('a', never)
    assert cache.contents_under_way() == ['a'] and cache.poll('a') and cache.find('a') is None
    entry = cache.finish('a')
    cache.start('a', never)
    assert entry.made == 1 and cache.find('a') is entry and cache.finish('a') is entry
    assert job.finished == 1 and cache.under_way('a') is None


def test_a_failure_is_remembered_until_it_is_forgotten(cache):
    job = begin(cache, 'a', fails="There is no memory left.")
    for _ in range(2):
        with pytest.raises(NativeError, match="no memory left"):
            cache.finish('a')
    with pytest.raises(NativeError, match="no memory left"):
        cache.raise_failure('a')
    assert job.finished == 1 and cache.find('a') is None
    cache.keep({'a'})
    with pytest.raises(NativeError):
        cache.raise_failure('a')
    cache.forget_failure('a')
    cache.raise_failure('a')
    begin(cache, 'a', fails="There is no memory left.")
    with pytest.raises(NativeError):
        cache.finish('a')
    cache.keep(set())  # no follower needs 'a' any more
    cache.raise_failure('a')


def test_a_cancelled_job_may_be_replaced_by_a_new_one(cache):
    job = begin(cache, 'a', fails="It was cancelled.")
    cache.cancel('a')
    assert job.cancelled and cache.under_way('a') is job
    other = begin(cache, 'a', makes=2)
    assert cache.under_way('a') is other and cache.finish('a').made == 2 and job.finished == 0


def test_a_job_that_is_let_go_of_is_kept_unclosed_until_it_ends(cache):
    job = begin(cache, 'a', makes=1)
    cache.let_go('a')
    assert job.cancelled and cache.contents_under_way() == [] and not job.finished and not job.closed
    assert cache._ending == [job]
    cache.keep(set())
    assert cache._ending == [job]
    job.running = False
    cache.keep(set())
    assert cache._ending == []
    cache.let_go('nothing')


def test_spare_entries_are_kept_and_the_oldest_forgotten(cache):
    for number in range(5):
        begin(cache, number, makes=number)
        cache.finish(number)
    cache.keep({0, 4})
    assert [number for number in range(5) if cache.find(number)] == [0, 2, 3, 4]


def test_two_threads_wait_for_one_job(cache):
    gate, entries = threading.Event(), []

    class Slow(Job):
        def finish(self):
            assert gate.wait(10)
            return super().finish()

    job = Slow(makes=1)
    cache.start('a', lambda: job)
    threads = [threading.Thread(target=lambda: entries.append(cache.finish('a'))) for _ in range(2)]
    for thread in threads:
        thread.start()
    gate.set()
    for thread in threads:
        thread.join()
    assert job.finished == 1 and len(entries) == 2 and entries[0] is entries[1]


def test_a_job_begun_while_another_thread_finished_the_content_leaves_the_cache(cache):
    """The add-on's timer runs as long as a job is under way."""
    begin(cache, 'a', makes=1)
    class Meanwhile(Job):
        def finish(self):
            begin(cache, 'a', makes=2)
            return super().finish()

    cache._jobs['a'] = Meanwhile(makes=1)
    entry = cache.finish('a')
    assert cache.contents_under_way() == ['a']
    assert cache.finish('a') is entry and cache.contents_under_way() == []


def test_finishing_content_that_was_let_go_of_raises(cache):
    with pytest.raises(NativeError, match="cancelled"):
        cache.finish('a')


def test_owners_are_forgotten_and_all_is_closed(cache):
    begin(cache, 'a', makes=1)
    entry = cache.finish('a')
    entry.owners.add(1)
    session.ended(session.Until.REPLACED)
    assert not entry.owners
    under_way, let_go = begin(cache, 'b'), begin(cache, 'c')
    cache.let_go('c')
    session.ended(session.Until.DISABLED)
    assert under_way.closed and let_go.closed and cache.find('a') is None and not cache.contents_under_way()
