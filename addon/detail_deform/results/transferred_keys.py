# SPDX-License-Identifier: GPL-3.0-or-later
"""Transfers the source's pose and shape keys as shape keys."""

import fnmatch

import bpy

from ..follow import messages
from ..library import native
from ..scene import display_key, mesh_data, source_pose, transferred
from ..scene.mesh_data import MeshProblem
from . import frames, key_names
from .outcome import Outcome, listed, reasons

_POSE_NAME = "{} Pose"


def chosen(source, active_only, pattern):
    """The active shape key of the source, or those whose names fit the pattern; never its basis. Raises MeshProblem if
    there is none."""
    blocks = mesh_data.relative_keys(source)
    if not blocks:
        raise MeshProblem(f"'{source.name}' has no shape keys to transfer: choose Current Pose, or another source.")
    if active_only:
        if source.active_shape_key in blocks:
            return [source.active_shape_key]
        raise MeshProblem(f"The active shape key of '{source.name}' is its basis, or the one that shows Detail Deform: "
                          "choose another one.")
    fitting = [key for key in blocks if key.name == pattern
               or fnmatch.fnmatchcase(key.name.lower(), (pattern or '*').lower())]
    if not fitting:
        raise MeshProblem(f"'{source.name}' has no shape key whose name fits '{pattern}': choose other Keys.")
    return fitting


def check(target):
    """Raises MeshProblem if shape keys can't be added."""
    if target.data.shape_keys and not target.data.shape_keys.use_relative:
        raise MeshProblem(f"'{target.name}' has absolute shape keys, which can't be added to: "
                          "make them relative first.")


def _offset(prepared, target, pose, rotation_only):
    return prepared.apply(pose, rotation_only) - mesh_data.rest_positions(target.data)


def from_pose(context, prepared, source, target, request):
    """Generator: transfers the source's present pose as a shape key with the value 1; yields the fraction done and
    returns the Outcome."""
    frames.settle(context, source)
    pose = source_pose.evaluated_pose(source, context.evaluated_depsgraph_get(), prepared.wide)
    offsets = _offset(prepared, target, pose, request.settings.rotation_only)
    yield 1.0
    name = _POSE_NAME.format(source.name)
    origin = _origin(source, None, name)
    of_target = transferred.KeyWriter(target)
    key, _ = of_target.put(origin, offsets, request.replace)
    of_target.record(key, **origin)
    of_target.finish()
    key.value = 1
    target.data.update_tag()
    return Outcome([key.name], remarks=_remarks_on_renamed(target, {name: key.name}))


def _origin(source, key, name):
    """The origin for transferred.KeyWriter.put(). key: None for a pose."""
    return {'source': source.name, 'key': key and key.name, 'name': name}


def from_keys(prepared, source, target, keys, request):
    """Generator: transfers shape keys with their names, ranges and values; yields the fraction done and returns the
    Outcome. A present key that gets a new shape keeps its value, drivers and animation, and its range and group if the
    user has changed them. Nothing is changed before all shapes are computed."""
    present = target.data.shape_keys
    there = [key.name for key in present.key_blocks if key != present.reference_key] if present else []
    target_names = key_names.target_names([key.name for key in keys], there, request.names, request.alike_names)
    offsets, left_out = yield from _shapes(prepared, source, target, keys, target_names, request.settings.rotation_only)
    made, others, user_changes = {}, [], {'range': [], 'vertex group': []}
    of_target = transferred.KeyWriter(target)
    try:
        for key in keys:
            if key.name not in offsets:
                continue
            name = target_names[key.name]
            origin = _origin(source, key, name)
            copy, given = of_target.put(origin, offsets[key.name], request.replace)
            if given and (given.get('source'), given.get('key')) != (source.name, key.name):
                others.append(copy.name)
            of_target.record(copy, **origin, **_copy_settings(target, key, copy, given, user_changes))
            if request.drivers:
                _copy_drivers(source.data.shape_keys, key.name, target.data.shape_keys, copy.name,
                              keep=given is not None)
            made[name] = copy.name
    finally:
        of_target.finish()
    target.data.update_tag()
    remarks = _remarks_on_renamed(target, made)
    if others:
        remarks.append(f"Got another shape than before, of another key or source: {listed(others)}.")
    remarks += [f"Kept as it was changed here: {what} of {listed(names)}."
                for what, names in user_changes.items() if names]
    remarks += _remarks_on_left(source, target, offsets.keys(), set(made.values()))
    if request.what == 'ALL_KEYS':
        remarks += _remarks_on_orphans(source, target)
    return Outcome(list(made.values()), left_out=left_out, remarks=remarks)


def _shapes(prepared, source, target, keys, target_names, rotation_only):
    """Generator: yields the fraction done and returns ({key's name: offsets}, {key's name: why it has none}).
    target_names: of key_names.target_names(). Raises MeshProblem if no key has offsets."""
    offsets, left_out = {}, {}
    # The target's key gets the group's name as its own mask where the target has such a group. Only masks by other
    # groups are applied to the shape before it is transferred.
    masks = mesh_data.key_masks(source, [key for key in keys if key.vertex_group not in target.vertex_groups])
    for number, key in enumerate(keys, 1):
        try:
            if target_names[key.name] is None:
                left_out[key.name] = "another key goes to the one of that name here"
            else:
                shape = mesh_data.key_shape(source, key, masks)
                source_pose.check_extent(source, shape)
                offsets[key.name] = _offset(prepared, target, shape, rotation_only)
        except (MeshProblem, native.NativeError) as error:
            left_out[key.name] = messages.sentence(error).rstrip('.')
        yield number / len(keys)
    if not offsets:
        raise MeshProblem(f"No shape key could be transferred: {reasons(left_out)}.")
    return offsets, left_out


def _copy_settings(target, key, copy, given, user_changes):
    """Sets a copy's range and vertex group, and a new copy's value and mute; returns the source's range and group.
    given: what the copy was given before; None for a new one. Range or group that differ from given are the user's:
    they stay, and the copy's name is added to user_changes."""
    theirs = {'range': [key.slider_min, key.slider_max],
              'vertex group': key.vertex_group if key.vertex_group in target.vertex_groups else ""}
    ours = {'range': [copy.slider_min, copy.slider_max], 'vertex group': copy.vertex_group}
    for what in theirs:
        if given is None or ours[what] == given.get(what):
            _SETTERS[what](copy, theirs[what])
        elif ours[what] != theirs[what]:
            user_changes[what].append(copy.name)
    if given is None:
        copy.value, copy.mute = key.value, key.mute
    return theirs


def _set_range(key, ends):
    key.slider_max = ends[1]
    key.slider_min = ends[0]
    key.slider_max = ends[1]  # again: neither can pass the other


def _set_group(key, name):
    key.vertex_group = name


_SETTERS = {'range': _set_range, 'vertex group': _set_group}


def _remarks_on_renamed(target, made):
    """Remarks on keys that have another name than requested, because the target has a key of its own with that one.
    made: {requested name: actual}"""
    there = {key.name for key in display_key.others(target.data)} - set(made.values())
    others = [f"'{made[name]}' beside '{name}'" for name in made if made[name] != name and name in there]
    return [f"Made beside keys of its own, which Replace would take: {', '.join(others)}."] if others else []


def _of_source(source, target):
    """{name of the target's key: name of the source's} of the keys that were transferred from this source."""
    return {name: given['key'] for name, given in transferred.transferred_keys(target).items()
            if given.get('source') == source.name and given.get('key')}


def _remarks_on_left(source, target, keys, made):
    """Remarks on keys that were transferred under other names before. keys: names of the source's that were
    transferred now. made: names of the target's that they went to."""
    left = [name for name, key in _of_source(source, target).items() if key in keys and name not in made]
    return [f"Left as they are, for what they were made of has another name here now: {listed(left)}. Remove them, or "
            "set their values to 0."] if left else []


def _remarks_on_orphans(source, target):
    there = set(source.data.shape_keys.key_blocks.keys())
    gone = [name for name, key in _of_source(source, target).items() if key not in there]
    return [f"Left as they are, for '{source.name}' has them no more: {listed(gone)}."] if gone else []


def _copy_drivers(source_keys, name, target_keys, copy_name, keep):
    """Copies the drivers of a key's value, range and mute. Variables that read the source's keys still do. keep:
    present drivers stay, as the user may have changed them."""
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
        if present and keep:
            continue
        if present:
            target_keys.animation_data.drivers.remove(present)
        target_keys.animation_data.drivers.from_existing(src_driver=curve).data_path = path
