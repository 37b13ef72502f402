# SPDX-License-Identifier: GPL-3.0-or-later
"""Reports on a transfer to many targets: a table in a text data-block, and a list of failures with the source."""

import dataclasses

import bpy

from .outcome import Outcome, listed

TEXT_NAME = "Detail Deform Transfer"
_OURS = 'detail_deform_table'  # property of the text: its name when it was made. A renamed text is the user's
_HEAD = ("Target", "Matched By", "Made", "Seconds", "Remarks")


@dataclasses.dataclass
class Row:
    """A target with its outcome or failure; with neither if the run was cancelled before its turn ended."""
    name: str
    target: bpy.types.Object
    outcome: Outcome = None
    failure: str = ""

    def cells(self):
        if self.outcome:
            return (self.name, self.outcome.matched_by, self.outcome.count(), f"{self.outcome.seconds:.1f}",
                    ' '.join(self.outcome.notes()))
        return self.name, "", "", "", f"Failed: {self.failure}" if self.failure else "Cancelled, left as it was."


def any_begun(rows):
    return any(row.outcome or row.failure for row in rows)


def summary(rows):
    """(type of an operator's report, sentence)"""
    done, failed = sum(bool(row.outcome) for row in rows), [row.name for row in rows if row.failure]
    cancelled = len(rows) - done - len(failed)
    said = f"{done:,} of {len(rows):,} targets done"
    said += f", {len(failed):,} failed: {listed(failed)}" if failed else ""
    said += f", {cancelled:,} cancelled and left as they were" if cancelled else ""
    return ('WARNING' if done or cancelled else 'ERROR') if failed else 'INFO', said


def write(source, heading, rows):
    """Replaces the table in the text, and updates the source's list of failures if the source can be changed."""
    cells = [_HEAD, *(row.cells() for row in rows)]
    widths = [max(len(row[column]) for row in cells) for column in range(len(_HEAD))]
    lines = ['  '.join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in cells]
    table = text()
    if table is None:
        table = bpy.data.texts.new(TEXT_NAME)
        table[_OURS] = table.name
    table.clear()
    table.write('\n'.join([heading, summary(rows)[1] + ".", "", *lines, ""]))
    table.cursor_set(0)  # the Text Editor shows the text from there on
    for row in rows:
        if row.outcome or row.failure:
            note(source, row.name, row.target, row.failure)


def text():
    """The text data-block with the table, or None."""
    return next((text for text in bpy.data.texts if text.get(_OURS) == text.name and not text.library), None)


def note(source, name, target, failure):
    """Replaces a target's entry in the source's list of failures. failure: a sentence; '': there is none, and the entry
    is removed. target: None if no object has that name."""
    if source.library or source.override_library:  # linked data and overrides take no new entries
        return
    failed = source.detail_deform.transfer.failed
    present = [number for number, entry in enumerate(failed)
               if (entry.target == target if entry.target else entry.name == name)]
    for number in reversed(present):
        failed.remove(number)
    if failure:
        entry = failed.add()
        entry.name, entry.target, entry.reason = name, target, failure


def failed_target(entry):
    """The object of an entry, also if it was renamed; None if it was deleted."""
    target = entry.target  # the pointer keeps a deleted object in memory
    return target if target and target.users_scene else None
