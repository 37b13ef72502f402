# SPDX-License-Identifier: GPL-3.0-or-later
"""One source's deformation carried over to many meshes, one after the other."""

import contextlib

from ..follow import factored, words
from ..scene.mesh_data import MeshProblem
from . import transfer, transfer_table


def begin(context, source, rows, wanted_of, heading, tell):
    """Generator of the work; yields the fraction done. What fails leaves its target as it is. What was done stays when
    this is closed, and is noted then, too.

    rows: of the table, one a target; they are filled in. wanted_of: gives the Wanted of a target. heading: of the
    table. tell: hears whose turn it is."""
    factored.begin_run()
    try:
        for number, row in enumerate(rows):
            tell(f"'{row.name}', {number + 1} of {len(rows)}")
            work = _one(context, source, row, wanted_of)
            try:
                row.outcome = yield from transfer.share(work, number / len(rows), (number + 1) / len(rows))
            except words.TOLD as problem:
                row.failure = words.sentence(problem)
    finally:
        if transfer_table.any_begun(rows):
            transfer_table.write(source, heading, rows)


def _one(context, source, row, wanted_of):
    """Generator: as of transfer.begin()."""
    if row.target is None or row.target.type != 'MESH':
        raise MeshProblem(f"There is no mesh object '{row.name}' to transfer to: correct its name.")
    with contextlib.closing(transfer.begin(context, source, row.target, wanted_of(row.target))) as work:
        return (yield from work)
