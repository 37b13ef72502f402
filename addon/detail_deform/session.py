# SPDX-License-Identifier: GPL-3.0-or-later
"""The memory of the add-on between calls: caches and pending work. Each module declares its own here, together
with the event that ends it, so that none refers to data that are gone, and nothing is left when the add-on is disabled.
"""

import copy
import enum


class Until(enum.IntEnum):
    """The event that ends a memory. A later one ends all that an earlier one does."""
    REPLACED = 1  # undo, redo and loading, which replace data-blocks: pointers to the former ones are invalid
    LOADED = 2  # another file: undo can't lead back to the one before
    DISABLED = 3  # the add-on


_endings = []  # (Until, function)


def at(until, end):
    """Calls end() at that event and at later ones. Of several calls the earlier ones come first."""
    _endings.append((until, end))


def ended(event):
    """To be called at the event: by the handlers, and when the add-on is disabled."""
    for until, end in sorted(_endings, key=lambda ending: ending[0]):
        if until <= event:
            end()


def kept(memory, until):
    """The memory (a dict, list or set, or what else has clear()), which is cleared at that event."""
    at(until, memory.clear)
    return memory


class Values:
    """Values by name, which go back to the first ones at that event."""

    def __init__(self, until, **first):
        self._first = first
        self.clear()
        at(until, self.clear)

    def clear(self):
        vars(self).update(copy.deepcopy(self._first))


class Memo:
    """Results by key, of which the least recently used are dropped."""

    def __init__(self, size, until=Until.DISABLED):
        """size: how many are kept, or a function that returns it."""
        self._size = size if callable(size) else lambda: size
        self._found = kept({}, until)

    def __contains__(self, key):
        return key in self._found

    def __len__(self):
        return len(self._found)

    def of(self, key, make, fits=lambda found: True):
        """The result of this key: the present one if there is one that fits, else that of make()."""
        is_there = key in self._found and fits(self._found[key])
        return self.put(key, self._found[key] if is_there else make())

    def get(self, key, default=None):
        return self._found.get(key, default)

    def put(self, key, found):
        is_new = key not in self._found
        self.drop(key)
        self._found[key] = found  # at the end: the most recently used
        for old in list(self._found)[:-max(1, self._size())] if is_new else ():
            del self._found[old]
        return found

    def drop(self, key):
        self._found.pop(key, None)
