# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that are read, and those that are not finished. Nothing here knows Blender."""

import contextlib
import os


def check(path):
    """Raises OSError where a path, which another's file may hold, leads to what has no end or waits for a writer."""
    if os.path.exists(path) and not os.path.isfile(path):
        raise OSError(0, "it is no file")


def name_for(name):
    """A data-block's name as that of a file."""
    return ''.join('_' if letter in '\\/:*?"<>|' or ord(letter) < 32 else letter for letter in name)


def take_away(path):
    """An unfinished file, as far as the disk lets: what went wrong before is what is said."""
    with contextlib.suppress(OSError):
        os.remove(path)
