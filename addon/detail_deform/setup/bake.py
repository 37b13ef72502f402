# SPDX-License-Identifier: GPL-3.0-or-later
"""The deformation of a range of frames, kept where the add-on is not needed: a cache or shape keys."""

import contextlib
import os

import bpy

from ..follow import binding
from ..scene import apply_result, mesh_data, node_group, offset_attribute, pc2
from ..scene.mesh_data import MeshProblem

KEY_NAME = "Detail Deform {}"


def absolute(path):
    """Of a path as Blender writes it. Raises MeshProblem where it is relative to a file never saved."""
    if not path:
        raise MeshProblem("There is no file to bake to: choose one.")
    if path.startswith('//') and not bpy.data.filepath:
        raise MeshProblem("This file was never saved, so there is no folder beside it: save it, or choose a "
                          "full path for the cache.")
    return os.path.abspath(bpy.path.abspath(path))


def usual_path(ob, present):
    """Beside the file, under a name that no other cache has; '' for a file that was never saved. present: the
    modifier that will play it, if it is there already."""
    if not bpy.data.filepath:
        return ""
    stem = os.path.splitext(os.path.basename(bpy.data.filepath))[0]
    name = ''.join('_' if letter in '\\/:*?"<>|' or ord(letter) < 32 else letter for letter in ob.name)
    taken = {absolute(modifier.filepath) for other in bpy.data.objects for modifier in other.modifiers
             if modifier.type == 'MESH_CACHE' and modifier.filepath and modifier != present}
    paths = (f"//{stem}_{name}{number}.pc2" for number in ("", *(f" {k}" for k in range(2, 10000))))
    return next(path for path in paths if absolute(path) not in taken)


@contextlib.contextmanager
def disk(path, what):
    """What the disk or a file refuses, as a sentence."""
    try:
        yield
    except OSError as error:
        raise MeshProblem(f"'{path}' can't be {what}: {error.strerror or error}.") from error
    except pc2.NotACache as error:
        raise MeshProblem(str(error)) from error


class _ShownUpTo:
    """While it lasts, the object's stack is shown up to this modifier and no further."""

    def __init__(self, ob, modifier):
        modifiers = list(ob.modifiers)
        self._behind = modifiers[modifiers.index(modifier) + 1:]
        self._modifier = modifier

    def __enter__(self):
        self._shown = [(m, m.show_viewport) for m in (self._modifier, *self._behind)]
        self._modifier.show_viewport = True
        for modifier in self._behind:
            modifier.show_viewport = False

    def __exit__(self, *_):
        for modifier, shown in self._shown:
            modifier.show_viewport = shown


def _frame(context, ob, frame):
    """Brings scene and object to a frame, slow results included."""
    context.scene.frame_set(frame)
    settings = ob.detail_deform
    binding.refresh(ob, context.evaluated_depsgraph_get())
    if settings.stale or settings.problem:
        raise MeshProblem(f"Frame {frame}: {settings.stale or settings.problem}")
    binding.settle(ob)
    context.view_layer.update()


def _modifier(ob):
    modifier = node_group.find_modifier(ob)
    if not ob.detail_deform.signature or modifier is None:
        raise MeshProblem(f"'{ob.name}' is not bound, so there is nothing to bake: press Bind first.")
    return modifier


def check_range(start, end):
    if end < start:
        raise MeshProblem(f"The last frame, {end}, is before the first, {start}.")


def check_time(context):
    """Raises MeshProblem where a cache would play at other times than it was baked."""
    if context.scene.render.frame_map_old != context.scene.render.frame_map_new:
        raise MeshProblem("The scene remaps its time (Output > Frame Range > Time Stretching), which a cache doesn't "
                          "follow: set Old and New alike to bake.")


def _over_frames(context, ob, start, end, take):
    """Generator: take(frame) after bringing all to each frame from start to end; yields the fraction done.
    Leaves the scene at the frame where it was."""
    check_range(start, end)
    binding.wait(ob, context.evaluated_depsgraph_get())
    scene = context.scene
    present, shown = (scene.frame_current, scene.frame_subframe), offset_attribute.read(ob.data)
    try:
        for frame in range(start, end + 1):
            _frame(context, ob, frame)
            take(frame)
            yield (frame + 1 - start) / (end + 1 - start)
    finally:
        scene.frame_set(present[0], subframe=present[1])
        if not ob.detail_deform.live:  # nothing else brings back what was shown
            offset_attribute.write(ob.data, shown.ravel())


def _evaluated(context, ob):
    mesh = ob.evaluated_get(context.evaluated_depsgraph_get()).data
    return mesh_data.positions(mesh)


def to_cache(context, ob, start, end, path, whole=None):
    """Generator: writes a point cache of what the object's modifiers up to Detail Deform make of it.

    whole: first and last frame of the cache, of which start to end are written now; None: these are
    all."""
    first, last = whole or (start, end)
    check_range(start, end)
    check_time(context)
    if not first <= start <= end <= last:
        raise MeshProblem(f"Frames {start} to {end} are not within the cache's {first} to {last}.")
    modifier = _modifier(ob)
    for other in list(ob.modifiers)[:list(ob.modifiers).index(modifier)]:
        if other.type in {'SUBSURF', 'MULTIRES'} and other.levels != other.render_levels:
            raise MeshProblem(f"Modifier '{other.name}' before Detail Deform makes other vertices in renders (level "
                              f"{other.render_levels}) than in the viewport (level {other.levels}), and a cache holds "
                              "one kind: make the levels alike.")
    path, writer = absolute(path), None

    def take(frame):
        nonlocal writer
        positions = _evaluated(context, ob)
        if writer is None:
            writer = pc2.Writer(path, len(positions), last + 1 - first, start - first, end + 1 - first)
        if len(positions) != writer.points:
            raise MeshProblem(f"Frame {frame}: the modifiers before Detail Deform make {len(positions):,} vertices "
                              f"where they made {writer.points:,}, which a cache can't hold.")
        writer.write(positions)

    done = False
    try:
        with disk(path, "written"):
            with _ShownUpTo(ob, modifier):
                yield from _over_frames(context, ob, start, end, take)
            writer.finish()
        done = True
    finally:
        if writer and not done:
            writer.give_up()


def _show(modifier, shown):
    modifier.show_viewport = modifier.show_render = shown


def use_cache(ob, path, start):
    """Shows a cache whose first frame is start in place of the live deformation."""
    modifier = _modifier(ob)
    with disk(path, "read"):
        points, _ = pc2.read_header(absolute(path))
    before = len(ob.data.vertices)
    if points != before and list(ob.modifiers).index(modifier) == 0:
        raise MeshProblem(f"'{path}' holds {points:,} vertices, and '{ob.name}' has {before:,}: bake it anew.")
    cache = node_group.find_cache(ob)
    if cache is None:
        cache = ob.modifiers.new(node_group.CACHE_NAME, 'MESH_CACHE')
        ob.detail_deform.cache_modifier = cache.name
    node_group.set_up_cache(cache, path, start)
    node_group.move_behind(ob, cache, modifier)
    # Nothing is computed any more for what is not shown.
    _show(modifier, False)
    _show(cache, True)


def to_alembic(context, ob, start, end, path):
    """Writes the object as all its modifiers make it, for programs of all kinds."""
    _modifier(ob)
    if not bpy.app.build_options.alembic:
        raise MeshProblem("This Blender was built without Alembic: bake a Mesh Cache, or use an official build.")
    path = absolute(path)
    check_range(start, end)
    for _ in _over_frames(context, ob, start, start, lambda frame: None):
        pass  # what is wrong is said before the export begins
    unfinished = f"{os.path.splitext(path)[0]}.unfinished.abc"
    try:
        with _Exported(context, ob), disk(path, "written"):
            bpy.ops.wm.alembic_export(filepath=unfinished, start=start, end=end, selected=True,
                                      as_background_job=False)
            os.replace(unfinished, path)
    except RuntimeError as error:
        raise MeshProblem(f"'{path}' can't be written: {str(error).strip()}") from error
    finally:
        if os.path.exists(unfinished):
            os.remove(unfinished)


class _Exported:
    """While it lasts, the object is all that is selected, and shown and followed as an exporter sees it."""

    def __init__(self, context, ob):
        self._context, self._ob, self._modifier = context, ob, node_group.find_modifier(ob)

    def __enter__(self):
        ob = self._ob
        self._selected = list(self._context.selected_objects)
        self._kept = [(owner, name, getattr(owner, name)) for owner, name in (
            (ob, 'hide_select'), (ob, 'hide_viewport'), (ob, 'hide_render'), (ob.detail_deform, 'live'),
            (self._modifier, 'show_render'), (self._modifier, 'show_viewport'))]
        self._hidden = ob.hide_get()
        ob.hide_select = ob.hide_viewport = ob.hide_render = False
        ob.hide_set(False)
        ob.detail_deform.live = self._modifier.show_render = self._modifier.show_viewport = True
        for other in self._selected:
            other.select_set(False)
        ob.select_set(True)

    def __exit__(self, *_):
        self._ob.select_set(False)
        for other in self._selected:
            other.select_set(True)
        for owner, name, value in self._kept:
            setattr(owner, name, value)
        self._ob.hide_set(self._hidden)


def drop_cache(ob):
    """Back from the cache to the live deformation; the file stays."""
    cache, modifier = node_group.find_cache(ob), node_group.find_modifier(ob)
    if cache:
        ob.modifiers.remove(cache)
        if modifier:
            _show(modifier, True)


def to_shape_keys(context, ob, start, end):
    """Generator: a shape key a frame, keyed so that they play."""
    modifier = _modifier(ob)
    earlier = next(m for m in ob.modifiers if m == modifier or m.show_viewport or m.show_render)
    if earlier != modifier:
        raise MeshProblem(f"Modifier '{earlier.name}' stands before Detail Deform, and shape keys act before both: "
                          "move Detail Deform to the top, or bake a cache.")
    check_keyed_keys(ob)
    frames = []

    def take(frame):
        offsets = offset_attribute.read(ob.data) * node_group.amount(ob, modifier)
        frames.append((frame, offsets))

    with _ShownUpTo(ob, modifier):
        yield from _over_frames(context, ob, start, end, take)
    add_keyed_keys(ob, frames, start, end)
    _show(modifier, False)


def check_keyed_keys(ob):
    """Raises MeshProblem where keyed shape keys can't be added."""
    present = ob.data.shape_keys
    if present and not present.use_relative:
        raise MeshProblem("The mesh has absolute shape keys, which can't be added to: make them relative first.")
    if present and any(key.name.startswith(KEY_NAME.format("")) for key in present.key_blocks):
        raise MeshProblem("There are baked shape keys already, and the new ones would add to them: remove those first.")


def add_keyed_keys(ob, frames, start, end):
    """frames: [(frame, (n, 3) offsets)] from start to end; each gets a shape key that is keyed to show there."""
    for frame, offsets in frames:
        key = apply_result.add_key(ob, KEY_NAME.format(frame), offsets)
        for at, value in ((frame - 1, 0.0), (frame, 1.0), (frame + 1, 0.0)):
            if start <= at <= end:
                key.value = value
                key.keyframe_insert('value', frame=at)
