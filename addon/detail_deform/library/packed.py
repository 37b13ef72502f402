# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds the file of the library, and checks that it is the one that was packed.

A full disk, or an update while the library is loaded, can leave a damaged file. The system loads such a file without an
error, and Blender crashes when it reaches a part that is missing. The check takes 2 ms, once."""

import hashlib
import importlib.util
import os

from .structs import NativeError
from .wheel import PACKAGE

# Blender unpacks the wheel of a version once, and removes it where the add-on is switched off.
AGAIN = "Switch the add-on off and on again" if PACKAGE else "Install the add-on's zip again"


def place(name):
    """The path of the library with this name, whether or not it is there."""
    folder = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), PACKAGE or 'lib')
    if PACKAGE:
        importlib.invalidate_caches()  # it may have been unpacked a moment ago
        spec = importlib.util.find_spec(PACKAGE)
        if spec and spec.origin:
            folder = os.path.dirname(spec.origin)
    return os.path.join(folder, name)


def check(path):
    """Raises NativeError where the library is not the one whose digest was packed beside it, and OSError where it can't
    be read. One without a digest was built here, or chosen by the environment."""
    record = f"{path}.sha256"
    if not os.path.exists(record):
        return
    with open(record, encoding='ascii', errors='replace') as file:
        wanted = file.read().strip()
    with open(path, 'rb') as file:
        found = hashlib.sha256(file.read()).hexdigest()
    if found != wanted:
        raise NativeError(f"The Detail Deform library {path} is damaged or of another version: it is not the file that "
                          f"came with the add-on. {AGAIN} and restart Blender.")
