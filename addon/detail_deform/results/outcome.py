# SPDX-License-Identifier: GPL-3.0-or-later
"""What a transfer has made on a target."""

import dataclasses

_NAMED = 3  # of a list


@dataclasses.dataclass
class Outcome:
    names: list = dataclasses.field(default_factory=list)  # of the shape keys that were made or given a new shape
    frames: int = 0  # of an animation
    left_out: dict = dataclasses.field(default_factory=dict)  # {source's key: why}
    remarks: list = dataclasses.field(default_factory=list)  # what the user may not expect, in sentences
    matched_by: str = ""
    seconds: float = 0.0

    def made(self):
        """In words."""
        if self.frames:
            return f"{self.frames:,} keyed shape keys" if self.names else f"{self.frames:,} frames"
        return f"Shape {'key' if len(self.names) == 1 else 'keys'} {listed(self.names)}"

    def count(self):
        """The same in a column."""
        return f"{self.frames:,} frames" if self.frames else f"{len(self.names):,} key{'s' * (len(self.names) != 1)}"

    def notes(self):
        """What the user may not expect, in sentences."""
        return [*([f"Left out: {reasons(self.left_out)}."] if self.left_out else []), *self.remarks]


def listed(names):
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ', '.join(map(repr, names[:_NAMED])) + more


def reasons(left_out):
    return '; '.join(f"'{name}': {reason}" for name, reason in left_out.items())
