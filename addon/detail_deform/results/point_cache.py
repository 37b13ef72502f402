# SPDX-License-Identifier: GPL-3.0-or-later
"""Point caches: where they go, and their writing frame by frame."""

import contextlib
import os

import bpy

from ..scene import files, pc2
from ..scene.mesh_data import MeshProblem


def absolute(path):
    """Of a path as Blender writes it. Raises MeshProblem where it is relative to a file never saved."""
    if not path:
        raise MeshProblem("There is no file to bake to: choose one in File.")
    if path.startswith('//') and not bpy.data.filepath:
        raise MeshProblem("This file was never saved, so there is no folder beside it: save it, or choose a "
                          "full path for the cache.")
    return os.path.abspath(bpy.path.abspath(path))


def usual_path(ob, present):
    """Beside the file, under a name that no other object's cache or Alembic file has; '' for a file that was never
    saved. present: the modifier that will play it, if it is there already."""
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
    """What was baked of objects whose files would be called alike. (A copy, which has another name, has the path of
    what was baked of the first.)"""
    return [other.detail_deform.baked_file for other in bpy.data.objects
            if other != ob and other.detail_deform.baked_file
            and files.folded(files.name_for(other.name)) == files.folded(name)]


@contextlib.contextmanager
def disk(path, what):
    """What the disk or a file refuses, as a sentence."""
    try:
        yield
    except OSError as error:
        raise MeshProblem(f"'{path}' can't be {what}: {files.reason(error, path)}.") from error
    except pc2.NotACache as error:
        raise MeshProblem(str(error)) from error


def point_count(path):
    """Of the cache there. Raises MeshProblem where it is none."""
    with disk(path, "read"):
        return pc2.read_header(absolute(path))[0]


def write(path, poses, start, end, whole=None):
    """Generator: writes a cache; yields the fraction done.

    poses: a generator of (n, 3) float32, one for each frame from start to end. whole: first and last frame of the
    cache, of which start to end are written now; None: these are all."""
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
