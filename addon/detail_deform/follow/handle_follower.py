# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes that are bound to handles, as a kind.Kind. When their content changes, they are stale until the next Bind."""

import copy

import bpy
import numpy as np

from ..library import native
from ..scene import (carried, channel, deform_modifier, dependency, handle_motions, handle_rests, handle_transforms,
                     mesh_data, mirror_plane, offset_attribute, outside_base, renamed_groups, split, start)
from ..scene.mesh_data import MeshProblem
from ..scene.subject import Subject
from ..scene.window import redraw_panels
from . import binding_content, frame_results, job_cache, roles, slow_results, update_options, written_offsets
from .bind_job import BindJob
from .parts_job import PartsJob
from .slow_update import SlowUpdate

cache = job_cache.Cache(spare=3)  # of native.Deformer or composed_deformer.Deformer; during a bind of drafts

# Vertices. Tuned: at 40,401 a draft comes only 150 ms before the result (native/bench/RESULTS.md).
_DRAFT_FROM = 100_000


def has(ob):
    return bool(ob.detail_deform.signature)


def settings(ob):
    return ob.detail_deform


def content_of(ob):
    return ob.detail_deform.signature


def is_live(ob):
    return ob.detail_deform.live


def others(ob):
    """Other objects whose meshes are part of the content: examples."""
    return [example.object for example in ob.detail_deform.examples if example.object]


# Whether the content is unchanged

def compare(ob):
    """Stores how mesh, groups and options differ from those that were bound. Returns a sentence if the binding is lost.

    Hashes are compared: swapped vertices and re-painted weights make a difference, an edit that was undone does not.
    """
    of = ob.detail_deform
    if ob.mode == 'EDIT':
        return ""
    note_handles(ob)
    stale = binding_content.difference(Subject(ob))
    is_edited = stale in {binding_content.TOPOLOGY_CHANGED, binding_content.VERTICES_MOVED}
    # Tools that change the topology remove keys, too.
    is_key_applied = stale == binding_content.VERTICES_MOVED and channel.is_lost(ob.data)
    if is_edited and deform_modifier.find(ob) is None or is_key_applied:
        what = "shape key" if is_key_applied else "modifier"
        return (f"The {what} was applied by hand, or removed and the mesh edited, so the surface is no longer bound: "
                "press Bind to go on from here.")
    if stale == binding_content.TOPOLOGY_CHANGED:
        channel.take_in_joined(ob)
    if stale == binding_content.VERTICES_MOVED:
        channel.take_in_moved_vertices(ob)
        carry_along(ob, bpy.context.evaluated_depsgraph_get())
    if of.stale != stale:
        if not is_edited:
            _show_whole(ob)
        of.stale = stale
        # A draft stays until its result comes.
        if stale == binding_content.TOPOLOGY_CHANGED or not frame_results.is_draft(ob.data):
            frame_results.forget(ob.data)  # the edit may have changed the stored offsets
    return ""


def carry_along(ob, depsgraph):
    """Transforms all that is stored in the object's space after Set Origin or Apply has changed that space, so that the
    next Bind keeps the pose."""
    of = ob.detail_deform
    motion = carried.space_change(ob.data, of.bound_points) if of.bound_points else None
    if motion is None:
        return
    try:
        now = carried.transforms(ob, depsgraph)
    except MeshProblem:
        return  # the next update reports it
    record = frame_results.by(ob.data)
    before = record.transforms if record and record.transforms is not None else carried.rest_transforms(of)
    if len(before) == len(now) and carried.moved_with_space(motion, before, now):
        carried.carry(ob, motion)
    else:
        # The user moved all vertices: later motions are relative to this.
        of.bound_points = carried.sample_points(ob.data)


def _show_whole(ob):
    """Replaces the quick result of a drag by the refined one, as a stale object gets no further frames."""
    record = frame_results.by(ob.data)
    if record is not None and record.is_hurried:
        try:
            slow_results.finish(offset_attribute.token(ob.data))
        except native.NativeError:
            pass  # the quick result stays


def note_handles(ob):
    order = binding_content.order_of_handles(Subject(ob))
    if ob.detail_deform.compared_handles != order:
        ob.detail_deform.compared_handles = order


def check_base(ob):
    """As compare(), but only for the base object's mesh, which may change in every frame."""
    of = ob.detail_deform
    if not of.signature or of.base != 'OBJECT' or of.stale not in {"", binding_content.BASE_CHANGED}:
        return
    try:
        stale = "" if binding_content.is_of_base(ob) else binding_content.BASE_CHANGED
    except MeshProblem:
        return  # the next update reports it
    if of.stale != stale:
        of.stale = stale


def is_outdated(subject):
    """Whether handles were added, removed or reordered since the last comparison."""
    return subject.settings.compared_handles != binding_content.order_of_handles(subject)


def is_fit(subject):
    return not subject.settings.stale


def is_for(ob, entry):
    """Whether a deformer of the cache fits this object for certain."""
    if entry.made.is_draft and ob.detail_deform.method == 'EXAMPLES':
        return False  # examples need handles' vertices that the coarse mesh of a draft lacks
    return entry.made.vertex_count == len(ob.data.vertices)


# Made and lost

def begin(subject, signature, found, options, welded):
    """Starts to bind, and returns the job. found: roles.Roles. welded: the object's split.WeldedMesh."""
    triangles = mesh_data.triangles(subject.mesh)
    hung = roles.hung(subject.mesh, found.of_all, triangles)
    written_offsets.know(subject, signature, welded, triangles, hung, found.of_all)
    of_all = options | {name: subject.space.to(options[name]) for name in ('examples', 'base') if name in options}
    if 'stiffness' in options:
        of_all['stiffness'] = welded.largest(options['stiffness'])
    of_all['draft'] = _has_draft(len(hung))
    parts = binding_content.parts_to_bind(subject, found, welded, triangles, hung)
    if subject.settings.base == 'OBJECT':  # without a first update: the base may have moved by then
        return native.Bind(*parts[0].bind_arguments(), **of_all)
    arguments = update_options.quick(with_free(update_options.arguments(subject.settings), subject))
    jobs = [BindJob(native.Bind(*part.bind_arguments(), **part.bind_options(of_all)), len(part.numbers),
                    part.update_arguments(arguments)) for part in parts]
    return jobs[0] if parts[0].is_whole and len(parts) == 1 else PartsJob(parts, jobs, len(hung))


def _has_draft(vertex_count):
    """Whether to ask for a draft: only for large meshes, and only if a window shows it."""
    return vertex_count >= _DRAFT_FROM and not bpy.app.background


def with_free(arguments, subject):
    """The options of an update, with those for free handles if there are any."""
    if not subject.are_free.any():
        return arguments
    pivots, of_each = subject.space.to(handle_motions.pivots(subject)), subject.pieces.of_each
    return arguments | {'handle_turns': of_each(subject.are_free.astype(np.int32)), 'pivots': of_each(pivots)}


def job(ob):
    subject, welded = Subject(ob), split.WeldedMesh(ob)
    return begin(subject, content_of(ob), roles.of(subject, welded=welded), binding_content.options(subject), welded)


def refuse(ob, sentence):
    """Stores why the object could not be bound, and that it has no binding."""
    clear_binding(ob.detail_deform)
    ob.detail_deform.problem = sentence


def clear_binding(of):
    of.signature = of.stale = of.problem = of.render_problem = ""


def forget(ob):
    """Removes all data of the binding from the object."""
    of = ob.detail_deform
    clear_binding(of)
    for handle in of.handles:
        for name in handle_rests.BINDING_PROPERTIES:
            handle.property_unset(name)
    start.forget(ob.data)
    outside_base.forget_rest(of)
    of.property_unset('proportions')
    dependency.release(ob)


# A frame

def check_frame(subject):
    try:
        subject.check_groups()
    except MeshProblem:
        if not renamed_groups.update_names(subject.ob):
            raise
        check_frame(Subject(subject.ob))  # another group may be missing


class Frame:
    """The present motions of the handles, as kind.Frame."""

    def __init__(self, subject, deformer, record):
        of = subject.settings
        self._ob, self._deformer, self.is_draft = subject.ob, deformer, deformer.is_draft
        transforms = handle_transforms.local_transforms(subject, last=record and record.transforms)
        motions = handle_motions.motions(subject, transforms)
        only_moved = handle_motions.are_translations(motions) & ~subject.are_free
        only_moved[list(subject.pieces.rests)] = False  # their points may have moved otherwise
        self._only_moved = [subject.handles[number].name for number in np.flatnonzero(only_moved)]
        turns = np.zeros((len(motions), 3))
        knows_turns = of.base != 'OBJECT' and update_options.knows_whole_turns(of)
        if knows_turns:
            turns = handle_motions.turn_vectors(subject, transforms)
        self._of_pieces = subject.pieces.motions(subject, transforms, subject.space.motions(motions), turns,
                                                 last=record and record.of_pieces)
        self._motions, turns = self._of_pieces
        self._turns, self._base = turns if knows_turns else np.zeros_like(turns), None
        self._transforms = None if of.base == 'OBJECT' else transforms[subject.own]
        arguments, self._soft_border = update_options.arguments(of), update_options.soft_border(of)
        self.key = (of.signature, self._motions.tobytes(), arguments.copy(), subject.are_free.tobytes(),
                    mirror_plane.signature(subject.ob), self._soft_border, update_options.loose_parts(of))
        self._arguments = with_free(arguments, subject)
        if of.base == 'OBJECT':
            self._base = subject.space.to(outside_base.deformed_positions(subject.ob, subject.depsgraph))
            self.key += (self._base.tobytes(),)
        elif knows_turns:
            self.key += (self._turns.tobytes(),)

    def by(self, deformer):
        """A copy of the frame for another deformer, one that is no draft."""
        frame = copy.copy(self)
        frame._deformer, frame.is_draft = deformer, False
        return frame

    def is_of(self, ob):
        """Whether the object is still bound to the same content."""
        return self.key[0] == ob.detail_deform.signature

    def offsets(self, share):
        """As kind.Frame: the quick result if the method has a slow one, or if share is less than 1."""
        slow_results.cancel(offset_attribute.token(self._ob.data))
        slow_results.make_way(self._deformer)
        arguments = self._arguments_of_update()
        if self.is_draft or self._deformer.info.coarse_vertex_count:  # refinement on a coarse mesh is cheap
            share = 1.0
        quick = update_options.quick(arguments, share)
        self.is_hurried = quick.get('refine') != update_options.quick(arguments).get('refine')
        found = self._deformer.offsets(self._motions, self._base, **quick)
        return written_offsets.offsets(Subject(self._ob), found, self._deformer.fades)

    def _arguments_of_update(self):
        of_all = {**self._arguments, 'turns': self._turns}
        if self._deformer.fades:
            of_all['soft_border'] = self._soft_border
        return of_all

    def written(self, record, wait):
        """As kind.Frame: completes the record, and starts the slow result, or waits for it."""
        of = self._ob.detail_deform
        record.transforms, record.only_moved = self._transforms, self._only_moved
        record.of_pieces = self._of_pieces
        if self.is_draft:
            record.draft, record.is_final = self, False
            return
        if of.method == 'EXAMPLES':
            record.example_weights = self._deformer.example_weights().tolist()
            if not wait:
                redraw_panels()  # they show the weights
        is_slow = update_options.is_slow(of)
        if (is_slow or self.is_hurried) and not self._is_rest():
            record.is_final = False
            arguments = {**self._arguments_of_update(), 'base': self._base}
            SlowUpdate(self._ob, self._deformer, self._motions, arguments, is_slow).run(wait)

    def _is_rest(self):
        return self._base is None and np.abs(self._motions - np.eye(4)[:3]).max() < 1e-6 and not self._turns.any()
