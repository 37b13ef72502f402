# SPDX-License-Identifier: GPL-3.0-or-later
"""Evaluated world transforms of objects, and whether an object is in the scene at all."""

import bpy
import numpy as np

from .mesh_data import MeshProblem


def in_scene(ob, depsgraph):
    """Whether the object belongs to the depsgraph's scene and is evaluated there. An object that is only referred to is
    evaluated too, but its transform then is meaningless."""
    return ObjectPresence(depsgraph).is_in_scene(ob)


class ObjectPresence:
    """Whether objects are in the scene, or deleted. For many at once: sets of all objects are built once, if needed."""

    def __init__(self, depsgraph):
        self._depsgraph, self._in_scene, self._anywhere = depsgraph, None, None

    def is_in_scene(self, ob):
        """As in_scene()."""
        layer = self._depsgraph.view_layer
        if not ob.evaluated_get(self._depsgraph).is_evaluated:
            return False
        # Fast and nearly always sufficient; the last test below goes through all objects.
        if ob.visible_get(view_layer=layer) or ob.hide_get(view_layer=layer):
            return True
        if self._in_scene is None:
            self._in_scene = set(self._depsgraph.scene.objects)
        return ob in self._in_scene

    def is_deleted(self, empty):
        """Whether an empty was deleted: from the file, or from all collections while references keep the data-block."""
        if empty is None:
            return True
        if self.is_in_scene(empty):
            return False
        if self._anywhere is None:
            collections = (*bpy.data.collections, *(scene.collection for scene in bpy.data.scenes))
            self._anywhere = {ob for collection in collections for ob in collection.objects}
        return empty not in self._anywhere


def evaluated_world(ob, depsgraph, what):
    return evaluated_worlds([(ob, what)], depsgraph)[0]


def evaluated_worlds(named, depsgraph, is_absent=None):
    """(k, 4, 4) float64: evaluated world matrices. named: [(object, what messages call it)]. is_absent: (k,) bool,
    whether each is not in_scene(), if known. Raises MeshProblem."""
    rows = []
    for number, (ob, what) in enumerate(named):
        if is_absent[number] if is_absent is not None else not in_scene(ob, depsgraph):
            raise MeshProblem(f"{what} '{ob.name}' is not in this scene, or is disabled or excluded so that "
                              "its place is not known: bring it back, or choose another one.")
        world = ob.evaluated_get(depsgraph).matrix_world
        rows += (*world[0], *world[1], *world[2], *world[3])  # numpy converts a Matrix far more slowly
    worlds = np.array(rows, np.float64).reshape(-1, 4, 4)
    for number in np.flatnonzero(~np.isfinite(worlds).all(axis=(1, 2))):
        ob, what = named[number]
        raise MeshProblem(f"{what} '{ob.name}' has a location, rotation or scale that is not a finite number: set it "
                          "anew, or look at what moves it.")
    return worlds


def are_singular(matrices):
    """(...) bool: which of these have a singular linear part: |det| < 1e-30, as of a scale of 1e-10. Safety before
    an inverse; a scale of 1e-6 is a legal, if odd, unit."""
    with np.errstate(invalid='ignore'):  # NaN passes here: the result shows it
        return np.abs(np.linalg.det(matrices[..., :3, :3])) < 1e-30


def inverse_or_refuse(matrix, sentence):
    if are_singular(matrix):
        raise MeshProblem(sentence)
    return np.linalg.inv(matrix)


def world_to_local(ob, depsgraph):
    """(4, 4): the inverse of the object's evaluated world matrix. Raises MeshProblem where it is singular."""
    return inverse_or_refuse(evaluated_world(ob, depsgraph, "Object"),
                              f"'{ob.name}' has a scale of zero: give it a size.")
