# SPDX-License-Identifier: GPL-3.0-or-later
"""F-curves and keyframes of actions, with and without action slots; saving and restoring what a pose overwrites."""

from typing import NamedTuple

import bpy
import numpy as np
from bpy.utils import unescape_identifier

_CHANNELS = ('location', 'rotation_euler', 'rotation_quaternion', 'rotation_axis_angle', 'scale')


def curves(action, slot=None):
    """[FCurve] of an action, of all its slots unless one is given."""
    return [curve for container in _containers(action, slot) for curve in container]


def _containers(action, slot=None):
    """[collection of FCurve]"""
    if not hasattr(action, 'layers') or not action.layers:  # before 4.4
        return [action.fcurves] if hasattr(action, 'fcurves') else []
    slots = [slot] if slot else list(action.slots)
    bags = [strip.channelbag(s) for layer in action.layers for strip in layer.strips for s in slots]
    return [bag.fcurves for bag in bags if bag]


def is_driven(owner, name):
    """Whether a driver sets this property, so that keyframes have no effect on it."""
    animation = owner.id_data.animation_data
    return bool(animation and animation.drivers.find(owner.path_from_id(name)))


def is_animated(owner, name):
    """Whether the active action or that of an NLA strip of _strips() has an F-curve for this property."""
    return is_path_animated(owner.id_data, owner.path_from_id(name))


def is_path_animated(data, path):
    """The same for a property of a data-block."""
    animation = data.animation_data
    owners = [animation, *_strips(animation)] if animation else ()
    played = {(owner.action, getattr(owner, 'action_slot', None)) for owner in owners if owner.action}
    return any(curve.data_path == path for action, slot in played for curve in curves(action, slot))


def remove_curves(owner, name):
    """Removes the F-curves of this property from the active action, unless others play that, too."""
    animation, path = owner.id_data.animation_data, owner.path_from_id(name)
    action = animation.action if animation else None
    if action is None or action.users > 1 + action.use_fake_user:
        return
    for container in _containers(action, getattr(animation, 'action_slot', None)):
        for curve in [curve for curve in container if curve.data_path == path]:
            container.remove(curve)


def keyframe_times(ob):
    """[float], sorted: the frames, possibly fractional, of all keyframes in an object's active action and NLA
    strips."""
    animation = ob.animation_data
    if not animation:
        return []
    found = set()
    if animation.action:
        found.update(_action_times(animation.action, getattr(animation, 'action_slot', None)))
    for strip in _strips(animation):
        found.update(_scene_times(strip, _action_times(strip.action, getattr(strip, 'action_slot', None))))
    return sorted(found)


def _action_times(action, slot):
    return {round(float(key.co.x), 3) for curve in curves(action, slot) for key in curve.keyframe_points}


def _strips(animation):
    """The unmuted NLA strips with an action: of the soloed track if there is one, else of all unmuted tracks."""
    tracks = [track for track in animation.nla_tracks if track.is_solo] or [
        track for track in animation.nla_tracks if not track.mute]
    return [strip for track in tracks for strip in track.strips if strip.action and not strip.mute]


def _scene_times(strip, of_action):
    """Generator: the scene frames at which an NLA strip plays these keyframe times of its action, with its repeats."""
    begin, end = strip.action_frame_start, strip.action_frame_end
    inside = [end + begin - time if strip.use_reverse else time for time in of_action if begin <= time <= end]
    length = (end - begin) * strip.scale
    for turn in range(int(np.ceil(strip.repeat))):
        for time in inside:
            at = strip.frame_start + turn * length + (time - begin) * strip.scale
            if at <= strip.frame_end + 1e-3:
                yield round(float(at), 3)


def insert_keyframes(owner, name, start, values):
    """Inserts a keyframe in each frame from start, and replaces those in that range. The property itself isn't set, as
    each assignment would trigger its update callback."""
    owner.keyframe_insert(name, frame=start)  # creates animation data, action, slot and curve where missing
    animation, path = owner.id_data.animation_data, owner.path_from_id(name)
    curve = next(curve for curve in curves(animation.action, getattr(animation, 'action_slot', None))
                 if curve.data_path == path)
    points = curve.keyframe_points
    for number in reversed(range(len(points))):
        if start <= points[number].co.x < start + len(values):
            points.remove(points[number], fast=True)
    for frame, value in enumerate(values, start):
        points.insert(frame, value, options={'FAST'})
    curve.update()


def single_pose_actions(actions, rig):
    """Generator of (action, frame): the actions with keyframes of bones in a single frame, at least one of which rig
    has."""
    for action in actions:
        keyed = [curve for curve in curves(action) if curve.data_path.startswith('pose.bones["')]
        frames = {round(float(key.co.x), 3) for curve in keyed for key in curve.keyframe_points}
        if len(frames) == 1 and any(curve.data_path.split('"')[1] in rig.pose.bones for curve in keyed):
            yield action, frames.pop()


class RestoredPose:
    """Context manager that saves transforms, pose channels and custom properties and restores them on exit, so that
    changes of frame and applied poses don't lose values without keyframes."""

    def __init__(self, scene, rigs=(), applied=()):
        """rigs: armature objects to save whether or not they are animated, beside all animated local objects. applied:
        actions that will be applied to rigs; all properties that they animate are saved too."""
        owners = {*rigs, *(ob for ob in scene.objects if ob.animation_data and not ob.library)}
        self._owners = [*owners, *(bone for ob in owners if ob.pose for bone in ob.pose.bones)]
        paths = dict.fromkeys(curve.data_path for action in applied for curve in curves(action))
        self._keyed = [found for rig in rigs for path in paths if (found := _property(rig, path))]

    def __enter__(self):
        self._values = [([tuple(getattr(owner, name)) for name in _CHANNELS], _own_numbers(owner))
                        for owner in self._owners]
        self._of_keyed = [prop.value() for prop in self._keyed]
        return self

    def __exit__(self, *_):
        self.restore()

    def restore(self):
        for prop, value in zip(self._keyed, self._of_keyed):
            if prop.value() != value:
                prop.set(value)
        for owner, (values, numbers) in zip(self._owners, self._values):
            for name, value in zip(_CHANNELS, values):
                if tuple(getattr(owner, name)) != value:
                    setattr(owner, name, value)
            for name, value in numbers.items():
                if owner.get(name) != value:
                    owner[name] = value


def _own_numbers(owner):
    """{name: value} of the numeric custom properties, such as the switches of a rig."""
    return {name: value for name, value in owner.items() if isinstance(value, (int, float))}


class _Property(NamedTuple):
    """The property that a data path refers to. is_own: whether it is a custom property."""
    owner: object
    name: str
    is_own: bool

    def value(self):
        found = self.owner[self.name] if self.is_own else getattr(self.owner, self.name)
        return found if isinstance(found, (bool, int, float, str, set)) else tuple(found)

    def set(self, value):
        if self.is_own:
            self.owner[self.name] = value
        else:
            setattr(self.owner, self.name, value)


def _property(ob, path):
    """The _Property at a data path; None where the path does not resolve."""
    is_own = path.endswith('"]')
    before, _, name = path[:-2].rpartition('["') if is_own else path.rpartition('.')
    try:
        found = _Property(ob.path_resolve(before) if before else ob, unescape_identifier(name), is_own)
        found.value()
    except (ValueError, KeyError, AttributeError, TypeError):
        return None
    return found


class DeselectedBones:
    """Context manager that deselects all bones of these armature objects: Blender applies a pose to the selected bones,
    or to all if none is selected."""

    def __init__(self, rigs):
        self._bones = [bone for rig in rigs for bone in _selectable(rig)]

    def __enter__(self):
        self._selected = [bone for bone in self._bones if bone.select]
        for bone in self._selected:
            bone.select = False

    def __exit__(self, *_):
        for bone in self._selected:
            bone.select = True


def _selectable(rig):
    return rig.pose.bones if bpy.app.version >= (5, 0) else rig.data.bones


def reset_pose(rig):
    """Sets the pose channels of all bones to the rest pose."""
    for bone in rig.pose.bones:
        bone.location, bone.scale = (0, 0, 0), (1, 1, 1)
        bone.rotation_euler, bone.rotation_quaternion = (0, 0, 0), (1, 0, 0, 0)
        bone.rotation_axis_angle = (0, 0, 1, 0)
