# SPDX-License-Identifier: GPL-3.0-or-later
"""The zoo of defects: each kind alone and some of their pairs give a result that keeps its constraints, or a sentence
from the manual. zoo/run.py drives all pairs, and files."""

import bpy
import numpy as np
import pytest

from conftest import REPOSITORY, update
from zoo import checks, kinds
from zoo.driver import Case, drive, patterns
from zoo.kind import Kind
from zoo.run import print_table

PAIRS = 150  # one pair in 150 is driven: about 200 of 30,000


@pytest.fixture
def rows():
    return patterns((REPOSITORY / 'addon' / 'MANUAL.md').read_text(encoding='utf-8'))


def driven(cases, rows, capfd):
    """Drives the cases; prints the numbers of results, sentences and failures by part of the zoo; returns the
    failures."""
    part_of = {kind: module.__name__.split('.')[-1] for module in kinds.PARTS for kind in module.KINDS}
    table, failures = {}, []
    for case in cases:
        outcome = drive(case, rows)
        if outcome is None:
            continue
        for part in {part_of[kind] for kind in case.kinds} or {'healthy'}:
            counts = table.setdefault(part, [part, 0, 0, 0])
            counts[1 + ('result', 'sentence', 'failure').index(outcome.kind)] += 1
        if outcome.kind == 'failure':
            failures.append(f"{case.name}: {outcome.text}")
    with capfd.disabled():
        print()
        print_table(table.values())
    return failures


@pytest.mark.thorough
def test_each_kind_alone(rows, capfd):
    cases = [case._replace(methods=case.methods[:2]) for case in kinds.alone()]
    assert len(cases) > 250
    failures = driven(cases, rows, capfd)
    assert not failures, '\n'.join(failures)


@pytest.mark.thorough
def test_some_pairs(rows, capfd):
    failures = driven(kinds.pairs(PAIRS), rows, capfd)
    assert not failures, '\n'.join(failures)


# ---- planted faults, which the zoo's checks have to find

def posed(of):
    update()
    assert of.ob.detail_deform.is_bound


def spoiled(change):
    """A kind that changes the displayed offsets by change(offsets, rest)."""
    def make(of):
        posed(of)
        offsets = checks.offsets(of.ob)
        change(offsets, checks.own(of.ob))
        of.ob.data.attributes[checks.OFFSET].data.foreach_set('vector', offsets.astype(np.float32).ravel())
    return Kind("spoiled", 'pose', make, False, "")


def nan(offsets, rest):
    offsets[60] = np.nan


def at_rest(offsets, rest):
    offsets[:] = 0


def free_at_rest(offsets, rest):
    offsets[rest[:, 0] < 0.85] = 0


def thrown(offsets, rest):
    offsets[60] = 30


def torn(offsets, rest):
    offsets[60:99, 2] += 0.5


def fixed_moves(offsets, rest):
    offsets[0] = 1e-3


@pytest.mark.parametrize('change, said', [
    (nan, "not finite"), (at_rest, "a constraint is not kept"), (free_at_rest, "stays at rest beside handle"),
    (thrown, "is thrown"), (torn, "of the motion"), (fixed_moves, "what is fixed moved")])
def test_a_spoiled_result_is_a_failure(rows, change, said):
    outcome = drive(Case((spoiled(change),), ('TRANSFER',)), rows)
    assert outcome.kind == 'failure' and said in outcome.text


def test_a_changed_mesh_is_a_failure(rows):
    def make(of):
        def touch(*_):
            of.ob.data.vertices[0].co.x += 0.1
        bpy.app.handlers.depsgraph_update_pre.append(touch)
    try:
        outcome = drive(Case((Kind("touched", 'object', make, False, ""),), ('TRANSFER',)), rows)
    finally:
        bpy.app.handlers.depsgraph_update_pre.clear()
    assert outcome.kind == 'failure' and "coordinates changed" in outcome.text


def test_an_exception_on_the_console_is_a_failure(rows):
    def make(of):
        def fail(*_):
            raise ValueError("of a handler")
        bpy.app.handlers.depsgraph_update_post.append(fail)
    try:
        outcome = drive(Case((Kind("failing", 'object', make, False, ""),), ('TRANSFER',)), rows)
    finally:
        bpy.app.handlers.depsgraph_update_post[:] = [
            handler for handler in bpy.app.handlers.depsgraph_update_post if handler.__name__ != 'fail']
    assert outcome.kind == 'failure' and "of a handler" in outcome.text


def test_a_sentence_without_a_row_in_the_manual_is_a_failure():
    kind = next(kind for kind in kinds.ALL if kind.name == "one coordinate nan")
    outcome = drive(Case((kind,)), [])
    assert outcome.kind == 'failure' and "no row of the manual has: Vertex 60 " in outcome.text
