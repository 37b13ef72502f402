# SPDX-License-Identifier: GPL-3.0-or-later
"""Carries the deformation of one source over to many meshes, one after the other."""

import contextlib

from ..follow import messages, transfer_cache
from ..scene.mesh_data import MeshProblem
from . import transfer, transfer_table


def begin(context, source, rows, request_of, heading, tell):
    """Generator that does the work; yields the fraction done. A target whose transfer fails is left as it is. Closing
    the generator keeps the finished targets, and writes the table.

    rows: transfer_table.Row of each target; outcome or failure is filled in. request_of: a function that returns the
    TransferRequest of a target. heading: of the table. tell: called with the name and number of each target."""
    transfer_cache.begin_run()
    try:
        for number, row in enumerate(rows):
            tell(f"'{row.name}', {number + 1} of {len(rows)}")
            work = _one(context, source, row, request_of)
            try:
                row.outcome = yield from transfer.subprogress(work, number / len(rows), (number + 1) / len(rows))
            except messages.TOLD as problem:
                row.failure = messages.sentence(problem)
    finally:
        if transfer_table.any_begun(rows):
            transfer_table.write(source, heading, rows)


def _one(context, source, row, request_of):
    """Generator: as that of transfer.begin(), for the target of a row."""
    if row.target is None or row.target.type != 'MESH':
        raise MeshProblem(f"There is no mesh object '{row.name}' to transfer to: correct its name.")
    with contextlib.closing(transfer.begin(context, source, row.target, request_of(row.target))) as work:
        return (yield from work)
