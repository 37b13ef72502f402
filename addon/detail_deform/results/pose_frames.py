# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses of a mesh: in frames, at keyframes, at markers, in a pose library; and its shape in each of them."""

from typing import NamedTuple

import bpy
import numpy as np

from ..scene import actions, posers
from ..scene.mesh_data import MeshProblem
from . import frames


class Pose(NamedTuple):
    """name: of the frame, marker or action. action: the name of an action that is the pose; '': the scene at frame."""
    name: str
    frame: float
    action: str = ""


def in_range(start, end, step):
    frames.check_range(start, end)
    return [Pose(f"Frame {frame}", frame) for frame in range(start, end + 1, step)]


def at_keys(ob):
    """[Pose] at the keyframes of the objects that its posing modifiers refer to, or else of its own. Raises MeshProblem
    if there are none."""
    carriers = list(dict.fromkeys(m.object for m in posers.of(ob) if getattr(m, 'object', None)))
    found = sorted({time for carrier in carriers
                    for time in actions.keyframe_times(carrier)}) or actions.keyframe_times(ob)
    if not found:
        names = ', '.join(f"'{carrier.name}'" for carrier in (*carriers, ob))
        raise MeshProblem(f"No action of {names} has keys: choose a range of frames, or those that differ most.")
    return [Pose(f"Frame {time:g}", time) for time in found]


def at_markers(scene):
    """[Pose] at the timeline's markers. Raises MeshProblem if there are none."""
    markers = sorted(scene.timeline_markers, key=lambda marker: marker.frame)
    if not markers:
        raise MeshProblem("The timeline has no markers: set one at each pose, or choose a range of frames.")
    return [Pose(marker.name, marker.frame) for marker in markers]


def in_library(ob):
    """[Pose] of the file's actions that are one pose of its armatures. Raises MeshProblem if there are none."""
    found = [Pose(action.name, frame, action.name) for rig in posers.rigs(ob)
             for action, frame in actions.single_pose_actions(bpy.data.actions, rig)]
    if not found:
        raise MeshProblem(f"This file has no action with one pose of what poses '{ob.name}': make poses in the pose "
                          "library, or choose a range of frames.")
    return list(dict.fromkeys(found))


def walk(context, ob, poses):
    """Generator of (n, 3) float32: the mesh in each pose, evaluated with only the modifiers that pose it (posers.py).
    Restores frame, poses, selection and modifiers at the end. Raises MeshProblem."""
    rigs, taken = posers.rigs(ob), [_action(pose) for pose in poses if pose.action]
    try:
        with (actions.RestoredPose(context.scene, rigs, taken) as unkeyed, actions.DeselectedBones(rigs),
              frames.RestoredFrame(context.scene), posers.OnlyPosers(ob) as alone):
            for pose in poses:
                if pose.action:
                    unkeyed.restore()  # removes what the pose before has set
                _go_to(context, pose, rigs)
                positions = alone.pose(context.evaluated_depsgraph_get())
                if not np.isfinite(positions).all():
                    raise MeshProblem(f"'{pose.name}': the pose of '{ob.name}' has a coordinate that is not finite: "
                                      "look at what poses it there.")
                yield positions
    finally:
        context.view_layer.update()


def _action(pose):
    found = bpy.data.actions.get(pose.action)
    if not found:
        raise MeshProblem(f"There is no action '{pose.action}' any more: name it so again, or press Find Missing to "
                          "list the poses anew.")
    return found


def _go_to(context, pose, rigs):
    if not pose.action:
        whole = int(np.floor(pose.frame))
        context.scene.frame_set(whole, subframe=min(pose.frame - whole, 0.999))
        return
    for rig in rigs:
        actions.reset_pose(rig)
        rig.pose.apply_pose_from_action(_action(pose), evaluation_time=pose.frame)
    context.view_layer.update()
