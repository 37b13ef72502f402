# SPDX-License-Identifier: GPL-3.0-or-later
"""The life cycle of followers, objects whose mesh follows handles or a source.

Nobody asks which empty has moved: at each update of the scene every live follower reads its input (kind.Frame), and
ends there if its key is the one of the result that the mesh shows (frame_results). Else the offsets are computed, made
fit for the mesh (written_offsets) and written (offset_attribute). What is written in a handler of the depsgraph,
Blender evaluates in a second pass without calling handlers; what is written elsewhere comes back as an edit, and is
compared: see take_in().

Their deformer or transfer is made in the background, their offsets are brought up to date, a change of their content is
noticed, and they are ended. What differs between the two kinds of followers is in the modules handle_follower and
source_follower, which implement kind.Kind.
"""

import contextlib
import time

import bpy

from .. import session, timers
from ..library import native
from ..scene import attribute_reaches, channel, deform_modifier, mesh_data, offset_attribute, renamed_groups
from ..scene.mesh_data import MeshProblem
from ..scene.subject import Subject
from ..scene.window import redraw_panels
from . import drag, frame_results, handle_follower, messages, problem_vertices, registry, slow_results, source_follower
from .kind import Kind

KINDS: tuple[Kind, ...] = (source_follower, handle_follower)

_POLL_SECONDS = 0.05  # interval of polls: about the delay with which a job's end is noticed
_known = session.kept(set(), session.Until.REPLACED)  # objects whose content is known to be unchanged: see take_in()
_to_be_bound = session.kept(set(), session.Until.REPLACED)  # objects of to_be_bound()

# Functions that are called when an object's content has changed since it was bound.
when_stale = session.kept([], session.Until.DISABLED)


def kind_of(ob):
    """The kind of follower that the object is, or None."""
    if ob.type != 'MESH':
        return None
    return next((kind for kind in KINDS if kind.has(ob)), None)


def must_wait(depsgraph):
    """Whether to wait for jobs: in renders, and without a window, where no timer would notice their end."""
    return bpy.app.background or depsgraph.mode == 'RENDER'


# Updates

def refresh_all(members, depsgraph):
    """Refreshes all of these that are live, sources before their followers."""
    poses = {}
    for ob in sorted(members, key=source_follower.depth) if len(members) > 1 else members:
        kind = kind_of(ob)
        if kind and kind.is_live(ob):
            refresh(ob, depsgraph, poses=poses)
        elif kind:
            settle_channel(ob, depsgraph)


def refresh(ob, depsgraph, force=False, poses=None):
    """Brings the object's offsets up to date with its handles or source. Does nothing if these haven't moved, or,
    unless force is set, if the modifier is hidden. poses: as for Subject.

    Raises nothing for mistakes of the user: the sentence is stored in the settings, where the panel shows it.
    """
    if channel.is_lost(ob.data):
        compare(ob)  # it may have been applied: then the binding ends
    _refresh(ob, depsgraph, force, poses)
    settle_channel(ob, depsgraph)


def settle_channel(ob, depsgraph):
    """Has the offsets displayed as the settings and the modifier stack ask for."""
    try:
        registry.check_mesh(ob)
    except MeshProblem:  # refresh() has said it
        if mesh_data.is_shared(ob.data) and not mesh_data.why_not_editable(ob):
            channel.settle_copy(ob)
    else:
        channel.settle(ob, depsgraph)


def _refresh(ob, depsgraph, force, poses):
    kind = kind_of(ob)
    if kind is None or ob.mode == 'EDIT' or ob in _to_be_bound:
        return
    subject = Subject(ob, depsgraph, poses)
    if kind.is_outdated(subject):
        compare(ob)
        subject = Subject(ob, depsgraph, poses)  # compare() follows groups that were renamed
    if not (kind.has(ob) and kind.is_fit(subject) and (force or channel.is_shown(ob, subject.modifier, depsgraph))):
        return
    wait, problem, before = must_wait(depsgraph), "", offset_attribute.token(ob.data)
    try:
        registry.check_mesh(ob)
        offset_attribute.check_name(ob)
        kind.check_frame(subject)
        entry = _made(kind, subject, wait)
        if entry:
            problem = _show(kind, subject, entry, force, wait) or attribute_reaches.why_not(subject)
        elif not kind.has(ob):  # compare() has ended it, and stored why
            return
    except messages.TOLD as error:
        problem = messages.said(ob, error)
    if kind.settings(ob).problem != problem:
        kind.settings(ob).problem = problem
    if depsgraph.mode == 'RENDER' and not ob.detail_deform.render_problem:
        # Stored apart, as the next update in the viewport clears the other one.
        ob.detail_deform.render_problem = _render_problem(depsgraph.scene, problem,
                                                          offset_attribute.token(ob.data) != before)


def _render_problem(scene, problem, has_written):
    """What to say of a frame of a render. has_written: whether it changed the mesh."""
    if problem:
        return f"A render could not follow it in frame {scene.frame_current}: {problem}"
    if has_written and not (bpy.app.background or scene.render.use_lock_interface):
        return ("A render changed this mesh while the window could draw it, in which Blender may crash: switch on "
                "Render > Lock Interface.")
    return ""


def render_begins(members):
    """Clears the problems of the last render."""
    for ob in members:
        if ob.detail_deform.render_problem:
            ob.detail_deform.render_problem = ""


def _show(kind, subject, entry, force, wait):
    """Writes the frame to the mesh. Returns the problem of the result, or ''."""
    start, record = time.perf_counter(), frame_results.by(subject.mesh)
    frame = kind.Frame(subject, entry.made, record)
    share = 1.0 if force or wait else drag.share(entry.full_ms)
    if not force and record is not None and _is_result_of(record, frame) and (
            record.will_do(wait, share) or not wait and _is_to_follow(subject.mesh, record)):
        return record.problem
    record = frame_results.show(subject.ob, frame.offsets(share), frame.key)
    entry.update_ms = 1e3 * (time.perf_counter() - start)
    if frame.is_hurried:
        record.is_hurried = True
    else:
        entry.full_ms = entry.update_ms
    frame.written(record, wait)
    return record.problem


def _is_result_of(record, frame):
    """Whether the mesh shows a result of this frame's input, by the same kind of deformer."""
    return (record.key, record.is_draft) == (frame.key, frame.is_draft)


def _is_to_follow(mesh, record):
    """Whether the refined result is being computed for a quick one that a drag has shown."""
    return record.is_hurried and slow_results.progress(offset_attribute.token(mesh)) is not None


def is_drafted(ob):
    """Whether the object shows a draft while its deformer is being bound."""
    kind = kind_of(ob)
    return bool(kind and frame_results.is_draft(ob.data) and kind.cache.under_way(kind.content_of(ob)))


def _replace_draft(ob):
    """Replaces a draft by the result of the finished deformer for the same pose."""
    kind = kind_of(ob)
    entry = kind and kind.cache.find(kind.content_of(ob))
    if ob.mode == 'EDIT' or not (entry and frame_results.is_draft(ob.data) and kind.is_for(ob, entry)):
        return
    frame = frame_results.by(ob.data).draft.by(entry.made)
    if not frame.is_of(ob):
        return
    try:
        frame.written(frame_results.show(ob, frame.offsets(1.0), frame.key), wait=False)
    except messages.TOLD as error:
        kind.settings(ob).problem = messages.said(ob, error)


def end_drag(members):
    """Ends a drag: the next refresh shows the full result. To be called at frame changes and before saving."""
    drag.ended()
    for ob in members:
        record = frame_results.by(ob.data)
        if record is not None and record.is_hurried:
            slow_results.cancel(offset_attribute.token(ob.data))


def wait(ob, depsgraph):
    """Waits for the object's deformer or transfer, which is made first if the object was loaded without one."""
    refresh(ob, depsgraph)
    kind = kind_of(ob)
    if kind and kind.cache.under_way(kind.content_of(ob)):
        finish(kind, kind.content_of(ob))
        refresh(ob, depsgraph)


def take_in(ob, view_layer):
    """Evaluates a view layer after something was written to an object whose content is known to be unchanged. The
    update that Blender makes later would look like an edit by the user, and all content would be compared again."""
    _known.add(ob)
    try:
        view_layer.update()
    finally:
        _known.discard(ob)


@contextlib.contextmanager
def to_be_bound(ob):
    """Context manager for an object that is changed and then bound: meanwhile it shows what it shows, and no change is
    compared with what was bound, which on a large mesh takes longer than the bind of a small part."""
    _to_be_bound.add(ob)
    try:
        yield
    finally:
        _to_be_bound.discard(ob)


def is_known(ob):
    return ob in _known or ob in _to_be_bound


def settle(ob):
    """Waits for the result that is to replace the one shown: a slow one, or that of a bind under way."""
    kind = kind_of(ob)
    if kind and frame_results.is_draft(ob.data):
        if kind.cache.under_way(kind.content_of(ob)):
            finish(kind, kind.content_of(ob))
        _replace_draft(ob)
    slow_results.finish(offset_attribute.token(ob.data))


# Whether the content is unchanged

def compare(ob):
    """Compares the object's content with the one that was bound, and stores the difference in its settings."""
    if ob in _to_be_bound:
        return
    kind = kind_of(ob)
    try:
        renamed_groups.update_names(ob)
        renamed_groups.store_names(ob)
        if ob.mode != 'EDIT' and not mesh_data.why_not_editable(ob):
            channel.take_in_edits(ob)
        lost = kind and kind.compare(ob)
    except MemoryError:
        return  # the next update reports it
    if lost:
        end(kind, ob)
        kind.settings(ob).problem = lost
    elif ob.detail_deform.stale:
        _replace_draft(ob)  # refresh() won't, as the object doesn't follow any more
        for tell in when_stale:
            tell()


# Binds, and preparations of transfers

def _made(kind, subject, wait):
    """The cache entry for the object's content. While it is being made, that of its draft, if there is one, else None;
    None also if the object is stale. Raises MeshProblem or native.NativeError."""
    cache, ob = kind.cache, subject.ob
    entry = cache.find(kind.content_of(ob))
    if entry and kind.is_for(ob, entry):
        return entry
    if not cache.under_way(kind.content_of(ob)):
        native.library()
        compare(ob)
        if not (kind.has(ob) and kind.is_fit(subject)):
            return None
    content = kind.content_of(ob)
    under_way = cache.under_way(content)
    if under_way and under_way.cancelled and not wait:
        return None  # starting the same job again would undo the cancel
    if not cache.find(content):
        cache.raise_failure(content)
        cache.start(content, lambda: kind.job(ob))
        if wait:  # maybe in the thread of a render, which must not register timers
            return finish(kind, content)
        _timer.start()
    draft = cache.draft(content)
    return draft if draft and kind.is_for(ob, draft) else cache.find(content)


def start(kind, content, begin):
    """Starts the job that begin() returns, unless the entry exists or its job is under way. A job that failed before is
    tried again."""
    kind.cache.forget_failure(content)
    kind.cache.start(content, begin)
    _timer.start()


def finish(kind, content):
    """Waits for a job and returns its entry. If it fails, all objects with this content get the sentence, and
    native.NativeError is raised."""
    try:
        return kind.cache.finish(content)
    except native.NativeError as error:
        for ob in _owners(kind, content):
            kind.refuse(ob, messages.said(ob, error))
            problem_vertices.note(ob, error)
            if frame_results.is_draft(ob.data) and ob.mode != 'EDIT':
                frame_results.show_start(ob)
        raise


def _owners(kind, content):
    return [ob for ob in registry.members() if kind.has(ob) and kind.content_of(ob) == content]


def drop_unused(spares=True):
    """Drops deformers, transfers and records that no object uses. spares: keeps some for undo."""
    members = registry.members()
    for kind in KINDS:
        kind.cache.keep({kind.content_of(ob) for ob in members}, spares)
    frame_results.keep(ob.data for ob in members)


def _poll():
    """Timer: fetches and shows the results of finished jobs. Returns the seconds to the next call, None to end."""
    for kind in KINDS:
        for content in kind.cache.contents_under_way():
            if not kind.cache.poll(content):
                _arrive(kind, content)
            elif kind.cache.draft(content):
                _show_draft(kind, content)
    redraw_panels()
    return _POLL_SECONDS if any(kind.cache.contents_under_way() for kind in KINDS) else None


def _arrive(kind, content):
    try:
        finish(kind, content)
    except native.NativeError:
        pass  # finish() has told the objects
    else:
        for ob in _owners(kind, content):
            refresh(ob, bpy.context.evaluated_depsgraph_get(), force=True)
            _replace_draft(ob)  # refresh() doesn't if the object is stale, as by a handle added meanwhile
    drop_unused()


def _show_draft(kind, content):
    depsgraph, owners = bpy.context.evaluated_depsgraph_get(), _owners(kind, content)
    refresh_all([ob for ob in registry.of_scene(depsgraph) if ob in owners], depsgraph)


_timer = timers.Timer(_poll, _POLL_SECONDS, through_loading=True)
# After loading, undo can't lead back to the last file, whose deformers and transfers are dropped.
session.at(session.Until.LOADED, lambda: drop_unused(spares=False))


# The end of following

def end(kind, ob):
    """Ends following: removes the offsets, and cancels a job that no other object needs."""
    content = kind.content_of(ob)
    kind.forget(ob)
    if not _owners(kind, content):
        kind.cache.let_go(content)
    slow_results.cancel(offset_attribute.token(ob.data))
    modifier = deform_modifier.find(ob)
    if modifier:
        deform_modifier.set_base(modifier, None)
    frame_results.show_rest(ob)
