# SPDX-License-Identifier: GPL-3.0-or-later
"""Bind, Unbind, and the changes of settings that a binding must react to."""

import numpy as np

from ..library import native
from ..scene import (carried, channel, deform_modifier, dependency, displayed, group_columns, handle_curves,
                     handle_motions, handle_owners, handle_rests, handle_transforms, mesh_data, offset_attribute,
                     outside_base, pieces, proportions, renamed_groups, split, stack, start)
from ..scene.mesh_data import MeshProblem
from ..scene.subject import Subject, enabled_handles
from . import binding_content, handle_follower, hints, lifecycle, registry, roles, update_options


def bind(ob, depsgraph, wait, keep_rest):
    """Starts to bind the object's region to its handles; with wait, or if the deformer is cached, also finishes.

    keep_rest: the empties' rests stay those of the last Bind, so that the pose survives an edit of the mesh. If a
    handle was added to the deformed surface, the present transforms of all handles and the present surface become the
    new start instead (scene/start.py).
    Raises MeshProblem or native.NativeError. Faults of the input that are found at once leave the present binding;
    after any other error the object has none.
    """
    _check(ob)
    start.forget_foreign(ob)
    if keep_rest:
        handle_follower.carry_along(ob, depsgraph)
    renamed_groups.update_names(ob)
    renamed_groups.store_names(ob)
    subject, topology = Subject(ob, depsgraph), mesh_data.topology_signature(ob.data)
    welded = split.WeldedMesh(ob, topology)
    found = roles.of_handles(subject, group_columns.entries, welded)
    # Examples that are no poses are refused while the present binding is still there. The options of a base object are
    # of its rest, which is stored below.
    options = binding_content.options(subject, group_columns.entries) if subject.settings.base == 'COMPUTED' else None
    _store_rests(subject, found.of_all, wait, keep_rest)
    subject = Subject(ob, depsgraph)
    found = roles.in_pieces(found, subject)  # whose curves have their rests only now
    if options is None:
        options = binding_content.options(subject)  # of the stored rest of a base object
    signature = binding_content.signature(binding_content.shape_signature(subject, topology), found, options)
    lifecycle.start(handle_follower, signature,
                    lambda: handle_follower.begin(subject, signature, found, options, welded))
    _store(ob, signature)
    # Memoized while the roles are at hand: reading groups is slow.
    hints.of_region(ob, found, welded, options.get('stiffness'))
    if wait or handle_follower.cache.find(signature):
        lifecycle.finish(handle_follower, signature)
        lifecycle.refresh(ob, depsgraph, force=True)
        lifecycle.take_in(ob, depsgraph.view_layer)
    lifecycle.drop_unused()


def _check(ob):
    """Raises MeshProblem or native.NativeError where the object can't be bound, whatever its groups and handles."""
    registry.check_mesh(ob)
    native.library()
    transfer = ob.detail_deform.transfer
    if transfer.live:
        raise MeshProblem(f"'{ob.name}' follows '{transfer.source.name if transfer.source else ''}': "
                          "press Follow to stop that (Detail Deform: Transfer) before you bind it to handles.")
    offset_attribute.check_name(ob)


def _store_rests(subject, roles_of_vertices, wait, keep_rest):
    """Stores all that motions are relative to: the rests of handles and of a base object, and the start. Ends the
    present binding, once all is checked that can be checked without changing anything."""
    ob, settings = subject.ob, subject.settings
    poses = _poses(subject, roles_of_vertices, only_new=keep_rest)
    transforms, curves = handle_transforms.local_transforms(subject, poses), pieces.present(subject)
    # The checks up to clear_binding() leave the present binding when they raise.
    if not keep_rest or subject.has_new_handle:
        handle_motions.check_rest(subject, transforms)
    if settings.base == 'COMPUTED' and keep_rest and subject.has_new_handle:
        if not wait and lifecycle.is_drafted(ob):
            raise MeshProblem(f"'{ob.name}' is still being bound, and the added handle starts from the result: wait "
                              "for it, and bind then.")
        lifecycle.settle(ob)  # the final result of the present pose is the new start
    handle_follower.clear_binding(settings)  # from here on an error leaves no binding
    for handle in filter(handle_curves.is_new, subject.handles):
        for name in handle_rests.BINDING_PROPERTIES:
            handle.property_unset(name)  # those of the empty that it had
    if settings.base == 'OBJECT':
        # Blender evaluates a hidden base object only if a modifier depends on it.
        stack.ensure_modifier(ob)
        _need_base(ob)
        subject.depsgraph.view_layer.update()
        outside_base.store_rest(ob, subject.depsgraph, only_new=keep_rest)
    else:
        outside_base.forget_rest(settings)
    settings.proportions = proportions.of(ob).ravel().tolist()
    for number, pose in poses.items():
        handle_transforms.set_pose_matrix(subject.handles[number], pose)
    only_new = _find_start(subject, transforms, keep_rest,
                           handle_transforms.rest_transforms(subject, transforms, roles_of_vertices))
    subject = Subject(ob, subject.depsgraph)
    handle_motions.motions(subject, transforms)  # raises if a rest is singular
    pieces.store(subject, curves, only_new, roles_of_vertices, subject.space.to(start.shape(ob)))


def _store(ob, signature):
    """Stores the new binding, and shows its result from now on."""
    settings = ob.detail_deform
    settings.signature, settings.bound_points = signature, carried.sample_points(ob.data)
    handle_follower.note_handles(ob)
    settings.begun_as = ob.name
    registry.forget()
    stack.ensure_modifier(ob)
    influence_changed(ob)
    targets_changed(ob)


def _poses(subject, roles_of_vertices, only_new):
    """{number: handle_transforms.pose_matrix_beside_bone()} of the handles with empties; only_new: those without a
    rest."""
    chosen = {number: subject.handles[number].target for number in subject.own}
    chosen = {number: empty for number, empty in chosen.items()
              if empty and (not only_new or subject.is_new(number))}
    if not chosen or not displayed.needs_measuring(subject.ob) or subject.settings.base == 'OBJECT':
        return dict.fromkeys(chosen)
    order = np.argsort(roles_of_vertices, kind='stable')
    begins, ends = (np.searchsorted(roles_of_vertices[order], list(chosen), side) for side in ('left', 'right'))
    motions = displayed.similarities(subject.ob, [order[begin:end] for begin, end in zip(begins, ends)],
                                     subject.depsgraph)
    return {number: handle_transforms.pose_matrix_beside_bone(subject.ob, empty, motion, subject.depsgraph)
            for (number, empty), motion in zip(chosen.items(), motions)}


def _find_start(subject, transforms, keep_rest, rests):
    """Stores the start: the shape that is bound, and the transforms that the handles' motions are relative to. Returns
    whether handles keep those that they have."""
    if subject.settings.base == 'OBJECT' or not keep_rest:
        start.forget(subject.mesh)
    if subject.settings.base == 'COMPUTED':
        start.store_key_offsets(subject.ob)
        if keep_rest and subject.has_new_handle and start.store_previous_offsets(subject.ob):
            handle_motions.make_present_rest(subject, transforms)
            return False
    handle_rests.store_rest(subject.handles, rests, only_new=keep_rest)
    return keep_rest


def go_home(ob, depsgraph, wait):
    """Makes the undeformed mesh the start again, by a new bind, if the start was deformed or a handle was added. To be
    called when all handles are back at their home places."""
    settings = ob.detail_deform
    if settings.signature and (start.forget_previous_offsets(ob.data) or Subject(ob).has_new_handle):
        handle_rests.reset_rests_to_homes(settings)
        channel.show_rest(ob)  # else bind() would take the shown deformation as the start
        bind(ob, depsgraph, wait, keep_rest=True)


def show_again(ob):
    """Adds the modifier of a bound object again if it was removed."""
    if ob.detail_deform.signature and deform_modifier.find(ob) is None:
        stack.ensure_modifier(ob)
        influence_changed(ob)
        targets_changed(ob)


def influence_changed(ob):
    modifier = deform_modifier.find(ob)
    if modifier:
        deform_modifier.set_influence(modifier, ob.detail_deform.influence, ob.detail_deform.invert_influence)


def targets_changed(ob):
    """Makes a bound object depend on its empties and base. To be called when any of them is replaced."""
    handle_owners.forget()
    settings = ob.detail_deform
    if not settings.signature:
        return
    _need_base(ob)
    dependency.depend_on(ob, [read for handle in enabled_handles(settings) if handle.target
                              for read in handle_curves.reads(handle)])


def _need_base(ob):
    """Makes the modifier depend on the base object's geometry, so that Blender evaluates it along with the surface."""
    settings, modifier = ob.detail_deform, deform_modifier.find(ob)
    if modifier:
        deform_modifier.set_base(modifier, settings.base_object if settings.base == 'OBJECT' else None)


def cancel(ob):
    """Cancels a bind under way; the timer of lifecycle.py then removes the incomplete binding."""
    handle_follower.cache.cancel(ob.detail_deform.signature)


def unbind(ob, keep_rest=False):
    """Removes the binding; the mesh shows its rest shape. keep_rest: the handles keep their home places as rest."""
    homes = [handle_rests.home_to_store(handle) for handle in ob.detail_deform.handles] if keep_rest else ()
    lifecycle.end(handle_follower, ob)
    for handle, kept in zip(ob.detail_deform.handles, homes):
        handle.rest_matrix, handle.rest_euler, handle.rest_order, handle.rest_curve = kept


def make_base_object(ob):
    """Makes an object of the computed base surface, as Smooth Preview shows it at rest, which is the base from the next
    Bind on. Raises MeshProblem."""
    settings = ob.detail_deform
    entry = handle_follower.cache.find(settings.signature)
    if entry is None or settings.stale or settings.base == 'OBJECT':
        raise MeshProblem("Set Base to Computed and press Bind first: that base is what becomes an object.")
    if start.has_previous_offsets(ob.data):
        raise MeshProblem("A handle was added to the deformed surface, and a base is made of the mesh without "
                          "deformation: put all handles back to rest first (All Back to Rest).")
    rest = native.at_rest(entry.made.info.handle_count)
    arguments = {**update_options.arguments(settings), 'method': 'DETAIL', 'output': 'BASE'}
    offsets = proportions.bound(settings).back(entry.made.offsets(rest, **arguments).reshape(-1, 3))
    settings.base_object = outside_base.make(ob, mesh_data.positions(ob.data) + offsets)
    settings.base = 'OBJECT'
