# SPDX-License-Identifier: GPL-3.0-or-later
"""Read-only properties of a binding: whether it is valid, its times, and its state in sentences."""

import bpy

from ..scene import (attribute_reaches, cache_modifier, carried, deform_modifier, display_key, examples,
                     offset_attribute, posers, proportions, stack)
from ..scene.subject import Subject, enabled_handles
from . import frame_results, handle_follower, hints, messages, slow_results, update_options, written_offsets


# Ratio of the largest to the smallest change of scale since Bind, among all directions: the factor by which a turn of
# 90° stretches a detail at most. Above it Re-bind is advised.
_UNEVEN = 1.05


def is_bound(ob):
    settings = ob.detail_deform
    return bool(settings.signature and not settings.stale and handle_follower.cache.find(settings.signature))


def bind_ms(ob):
    entry = handle_follower.cache.find(ob.detail_deform.signature)
    return 1e3 * entry.made.info.bind_seconds if entry else 0.0


def update_ms(ob):
    entry = handle_follower.cache.find(ob.detail_deform.signature)
    return entry.update_ms if entry else 0.0


def example_weight(ob, example):
    """The weight of an example in the shown pose; 0 if unknown."""
    weights = example_weights(ob)
    number = next((k for k, e in enumerate(examples.enabled(ob.detail_deform)) if e == example), len(weights))
    return weights[number] if number < len(weights) else 0.0


def weights_are_found(ob):
    """Whether the weights of examples in the shown pose are known."""
    return bool(example_weights(ob))


def example_weights(ob):
    """The weights of the enabled examples in the shown pose; empty if unknown."""
    record = frame_results.by(ob.data)
    return record.example_weights if record else ()


def text(ob):
    """The status in one or more sentences, the overall state first."""
    return ' '.join(filter(None, (urgent(ob), harmless(ob))))


def harmless(ob):
    """A finding that needs no action: a sentence, or ''."""
    settings = ob.detail_deform
    entry = handle_follower.cache.find(settings.signature)
    if entry is None or settings.stale or settings.problem or not entry.made.info.degenerate_count:
        return ""
    info = entry.made.info
    return (f"{_count(info.degenerate_count, 'triangle has', 'triangles have')} next to no area "
            f"(such as triangle {info.degenerate_example}).")


def urgent(ob):
    """The status without harmless()."""
    settings = ob.detail_deform
    under_way = handle_follower.cache.under_way(settings.signature)
    if under_way:
        if under_way.cancelled:
            return "Cancelling."
        fraction, stage = handle_follower.cache.progress(settings.signature)
        parts = [f"Preparing {messages.step(stage)}, {100 * fraction:.0f}%."]
        if frame_results.is_draft(ob.data) and handle_follower.cache.has_draft(settings.signature):
            parts.append("Meanwhile a draft follows the handles.")
        return ' '.join(parts)
    if settings.transfer.live:
        return settings.transfer.state
    if settings.stale:
        return f"{settings.stale} Press Re-bind to go on."
    if settings.problem:
        return settings.problem
    if not settings.signature and not settings.handles and settings.base == 'COMPUTED':
        also = ", and examples to mix (Examples)" if settings.method == 'EXAMPLES' else ""
        return f"Not bound: select vertices in Edit Mode and press Pull Selected, or add a handle{also}."
    if not settings.signature:
        return "Not bound."
    entry = handle_follower.cache.find(settings.signature)
    if entry is None:
        return "Bound; the handles will be followed again after the next update."
    return ' '.join([_summary(settings, entry.made.info), *_remarks(ob, entry.made.info)])


def _count(number, one, many):
    return f"{number:,} {one if number == 1 else many}"


def _summary(settings, info):
    handles = [handle.name for handle in enabled_handles(settings)]
    movers = [f"'{handles[0]}'" if len(handles) == 1 else f"{len(handles):,} handles"] * bool(handles)
    if settings.base == 'OBJECT' and settings.base_object:
        movers.insert(0, f"the base '{settings.base_object.name}'")
    return (f"Bound to {' and '.join(movers)}: {_count(info.free_count, 'vertex follows', 'vertices follow')}"
            f"{' it' if len(movers) == 1 and len(handles) < 2 else ''}.")


def _loose_parts(ob, info):
    """Generator of sentences: which loose parts ride along, and which stay."""
    riding = written_offsets.riding_if_known(ob)
    parts, vertices, example = info.resting_component_count, info.resting_count, info.resting_example
    loose, loose_example, why = info.loose_count, info.loose_example, ""
    if riding is not None:
        counts, why = riding.counts, ", and no larger surface is near"
        if counts.rigid + counts.bending:
            bend = f" ({counts.bending:,} of them bend with it)" if counts.bending else ""
            yield (f"{_count(counts.rigid + counts.bending, 'loose part rides', 'loose parts ride')} along with what "
                   f"is beneath{bend}.")
        # With reaches nothing is counted: what no edges connect with a handle is expected to stay.
        if vertices:
            parts, vertices, example = counts.staying, counts.staying_vertices, counts.staying_example
        if loose:
            loose, loose_example = counts.loose, counts.loose_example
    if parts:
        yield (f"{_count(parts, 'loose part', 'loose parts')} of the region ({_count(vertices, 'vertex', 'vertices')}, "
               f"such as vertex {example}) {'stays' if parts == 1 else 'stay'} at rest: no handle is on "
               f"{'it' if parts == 1 else 'them'}{why}.")
    if loose:
        yield (f"{_count(loose, 'vertex', 'vertices')} without faces (such as vertex {loose_example}) "
               f"{'stays' if loose == 1 else 'stay'} at rest.")


def _shown_slow(ob):
    """Generator of sentences: whether the quick or the slow result is shown, and how exact the slow one is."""
    settings = ob.detail_deform
    what = "by Displacement Volumes" if settings.method == 'VOLUMES' else ""
    if update_options.steps(settings) > 1:
        what = f"{what} in {settings.steps} steps".strip()
    done, record = slow_results.progress(offset_attribute.token(ob.data)), frame_results.by(ob.data)
    if done is not None:
        yield f"A quick result is shown; the one {what} is being computed, {100 * done:.0f}%."
    elif record is None or not record.is_final:
        yield f"A quick result is shown; the one {what} comes when you move a handle or press Update."
    elif record.slow_info is not None:
        yield f"The result {what} is shown."
        if settings.method == 'VOLUMES':
            yield f"Volumes are kept within {100 * record.slow_info.volume_error:.2g}%."
            if not record.slow_info.volumes_converged:
                yield "The search for them stopped early: raise Iterations (For Comparison) for a better result."


def _shown_by_key(ob):
    key, wanting = display_key.find(ob.data), stack.wanting_mesh(ob)
    if key.value == 0:
        return f"The value of its shape key '{key.name}' is 0, so nothing is seen."
    if display_key.is_animated(key) and not wanting and ob.detail_deform.show_as != 'SHAPE_KEY':
        return f"The shape key '{key.name}' shows the deformation and stays, as its value is keyed or driven."
    why = f", which acts before '{wanting[0].name}'" if wanting else ""
    return f"The shape key '{key.name}' shows the deformation{why}."


def _names(names):
    return ', '.join(f"'{name}'" for name in names)


def _remarks(ob, info):
    """Generator of sentences: what may surprise the user about this mesh or this method."""
    modifier = deform_modifier.find(ob)
    is_hidden = modifier is not None and not modifier.show_viewport
    plays_keys = is_hidden and ob.detail_deform.method == 'EXAMPLES' and examples.are_animated(ob)
    if cache_modifier.find(ob):
        yield "A baked cache is played in its place: press Go Live to follow the handles again."
        if ob.detail_deform.cached_points not in {"", carried.sample_points(ob.data)}:
            yield ("The mesh's vertices have moved or changed since then, and the cache plays the places of before: "
                   "press Go Live, and Bake again.")
    elif modifier is None:
        yield "Its modifier was removed, so nothing is shown: press Update to add it."
    elif is_hidden:
        yield ("The values of its examples' keys are played in its place: to follow the handles again, delete their "
               "keyframes, set them to 0, and show the modifier in the viewport." if plays_keys else
               "Its modifier is hidden, so nothing is computed: show it in the viewport.")
    elif display_key.find(ob.data):
        yield display_key.why_hidden(ob) or _shown_by_key(ob)
    if proportions.changed_since(ob) > _UNEVEN:
        yield (f"'{ob.name}' is scaled along other directions than when it was bound, so that details that turn are "
               "sheared: press Re-bind.")
    yield from filter(None, (ob.detail_deform.render_problem, attribute_reaches.influence_gone(ob),
                             stack.why_misplaced(ob)))
    yield from _loose_parts(ob, info)
    if info.proxy_vertex_count and ob.detail_deform.base_object:
        yield (f"'{ob.detail_deform.base_object.name}' is no copy of this mesh: each vertex follows the nearest point "
               "of it.")
    if info.far_count:
        yield (f"{_count(info.far_count, 'vertex lies', 'vertices lie')} far from the base (such as vertex "
               f"{info.far_example}), and what they follow is a guess: move the base closer, or leave them out of the "
               "Region.")
    if info.torn_count:
        yield (f"{_count(info.torn_count, 'vertex lies', 'vertices lie')} between parts of the base (such as vertex "
               f"{info.torn_example}): neighbours follow different parts. Fit the base closer there, or pose it so "
               "that its parts are apart when you bind.")
    settings = ob.detail_deform
    if (info.handle_count == 1 and not settings.region and settings.base == 'COMPUTED'
            and not enabled_handles(settings)[0].reach):
        yield ("The only handle takes the whole mesh along, because nothing holds it: make a region (By Radius), or "
               "add a handle that stays.")
    subject = Subject(ob)
    owner = subject.pieces.owner[info.idle_handle_example] if info.idle_handle_count else None
    # A curve may have stations within its vertices, beside which nothing is free.
    if owner is not None and owner not in subject.pieces.rests:
        idle = subject.handles[owner]
        idle_ones = f"{_count(info.idle_handle_count, 'handle', 'handles')} (such as '{idle.name}')"
        if idle.reach:
            yield (f"Nothing follows {idle_ones}: no vertex of its reach is beside it. Give its Reach more vertices, "
                   "or none.")
        else:
            yield (f"Nothing follows {idle_ones}: no vertex of the region is beside it. Make the region larger (By "
                   "Radius), or choose another one.")
    yield from hints.of_region(ob)
    hanging = hints.goes_by_its_mesh(ob)
    if hanging:
        yield (f"The {hanging[0]} goes by vertices of this mesh ({hanging[1]}), and runs after itself where they "
               "follow it: a frame depends on how often it was updated. Let it go by the object, or by something else.")
    gone = hints.gone_empties(ob, bpy.context.view_layer.depsgraph)
    if gone:
        yield (f"These handles have lost their empties, which were deleted or left behind, so what they hold stays "
               f"where it is: {_names(gone)}. Press Bring Back Empties, or remove the handles.")
    other = hints.shares_empties_with(ob)
    if other and hints.is_posed_alike(ob, other):
        yield (f"Its empties are those of '{other.name}' too, so the two are posed alike: press Own Empties to pose it "
               "alone.")
    elif other:
        yield (f"Its empties are those of '{other.name}' too, so it is pulled back when it is moved alone: press Own "
               "Empties.")
    if settings.influence and settings.influence in {*ob.data.attributes.keys(), 'position', 'normal', 'index', 'id'}:
        yield (f"The influence group '{settings.influence}' has the name of an attribute, which is taken in its place: "
               "rename the group.")
    if update_options.is_slow(settings):
        yield from _shown_slow(ob)
    if settings.method == 'NORMAL' and info.unrepresented_count:
        yield (f"{_count(info.unrepresented_count, 'vertex', 'vertices')} (such as vertex "
               f"{info.unrepresented_example}) {'overhangs' if info.unrepresented_count == 1 else 'overhang'} "
               "the base, where Normal Displacement fails: choose Detail Transfer, or a smaller region.")
    if settings.method == 'EXAMPLES':
        if settings.base == 'OBJECT':
            yield "The method Examples goes by the handles and not by a base object: choose another one to follow it."
        elif not examples.enabled(settings):
            yield ("There are no examples, so the rest shape alone is pulled: press Add Shape Keys or Add Selected "
                   "Objects (Examples).")
        keys = examples.shown_keys(ob)
        if keys and not plays_keys:
            yield f"Shape keys that are examples are shown too, as {_names(keys[:3])}: set their values to 0."
        twice = posers.applied_twice(ob)
        if twice:
            yield f"{_names(twice)} poses the result once more, of whose poses there are examples: switch it off."
    if settings.stiff_parts and settings.base == 'COMPUTED' and not update_options.keeps_parts_rigid(settings):
        yield ("Stiff Parts are not rigid as it is set now: choose Detail Transfer with Keep Detail Size and Quality "
               "of large bends, or Gradient Editing.")
    if settings.method == 'GRADIENT' and settings.base == 'OBJECT':
        yield "Gradient Editing goes by the handles and not by the base: choose another method to follow it."
    if settings.method == 'GRADIENT':
        record = frame_results.by(ob.data)
        moved = record.only_moved if record else ()
        if moved:
            yield (f"Gradient Editing turns nothing where a handle is only moved, as {_names(moved)} "
                   f"{'is' if len(moved) == 1 else 'are'}: turn the empty too, or choose Detail Transfer.")
