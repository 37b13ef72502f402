# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the library is the file that was packed. Of a damaged one, as a full disk or an update of a loaded file
leaves behind, the system loads what there is, and Blender ends without a word when it gets to what is missing."""

import hashlib
import os

from .structs import NativeError


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
                          "came with the add-on. Install the add-on's zip again and restart Blender.")
