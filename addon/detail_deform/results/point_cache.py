# SPDX-License-Identifier: GPL-3.0-or-later
"""Point caches (PC2): their paths, and writing them frame by frame."""

import contextlib
import os

import bpy

from ..scene import files, pc2
from ..scene.mesh_data import MeshProblem


def absolute(path):
    """The absolute path of one in Blender's notation. Raises MeshProblem if it is empty, or relative to a file that was
    never saved."""
    if not path:
        raise MeshProblem("There is no file to bake to: choose one in File.")
    if path.startswith('//') and not bpy.data.filepath:
        raise MeshProblem("This file was never saved, so there is no folder beside it: save it, or choose a "
                          "full path for the cache.")
    return os.path.abspath(bpy.path.abspath(path))


def usual_path(ob, present):
    """The default path: beside the file, with a name that no other object's cache or Alembic file has; '' if the file
    was never saved. present: the modifier that will play the cache, or None."""
    if not bpy.data.filepath:
        return ""
    stem = os.path.splitext(os.path.basename(bpy.data.filepath))[0]
    name = files.name_for(ob.name)
    taken = {_without_ending(path) for path in (*_played(present), *_baked_of_others(ob, name))}
    paths = (f"//{stem}_{name}{number}.pc2" for number in ("", *(f" {k}" for k in range(2, 10000))))
    return next(path for path in paths if _without_ending(path) not in taken)


def _without_ending(path):
    return os.path.splitext(files.folded(absolute(path)))[0]


def _played(present):
    return [modifier.filepath for ob in bpy.data.objects for modifier in ob.modifiers
            if modifier.type == 'MESH_CACHE' and modifier.filepath and modifier != present]


def _baked_of_others(ob, name):
    """Paths of files baked of other objects whose names give the same file name. Other names don't count, as a copy of
    an object keeps the path of the original's file."""
    return [other.detail_deform.baked_file for other in bpy.data.objects
            if other != ob and other.detail_deform.baked_file
            and files.folded(files.name_for(other.name)) == files.folded(name)]


@contextlib.contextmanager
def disk(path, what):
    """Context that turns OSError and pc2.NotACache into MeshProblem. what: read or written, for the sentence."""
    try:
        yield
    except OSError as error:
        raise MeshProblem(f"'{path}' can't be {what}: {files.reason(error, path)}.") from error
    except pc2.NotACache as error:
        raise MeshProblem(str(error)) from error


def point_count(path):
    """The number of points in the cache. Raises MeshProblem if the file is no cache."""
    with disk(path, "read"):
        return pc2.read_header(absolute(path))[0]


def write(path, poses, start, end, whole=None):
    """Generator: writes a cache; yields the fraction done.

    poses: a generator of (n, 3) float32, one for each frame from start to end. whole: first and last frame of the
    cache, if only the part from start to end is written now."""
    first, last = whole or (start, end)
    path, writer, done = absolute(path), None, False
    try:
        with disk(path, "written"), contextlib.closing(poses):
            for number, positions in enumerate(poses, 1):
                if writer is None:
                    writer = pc2.Writer(path, len(positions), last + 1 - first, start - first, end + 1 - first)
                writer.write(positions)
                yield number / (end + 1 - start)
            writer.finish()
        done = True
    finally:
        if writer and not done:
            writer.give_up()
