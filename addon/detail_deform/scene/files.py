# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that are read. Nothing here knows Blender."""

import os


def check(path):
    """Raises OSError where a path, which another's file may hold, leads to what has no end or waits for a writer."""
    if os.path.exists(path) and not os.path.isfile(path):
        raise OSError(0, "it is no file")
