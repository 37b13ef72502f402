# SPDX-License-Identifier: GPL-3.0-or-later
"""The outcome of a transfer to one target."""

import dataclasses

_NAMED = 3  # names of a list that a sentence gives; the others are counted


@dataclasses.dataclass
class Outcome:
    names: list = dataclasses.field(default_factory=list)  # shape keys that were made or given a new shape
    frames: int = 0  # number of frames of an animation
    left_out: dict = dataclasses.field(default_factory=dict)  # {name of the source's key: reason}
    remarks: list = dataclasses.field(default_factory=list)  # sentences: what may surprise the user
    matched_by: str = ""
    seconds: float = 0.0

    def made(self):
        """The result as the beginning of a sentence."""
        if self.frames:
            return f"{self.frames:,} keyed shape keys" if self.names else f"{self.frames:,} frames"
        return f"Shape {'key' if len(self.names) == 1 else 'keys'} {listed(self.names)}"

    def count(self):
        """The same for a column of a table."""
        return f"{self.frames:,} frames" if self.frames else f"{len(self.names):,} key{'s' * (len(self.names) != 1)}"

    def notes(self):
        """All sentences: the keys that were left out, and the remarks."""
        return [*([f"Left out: {reasons(self.left_out)}."] if self.left_out else []), *self.remarks]


def listed(names):
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ', '.join(map(repr, names[:_NAMED])) + more


def reasons(left_out):
    return '; '.join(f"'{name}': {reason}" for name, reason in left_out.items())
