# SPDX-License-Identifier: GPL-3.0-or-later
"""The life of a binding: made, followed, noticed when it no longer fits, restored, undone."""

import time

import bpy
import numpy as np

from ..library import native
from ..scene import dependency, examples, handle_matrices, mesh_data, node_group, outside_base
from . import deformers, look, slow_results
from ..scene.mesh_data import MeshProblem

_POLL_SECONDS = 0.1
_EXAMPLES = 'examples-'  # before their part of a signature
_BASE_CHANGED = "The base object, its mesh or its choice was changed since Bind."
_TOPOLOGY_CHANGED = "The mesh's vertices or faces were changed since Bind."
_VERTICES_MOVED = "The mesh's vertices were moved since Bind."


# What is bound, and to which content

def _handle_groups(settings):
    return [(h.name, h.vertex_group) for h in handle_matrices.enabled_handles(settings)]


def _options(ob):
    """Of native.Bind: what a binding depends on beside mesh and roles."""
    settings = ob.detail_deform
    if settings.base == 'OBJECT':
        return {'base': outside_base.rest_positions(ob)}
    smoothing = settings.metric_smoothing if settings.base_metric == 'SURFACE' else 0.0
    options = {'base_metric': settings.base_metric, 'metric_smoothing': smoothing,
               'smoothness': settings.smoothness}
    try:
        poses = examples.positions(ob)
    except MeshProblem:
        if settings.method == 'EXAMPLES':
            raise
        poses = None  # they matter to that method alone
    return options if poses is None else {**options, 'examples': poses}


def _signature(ob, shape, roles):
    texts = {'examples': lambda value: _EXAMPLES + mesh_data.signature(value), 'base': mesh_data.signature,
             'metric_smoothing': "{:g}".format}
    return '.'.join([*shape, mesh_data.signature(roles),
                     *(texts.get(name, str)(value) for name, value in _options(ob).items())])


def _roles(ob):
    settings = ob.detail_deform
    return mesh_data.roles(ob, settings.region, _handle_groups(settings),
                           need_handles=settings.base == 'COMPUTED')


def bound_objects(objects):
    """Those with a binding, whether its deformer is at hand or not."""
    return [ob for ob in objects if ob.type == 'MESH' and ob.detail_deform.signature]


def check_content(ob):
    """Compares mesh, groups and options with what was bound, and notes what differs.

    By content: swapped vertices and re-painted weights count, a mesh that is as it was does not.
    """
    settings = ob.detail_deform
    if ob.type != 'MESH' or not settings.signature or ob.mode == 'EDIT':
        return
    stale = _difference(ob)
    if stale in {_TOPOLOGY_CHANGED, _VERTICES_MOVED} and node_group.find_modifier(ob) is None:
        unbind(ob)
        settings.problem = ("The modifier was applied by hand, or removed and the mesh edited, so the surface is no "
                            "longer bound: Bind to go on from here.")
    elif settings.stale != stale:
        settings.stale = stale


def check_base(ob):
    """As check_content, of the base object's mesh alone, which may change in every frame."""
    settings = ob.detail_deform
    if not settings.signature or settings.base != 'OBJECT' or settings.stale not in {"", _BASE_CHANGED}:
        return
    try:
        same = settings.signature.endswith('.' + mesh_data.signature(outside_base.rest_positions(ob)))
    except MeshProblem:
        return  # the next update says it
    stale = "" if same else _BASE_CHANGED
    if settings.stale != stale:
        settings.stale = stale


def _difference(ob):
    settings = ob.detail_deform
    positions, topology, roles, *options = settings.signature.split('.', 3)
    shape = mesh_data.shape_signature(ob.data)
    if shape[1] != topology:
        return _TOPOLOGY_CHANGED
    if shape[0] != positions:
        return _VERTICES_MOVED
    try:
        current = _signature(ob, shape, _roles(ob)).split('.', 3)
    except MeshProblem as problem:
        return str(problem)
    if current[2] != roles:
        return "The region, the handles or their vertex groups were changed since Bind."
    if current[3:] == options:
        return ""
    if settings.method != 'EXAMPLES' and _without_examples(current[3]) == _without_examples(options[0]):
        return ""
    if settings.base == 'OBJECT':
        return _BASE_CHANGED
    return "Settings or examples that need a new Bind were changed."


def _without_examples(options):
    return options.split(f'.{_EXAMPLES}')[0]


# Following the handles

def refresh(ob, depsgraph, force=False):
    """Brings the object's offsets up to date with its empties. Does nothing when no empty moved, or, unless
    forced to, while the modifier is not shown.

    Never raises for what the user can cause: the sentence goes to the status.
    """
    settings = ob.detail_deform
    if ob.type != 'MESH' or not settings.signature or settings.stale or ob.mode == 'EDIT':
        return
    if not (force or node_group.is_shown(ob, depsgraph)):
        return
    try:
        mesh_data.check_object(ob)
        mesh_data.check_groups(ob, settings.region, _handle_groups(settings))
        bound = deformers.find(settings.signature) or _restore(ob, depsgraph)
        if bound is not None:
            _follow(ob, bound, depsgraph, force)
            _note(settings, "")
    except (MeshProblem, native.NativeError) as problem:
        _note(settings, str(problem))


def _note(settings, problem):
    if settings.problem != problem:
        settings.problem = problem


def _follow(ob, bound, depsgraph, force):
    start = time.perf_counter()
    settings = ob.detail_deform
    if bound.deformer.info.vertex_count != len(ob.data.vertices):
        settings.stale = _TOPOLOGY_CHANGED
        return
    places = handle_matrices.local_places(ob, depsgraph)
    motions = handle_matrices.motions(settings, places)
    asked = look.options(settings)
    base = None
    shown = (motions.tobytes(), asked)
    if settings.base == 'OBJECT':
        base = outside_base.deformed_positions(ob, depsgraph)
        shown += (base.tobytes(),)
    slow = look.is_slow(settings)
    turns = np.zeros((len(motions), 3))
    if look.steps(settings) > 1:
        turns = handle_matrices.turns(settings, places, depsgraph)
        shown += (settings.steps, turns.tobytes())
    if not force and bound.shown.get(ob.name) == shown:
        return
    bound.shown.pop(ob.name, None)
    slow_results.cancel(ob.name)
    slow_results.make_way(bound.deformer)
    mesh_data.write_offsets(ob.data, bound.deformer.offsets(motions, base, **look.quick(asked)))
    bound.shown[ob.name] = shown
    bound.only_moved[ob.name] = [
        handle.name for handle, motion in zip(handle_matrices.enabled_handles(settings), motions)
        if handle_matrices.only_moves(motion)]
    if settings.method == 'EXAMPLES':
        bound.example_weights[ob.name] = bound.deformer.example_weights().tolist()
        if depsgraph.mode == 'VIEWPORT' and not bpy.app.background:
            redraw_panels()  # they show the weights
    bound.update_ms = 1e3 * (time.perf_counter() - start)
    if slow and not (base is None and np.abs(motions - np.eye(4)[:3]).max() < 1e-6 and not turns.any()):
        # A render must not show the quick result, and without a window there is no drag to keep up with.
        wait = bpy.app.background or depsgraph.mode == 'RENDER'
        steps = {'steps': look.steps(settings), 'turns': turns}
        _follow_slowly(ob, bound.deformer, shown, motions, {**asked, **steps, 'base': base}, wait)
    else:
        bound.slow[ob.name] = (shown, None)  # at rest there is nothing more to show


def _follow_slowly(ob, deformer, shown, motions, asked, wait):
    """Asks for the slow result, to be shown if it is still what the handles ask for."""
    name, signature = ob.name, ob.detail_deform.signature

    def still_wanted():
        present, bound = bpy.data.objects.get(name), deformers.find(signature)
        fits = present and bound and present.detail_deform.signature == signature
        return (present, bound) if fits and bound.shown.get(name) == shown else (None, None)

    def start(wait):
        present, _ = still_wanted()
        if present is None:
            raise native.NativeError("The object was changed.")
        return native.Update(deformer, motions, wait=wait, **asked)

    def deliver(offsets, info):
        present, bound = still_wanted()
        if present is not None:
            mesh_data.write_offsets(present.data, offsets)
            bound.slow[name] = (shown, info)
            redraw_panels()

    def refuse(sentence):
        present, _ = still_wanted()
        if present is not None:
            _note(present.detail_deform, sentence)
            redraw_panels()

    if wait:  # in a render another thread, which must not set up timers
        deliver(*start(wait=True).finish())
    else:
        slow_results.request(name, deformer, start, deliver, refuse, redraw_panels)


def wait(ob, depsgraph):
    """Waits for a bind that is under way, or that the file asks for."""
    settings = ob.detail_deform
    refresh(ob, depsgraph)
    if deformers.bind_under_way(settings.signature):
        _finish(settings.signature)
        refresh(ob, depsgraph)


def settle(ob):
    """Waits for a slow result that is under way."""
    slow_results.finish(ob.name)


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
        _start(ob, signature, _roles(ob))
    # A render must not show a frame that isn't finished, and without a window nothing polls.
    if bpy.app.background or depsgraph.mode == 'RENDER':
        return _finish(signature)
    return None


# Binding and unbinding

def _bind_arguments(ob, roles):
    """Positional arguments and those by name of native.Bind."""
    return ((mesh_data.positions(ob.data), mesh_data.triangles(ob.data), roles,
             len(handle_matrices.enabled_handles(ob.detail_deform))), _options(ob))


def _start(ob, signature, roles):
    arguments, options = _bind_arguments(ob, roles)
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
    roles = _roles(ob)
    places = handle_matrices.local_places(ob, depsgraph)
    if settings.base == 'COMPUTED':
        _options(ob)  # what it refuses leaves the present binding
    _forget(settings)
    if settings.base == 'OBJECT':
        outside_base.store_rest(ob, depsgraph, only_new=keep_rest)
    handle_matrices.store_rest(settings, places, only_new=keep_rest)
    handle_matrices.motions(settings, places)  # refuses places that can't be inverted

    signature = _signature(ob, mesh_data.shape_signature(ob.data), roles)
    _start(ob, signature, roles)
    settings.signature = signature
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
    return [ob for ob in bound_objects(bpy.data.objects) if ob.detail_deform.signature == signature]


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
    deformers.drop_unused({o.detail_deform.signature for o in bound_objects(bpy.data.objects)})


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
    slow_results.cancel(ob.name)
    if not _owners(signature):
        cancel(signature)
    dependency.release(ob)
    modifier = node_group.find_modifier(ob)
    if modifier:
        node_group.set_base(modifier, None)
    mesh_data.remove_offsets(ob.data)


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


def redraw_panels():
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in {'PROPERTIES', 'VIEW_3D'}:
                area.tag_redraw()


def make_base_object(ob):
    """The computed base as an object, which becomes the base at the next Bind."""
    settings = ob.detail_deform
    bound = deformers.find(settings.signature)
    if bound is None or settings.stale or settings.base == 'OBJECT':
        raise MeshProblem("Bind with a computed base first: that is what becomes an object.")
    rest = np.repeat(np.eye(4)[None, :3], bound.deformer.info.handle_count, axis=0)
    offsets = bound.deformer.offsets(rest, output='BASE').reshape(-1, 3)
    bound.shown.pop(ob.name, None)
    settings.base_object = outside_base.make(ob, mesh_data.positions(ob.data) + offsets)
    settings.base = 'OBJECT'
