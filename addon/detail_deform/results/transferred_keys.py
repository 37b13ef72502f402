# SPDX-License-Identifier: GPL-3.0-or-later
"""The source's pose and shape keys, carried over as shape keys."""

import fnmatch

import bpy

from ..scene import mesh_data, source_pose, transferred
from ..scene.mesh_data import MeshProblem
from . import frames

_POSE_NAME = "{} Pose"


def chosen(source, active_only, pattern):
    """The source's shape keys beside its basis. Raises MeshProblem when there is none."""
    blocks = mesh_data.relative_keys(source)
    if not blocks:
        raise MeshProblem(f"'{source.name}' has no shape keys to transfer: choose Current Pose, or another source.")
    if active_only:
        if source.active_shape_key in blocks:
            return [source.active_shape_key]
        raise MeshProblem(f"The active shape key of '{source.name}' is its basis: choose another one.")
    fitting = [key for key in blocks if key.name == pattern
               or fnmatch.fnmatchcase(key.name.lower(), (pattern or '*').lower())]
    if not fitting:
        raise MeshProblem(f"'{source.name}' has no shape key whose name fits '{pattern}': choose other Keys.")
    return fitting


def _offsets(prepared, target, poses, count, rotation_only):
    """Generator: the offsets of the target for each of the source's poses into a list, which it returns; yields
    the fraction done. Nothing is changed before all are there."""
    if target.data.shape_keys and not target.data.shape_keys.use_relative:
        raise MeshProblem(f"'{target.name}' has absolute shape keys, which can't be added to: "
                          "make them relative first.")
    rest, offsets = mesh_data.rest(target.data), []
    for number, pose in enumerate(poses, 1):
        offsets.append(prepared.apply(pose, rotation_only) - rest)
        yield number / count
    return offsets


def from_pose(context, prepared, source, target, rotation_only, replace):
    """Generator: the source's present pose as a shape key that is shown; yields the fraction done and returns
    the key's name."""
    frames.settle(context, source)
    pose = source_pose.evaluated_pose(source, context.evaluated_depsgraph_get())
    offsets, = yield from _offsets(prepared, target, [pose], 1, rotation_only)
    key = transferred.put_key(target, _POSE_NAME.format(source.name), offsets, replace)
    key.value = 1
    target.data.update_tag()
    return [key.name]


def from_keys(prepared, source, target, keys, rotation_only, replace, drivers):
    """Generator: shape keys with the names, ranges and values of the source's; yields the fraction done and
    returns their names."""
    poses = (mesh_data.key_shape(source.data, key) for key in keys)
    offsets = yield from _offsets(prepared, target, poses, len(keys), rotation_only)
    names = []
    for key, of_key in zip(keys, offsets):
        copy = transferred.put_key(target, key.name, of_key, replace)
        for prop in ('slider_max', 'slider_min', 'slider_max'):  # one can't pass the other
            setattr(copy, prop, getattr(key, prop))
        copy.value, copy.mute = key.value, key.mute
        copy.vertex_group = key.vertex_group if key.vertex_group in target.vertex_groups else ""
        names.append(copy.name)
        if drivers:
            _copy_drivers(source.data.shape_keys, key.name, target.data.shape_keys, copy.name)
    target.data.update_tag()
    return names


def _copy_drivers(source_keys, name, target_keys, copy_name):
    """Those of a key's value and range. What they read from the source's own keys stays there."""
    animation = source_keys.animation_data
    if animation is None:
        return

    def path_of(key_name, prop):
        return f'key_blocks["{bpy.utils.escape_identifier(key_name)}"].{prop}'

    for prop in ('value', 'slider_min', 'slider_max', 'mute'):
        curve = animation.drivers.find(path_of(name, prop))
        if curve is None:
            continue
        if target_keys.animation_data is None:
            target_keys.animation_data_create()
        path = path_of(copy_name, prop)
        present = target_keys.animation_data.drivers.find(path)
        if present:
            target_keys.animation_data.drivers.remove(present)
        target_keys.animation_data.drivers.from_existing(src_driver=curve).data_path = path
