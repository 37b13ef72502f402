# SPDX-License-Identifier: GPL-3.0-or-later
"""Starts and ends following the deformation of another mesh, and describes the state of a follower."""

import bpy

from ..library.options import NEAREST
from ..scene import (attribute_reaches, channel, deform_modifier, offset_attribute, partial_evaluation, saved_match,
                     source_pose, stack, transferred)
from ..scene.mesh_data import MeshProblem
from ..scene.start import forget_foreign
from . import binding, lifecycle, registry, source_follower


def check_start(ob, source):
    """Raises MeshProblem if the object can't follow that source, whatever the correspondence."""
    if ob.detail_deform.signature:
        raise MeshProblem(f"'{ob.name}' is bound to handles, which move it already: press Unbind first.")
    offset_attribute.check_name(ob)
    _check_circle(source, ob)
    transferred.check_not_shown(ob)
    source_pose.evaluated_pose(source, bpy.context.evaluated_depsgraph_get())


def _check_circle(source, ob):
    seen, follower = {ob}, source
    while follower is not None and follower.detail_deform.transfer.live:
        follower = follower.detail_deform.transfer.source
        if follower in seen:
            raise MeshProblem(f"'{source.name}' follows '{ob.name}' already, itself or by way of others: select "
                              f"'{source.name}' and press Follow there to stop.")
        seen.add(follower)


def start(context, ob, source, matched=None):
    """Starts following. matched: the correspondence to use and to store; None: the one that the settings choose.
    Raises MeshProblem or native.NativeError; nothing is changed then."""
    settings, depsgraph = ob.detail_deform.transfer, context.evaluated_depsgraph_get()
    check_start(ob, source)
    used, content = matched or source_follower.matched(source, ob), source_follower.content(source, ob, matched)
    lifecycle.start(source_follower, content, lambda: source_follower.begin(source, ob, used))
    if lifecycle.must_wait(depsgraph):
        lifecycle.finish(source_follower, content)
    if matched:
        saved_match.store(matched, source, ob)
        if matched.pairs_of != NEAREST:  # nearest points are found anew at each start
            settings.correspondence = 'STORED'
    forget_foreign(ob)
    modifier = stack.ensure_modifier(ob)
    if settings.source != source:
        settings.source = source
    settings.prepared_for = content
    settings.live, ob.detail_deform.begun_as = True, ob.name
    registry.forget()
    deform_modifier.set_base(modifier, source)  # so that a hidden source is evaluated, too
    binding.influence_changed(ob)
    lifecycle.refresh(ob, context.evaluated_depsgraph_get(), force=True)
    lifecycle.drop_unused()


def stop(ob):
    """The mesh shows its rest shape again."""
    if not source_follower.has(ob):
        return
    lifecycle.end(source_follower, ob)
    if not ob.detail_deform.handles:  # handles would need it at the next Bind
        channel.remove(ob)


def source_changed(ob):
    """To be called when another source was chosen: makes the modifier depend on it."""
    settings, modifier = ob.detail_deform.transfer, deform_modifier.find(ob)
    if settings.live and modifier:
        deform_modifier.set_base(modifier, settings.source)


def state(ob):
    """The state of a follower in sentences; of an object that follows nothing its problem, or ''."""
    settings = ob.detail_deform.transfer
    if not settings.live:
        return settings.problem
    if source_follower.cache.under_way(settings.prepared_for):
        fraction, _ = source_follower.cache.progress(settings.prepared_for)
        source = settings.source.name if settings.source else ""
        return f"Preparing to follow '{source}', {100 * fraction:.0f}%."
    if settings.problem or settings.source is None:
        return settings.problem or source_follower.GONE
    # The depsgraph as it is: this is drawn, and drawing must not evaluate the scene.
    depsgraph = bpy.context.view_layer.depsgraph
    left_out = partial_evaluation.left_out(settings.source, depsgraph) if depsgraph else ""
    entry = source_follower.cache.find(settings.prepared_for)
    unfollowed = entry.made.unfollowed if entry else ""
    return ' '.join(filter(None, (f"Follows '{settings.source.name}'.", left_out, unfollowed,
                                  ob.detail_deform.render_problem, attribute_reaches.influence_gone(ob),
                                  stack.why_misplaced(ob))))


def is_preparing(ob):
    return source_follower.cache.under_way(ob.detail_deform.transfer.prepared_for) is not None
