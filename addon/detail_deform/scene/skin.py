# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles on a mesh that an armature poses. The deformation comes before the armature, as a shape key does, so a handle
counts in the space of the mesh at rest; its empty stands on the posed surface, and goes with a bone."""

import numpy as np

from . import mesh_data, node_group, posers
from .mesh_data import MeshProblem


def _armatures(ob):
    """Those that pose what the deformation makes, shown in the viewport or not; one that is hidden in renders too is
    switched off, as where its poses have become examples."""
    return [m for m in node_group.behind(ob) if m.type == 'ARMATURE' and m.object and m.use_vertex_groups
            and (m.show_viewport or m.show_render)]


def is_plain(ob, modifier):
    """Whether the modifier blends the motions of bones by their weights, and nothing else."""
    return modifier in _armatures(ob) and not (
        modifier.use_multi_modifier or modifier.vertex_group or modifier.use_deform_preserve_volume
        or modifier.use_bone_envelopes)


class Rigs:
    """Whose bones pose which vertices of an object: its groups are read once, when they are first asked for."""

    def __init__(self, ob):
        self._ob, self._weights = ob, {}  # by armature object: names of bones, and their weights

    def of(self, chosen):
        """(armature object, {bone name: mean weight}) of the first that is seen to pose the chosen vertices, of the
        bones that do; None and nothing. chosen: (n,) bool or the vertices."""
        for modifier in _armatures(self._ob):
            means = self._means(modifier.object, chosen) if modifier.show_viewport else {}
            if means:
                return modifier.object, means
        return None, {}

    def _means(self, rig, chosen):
        if rig not in self._weights:
            names = [bone.name for bone in rig.data.bones if bone.use_deform and bone.name in self._ob.vertex_groups]
            self._weights[rig] = names, mesh_data.group_weights(self._ob, names) if names else None
        names, weights = self._weights[rig]
        if not names:
            return {}
        return {name: float(mean) for name, mean in zip(names, weights[:, chosen].mean(axis=1)) if mean > 0}


def motion(ob, rig, bone, depsgraph):
    """(4, 4) float64: by which a bone's pose moves the mesh, in the object's own space."""
    evaluated = rig.evaluated_get(depsgraph)
    pose, rest = evaluated.pose.bones[bone].matrix, evaluated.data.bones[bone].matrix_local
    space = np.linalg.inv(np.array(ob.evaluated_get(depsgraph).matrix_world, np.float64)) @ np.array(
        evaluated.matrix_world, np.float64)
    return space @ np.array(pose, np.float64) @ np.linalg.inv(np.array(rest, np.float64)) @ np.linalg.inv(space)


def mean_motion(ob, rig, means, depsgraph):
    """(4, 4): of bones by their weights, as the armature blends them."""
    total = sum(means.values())
    return sum(mean / total * motion(ob, rig, bone, depsgraph) for bone, mean in means.items())


def pose_of(ob, empty, depsgraph):
    """(4, 4) float64: by which the bone that carries this empty moves the mesh; nothing where none does. Raises
    MeshProblem."""
    return _pose_of(ob, empty, _armatures(ob), depsgraph)


def pose_that_was(ob, empty, depsgraph):
    """The same of an armature that is switched off, as examples have been made of its poses."""
    shown = _armatures(ob)
    return _pose_of(ob, empty, [m for m in posers.remembered(ob) if m.type == 'ARMATURE' and m not in shown], depsgraph)


def _pose_of(ob, empty, armatures, depsgraph):
    rig = empty.parent
    if empty.parent_type != 'BONE' or rig is None or all(m.object != rig for m in armatures):
        return np.eye(4)
    if empty.parent_bone not in rig.data.bones:
        raise MeshProblem(f"The bone '{empty.parent_bone}' of '{rig.name}', which carries the empty '{empty.name}', is "
                          "gone: parent the empty to another one, and bind again.")
    return motion(ob, rig, empty.parent_bone, depsgraph)
