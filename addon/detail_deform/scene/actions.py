# SPDX-License-Identifier: GPL-3.0-or-later
"""What actions key, in Blenders with slots and without, and what they would overwrite."""

from typing import NamedTuple

import bpy
import numpy as np
from bpy.utils import unescape_identifier

_CHANNELS = ('location', 'rotation_euler', 'rotation_quaternion', 'rotation_axis_angle', 'scale')


def curves(action, slot=None):
    """The F-curves of an action, of one slot alone where that is given."""
    if not hasattr(action, 'layers') or not action.layers:  # before 4.4
        return list(getattr(action, 'fcurves', ()))
    slots = [slot] if slot else list(action.slots)
    bags = [strip.channelbag(s) for layer in action.layers for strip in layer.strips for s in slots]
    return [curve for bag in bags if bag for curve in bag.fcurves]


def is_driven(owner, name):
    """Whether a driver sets this property, which then no key does."""
    animation = owner.id_data.animation_data
    return bool(animation and animation.drivers.find(owner.path_from_id(name)))


def is_keyed(owner, name):
    """Whether keys of an action, or of one that is played by a strip, set this property."""
    animation, path = owner.id_data.animation_data, owner.path_from_id(name)
    found = [animation.action, *(strip.action for strip in _strips(animation))] if animation else ()
    return any(curve.data_path == path for action in found if action for curve in curves(action))


def times(ob):
    """The frames, not all whole, at which an object's action has keys, or those that its strips play, in order."""
    animation = ob.animation_data
    if not animation:
        return []
    found = set()
    if animation.action:
        found.update(_times(animation.action, getattr(animation, 'action_slot', None)))
    for strip in _strips(animation):
        found.update(_times_in(strip, _times(strip.action, getattr(strip, 'action_slot', None))))
    return sorted(found)


def _times(action, slot):
    return {round(float(key.co.x), 3) for curve in curves(action, slot) for key in curve.keyframe_points}


def _strips(animation):
    """Of the nonlinear animation, those that count: of all tracks but muted ones, or of the one that is alone."""
    tracks = [track for track in animation.nla_tracks if track.is_solo] or [
        track for track in animation.nla_tracks if not track.mute]
    return [strip for track in tracks for strip in track.strips if strip.action and not strip.mute]


def _times_in(strip, of_action):
    """When a strip plays these times of its action."""
    begin, end = strip.action_frame_start, strip.action_frame_end
    inside = [end + begin - time if strip.use_reverse else time for time in of_action if begin <= time <= end]
    length = (end - begin) * strip.scale
    for turn in range(int(np.ceil(strip.repeat))):
        for time in inside:
            at = strip.frame_start + turn * length + (time - begin) * strip.scale
            if at <= strip.frame_end + 1e-3:
                yield round(float(at), 3)


def key(owner, name, start, values):
    """Keys a property with a value in each frame from start, in place of the keys that are there. The property itself
    isn't set, which would bring what goes by it up to date for each."""
    owner.keyframe_insert(name, frame=start)  # makes what is missing up to the curve
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


def poses(actions, rig):
    """(action, frame) of those that are one pose which the armature object can take."""
    for action in actions:
        keyed = [curve for curve in curves(action) if curve.data_path.startswith('pose.bones["')]
        frames = {round(float(key.co.x), 3) for curve in keyed for key in curve.keyframe_points}
        if len(frames) == 1 and any(curve.data_path.split('"')[1] in rig.pose.bones for curve in keyed):
            yield action, frames.pop()


class Unkeyed:
    """While it lasts frames may be gone to and poses taken: places and poses that are in no key come back."""

    def __init__(self, scene, rigs=(), taken=()):
        """rigs: armature objects that are posed by more than their animation. taken: actions that these take poses
        of, which may key anything."""
        owners = {*rigs, *(ob for ob in scene.objects if ob.animation_data and not ob.library)}
        self._owners = [*owners, *(bone for ob in owners if ob.pose for bone in ob.pose.bones)]
        paths = dict.fromkeys(curve.data_path for action in taken for curve in curves(action))
        self._keyed = [found for rig in rigs for path in paths if (found := _property(rig, path))]

    def __enter__(self):
        self._values = [([tuple(getattr(owner, name)) for name in _CHANNELS], _own_numbers(owner))
                        for owner in self._owners]
        self._of_keyed = [prop.value() for prop in self._keyed]
        return self

    def __exit__(self, *_):
        self.put_back()

    def put_back(self):
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
    """The custom properties by which rigs are switched."""
    return {name: value for name, value in owner.items() if isinstance(value, (int, float))}


class _Property(NamedTuple):
    """What a data path leads to. is_own: a custom property."""
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
    """None where the object has none there."""
    is_own = path.endswith('"]')
    before, _, name = path[:-2].rpartition('["') if is_own else path.rpartition('.')
    try:
        found = _Property(ob.path_resolve(before) if before else ob, unescape_identifier(name), is_own)
        found.value()
    except (ValueError, KeyError, AttributeError, TypeError):
        return None
    return found


class Unselected:
    """While it lasts no bone of these armature objects is selected: poses reach the selected ones alone, and all where
    there are none."""

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


def reset(rig):
    """Puts all bones of an armature object to rest."""
    for bone in rig.pose.bones:
        bone.location, bone.scale = (0, 0, 0), (1, 1, 1)
        bone.rotation_euler, bone.rotation_quaternion = (0, 0, 0), (1, 0, 0, 0)
        bone.rotation_axis_angle = (0, 0, 1, 0)
