# SPDX-License-Identifier: GPL-3.0-or-later
"""The life of a binding: made, followed, noticed when it no longer fits, restored, undone."""

import time

import bpy
import numpy as np

from ..library import native
from ..scene import dependency, handle_matrices, mesh_data, node_group, offset_attribute, outside_base, reach
from ..scene.mesh_data import MeshProblem
from ..scene.window import redraw_panels
from . import content, deformers, look, registry, shown, slow_results
from .slow_update import SlowUpdate

_POLL_SECONDS = 0.1


# Whether the content is still that which was bound

def check_content(ob):
    """Compares mesh, groups and options with what was bound, and notes what differs.

    By content: swapped vertices and re-painted weights count, a mesh that is as it was does not.
    """
    settings = ob.detail_deform
    if ob.type != 'MESH' or not settings.signature or ob.mode == 'EDIT':
        return
    _note_handles(settings)
    stale = content.difference(ob)
    if stale in {content.TOPOLOGY_CHANGED, content.VERTICES_MOVED} and node_group.find_modifier(ob) is None:
        unbind(ob)
        settings.problem = ("The modifier was applied by hand, or removed and the mesh edited, so the surface is no "
                            "longer bound: Bind to go on from here.")
    elif settings.stale != stale:
        settings.stale = stale
        shown.forget(ob.data)  # an edit may have reached the offsets too


def _note_handles(settings):
    order = content.order_of_handles(settings)
    if settings.compared_handles != order:
        settings.compared_handles = order


def check_base(ob):
    """As check_content, of the base object's mesh alone, which may change in every frame."""
    settings = ob.detail_deform
    if not settings.signature or settings.base != 'OBJECT' or settings.stale not in {"", content.BASE_CHANGED}:
        return
    try:
        stale = "" if content.is_of_base(ob) else content.BASE_CHANGED
    except MeshProblem:
        return  # the next update says it
    if settings.stale != stale:
        settings.stale = stale


# Following the handles

def refresh(ob, depsgraph, force=False):
    """Brings the object's offsets up to date with its empties. Does nothing when no empty moved, or, unless
    forced to, while the modifier is not shown.

    Never raises for what the user can cause: the sentence goes to the status.
    """
    settings = ob.detail_deform
    if ob.type != 'MESH' or not settings.signature or ob.mode == 'EDIT':
        return
    if settings.compared_handles != content.order_of_handles(settings):
        check_content(ob)
    if not settings.signature or settings.stale:
        return
    if not (force or node_group.is_shown(ob, depsgraph)):
        return
    try:
        mesh_data.check_object(ob)
        offset_attribute.check_name(ob)
        mesh_data.check_groups(ob, settings.region, content.handle_groups(settings))
        bound = deformers.find(settings.signature) or _restore(ob, depsgraph)
        if bound is not None:
            _note(settings, _follow(ob, bound, depsgraph, force) or reach.why_not(ob, depsgraph))
    except (MeshProblem, native.NativeError) as problem:
        _note(settings, str(problem))


def _note(settings, problem):
    if settings.problem != problem:
        settings.problem = problem


def _follow(ob, bound, depsgraph, force):
    """Returns what is wrong with what is shown, or ''."""
    start = time.perf_counter()
    settings = ob.detail_deform
    if bound.deformer.info.vertex_count != len(ob.data.vertices):
        settings.stale = content.TOPOLOGY_CHANGED
        return ""
    places = handle_matrices.local_places(ob, depsgraph)
    motions = handle_matrices.motions(settings, places)
    asked = look.asked(settings)
    base = None
    what = (settings.signature, motions.tobytes(), asked)
    if settings.base == 'OBJECT':
        base = outside_base.deformed_positions(ob, depsgraph)
        what += (base.tobytes(),)
    slow = look.is_slow(settings)
    turns = np.zeros((len(motions), 3))
    if look.steps(settings) > 1:
        turns = handle_matrices.turns(settings, places, depsgraph)
        what += (settings.steps, turns.tobytes())
    record = shown.by(ob.data)
    if not force and record is not None and record.of == what:
        return record.problem
    slow_results.cancel(offset_attribute.token(ob.data))
    slow_results.make_way(bound.deformer)
    record = shown.show(ob.data, bound.deformer.offsets(motions, base, **look.quick(asked)), what)
    record.only_moved = [
        handle.name for handle, motion in zip(handle_matrices.enabled_handles(settings), motions)
        if handle_matrices.only_moves(motion)]
    if settings.method == 'EXAMPLES':
        record.example_weights = bound.deformer.example_weights().tolist()
        if depsgraph.mode == 'VIEWPORT' and not bpy.app.background:
            redraw_panels()  # they show the weights
    bound.update_ms = 1e3 * (time.perf_counter() - start)
    if slow and not (base is None and np.abs(motions - np.eye(4)[:3]).max() < 1e-6 and not turns.any()):
        # A render must not show the quick result, and without a window there is no drag to keep up with.
        wait = bpy.app.background or depsgraph.mode == 'RENDER'
        record.is_final = False
        asked = {**asked, 'steps': look.steps(settings), 'turns': turns, 'base': base}
        SlowUpdate(ob, bound.deformer, motions, asked).run(wait)
    return record.problem


def wait(ob, depsgraph):
    """Waits for a bind that is under way, or that the file asks for."""
    settings = ob.detail_deform
    refresh(ob, depsgraph)
    if deformers.bind_under_way(settings.signature):
        _finish(settings.signature)
        refresh(ob, depsgraph)


def settle(ob):
    """Waits for a slow result that is under way."""
    slow_results.finish(offset_attribute.token(ob.data))


def _restore(ob, depsgraph):
    """Binds again what the file or an undone step says was bound, at the stored rest places.

    Returns None while that goes on in the background."""
    settings = ob.detail_deform
    signature = settings.signature
    native.library()
    if not deformers.bind_under_way(signature):
        check_content(ob)
        if settings.stale:
            return None
        _start(ob, signature, content.roles(ob))
    # A render must not show a frame that isn't finished, and without a window nothing polls.
    if bpy.app.background or depsgraph.mode == 'RENDER':
        return _finish(signature)
    return None


# Binding and unbinding

def _start(ob, signature, roles):
    arguments, options = content.bind_arguments(ob, roles)
    deformers.start(signature, *arguments, **options)
    if not bpy.app.background and not bpy.app.timers.is_registered(_poll):
        # Persistent: a file opened meanwhile must not leave the bind without anyone to finish it.
        bpy.app.timers.register(_poll, first_interval=_POLL_SECONDS, persistent=True)


def bind(ob, depsgraph, wait, keep_rest):
    """Starts to bind the object's region to its handles, and with wait also finishes.

    keep_rest: the empties' rest places stay those of the last Bind, so that a pose survives a
    change of the mesh; handles that have none yet get their present place.
    Raises MeshProblem or native.NativeError; the object then has no binding.
    """
    mesh_data.check_object(ob)
    native.library()
    settings = ob.detail_deform
    if settings.transfer.live:
        raise MeshProblem(f"'{ob.name}' follows '{settings.transfer.source.name if settings.transfer.source else ''}' "
                          "(Transfer): stop that before binding it to handles.")
    offset_attribute.check_name(ob)
    roles = content.roles(ob)
    places = handle_matrices.local_places(ob, depsgraph)
    if settings.base == 'COMPUTED':
        content.options(ob)  # what it refuses leaves the present binding
    _forget(settings)
    if settings.base == 'OBJECT':
        outside_base.store_rest(ob, depsgraph, only_new=keep_rest)
    handle_matrices.store_rest(settings, places, only_new=keep_rest)
    handle_matrices.motions(settings, places)  # refuses places that can't be inverted

    signature = content.signature(ob, mesh_data.shape_signature(ob.data), roles)
    _start(ob, signature, roles)
    settings.signature = signature
    _note_handles(settings)
    registry.forget()
    node_group.ensure_modifier(ob)
    influence_changed(ob)
    targets_changed(ob)
    if wait or deformers.find(signature):
        _finish(signature)
        _bind_finished(ob, depsgraph)


def influence_changed(ob):
    modifier = node_group.find_modifier(ob)
    if modifier:
        node_group.set_influence(modifier, ob.detail_deform.influence, ob.detail_deform.invert_influence)


def targets_changed(ob):
    """To be told when a handle of a bound object gets another empty, or the object another base."""
    settings = ob.detail_deform
    if not settings.signature:
        return
    modifier = node_group.find_modifier(ob)
    if modifier:
        node_group.set_base(modifier, settings.base_object if settings.base == 'OBJECT' else None)
    dependency.depend_on(ob, [h.target for h in handle_matrices.enabled_handles(settings) if h.target])


def _owners(signature):
    return [ob for ob in registry.members() if ob.detail_deform.signature == signature]


def _finish(signature):
    """Waits for a bind. When it fails, its objects are unbound and hold the sentence."""
    try:
        return deformers.finish(signature)
    except native.NativeError as error:
        for ob in _owners(signature):
            _forget(ob.detail_deform)
            ob.detail_deform.problem = str(error)
        raise


def _bind_finished(ob, depsgraph):
    refresh(ob, depsgraph, force=True)
    deformers.drop_unused({o.detail_deform.signature for o in registry.members()})
    shown.keep(o.data for o in registry.members())


def _forget(settings):
    settings.signature = settings.stale = settings.problem = ""


def cancel(signature):
    """Stops a bind under way; the timer then takes back what it began."""
    under_way = deformers.bind_under_way(signature)
    if under_way:
        under_way.cancel()


def unbind(ob):
    """Forgets the binding; the mesh shows its rest shape."""
    settings = ob.detail_deform
    signature = settings.signature
    _forget(settings)
    for handle in settings.handles:
        handle.property_unset('rest_matrix')
        handle.property_unset('rest_euler')
    settings.property_unset('base_rest_matrix')
    slow_results.cancel(offset_attribute.token(ob.data))
    if not _owners(signature):
        cancel(signature)
    dependency.release(ob)
    modifier = node_group.find_modifier(ob)
    if modifier:
        node_group.set_base(modifier, None)
    shown.forget(ob.data)
    offset_attribute.remove(ob.data)


def _poll():
    """Timer: finishes binds that are ready. Returns the seconds to the next call, None to end."""
    for signature in deformers.binds_under_way():
        if deformers.is_running(signature):
            continue
        try:
            _finish(signature)
        except native.NativeError:
            continue
        for ob in _owners(signature):
            check_content(ob)  # it may have been edited meanwhile
            _bind_finished(ob, bpy.context.evaluated_depsgraph_get())
    redraw_panels()
    return _POLL_SECONDS if deformers.binds_under_way() else None


def stop_polling():
    if bpy.app.timers.is_registered(_poll):
        bpy.app.timers.unregister(_poll)


def make_base_object(ob):
    """The computed base as an object, which becomes the base at the next Bind."""
    settings = ob.detail_deform
    bound = deformers.find(settings.signature)
    if bound is None or settings.stale or settings.base == 'OBJECT':
        raise MeshProblem("Bind with a computed base first: that is what becomes an object.")
    rest = np.repeat(np.eye(4)[None, :3], bound.deformer.info.handle_count, axis=0)
    offsets = bound.deformer.offsets(rest, output='BASE').reshape(-1, 3)
    settings.base_object = outside_base.make(ob, mesh_data.positions(ob.data) + offsets)
    settings.base = 'OBJECT'
