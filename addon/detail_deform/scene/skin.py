# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles on a mesh that an armature poses. The deformation comes before the armature, as a shape key does, so a handle
counts in the space of the mesh at rest; its empty stands on the posed surface, and goes with a bone."""

import numpy as np

from . import mesh_data, node_group


def armature(ob):
    """The armature object that poses what the deformation makes, or None."""
    modifiers = list(ob.modifiers)
    ours = node_group.find_modifier(ob)
    behind = modifiers[modifiers.index(ours) + 1:] if ours else modifiers
    return next((m.object for m in behind if m.type == 'ARMATURE' and m.object and m.show_viewport
                 and m.use_vertex_groups), None)


def weights(ob, rig, chosen):
    """{bone name: mean weight of the chosen vertices} of those bones that pose them. chosen: (n,) bool."""
    names = [bone.name for bone in rig.data.bones if bone.use_deform and bone.name in ob.vertex_groups]
    if not names:
        return {}
    means = mesh_data.group_weights(ob, names)[:, chosen].mean(axis=1)
    return {name: float(mean) for name, mean in zip(names, means) if mean > 0}


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
    """(4, 4) float64: by which the bone that carries this empty moves the mesh; nothing where none does."""
    rig = empty.parent
    if empty.parent_type != 'BONE' or rig is None or rig != armature(ob) or empty.parent_bone not in rig.data.bones:
        return np.eye(4)
    return motion(ob, rig, empty.parent_bone, depsgraph)
