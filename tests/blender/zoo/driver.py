# SPDX-License-Identifier: GPL-3.0-or-later
"""Drives a case through the add-on: Add, handles, Bind, a motion, the methods, Apply or Remove All. The outcome is a
result that keeps its constraints, or a sentence from the manual; anything else is a failure."""

import contextlib
import os
import re
import sys
import tempfile
from typing import NamedTuple

import bpy
import numpy as np

from . import checks
from .specimen import RIGHT, DoesNotCombine, Sheet, Specimen, update

METHODS = ('TRANSFER', 'VARIATIONAL', 'NORMAL', 'GRADIENT', 'VOLUMES', 'EXAMPLES')


class Outcome(NamedTuple):
    kind: str  # 'result', 'sentence' or 'failure'
    text: str  # the sentences, or the failure


class Case(NamedTuple):
    """kinds: Kinds, in the order in which they are made."""
    kinds: tuple
    methods: tuple = METHODS
    applied: bool = True  # ends with Apply, otherwise with Remove All

    @property
    def name(self):
        return ' + '.join(kind.name for kind in self.kinds) or "healthy"


def drive(case, rows, prepared=None):
    """The Outcome of a case in an empty scene, None where its kinds don't combine. rows: patterns() of the manual.
    prepared: a function that returns a Specimen with handles, in place of the healthy sheet."""
    said = []
    with console(said):
        try:
            drive_ = _Drive(case, rows)
            outcome = drive_.run(prepared)
        except DoesNotCombine:
            return None
        except checks.Failure as failure:
            outcome = Outcome('failure', str(failure))
    if any(word in said[0] for word in ("Traceback", "Error: Python", "EXCEPTION_")):
        return Outcome('failure', f"on the console: {said[0][-2000:]}")
    return outcome


@contextlib.contextmanager
def console(said):
    """Appends everything that is printed meanwhile, also by C, to `said`."""
    sys.stdout.flush()
    sys.stderr.flush()
    with tempfile.TemporaryFile() as kept:
        before = [os.dup(1), os.dup(2)]
        try:
            os.dup2(kept.fileno(), 1)
            os.dup2(kept.fileno(), 2)
            with open(os.dup(kept.fileno()), 'w', encoding='utf-8') as text, contextlib.redirect_stdout(text), \
                    contextlib.redirect_stderr(text):  # pytest may have replaced sys.stdout and sys.stderr
                yield
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            for number, copy in zip((1, 2), before):
                os.dup2(copy, number)
                os.close(copy)
            kept.seek(0)
            said.append(kept.read().decode(errors='replace'))


def patterns(manual):
    """The rows of the manual's tables of messages as regular expressions."""
    text = manual.split('## What a message means')[1].split('\n## ')[0]
    cells = [cell for cell in re.findall(r'^\| (.*?) \|', text, re.MULTILINE) if set(cell) - set('-|')]
    rows = [row.strip() for cell in cells if cell != 'it says' for row in cell.split(' / ')]
    return [re.compile('.*'.join(re.escape(part.strip()) for part in row.split('…')), re.DOTALL) for row in rows]


class _Drive:
    def __init__(self, case, rows):
        self._case, self._rows, self._sentences = case, rows, []

    def run(self, prepared):
        of = self._specimen = prepared(self) if prepared else self._healthy()
        self._make('object')
        self._before = checks.stored(of.ob)
        if not self.operate('bind', wait=True):
            if of.ob.detail_deform.is_bound:
                raise checks.Failure("it refuses and is bound")
            return self._ended()
        if not of.ob.detail_deform.is_bound and not self._wrong():
            raise checks.Failure(f"Bind says nothing, and: {of.ob.detail_deform.status}")
        self._look("at rest", moved=False)
        self._move()
        for method in self._case.methods:
            of.ob.detail_deform.method = method
            update()
            self._look(method)
        if any(kind.stage == 'pose' for kind in self._case.kinds):
            self._make('pose')
            self._look("posed")
        return self._ended()

    def _healthy(self):
        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
        sheet = Sheet()
        with np.errstate(all='ignore'):
            for kind in self._case.kinds:
                if kind.stage == 'mesh':
                    kind.make(sheet)
        of = self._specimen = Specimen.made(sheet)
        update()
        self._before = checks.stored(of.ob)
        self.operate('add')
        if not self.operate('handle_add', vertex_group=RIGHT):
            of.add_handle(RIGHT, sheet.right)
        update()
        return of

    def _make(self, stage):
        for kind in self._case.kinds:
            if kind.stage == stage:
                kind.make(self._specimen)
        if bpy.context.view_layer.objects.active is None and self._specimen.name in bpy.context.view_layer.objects:
            bpy.context.view_layer.objects.active = self._specimen.ob
        update()
        if stage == 'pose':
            self._before = checks.stored(self._specimen.ob)

    def operate(self, name, **options):
        """Runs an operator; whether it finished. The sentence of a refusal is checked and kept."""
        operator = getattr(bpy.ops.object, f'detail_deform_{name}')
        try:
            return operator(**options) == {'FINISHED'}
        except RuntimeError as error:
            self._take(re.sub(r'^Error: ', "", str(error)).strip())
            return False

    def _take(self, sentence):
        if not sentence:
            raise checks.Failure("an empty sentence")
        if re.search(r"\b(nan|inf)\b", sentence) and "finite" not in sentence:
            raise checks.Failure(f"numbers that are none: {sentence}")
        if not any(row.search(sentence) for row in self._rows):
            raise checks.Failure(f"no row of the manual has: {sentence}")
        if sentence not in self._sentences:
            self._sentences.append(sentence)

    def _wrong(self):
        """The status where it reports a problem, or ''."""
        settings = self._specimen.ob.detail_deform
        return settings.status if settings.stale or settings.problem else ""

    def _move(self):
        of = self._specimen
        try:
            empty = of.empty
        except DoesNotCombine:  # a kind took the empty away; its case goes on with the sentence of Bind
            return
        with np.errstate(all='ignore'):
            empty.location.x -= 0.05 * of.size
            empty.location.z += 0.2 * of.size
            empty.rotation_euler.y += 0.4
        update()

    def _look(self, when, moved=True):
        of = self._specimen
        if of.ob.detail_deform.signature and not of.ob.detail_deform.live:
            self.operate('update')
        wrong = self._wrong()
        if wrong:
            self._take(wrong)
        try:
            checks.own_is_kept(of.ob, self._before)
            checks.is_finite(of)
            if not wrong:
                checks.is_result(of, of.ob.detail_deform.status, moved)
        except checks.Failure as failure:
            raise checks.Failure(f"{when}: {failure} | {of.ob.detail_deform.status}") from None

    def _ended(self):
        """Applies or removes all; returns the Outcome."""
        of = self._specimen
        checks.own_is_kept(of.ob, self._before)
        if self._case.applied and self._is_bound_well() and checks.offsets(of.ob) is not None:
            expected = checks.own(of.ob) + checks.offsets(of.ob)
            if self.operate('apply'):
                checks.was_applied(of, expected)
        elif self.operate('remove'):
            checks.own_is_kept(of.ob, self._before)
            if checks.offsets(of.ob) is not None or of.ob.detail_deform.signature:
                raise checks.Failure("Remove All leaves the deformation behind")
        return Outcome('sentence', '\n'.join(self._sentences)) if self._sentences else Outcome('result', "")

    def _is_bound_well(self):
        return self._specimen.ob.detail_deform.is_bound and not self._wrong()
