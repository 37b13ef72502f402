# SPDX-License-Identifier: GPL-3.0-or-later
"""The deformation of one mesh carried over to another: its pose, its shape keys, its animation."""

import fnmatch

import bpy
import numpy as np

from ..follow import binding
from ..library import native
from ..scene import apply_result, mesh_data, node_group, offset_attribute, pc2
from . import bake
from ..scene.mesh_data import MeshProblem

POSE_NAME = "{} Pose"
CACHE_NAME = "Detail Deform Transfer"

_MAKERS = {'SUBSURF', 'MULTIRES', 'MIRROR', 'ARRAY', 'SOLIDIFY', 'BEVEL', 'DECIMATE', 'REMESH', 'SKIN', 'SCREW',
           'BOOLEAN', 'BUILD', 'EDGE_SPLIT', 'MASK', 'TRIANGULATE', 'WELD', 'WIREFRAME', 'NODES'}
_MADE_KEYS = 'detail_deform_transferred_keys'  # of the mesh: names of those that were made here
_LONGEST_NAME = 63  # bytes that Blender keeps of one


class Prepared:
    """A factored transfer between two objects, in spaces as they are proportioned in the scene."""

    def __init__(self, transfer, source, target):
        """source, target: proportions of the two."""
        self.info = transfer.info
        self._transfer, self._source, self._target = transfer, source, target

    def apply(self, pose, rotation_only):
        """(n, 3) float32 of the target, from the source's."""
        gradients = 'ROTATIONS' if rotation_only else 'WHOLE'
        return self._transfer.apply(pose * self._source, gradients) / self._target


def proportions(ob):
    """(3,) float32: an object's scale, the largest as 1: alike along all axes, it changes no shape."""
    scale = np.array(ob.matrix_world.to_scale(), np.float32)
    largest = np.abs(scale).max()
    scale = scale / largest if largest > 0 else np.ones(3, np.float32)
    return np.where(np.abs(scale) > 1e-6, np.abs(scale), np.float32(1))


class Preparation:
    """A transfer between two objects that is being factored: a job like those of native. Blender's data are read at the
    start alone."""

    def __init__(self, source, target, matched, anchor, anchor_group, formulation='SURFACE', precision='DOUBLE'):
        """anchor and formulation: as in transfer_settings. Raises MeshProblem or native.NativeError."""
        self._sides = proportions(source), proportions(target)
        meshes = ((mesh_data.rest(source.data) * self._sides[0], matched.source_triangles),
                  (mesh_data.rest(target.data) * self._sides[1], matched.target_triangles))
        self._job = native.TransferJob(*meshes, matched.pairs, pairs_of=matched.pairs_of, anchor=anchor,
                                       anchors=_anchors(target, anchor, anchor_group), formulation=formulation,
                                       precision=precision)
        self.progress, self.cancel, self.close = self._job.progress, self._job.cancel, self._job.close

    def finish(self):
        """The Prepared, or native.NativeError."""
        return Prepared(self._job.finish(), *self._sides)


def prepare(source, target, matched, anchor, anchor_group, formulation='SURFACE'):
    """The factored transfer of these objects, as of Preparation. Raises MeshProblem or native.NativeError."""
    return Preparation(source, target, matched, anchor, anchor_group, formulation).finish()


def _anchors(target, anchor, anchor_group):
    anchors = ()
    if anchor in {'VERTICES', 'PINNED'}:
        if anchor_group not in target.vertex_groups:
            raise MeshProblem(f"'{target.name}' has no vertex group '{anchor_group}': choose the group of the "
                              "vertices that stay in place (Anchor).")
        anchors = np.flatnonzero(mesh_data.members(target, anchor_group))
        if not len(anchors):
            raise MeshProblem(f"The group '{anchor_group}' has no vertex with a weight over "
                              f"{mesh_data.MEMBER_WEIGHT}: assign those that stay in place.")
    return anchors


def remarks(transfer):
    """What the user may not expect of these meshes, in sentences."""
    info = transfer.info
    if info.unmatched_component_count:
        yield (f"{info.unmatched_component_count} loose part(s) of the target (such as that of vertex "
               f"{info.unmatched_component_example}) correspond to nothing and go with the rest.")
    elif info.unmatched_count:
        yield (f"{info.unmatched_count:,} triangles of the target correspond to nothing and go with the nearest "
               "that do.")
    if info.degenerate_count:
        yield f"{info.degenerate_count:,} triangles of the target have next to no area."
    if info.mirrored:
        yield "The target looks like the source's mirror image, which a deformation can't be turned into."


def evaluated_pose(source, depsgraph):
    """(n, 3) float32: what the source's modifiers and shape keys make of it now. Raises MeshProblem."""
    evaluated = source.evaluated_get(depsgraph)
    if not evaluated.is_evaluated or evaluated == source:
        raise MeshProblem(f"'{source.name}' is hidden by its monitor icon, or in an excluded collection, so that its "
                          "pose is not known: show it.")
    mesh = evaluated.data
    if len(mesh.vertices) != len(source.data.vertices):
        makers = [m.name for m in source.modifiers if m.show_viewport and m.type in _MAKERS]
        raise MeshProblem(
            f"The modifiers of '{source.name}' make {len(mesh.vertices):,} vertices of its "
            f"{len(source.data.vertices):,}: hide those that don't only move "
            f"vertices{', as ' + ', '.join(map(repr, makers)) if makers else ''}.")
    return mesh_data.positions(mesh) + _not_yet_shown(source, mesh)


def _not_yet_shown(source, mesh):
    """What Detail Deform has computed for the source itself since it was evaluated, as when it is bound or follows
    another mesh. Right where its modifier is the last that moves vertices."""
    modifier = node_group.find_modifier(source)
    if modifier is None or not modifier.show_viewport:
        return np.float32(0)
    change = offset_attribute.read(source.data) - offset_attribute.read(mesh)
    if not change.any():  # reading an influence group takes a while
        return np.float32(0)
    return (change * node_group.amount(source, modifier)).astype(np.float32)


# Shape keys

def chosen_keys(source, active_only, pattern):
    """The source's shape keys beside its basis. Raises MeshProblem when there is none."""
    blocks = mesh_data.relative_keys(source)
    if not blocks:
        raise MeshProblem(f"'{source.name}' has no shape keys to transfer.")
    if active_only:
        if source.active_shape_key in blocks:
            return [source.active_shape_key]
        raise MeshProblem(f"The active shape key of '{source.name}' is its basis: choose another one.")
    chosen = [key for key in blocks if key.name == pattern
              or fnmatch.fnmatchcase(key.name.lower(), (pattern or '*').lower())]
    if not chosen:
        raise MeshProblem(f"'{source.name}' has no shape key whose name fits '{pattern}'.")
    return chosen


def _transferred(transfer, target, poses, count, rotation_only):
    """Generator: the offsets of the target for each of the source's poses into a list, which it returns; yields
    the fraction done. Nothing is changed before all are there."""
    if target.data.shape_keys and not target.data.shape_keys.use_relative:
        raise MeshProblem(f"'{target.name}' has absolute shape keys, which can't be added to: "
                          "make them relative first.")
    rest, offsets = mesh_data.rest(target.data), []
    for number, pose in enumerate(poses, 1):
        offsets.append(transfer.apply(pose, rotation_only) - rest)
        yield number / count
    return offsets


def _put_key(target, name, offsets, replace):
    """The key of that name with this shape. One that was not made here stays as it is, unless it may be replaced,
    and gets another one beside it."""
    name = name.encode()[:_LONGEST_NAME].decode(errors='ignore')
    keys = target.data.shape_keys
    present = keys and keys.key_blocks.get(name)
    made = target.data.get(_MADE_KEYS, "").split('\n')
    if present and present != keys.reference_key and (replace or name in made):
        apply_result.set_key(target, present, offsets)
    else:
        present = apply_result.add_key(target, name, offsets)
    target.data[_MADE_KEYS] = '\n'.join(dict.fromkeys([*filter(None, made), present.name]))
    target.active_shape_key_index = target.data.shape_keys.key_blocks.find(present.name)
    return present


def pose_to_key(context, transfer, source, target, rotation_only, replace):
    """Generator: the source's present pose as a shape key that is shown; yields the fraction done and returns
    the key's name."""
    settle(context, source)
    pose = evaluated_pose(source, context.evaluated_depsgraph_get())
    offsets, = yield from _transferred(transfer, target, [pose], 1, rotation_only)
    key = _put_key(target, POSE_NAME.format(source.name), offsets, replace)
    key.value = 1
    target.data.update_tag()
    return [key.name]


def check_not_shown(target):
    """Raises MeshProblem where something that was transferred shows already, and following would double it."""
    if find_cache(target):
        raise MeshProblem(f"'{target.name}' plays a transferred animation: remove its modifier '{CACHE_NAME}' first.")
    made = target.data.get(_MADE_KEYS, "").split('\n')
    shown = [key.name for key in target.data.shape_keys.key_blocks
             if key.name in made and key.value and not key.mute] if target.data.shape_keys else []
    if shown:
        raise MeshProblem(f"Shape keys that were transferred are shown, as '{shown[0]}', and would be doubled: set "
                          "their values to 0 first.")


def settle(context, source):
    """Brings a source that is bound itself to the end of what its handles ask for."""
    if source.detail_deform.signature:
        binding.refresh(source, context.evaluated_depsgraph_get())
        binding.settle(source)
        context.view_layer.update()


def keys_to_keys(transfer, source, target, keys, rotation_only, replace, drivers):
    """Generator: shape keys with the names, ranges and values of the source's; yields the fraction done and
    returns their names."""
    poses = (mesh_data.key_shape(source.data, key) for key in keys)
    offsets = yield from _transferred(transfer, target, poses, len(keys), rotation_only)
    names = []
    for key, of_key in zip(keys, offsets):
        copy = _put_key(target, key.name, of_key, replace)
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


# Animation

def _over_frames(context, source, transfer, start, end, rotation_only):
    """Generator of (frame, (n, 3) positions of the target). Leaves the scene at the frame where it was."""
    bake.check_range(start, end)
    scene = context.scene
    present = (scene.frame_current, scene.frame_subframe)
    try:
        for frame in range(start, end + 1):
            scene.frame_set(frame)
            settle(context, source)
            yield frame, transfer.apply(evaluated_pose(source, context.evaluated_depsgraph_get()), rotation_only)
    finally:
        scene.frame_set(present[0], subframe=present[1])


def to_cache(context, transfer, source, start, end, path, rotation_only):
    """Generator: the source's animation as a point cache that the target plays; yields the fraction done."""
    bake.check_time(context)
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


def find_cache(target):
    """The modifier that plays what was transferred, or None."""
    cache = target.modifiers.get(CACHE_NAME)
    return cache if cache and cache.type == 'MESH_CACHE' else None


def use_cache(target, path, start):
    """Plays a cache as the first of the target's modifiers."""
    cache = find_cache(target)
    if cache is None:
        cache = target.modifiers.new(CACHE_NAME, 'MESH_CACHE')
        node_group.move_to(target, cache, 0)
    node_group.set_up_cache(cache, path, start)


def to_keyed_keys(context, transfer, source, target, start, end, rotation_only):
    """Generator: the source's animation as a keyed shape key a frame."""
    rest, frames = mesh_data.rest(target.data), []
    for frame, positions in _over_frames(context, source, transfer, start, end, rotation_only):
        frames.append((frame, positions - rest))
        yield (frame + 1 - start) / (end + 1 - start)
    bake.add_keyed_keys(target, frames, start, end)
