# SPDX-License-Identifier: GPL-3.0-or-later
"""The brush on each kind of the zoo of defects: a result that is finite, the mesh as it was, or a sentence from the
manual."""

import re

import bpy
import numpy as np
import pytest

from conftest import REPOSITORY, activate
from zoo import checks, kinds
from zoo.driver import console, patterns
from zoo.specimen import DoesNotCombine, Sheet, Specimen, update

RADIUS = 0.4  # of the sheet's size


@pytest.mark.thorough
def test_each_kind_of_defect_gives_a_result_or_a_sentence():
    rows = patterns((REPOSITORY / 'addon' / 'MANUAL.md').read_text(encoding='utf-8'))
    failures, counts = [], {'result': 0, 'sentence': 0}
    for kind in [kind for kind in kinds.ALL if kind.stage in {'mesh', 'object'}]:
        said = []
        try:
            with console(said):
                outcome = _brushed(kind, rows)
        except DoesNotCombine:
            continue
        except checks.Failure as failure:
            failures.append(f"{kind.name}: {failure}")
            continue
        if "Traceback" in said[0]:
            failures.append(f"{kind.name}: on the console: {said[0][-1500:]}")
        counts[outcome] += 1
    assert not failures, '\n'.join(failures)
    assert min(counts.values()) > 20, counts


def _brushed(kind, rows):
    """'result' or 'sentence'. Raises checks.Failure, or DoesNotCombine where no one sculpts."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    sheet = Sheet()
    with np.errstate(all='ignore'):
        if kind.stage == 'mesh':
            kind.make(sheet)
        of = Specimen.made(sheet)
        of.ob.detail_deform.region = ""
        if kind.stage == 'object':
            kind.make(of)
    update()
    ob = of.ob
    if ob.name not in bpy.context.view_layer.objects:
        raise DoesNotCombine
    try:
        activate(ob)
        bpy.ops.object.mode_set(mode='SCULPT')
    except RuntimeError:
        raise DoesNotCombine from None
    if ob.mode != 'SCULPT' or not len(ob.data.vertices):
        raise DoesNotCombine
    before, size = checks.own(ob), of.size * max(ob.matrix_world.to_scale())
    handles = len(ob.detail_deform.handles)
    place = ob.matrix_world @ ob.data.vertices[min(60, len(ob.data.vertices) - 1)].co
    try:
        with np.errstate(all='ignore'):
            bpy.ops.object.detail_deform_brush_pull(
                point=place, offset=(0, 0, 0.2 * size), radius=max(abs(RADIUS * size), 1e-6))
    except RuntimeError as error:
        outcome = re.sub(r'^Error: ', "", str(error)).strip()
        _look_up(outcome, rows)
        if len(ob.detail_deform.handles) > handles or ob.modifiers.get("Detail Deform"):
            raise checks.Failure(f"a refusal leaves a handle: {outcome}") from None
        _is_kept(ob, before)
        return 'sentence'
    update()
    settings = ob.detail_deform
    if settings.stale or settings.problem:
        _look_up(settings.status, rows)
        return 'sentence'
    _is_kept(ob, before)
    offsets = checks.offsets(ob)
    if offsets is None or not np.isfinite(offsets).all():
        raise checks.Failure(f"no finite result | {settings.status}")
    if not np.abs(offsets).max() > 0:
        raise checks.Failure(f"nothing moves | {settings.status}")
    return 'result'


def _look_up(sentence, rows):
    if not any(row.search(sentence) for row in rows):
        raise checks.Failure(f"no row of the manual has: {sentence}")


def _is_kept(ob, before):
    if not np.array_equal(checks.own(ob), before, equal_nan=True):
        raise checks.Failure("the mesh's own coordinates changed")
