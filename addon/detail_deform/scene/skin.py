# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles on a mesh that an armature poses. The deformation comes before the armature, as a shape key does, so handles
move in the space of the unposed mesh, while their empties stand on the posed surface and are parented to bones."""

import numpy as np

from . import deform_modifier, mesh_data, posers
from .mesh_data import MeshProblem


def _armatures(ob):
    """[modifier]: the Armature modifiers after the deformation, except those disabled in both viewport and renders, as
    after examples have been made of their poses."""
    return [m for m in deform_modifier.after(ob) if m.type == 'ARMATURE' and m.object and m.use_vertex_groups
            and (m.show_viewport or m.show_render)]


def is_plain(ob, modifier):
    """Whether the modifier is plain linear blend skinning by vertex groups, of the whole mesh."""
    return modifier in _armatures(ob) and not (
        modifier.use_multi_modifier or modifier.vertex_group or modifier.use_deform_preserve_volume
        or modifier.use_bone_envelopes)


class Rigs:
    """Looks up which bones pose which vertices. An armature's groups are read once, at the first call."""

    def __init__(self, ob):
        self._ob, self._weights = ob, {}  # {armature object: (bone names, (bones, n) weights or None)}

    def of(self, chosen):
        """(armature object, {bone name: mean weight > 0}) of the first shown armature with weights on the chosen
        vertices; (None, {}) if there is none. chosen: (n,) bool or vertex indices."""
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


def bone_motion(ob, rig, bone, depsgraph):
    """(4, 4) float64: the motion of a bone from rest to its pose, in the object's local space."""
    evaluated = rig.evaluated_get(depsgraph)
    pose, rest = evaluated.pose.bones[bone].matrix, evaluated.data.bones[bone].matrix_local
    space = np.linalg.inv(np.array(ob.evaluated_get(depsgraph).matrix_world, np.float64)) @ np.array(
        evaluated.matrix_world, np.float64)
    return space @ np.array(pose, np.float64) @ np.linalg.inv(np.array(rest, np.float64)) @ np.linalg.inv(space)


def mean_bone_motion(ob, rig, means, depsgraph):
    """(4, 4): the mean of the bones' motions by their weights (linear blend skinning). means: of Rigs.of()."""
    total = sum(means.values())
    return sum(mean / total * bone_motion(ob, rig, bone, depsgraph) for bone, mean in means.items())


def bone_motion_of(ob, empty, depsgraph):
    """(4, 4) float64: the motion of the bone that carries this empty, if its armature poses the mesh; otherwise the
    identity. Raises MeshProblem if the bone no longer exists."""
    return _bone_motion_by(ob, empty, _armatures(ob), depsgraph)


def former_bone_motion_of(ob, empty, depsgraph):
    """bone_motion_of() with the disabled armatures from whose poses examples were made."""
    shown = _armatures(ob)
    return _bone_motion_by(ob, empty, [m for m in posers.remembered(ob)
                                       if m.type == 'ARMATURE' and m not in shown], depsgraph)


def _bone_motion_by(ob, empty, armatures, depsgraph):
    rig = empty.parent
    if empty.parent_type != 'BONE' or rig is None or all(m.object != rig for m in armatures):
        return np.eye(4)
    if empty.parent_bone not in rig.data.bones:
        raise MeshProblem(f"The bone '{empty.parent_bone}' of '{rig.name}', which carries the empty '{empty.name}', is "
                          "gone: parent the empty to another one, and bind again.")
    return bone_motion(ob, rig, empty.parent_bone, depsgraph)
