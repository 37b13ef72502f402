# SPDX-License-Identifier: GPL-3.0-or-later
"""One life for all that follows: made in the background, brought up to date, noticed stale, restored, ended.

What follows is of one of two kinds, the modules bound and fed. They say what differs, by the same names:
    cache: what was made, found by content            has(ob): whether the object is of this kind
    settings(ob): where it keeps its problem          content_of(ob): what it was made for
    is_live(ob): whether it follows by itself         others(ob): objects whose meshes are content too
    is_outdated(ob): whether to compare right now     check(ob): compares; a sentence where it is lost
    is_fit(ob, depsgraph): whether it can follow      is_for(ob, entry): whether that fits without comparing
    job(ob): that makes a deformer or a transfer      refuse(ob, sentence): why it could not be made
    check_frame(ob): raises what it can't follow by   forget(ob): what belongs to this kind
    Frame(ob, made, depsgraph): what is asked for: of tells it from all others, offsets(share) computes it, or in a
        drag what takes that share of the time, which is_hurried tells, and is_draft that made is but a draft;
        written(record, wait) is told that it is shown
"""

import time

import bpy

from ..library import native
from ..scene import node_group, offset_attribute, reach, renamed
from ..scene.window import redraw_panels
from . import bound, drag, fed, placed, problem_vertices, registry, shown, slow_results, words

KINDS = (fed, bound)

_POLL_SECONDS = 0.05
_known = None  # the object whose content nobody needs to compare: see take_in()

when_stale = []  # called where an object is found to differ from what was bound


def kind_of(ob):
    """The kind of what follows, None of all else."""
    if ob.type != 'MESH':
        return None
    return next((kind for kind in KINDS if kind.has(ob)), None)


def must_wait(depsgraph):
    """A render must not show a frame that isn't finished, and without a window nothing polls."""
    return bpy.app.background or depsgraph.mode == 'RENDER'


# Up to date

def refresh_all(members, depsgraph):
    """All of these but those that are updated by hand, each after whom it follows."""
    with fed.shared_poses():
        for ob in sorted(members, key=fed.depth) if len(members) > 1 else members:
            kind = kind_of(ob)
            if kind and kind.is_live(ob):
                refresh(ob, depsgraph)


def refresh(ob, depsgraph, force=False):
    """Brings the object's offsets up to date with what it follows. Does nothing when that did not move, or, unless
    forced to, while the modifier is not shown.

    Never raises for what the user can cause: the sentence goes to the settings.
    """
    kind = kind_of(ob)
    if kind is None or ob.mode == 'EDIT':
        return
    if kind.is_outdated(ob):
        check(ob)
    if not (kind.has(ob) and kind.is_fit(ob, depsgraph) and (force or node_group.is_shown(ob, depsgraph))):
        return
    wait, problem = must_wait(depsgraph), ""
    try:
        registry.check_mesh(ob)
        offset_attribute.check_name(ob)
        kind.check_frame(ob)
        entry = _made(kind, ob, depsgraph, wait)
        if entry:
            problem = _show(kind, ob, entry, depsgraph, force, wait) or reach.why_not(ob, depsgraph)
        elif not kind.has(ob):  # it has been ended, and says why
            return
    except words.TOLD as error:
        problem = words.said(ob, error)
    if kind.settings(ob).problem != problem:
        kind.settings(ob).problem = problem
    if problem and depsgraph.mode == 'RENDER' and not ob.detail_deform.render_problem:
        # The next update in the viewport takes the other one back.
        frame = depsgraph.scene.frame_current
        ob.detail_deform.render_problem = f"A render could not follow it in frame {frame}: {problem}"


def render_begins(members):
    """What the last one could not follow is said no more."""
    for ob in members:
        if ob.detail_deform.render_problem:
            ob.detail_deform.render_problem = ""


def _show(kind, ob, entry, depsgraph, force, wait):
    """Returns what is wrong with what is shown, or ''."""
    start = time.perf_counter()
    frame = kind.Frame(ob, entry.made, depsgraph)
    record, share = shown.by(ob.data), 1.0 if force or wait else drag.share(entry.full_ms)
    if not force and record is not None and (record.of, record.is_draft) == (frame.of, frame.is_draft) and (
            record.will_do(wait, share) or not wait and _is_to_follow(ob, record)):
        return record.problem
    record = shown.show(ob.data, frame.offsets(share), frame.of)
    entry.update_ms = 1e3 * (time.perf_counter() - start)
    if frame.is_hurried:
        record.is_hurried = True
    else:
        entry.full_ms = entry.update_ms
    frame.written(record, wait)
    return record.problem


def _is_to_follow(ob, record):
    """Whether the whole result is under way where a drag has shown the quick one."""
    return record.is_hurried and slow_results.progress(offset_attribute.token(ob.data)) is not None


def is_drafted(ob):
    """Whether it shows the draft of what is under way."""
    kind = kind_of(ob)
    return bool(kind and shown.is_draft(ob.data) and kind.cache.under_way(kind.content_of(ob)))


def _replace_draft(ob):
    """By the whole result of the same pose, when it is there."""
    kind = kind_of(ob)
    entry = kind and kind.cache.find(kind.content_of(ob))
    if ob.mode == 'EDIT' or not (entry and shown.is_draft(ob.data) and kind.is_for(ob, entry)):
        return
    frame = shown.by(ob.data).draft.by(entry.made)
    if not frame.is_of(ob):
        return
    try:
        frame.written(shown.show(ob.data, frame.offsets(1.0), frame.of), wait=False)
    except words.TOLD as error:
        kind.settings(ob).problem = words.said(ob, error)


def end_drag(members):
    """From the next refresh on they show the whole result: a frame has come, or a file is written."""
    drag.ended()
    for ob in members:
        record = shown.by(ob.data)
        if record is not None and record.is_hurried:
            slow_results.cancel(offset_attribute.token(ob.data))


def wait(ob, depsgraph):
    """Waits for what is being made for the object, or what the file asks for."""
    refresh(ob, depsgraph)
    kind = kind_of(ob)
    if kind and kind.cache.under_way(kind.content_of(ob)):
        finish(kind, kind.content_of(ob))
        refresh(ob, depsgraph)


def take_in(ob, view_layer):
    """Has Blender take in at once what was written to an object whose content is known to be what it was made for:
    of its own update it would look like an edit, and all would be compared again."""
    global _known
    _known = ob
    try:
        view_layer.update()
    finally:
        _known = None


def is_known(ob):
    return ob == _known


def settle(ob):
    """Waits for what is to take the place of what is shown: a slow result, or that of a bind that is under way."""
    kind = kind_of(ob)
    if kind and shown.is_draft(ob.data):
        if kind.cache.under_way(kind.content_of(ob)):
            finish(kind, kind.content_of(ob))
        _replace_draft(ob)
    slow_results.finish(offset_attribute.token(ob.data))


# Whether it is still what it was made for

def check(ob):
    """Compares the object with the content that it was made for, and notes what differs."""
    kind = kind_of(ob)
    try:
        renamed.follow(ob)
        renamed.note(ob)
        lost = kind and kind.check(ob)
    except MemoryError:
        return  # the next update says it
    if lost:
        end(kind, ob)
        kind.settings(ob).problem = lost
    elif ob.detail_deform.stale:
        _replace_draft(ob)  # nothing else would
        for tell in when_stale:
            tell()


# Made

def _made(kind, ob, depsgraph, wait):
    """The entry of the object as it is, or while that is under way of its draft, where there is one; None where it is
    stale. Raises MeshProblem or native.NativeError."""
    cache = kind.cache
    entry = cache.find(kind.content_of(ob))
    if entry and kind.is_for(ob, entry):
        return entry
    if not cache.under_way(kind.content_of(ob)):
        native.library()
        check(ob)
        if not (kind.has(ob) and kind.is_fit(ob, depsgraph)):
            return None
    content = kind.content_of(ob)
    under_way = cache.under_way(content)
    if under_way and under_way.cancelled and not wait:
        return None  # it would begin anew
    if not cache.find(content):
        cache.check(content)
        cache.start(content, lambda: kind.job(ob))
        if wait:  # in a render another thread, which must not set up timers
            return finish(kind, content)
        _poll_soon()
    draft = cache.draft(content)
    return draft if draft and kind.is_for(ob, draft) else cache.find(content)


def start(kind, content, begin):
    """Starts to make what is neither there nor under way; begin() gives the job. What failed before is tried again."""
    kind.cache.forget_failure(content)
    kind.cache.start(content, begin)
    _poll_soon()


def finish(kind, content):
    """Waits for what is being made. Where it fails, those who ask for it are told, and it is raised."""
    try:
        return kind.cache.finish(content)
    except native.NativeError as error:
        for ob in _owners(kind, content):
            kind.refuse(ob, words.said(ob, error))
            problem_vertices.note(ob, error)
            if shown.is_draft(ob.data) and ob.mode != 'EDIT':
                shown.show_start(ob.data)
        raise


def _owners(kind, content):
    return [ob for ob in registry.members() if kind.has(ob) and kind.content_of(ob) == content]


def drop_unused(spares=True):
    """Forgets what nobody asks for any more; spares: but what undo may ask for."""
    members = registry.members()
    for kind in KINDS:
        kind.cache.keep({kind.content_of(ob) for ob in members}, spares)
    shown.keep(ob.data for ob in members)


def _poll_soon():
    if not bpy.app.background and not bpy.app.timers.is_registered(_poll):
        # Persistent: a file opened meanwhile must not leave a job without anyone to finish it.
        bpy.app.timers.register(_poll, first_interval=_POLL_SECONDS, persistent=True)


def _poll():
    """Timer: finishes and shows what is made. Returns the seconds to the next call, None to end."""
    for kind in KINDS:
        for content in kind.cache.contents_under_way():
            if not kind.cache.is_running(content):
                _arrive(kind, content)
            elif kind.cache.draft(content):
                _show_draft(kind, content)
    redraw_panels()
    return _POLL_SECONDS if any(kind.cache.contents_under_way() for kind in KINDS) else None


def _arrive(kind, content):
    try:
        finish(kind, content)
    except native.NativeError:
        pass  # its owners have it
    else:
        for ob in _owners(kind, content):
            refresh(ob, bpy.context.evaluated_depsgraph_get(), force=True)
            _replace_draft(ob)  # where it doesn't follow any more, as a handle has come meanwhile
    drop_unused()


def _show_draft(kind, content):
    depsgraph, owners = bpy.context.evaluated_depsgraph_get(), _owners(kind, content)
    refresh_all([ob for ob in registry.of_scene(depsgraph) if ob in owners], depsgraph)


# Ended

def end(kind, ob):
    """The mesh shows its rest shape. What is being made for it alone is cancelled."""
    content = kind.content_of(ob)
    kind.forget(ob)
    if not _owners(kind, content):
        kind.cache.let_go(content)
    slow_results.cancel(offset_attribute.token(ob.data))
    modifier = node_group.find_modifier(ob)
    if modifier:
        node_group.set_base(modifier, None)
    shown.show_rest(ob.data)


def forget_addresses():
    """After undo, redo and loading: the meshes may hold any earlier result, and addresses mean others."""
    registry.forget()
    shown.clear()
    drag.ended()
    for kind in KINDS:
        kind.cache.forget_owners()


def clear():
    if bpy.app.timers.is_registered(_poll):
        bpy.app.timers.unregister(_poll)
    slow_results.clear()
    drag.ended()
    for kind in KINDS:
        kind.cache.clear()
    placed.clear()
    shown.clear()
    registry.forget()
