# SPDX-License-Identifier: GPL-3.0-or-later
"""Bind, Unbind, and the changes of settings that a binding must react to."""

from typing import NamedTuple

import numpy as np

from ..library import native
from ..scene import (carried, dependency, displayed, group_columns, handle_matrices, handle_owners, mesh_data,
                     node_group, offset_attribute, outside_base, proportions, renamed_groups, split, stack, start)
from ..scene.mesh_data import MeshProblem
from . import bound, content, hints, life, registry


def bind(ob, depsgraph, wait, keep_rest):
    """Starts to bind the object's region to its handles; with wait, or if the deformer is cached, also finishes.

    keep_rest: the empties' rest places stay those of the last Bind, so that the pose survives an edit of the mesh. If a
    handle was added to the deformed surface, the present places of all handles and the present surface become the new
    start instead (scene/start.py).
    Raises MeshProblem or native.NativeError. Faults of the input that are found at once leave the present binding;
    after any other error the object has none.
    """
    registry.check_mesh(ob)
    native.library()
    settings = ob.detail_deform
    if settings.transfer.live:
        raise MeshProblem(f"'{ob.name}' follows '{settings.transfer.source.name if settings.transfer.source else ''}': "
                          "press Follow to stop that (Detail Deform: Transfer) before you bind it to handles.")
    offset_attribute.check_name(ob)
    start.forget_foreign(ob)
    if keep_rest:
        bound.carry_along(ob, depsgraph)
    topology = mesh_data.topology_signature(ob.data)
    joined = split.WeldedMesh(ob, topology)
    renamed_groups.update_names(ob)
    renamed_groups.store_names(ob)
    known = content.roles_of(ob, group_columns.entries, joined)
    roles = known.of_all
    poses = _poses(ob, roles, depsgraph, only_new=keep_rest)
    places = handle_matrices.local_transforms(ob, depsgraph, poses)
    # The checks up to bound.refuse() leave the present binding when they raise.
    if not keep_rest or _has_come(settings):
        handle_matrices.check_rest(settings, places)
    options = None if settings.base == 'OBJECT' else content.options(ob)
    if settings.base == 'COMPUTED' and keep_rest and _has_come(settings):
        if not wait and life.is_drafted(ob):
            raise MeshProblem(f"'{ob.name}' is still being bound, and the added handle starts from the result: wait "
                              "for it, and bind then.")
        life.settle(ob)  # the final result of the present pose is the new start
    bound.refuse(ob, "")  # from here on an error leaves no binding
    if settings.base == 'OBJECT':
        # Blender evaluates a hidden base object only if a modifier depends on it.
        stack.ensure_modifier(ob)
        _need_base(ob)
        depsgraph.view_layer.update()
        outside_base.store_rest(ob, depsgraph, only_new=keep_rest)
        options = content.options(ob)
    else:
        outside_base.forget_rest(settings)
    settings.proportions = proportions.of(ob).ravel().tolist()
    for number, pose in poses.items():
        handle_matrices.set_pose_matrix(handle_matrices.enabled_handles(settings)[number], pose)
    _find_start(ob, places, keep_rest, handle_matrices.rest_transforms(ob, places, roles, depsgraph))
    handle_matrices.motions(settings, places)  # raises if a rest place is singular

    signature = content.signature(content.shape_signature(ob, topology), known, options)
    life.start(bound, signature, lambda: bound.begin(ob, signature, known, options, joined))
    settings.signature, settings.bound_points = signature, carried.sample_points(ob.data)
    hints.of_region(ob, known, joined)  # memoized while the roles are at hand: reading groups is slow
    bound.note_handles(settings)
    settings.begun_as = ob.name
    registry.forget()
    stack.ensure_modifier(ob)
    influence_changed(ob)
    targets_changed(ob)
    if wait or bound.cache.find(signature):
        life.finish(bound, signature)
        life.refresh(ob, depsgraph, force=True)
        life.take_in(ob, depsgraph.view_layer)
    life.drop_unused()


def _poses(ob, roles, depsgraph, only_new):
    """{number: handle_matrices.pose_matrix_beside_bone()} of the handles with empties; only_new: those without a rest
    place."""
    chosen = {number: handle.target for number, handle in enumerate(handle_matrices.enabled_handles(ob.detail_deform))
              if handle.target and not handle.mirrors and not (only_new and handle_matrices.has_rest(handle))}
    if not chosen or not displayed.needs_measuring(ob) or ob.detail_deform.base == 'OBJECT':
        return dict.fromkeys(chosen)
    order = np.argsort(roles, kind='stable')
    begins, ends = (np.searchsorted(roles[order], list(chosen), side) for side in ('left', 'right'))
    motions = displayed.similarities(ob, [order[begin:end] for begin, end in zip(begins, ends)], depsgraph)
    return {number: handle_matrices.pose_matrix_beside_bone(ob, empty, motion, depsgraph)
            for (number, empty), motion in zip(chosen.items(), motions)}


def _find_start(ob, places, keep_rest, rest_places):
    """Stores the start: the shape that is bound, and the places that the handles' motions are relative to."""
    settings = ob.detail_deform
    if settings.base == 'OBJECT' or not keep_rest:
        start.forget(ob.data)
    if settings.base == 'COMPUTED':
        start.store_key_offsets(ob)
        if keep_rest and _has_come(settings) and start.store_previous_offsets(ob):
            handle_matrices.make_present_rest(settings, places)
            return
    handle_matrices.store_rest(settings, rest_places, only_new=keep_rest)


def go_home(ob, depsgraph, wait):
    """Makes the undeformed mesh the start again, by a new bind, if the start was deformed or a handle was added. To be
    called when all handles are back at their home places."""
    settings = ob.detail_deform
    if settings.signature and (start.forget_previous_offsets(ob.data) or _has_come(settings)):
        handle_matrices.reset_rests_to_homes(settings)
        offset_attribute.remove(ob.data)  # else bind() would take the shown deformation as the start
        bind(ob, depsgraph, wait, keep_rest=True)


def _has_come(settings):
    """Whether a handle was added since the last Bind."""
    return any(not (handle.mirrors or handle_matrices.has_rest(handle))
               for handle in handle_matrices.enabled_handles(settings))


def show_again(ob):
    """Adds the modifier of a bound object again if it was removed."""
    if ob.detail_deform.signature and node_group.find_modifier(ob) is None:
        stack.ensure_modifier(ob)
        influence_changed(ob)
        targets_changed(ob)


def influence_changed(ob):
    modifier = node_group.find_modifier(ob)
    if modifier:
        node_group.set_influence(modifier, ob.detail_deform.influence, ob.detail_deform.invert_influence)


def targets_changed(ob):
    """Makes a bound object depend on its empties and base. To be called when any of them is replaced."""
    handle_owners.forget()
    settings = ob.detail_deform
    if not settings.signature:
        return
    _need_base(ob)
    dependency.depend_on(ob, [h.target for h in handle_matrices.enabled_handles(settings) if h.target])


def _need_base(ob):
    """Makes the modifier depend on the base object's geometry, so that Blender evaluates it along with the surface."""
    settings, modifier = ob.detail_deform, node_group.find_modifier(ob)
    if modifier:
        node_group.set_base(modifier, settings.base_object if settings.base == 'OBJECT' else None)


_STATE = ('signature', 'stale', 'problem', 'bound_points', 'compared_handles', 'proportions')
_OF_MESHES = (offset_attribute.PREVIOUS_OFFSETS, offset_attribute.SHAPE_KEY_OFFSETS)


class Kept(NamedTuple):
    """The state of a binding, to be restored if the bind that replaces it is cancelled."""
    state: list  # values of _STATE
    places: list  # values of handle_matrices.BINDING_PROPERTIES, for each handle
    attributes: list  # vectors of the attributes _OF_MESHES; None for each that the mesh lacks


def kept(ob):
    """The present Kept, for restore()."""
    settings = ob.detail_deform
    return Kept([getattr(settings, name) for name in _STATE],
                [[getattr(handle, name)[:] for name in handle_matrices.BINDING_PROPERTIES]
                 for handle in settings.handles],
                [offset_attribute.read(ob.data, name) if offset_attribute.find(ob.data, name) else None
                 for name in _OF_MESHES])


def restore(ob, present):
    settings = ob.detail_deform
    for handle, places in zip(settings.handles, present.places):
        for name, place in zip(handle_matrices.BINDING_PROPERTIES, places):
            setattr(handle, name, place)
    for name, vectors in zip(_OF_MESHES, present.attributes):
        if vectors is None:
            offset_attribute.remove_attribute(ob.data, name)
        else:
            offset_attribute.put(ob.data, name, vectors.ravel())
    for name, value in zip(_STATE, present.state):
        setattr(settings, name, value)
    if settings.signature:
        targets_changed(ob)
    else:
        dependency.release(ob)
    registry.forget()


def cancel(ob):
    """Cancels a bind under way; the timer of life.py then removes the incomplete binding."""
    bound.cache.cancel(ob.detail_deform.signature)


def unbind(ob, keep_rest=False):
    """Removes the binding; the mesh shows its rest shape. keep_rest: the handles keep their home places as rest."""
    homes = [handle_matrices.home_to_store(handle) for handle in ob.detail_deform.handles] if keep_rest else ()
    life.end(bound, ob)
    for handle, kept in zip(ob.detail_deform.handles, homes):
        handle.rest_matrix, handle.rest_euler, handle.rest_order = kept


def make_base_object(ob):
    """Makes an object of the computed base surface, which is the base from the next Bind on. Raises MeshProblem."""
    settings = ob.detail_deform
    entry = bound.cache.find(settings.signature)
    if entry is None or settings.stale or settings.base == 'OBJECT':
        raise MeshProblem("Set Base to Computed and press Bind first: that base is what becomes an object.")
    if start.has_previous_offsets(ob.data):
        raise MeshProblem("A handle was added to the deformed surface, and a base is made of the mesh without "
                          "deformation: put all handles back to rest first (All Back to Rest).")
    rest = native.at_rest(entry.made.info.handle_count)
    offsets = proportions.bound(settings).back(entry.made.offsets(rest, output='BASE').reshape(-1, 3))
    settings.base_object = outside_base.make(ob, mesh_data.positions(ob.data) + offsets)
    settings.base = 'OBJECT'
