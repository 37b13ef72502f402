# SPDX-License-Identifier: GPL-3.0-or-later
"""Point caches (PC2) as the Mesh Cache modifier reads them: a header, then float32 positions frame by frame.

Independent of Blender. Errors of the file system are raised as OSError.
"""

import contextlib
import os
import shutil
import struct

import numpy as np

from . import files

_HEADER = struct.Struct('<12siiffi')
_MARK = b'POINTCACHE2\0'


class NotACache(Exception):
    """A sentence about a file that is no point cache, is incomplete, or has another size than expected."""


# In bytes.
def size(point_count, frame_count):
    return _HEADER.size + 12 * point_count * frame_count


def read_header(path):
    """(point count, frame count) of a cache. Raises NotACache."""
    files.check(path)
    with open(path, 'rb') as file:
        head = file.read(_HEADER.size)
    if len(head) < _HEADER.size or not head.startswith(_MARK):
        raise NotACache(f"'{path}' is not a point cache (PC2).")
    _, _, points, _, _, frames = _HEADER.unpack(head)
    if min(points, frames) < 0:  # two negative numbers could match the file size
        raise NotACache(f"'{path}' is not a point cache (PC2).")
    if os.path.getsize(path) != size(points, frames):
        raise NotACache(f"'{path}' is not complete: it should have {size(points, frames):,} bytes and has "
                        f"{os.path.getsize(path):,}.")
    return points, frames


def check_room(path, needed):
    """Raises OSError where the disk has less than needed bytes free."""
    free = shutil.disk_usage(os.path.dirname(path) or '.').free
    if free < needed:
        raise OSError(0, f"the file takes {needed / 1e6:,.0f} MB and there are {free / 1e6:,.0f} MB left")


class Writer:
    """Writes frames first to last - 1 of a cache of frame_count frames.

    A whole cache is written to a temporary file, which replaces path when finished and is removed if given up. A part
    is written in place, into a file of full size that other processes may fill at the same time.
    """

    def __init__(self, path, point_count, frame_count, first=0, last=None):
        self._path, self.points, self._frames = path, point_count, frame_count
        self._next = first
        self._part = last is not None and (first, last) != (0, frame_count)
        needed = size(point_count, frame_count)
        unfinished = files.unfinished(path)
        if not (self._part and os.path.exists(path)):
            check_room(path, needed)
        self._target = path if self._part else unfinished
        self._file = self._open_part() if self._part else open(self._target, 'wb')
        if not self._part:
            self._write_header()

    def _open_part(self):
        # Several processes may run this at once: at any moment the file is empty or has its full size.
        file = os.fdopen(os.open(self._target, os.O_RDWR | os.O_CREAT | getattr(os, 'O_BINARY', 0), 0o666), 'r+b')
        present = os.fstat(file.fileno()).st_size
        if present not in {0, size(self.points, self._frames)}:
            file.close()
            raise NotACache(f"'{self._path}' is there and is a cache of another size: choose another file, or "
                            "remove it.")
        file.truncate(size(self.points, self._frames))
        self._file = file
        self._write_header()
        file.seek(_HEADER.size + 12 * self.points * self._next)
        return file

    def _write_header(self):
        self._file.write(_HEADER.pack(_MARK, 1, self.points, 1.0, 1.0, self._frames))

    def write(self, positions):
        """positions: (n, 3) float32 of the next frame."""
        self._file.write(np.ascontiguousarray(positions, '<f4').tobytes())

    def finish(self):
        self._file.close()
        if not self._part:
            os.replace(self._target, self._path)

    def give_up(self):
        with contextlib.suppress(OSError):  # closing flushes, which fails again after a failed write
            self._file.close()
        if not self._part:
            files.remove_unfinished(self._target)
