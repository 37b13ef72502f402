# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes the deformation of a range of frames to a cache or shape keys, which play without the add-on."""

from ..follow import lifecycle
from ..scene import (cache_modifier, carried, channel, deform_modifier, mesh_data, offset_attribute, partial_evaluation,
                     stack)
from ..scene.mesh_data import MeshProblem
from . import frames, keyframed_shape_keys, point_cache


class _StackUpTo:
    """Context in which the viewport shows the object's modifier stack up to the deformation only."""

    def __init__(self, ob, modifier):
        self._behind, self._modifier = deform_modifier.after(ob), modifier

    def __enter__(self):
        self._shown = [(m, m.show_viewport, m.show_render) for m in (self._modifier, *self._behind)]
        self._modifier.show_viewport = True
        for modifier in self._behind:
            # scene/skin.py ignores armatures that are hidden in both, and handles on their bones would lose the pose.
            modifier.show_render |= modifier.show_viewport
            modifier.show_viewport = False

    def __exit__(self, *_):
        for modifier, *shown in self._shown:
            modifier.show_viewport, modifier.show_render = shown


def modifier_of(ob):
    """The modifier that shows the deformation of a bound object. Raises MeshProblem if there is none."""
    modifier = deform_modifier.find(ob)
    if not ob.detail_deform.signature or modifier is None:
        raise MeshProblem(f"'{ob.name}' is not bound, so there is nothing to bake: press Bind first.")
    return modifier


def over_frames(context, ob, start, end):
    """As frames.walk(), for a bound object. Raises MeshProblem at a frame that it can't follow."""
    lifecycle.wait(ob, context.evaluated_depsgraph_get())
    settings, shown = ob.detail_deform, offset_attribute.read(ob.data)
    try:
        for frame in frames.walk(context, ob, start, end):
            if settings.stale or settings.problem:
                raise MeshProblem(f"Frame {frame}: {settings.stale or settings.problem}")
            yield frame
    finally:
        if not settings.live:  # no update restores the offsets
            channel.write(ob, shown.ravel())


def to_cache(context, ob, start, end, path, whole=None):
    """Generator: writes a point cache of the object, evaluated with its modifiers up to the deformation; yields the
    fraction done. whole: as for point_cache.write(). Raises MeshProblem."""
    first, last = whole or (start, end)
    frames.check_range(start, end)
    frames.check_time(context.scene)
    if not first <= start <= end <= last:
        raise MeshProblem(f"Frames {start} to {end} are not within the cache's {first} to {last}: choose others.")
    modifier = modifier_of(ob)
    earlier = deform_modifier.before(ob)
    for other in partial_evaluation.differing_in_renders(ob, context.scene):
        if other in earlier and getattr(other, 'levels', 0) != getattr(other, 'render_levels', 0):
            raise MeshProblem(f"Modifier '{other.name}' before Detail Deform makes other vertices in renders (level "
                              f"{other.render_levels}) than in the viewport (level {other.levels}), and a cache holds "
                              "one kind: make the levels alike.")
        if other in earlier:
            raise MeshProblem(f"Modifier '{other.name}' before Detail Deform makes other vertices in renders than in "
                              "the viewport, by what is shown, simplified, driven or asked by nodes, and a cache holds "
                              "one kind: have it alike in both.")
    yield from point_cache.write(path, _evaluated(context, ob, modifier, start, end), start, end, whole)
    ob.detail_deform.baked_file = path


def _evaluated(context, ob, modifier, start, end):
    """Generator of (n, 3) float32: the positions in each frame, evaluated with the modifiers up to the deformation."""
    count = None
    with _StackUpTo(ob, modifier):
        for frame in over_frames(context, ob, start, end):
            positions = mesh_data.positions(ob.evaluated_get(context.evaluated_depsgraph_get()).data)
            if count not in {None, len(positions)}:
                raise MeshProblem(f"Frame {frame}: the modifiers before Detail Deform make {len(positions):,} vertices "
                                  f"where they made {count:,}, which a cache can't hold: move Detail "
                                  "Deform above them.")
            count = len(positions)
            yield positions


def _show(modifier, shown):
    modifier.show_viewport = modifier.show_render = shown


def use_cache(ob, path, start):
    """Plays a cache, whose first frame is start, in place of the live deformation. Raises MeshProblem."""
    modifier = modifier_of(ob)
    points, before = point_cache.point_count(path), len(ob.data.vertices)
    if points != before and not deform_modifier.before(ob):
        raise MeshProblem(f"'{path}' holds {points:,} vertices, and '{ob.name}' has {before:,}: press Bake again.")
    cache = cache_modifier.find(ob)
    if cache is None:
        cache = ob.modifiers.new(cache_modifier.NAME, 'MESH_CACHE')
        ob.detail_deform.cache_modifier = cache.name
    ob.detail_deform.cached_points = carried.sample_points(ob.data)
    stack.place_cache(ob, cache)  # first: at the end of the stack its file may not fit the vertex count
    cache_modifier.set_up(cache, path, start)
    # A hidden modifier is not updated: this saves its time.
    _show(modifier, False)
    _show(cache, True)


def drop_cache(ob):
    """Removes the cache's modifier, not its file, and shows the live deformation again."""
    cache, modifier = cache_modifier.find(ob), deform_modifier.find(ob)
    if cache:
        ob.modifiers.remove(cache)
        if modifier:
            _show(modifier, True)


def to_shape_keys(context, ob, start, end):
    """Generator: adds a shape key for each frame, with keyframes that play them; yields the fraction done."""
    modifier = modifier_of(ob)
    frames.check_time(context.scene)
    earlier = next((m for m in deform_modifier.before(ob) if m.show_viewport or m.show_render), None)
    if earlier is not None:
        raise MeshProblem(f"Modifier '{earlier.name}' stands before Detail Deform, and shape keys act before both: "
                          "move Detail Deform to the top, or bake a cache.")
    keyframed_shape_keys.check(ob)
    yield from keyframed_shape_keys.add(ob, _offsets(context, ob, modifier, start, end), start, end)
    _show(modifier, False)


def _offsets(context, ob, modifier, start, end):
    """Generator of (n, 3): the offsets in each frame, as far as Factor and Influence show them."""
    with _StackUpTo(ob, modifier):
        for _ in over_frames(context, ob, start, end):
            yield offset_attribute.read(ob.data) * deform_modifier.display_weights(ob, modifier)
