# SPDX-License-Identifier: GPL-3.0-or-later
"""The deformation of one mesh carried over to another: its pose, its shape keys, its animation."""

import fnmatch

import numpy as np

from . import apply_result, bake, mesh_data, native_transfer, node_group, pc2
from .mesh_data import MeshProblem

POSE_NAME = "{} Pose"
CACHE_NAME = "Detail Deform Transfer"


def prepare(source, target, matched, anchor, anchor_group, precision='DOUBLE'):
    """The factored transfer of these objects. anchor: as in transfer_settings. Raises MeshProblem or native.NativeError."""
    anchors = ()
    if anchor in {'VERTICES', 'PINNED'}:
        if anchor_group not in target.vertex_groups:
            raise MeshProblem(f"'{target.name}' has no vertex group '{anchor_group}': choose the group of the "
                              "vertices that stay in place (Anchor).")
        anchors = np.flatnonzero(mesh_data.members(target, anchor_group))
        if not len(anchors):
            raise MeshProblem(f"The group '{anchor_group}' has no vertex with a weight over "
                              f"{mesh_data.MEMBER_WEIGHT}: assign those that stay in place.")
    return native_transfer.Transfer(
        (mesh_data.positions(source.data), matched.source_triangles),
        (mesh_data.positions(target.data), matched.target_triangles),
        matched.pairs, matched.pairs_of, anchor=anchor, anchors=anchors, precision=precision)


def remarks(transfer):
    """What the user may not expect of these meshes, in sentences."""
    info = transfer.info
    if info.unmatched_part_count:
        yield (f"{info.unmatched_part_count} loose part(s) of the target (such as that of vertex "
               f"{info.unmatched_part_example}) correspond to nothing and go with the rest.")
    elif info.unmatched_count:
        yield (f"{info.unmatched_count:,} triangles of the target correspond to nothing and go with the nearest "
               "that do.")
    if info.degenerate_count:
        yield f"{info.degenerate_count:,} triangles of the target have next to no area."


def evaluated_pose(source, depsgraph):
    """(n, 3) float32: what the source's modifiers and shape keys make of it now. Raises MeshProblem."""
    mesh = source.evaluated_get(depsgraph).data
    if len(mesh.vertices) != len(source.data.vertices):
        raise MeshProblem(
            f"The modifiers of '{source.name}' make {len(mesh.vertices):,} vertices of its {len(source.data.vertices):,}: "
            "hide those that don't only move vertices.")
    return mesh_data.positions(mesh)


# Shape keys

def chosen_keys(source, active_only, pattern):
    """The source's shape keys beside its basis. Raises MeshProblem when there is none."""
    keys = source.data.shape_keys
    if keys is None or len(keys.key_blocks) < 2:
        raise MeshProblem(f"'{source.name}' has no shape keys to transfer.")
    if not keys.use_relative:
        raise MeshProblem(f"'{source.name}' has absolute shape keys: make them relative first.")
    blocks = [key for key in keys.key_blocks if key != keys.reference_key]
    if active_only:
        if source.active_shape_key in blocks:
            return [source.active_shape_key]
        raise MeshProblem(f"The active shape key of '{source.name}' is its basis: choose another one.")
    chosen = [key for key in blocks if fnmatch.fnmatchcase(key.name, pattern or '*')]
    if not chosen:
        raise MeshProblem(f"'{source.name}' has no shape key whose name fits '{pattern}'.")
    return chosen


def _transferred(transfer, target, poses, count, rotation_only):
    """Generator: the offsets of the target for each of the source's poses into a list, which it returns; yields
    the fraction done. Nothing is changed before all are there."""
    if target.data.shape_keys and not target.data.shape_keys.use_relative:
        raise MeshProblem(f"'{target.name}' has absolute shape keys, which can't be added to: make them relative first.")
    rest, offsets = mesh_data.positions(target.data), []
    for number, pose in enumerate(poses, 1):
        offsets.append(transfer.apply(pose, rotation_only) - rest)
        yield number / count
    return offsets


def _put_key(target, name, offsets, replace):
    """A new key of that name, or, with replace, the present one with another shape."""
    keys = target.data.shape_keys
    present = keys and keys.key_blocks.get(name)
    if replace and present and present != keys.reference_key:
        apply_result.set_key(target, present, offsets)
        return present
    return apply_result.add_key(target, name, offsets)


def pose_to_key(context, transfer, source, target, rotation_only, replace):
    """Generator: the source's present pose as a shape key that is shown; yields the fraction done."""
    pose = evaluated_pose(source, context.evaluated_depsgraph_get())
    offsets, = yield from _transferred(transfer, target, [pose], 1, rotation_only)
    _put_key(target, POSE_NAME.format(source.name), offsets, replace).value = 1
    target.data.update_tag()


def keys_to_keys(transfer, source, target, keys, rotation_only, replace, drivers):
    """Generator: shape keys with the names, ranges and values of the source's; yields the fraction done."""
    rest = mesh_data.key_positions(source.data.shape_keys.reference_key)
    poses = (rest + mesh_data.key_positions(key) - mesh_data.key_positions(key.relative_key) for key in keys)
    offsets = yield from _transferred(transfer, target, poses, len(keys), rotation_only)
    for key, of_key in zip(keys, offsets):
        copy = _put_key(target, key.name, of_key, replace)
        copy.slider_min, copy.slider_max = key.slider_min, key.slider_max
        copy.value, copy.mute = key.value, key.mute
        if key.vertex_group in target.vertex_groups:
            copy.vertex_group = key.vertex_group
        if drivers:
            _copy_drivers(source.data.shape_keys, key.name, target.data.shape_keys, copy.name)
    target.data.update_tag()


def _copy_drivers(source_keys, name, target_keys, copy_name):
    """Those of a key's value and range. What they read from the source's own keys stays there."""
    animation = source_keys.animation_data
    if animation is None:
        return
    for prop in ('value', 'slider_min', 'slider_max', 'mute'):
        curve = animation.drivers.find(f'key_blocks["{name}"].{prop}')
        if curve is None:
            continue
        if target_keys.animation_data is None:
            target_keys.animation_data_create()
        path = f'key_blocks["{copy_name}"].{prop}'
        present = target_keys.animation_data.drivers.find(path)
        if present:
            target_keys.animation_data.drivers.remove(present)
        target_keys.animation_data.drivers.from_existing(src_driver=curve).data_path = path


# Animation

def _over_frames(context, source, transfer, start, end, rotation_only):
    """Generator of (frame, (n, 3) positions of the target). Leaves the scene at the frame where it was."""
    if end < start:
        raise MeshProblem(f"The last frame, {end}, is before the first, {start}.")
    scene = context.scene
    present = (scene.frame_current, scene.frame_subframe)
    try:
        for frame in range(start, end + 1):
            scene.frame_set(frame)
            yield frame, transfer.apply(evaluated_pose(source, context.evaluated_depsgraph_get()), rotation_only)
    finally:
        scene.frame_set(present[0], subframe=present[1])


def to_cache(context, transfer, source, start, end, path, rotation_only):
    """Generator: the source's animation as a point cache that the target plays; yields the fraction done."""
    path, writer, done = bake.absolute(path), None, False
    try:
        with bake.disk(path, "written"):
            for frame, positions in _over_frames(context, source, transfer, start, end, rotation_only):
                if writer is None:
                    writer = pc2.Writer(path, len(positions), end + 1 - start)
                writer.write(positions)
                yield (frame + 1 - start) / (end + 1 - start)
            writer.finish()
        done = True
    finally:
        if writer and not done:
            writer.give_up()


def use_cache(target, path, start):
    """Plays a cache as the first of the target's modifiers."""
    cache = target.modifiers.get(CACHE_NAME)
    if cache is None or cache.type != 'MESH_CACHE':
        cache = target.modifiers.new(CACHE_NAME, 'MESH_CACHE')
        node_group.move_to(target, cache, 0)
    node_group.set_up_cache(cache, path, start)


def to_keyed_keys(context, transfer, source, target, start, end, rotation_only):
    """Generator: the source's animation as a keyed shape key a frame."""
    rest, frames = mesh_data.positions(target.data), []
    for frame, positions in _over_frames(context, source, transfer, start, end, rotation_only):
        frames.append((frame, positions - rest))
        yield (frame + 1 - start) / (end + 1 - start)
    bake.add_keyed_keys(target, frames, start, end)
