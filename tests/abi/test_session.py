# SPDX-License-Identifier: GPL-3.0-or-later
"""Memory between calls ends at its event, and a memo keeps the most recently used results."""

import pytest
from conftest import part

session = part('session')
REPLACED, LOADED, DISABLED = session.Until


@pytest.fixture(autouse=True)
def no_others(monkeypatch):
    monkeypatch.setattr(session, '_endings', [])


@pytest.mark.parametrize('event, left', [(REPLACED, [LOADED, DISABLED]), (LOADED, [DISABLED]), (DISABLED, [])])
def test_a_later_event_ends_all_that_an_earlier_one_does(event, left):
    kept = {until: session.kept({'key': 1}, until) for until in session.Until}
    session.ended(event)
    assert [until for until in session.Until if kept[until]] == left


def test_what_is_to_end_first_ends_first():
    order = []
    for number, until in enumerate((DISABLED, REPLACED, LOADED, REPLACED)):
        session.at(until, lambda number=number: order.append(number))
    session.ended(DISABLED)
    assert order == [1, 3, 2, 0]


def test_a_memo_makes_a_result_once_and_again_where_it_does_not_fit():
    memo, made = session.Memo(4), []

    def make():
        made.append(len(made))
        return made[-1]

    assert [memo.of('a', make) for _ in range(3)] == [0, 0, 0]
    assert memo.of('a', make, lambda found: found > 0) == 1
    assert memo.get('a') == 1 and memo.get('b') is None and 'b' not in memo
    memo.drop('a')
    assert len(memo) == 0


def test_a_memo_drops_the_least_recently_used():
    size = [3]
    memo = session.Memo(lambda: size[0])
    for key in 'abc':
        memo.put(key, key)
    memo.of('a', lambda: pytest.fail("it is there"))
    memo.put('d', 'd')
    assert [key for key in 'abcd' if key in memo] == ['a', 'c', 'd']
    size[0] = 1
    memo.put('a', 'A')  # no new entry: none has to go
    assert len(memo) == 3
    memo.put('e', 'e')
    assert [key for key in 'abcde' if key in memo] == ['e']
    session.ended(DISABLED)
    assert len(memo) == 0


def test_values_go_back_to_the_first_ones():
    values = session.Values(LOADED, owners={}, count=-1)
    values.owners['a'], values.count = 1, 5
    session.ended(REPLACED)
    assert (values.owners, values.count) == ({'a': 1}, 5)
    session.ended(LOADED)
    assert (values.owners, values.count) == ({}, -1)
