# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh that follows the deformation of another one, live: in the viewport, in playback, in renders."""

import bpy

from ..library import native
from ..scene import mesh_data, node_group, offset_attribute, reach
from ..scene.mesh_data import MeshProblem
from ..scene.window import redraw_panels
from ..setup import correspondence, transfer
from . import binding, preparing, registry, shown

_POLL_SECONDS = 0.1
_GONE = "The source was deleted: choose another one, or stop following."


def following(objects):
    """Those that follow a source, each after those that it follows."""
    found = [ob for ob in objects if ob.type == 'MESH' and ob.detail_deform.transfer.live]
    return sorted(found, key=_depth) if len(found) > 1 else found


def _depth(ob):
    """Of a chain of followers, at most ten: one may bite its own tail."""
    depth = 0
    while ob is not None and ob.detail_deform.transfer.live and depth < 10:
        ob, depth = ob.detail_deform.transfer.source, depth + 1
    return depth


# Starting and stopping

def check_start(ob, source):
    """Raises MeshProblem where an object can't follow that source, whatever corresponds."""
    if ob.detail_deform.signature:
        raise MeshProblem(f"'{ob.name}' is bound to handles, which move it already: Unbind first.")
    offset_attribute.check_name(ob)
    _check_circle(source, ob)
    transfer.check_not_shown(ob)
    transfer.evaluated_pose(source, bpy.context.evaluated_depsgraph_get())


def start(context, ob, source, matched=None):
    """matched: the correspondence to go by from now on and to be kept; None: as the settings say. Raises MeshProblem
    or native.NativeError; nothing is changed then."""
    settings = ob.detail_deform.transfer
    check_start(ob, source)
    used, content = matched or _matched(source, ob), _content(source, ob, matched)
    preparing.forget_failure(content)
    if not (preparing.find(content) or preparing.under_way(content)):
        preparing.start(content, _job(source, ob, used))
    if bpy.app.background:
        preparing.finish(content)
    if matched:
        correspondence.store(matched, source, ob)
        settings.correspondence = 'STORED'
    modifier = node_group.ensure_modifier(ob)
    if settings.source != source:
        settings.source = source
    settings.prepared_for = content
    settings.live = True
    registry.forget()
    node_group.set_base(modifier, source)  # evaluated where it is hidden, too
    binding.influence_changed(ob)
    refresh(ob, context.evaluated_depsgraph_get(), force=True)
    members = following(registry.members())
    preparing.drop_unused({other.detail_deform.transfer.prepared_for for other in members})


def _check_circle(source, ob):
    seen, follower = {ob}, source
    while follower is not None and follower.detail_deform.transfer.live:
        follower = follower.detail_deform.transfer.source
        if follower in seen:
            raise MeshProblem(f"'{source.name}' follows '{ob.name}' already, itself or by way of others: stop that "
                              "first.")
        seen.add(follower)


def stop(ob):
    """The mesh shows its rest shape again. What was being prepared for it alone is cancelled."""
    settings = ob.detail_deform.transfer
    if not settings.live:
        return
    content = settings.prepared_for
    settings.live = False
    settings.problem = settings.prepared_for = ""
    if not _owners_of(content):
        preparing.cancel(content)
    modifier = node_group.find_modifier(ob)
    if modifier:
        node_group.set_base(modifier, None)
    shown.forget(ob.data)
    offset_attribute.remove(ob.data)
    if not ob.detail_deform.handles:  # nobody else has use for it
        node_group.remove_modifier(ob)


def source_changed(ob):
    """To follow another one."""
    settings, modifier = ob.detail_deform.transfer, node_group.find_modifier(ob)
    if settings.live and modifier:
        node_group.set_base(modifier, settings.source)


def state(ob):
    """How a follower fares, in a sentence."""
    settings = ob.detail_deform.transfer
    job = preparing.under_way(settings.prepared_for)
    if job:
        _, fraction, stage = job.progress()
        source = settings.source.name if settings.source else ""
        return f"Preparing to follow '{source}', {100 * fraction:.0f}%: {stage}."
    return settings.problem or (f"Follows '{settings.source.name}'." if settings.source else _GONE)


def is_preparing(ob):
    return preparing.under_way(ob.detail_deform.transfer.prepared_for) is not None


# Preparing: by whom, of what, and in the window in the background

def _matched(source, ob):
    how = ob.detail_deform.transfer.correspondence
    if how == 'TOPOLOGY':
        return correspondence.by_topology(source, ob)
    if how != 'STORED':
        what = "markers are searched" if how == 'MARKERS' else "a list is read"
        raise MeshProblem(f"'{ob.name}' follows by what is kept with it: {what} only when following starts. Stop "
                          "(Follow), and press Follow again.")
    return correspondence.stored(source, ob)


def _job(source, ob, matched):
    settings = ob.detail_deform.transfer
    # Single precision is what a viewport shows, and takes half the time.
    return transfer.Preparation(source, ob, matched, settings.anchor, settings.anchor_group, settings.formulation,
                                precision='SINGLE')


def _content(source, ob, matched=None):
    """What a prepared transfer depends on: equal texts, equal content. Cheap beside preparing it, too dear for every
    frame. matched: the correspondence that is going to be kept."""
    settings = ob.detail_deform.transfer
    how, kept = settings.correspondence, correspondence.digest(ob)
    if matched:
        how, kept = 'STORED', correspondence.digest_of(matched)
    anchors = ""
    if settings.anchor_group in ob.vertex_groups and settings.anchor in {'VERTICES', 'PINNED'}:
        anchors = mesh_data.signature(mesh_data.members(ob, settings.anchor_group))
    meshes = [mesh_data.signature(mesh_data.rest(side.data)) + mesh_data.topology_signature(side.data)
              for side in (source, ob)]
    scales = [mesh_data.signature(transfer.proportions(side)) for side in (source, ob)]
    return '.'.join([*meshes, how, kept if how == 'STORED' else "", settings.anchor, anchors, settings.formulation,
                     *scales])


def _owners(source, ob):
    """To notice that an object has another mesh or source now: never followed, only compared."""
    return tuple(block.as_pointer() for block in (source, source.data, ob, ob.data))


def _owners_of(content):
    return [ob for ob in following(registry.members()) if ob.detail_deform.transfer.prepared_for == content]


def check(ob):
    """Compares the meshes with what was prepared, and notes what is needed now."""
    settings = ob.detail_deform.transfer
    if ob.type != 'MESH' or not settings.live or settings.source is None:
        return
    content = _content(settings.source, ob)
    if settings.prepared_for != content:
        settings.prepared_for = content
    prepared = preparing.find(content)
    if prepared:
        prepared.owners.add(_owners(settings.source, ob))


def _prepared(source, ob, wait):
    """What was prepared for these objects as they are; None while that is under way. Raises MeshProblem or
    native.NativeError."""
    settings = ob.detail_deform.transfer
    prepared = preparing.find(settings.prepared_for)
    if prepared is None or _owners(source, ob) not in prepared.owners:
        if not preparing.under_way(settings.prepared_for):
            check(ob)
        prepared = preparing.find(settings.prepared_for)
    if prepared:
        return prepared
    content = settings.prepared_for
    if not preparing.under_way(content):
        preparing.check(content)
        preparing.start(content, _job(source, ob, _matched(source, ob)))
    if wait:  # in a render another thread, which must not set up timers
        return preparing.finish(content)
    _poll_for_it()
    return None


def _poll_for_it():
    if not bpy.app.background and not bpy.app.timers.is_registered(_poll):
        bpy.app.timers.register(_poll, first_interval=_POLL_SECONDS, persistent=True)


def _poll():
    """Timer: shows what is prepared. Returns the seconds to the next call, None to end."""
    for content in preparing.contents_under_way():
        if preparing.under_way(content).progress()[0]:
            continue
        problem = ""
        try:
            preparing.finish(content)
        except native.NativeError as error:
            problem = str(error)
        for ob in _owners_of(content):
            if problem:
                ob.detail_deform.transfer.problem = problem
            else:
                refresh(ob, bpy.context.evaluated_depsgraph_get())
    redraw_panels()
    return _POLL_SECONDS if preparing.contents_under_way() else None


def stop_polling():
    if bpy.app.timers.is_registered(_poll):
        bpy.app.timers.unregister(_poll)


# Following

def refresh(ob, depsgraph, force=False):
    """Brings the object's offsets up to date with its source. Does nothing when the source did not move, or,
    unless forced to, while the modifier is not shown.

    Never raises for what the user can cause: the sentence goes to the settings."""
    settings = ob.detail_deform.transfer
    if not settings.live or ob.mode == 'EDIT':
        return
    try:
        if settings.source is None or not _is_in_a_scene(settings.source, depsgraph):
            raise MeshProblem(_GONE)
        if node_group.find_modifier(ob) is None:
            raise MeshProblem("Its modifier was removed or applied by hand: press Follow to stop, and again to go on.")
        problem = ""
        if force or node_group.is_shown(ob, depsgraph):
            _follow(ob, settings, depsgraph)
            problem = reach.why_not(ob, depsgraph)
    except (MeshProblem, native.NativeError) as error:
        problem = str(error)
    if settings.problem != problem:
        settings.problem = problem


def _is_in_a_scene(ob, depsgraph):
    # The first test is quick and nearly always enough; the second goes through all scenes.
    return ob.visible_get(view_layer=depsgraph.view_layer) or bool(ob.users_scene)


def _follow(ob, settings, depsgraph):
    source = settings.source
    if source.mode == 'EDIT':
        return
    mesh_data.check_object(ob)
    offset_attribute.check_name(ob)
    # A render must not show a frame that isn't finished, and without a window nothing polls.
    prepared = _prepared(source, ob, wait=bpy.app.background or depsgraph.mode == 'RENDER')
    if prepared is None:
        return
    pose = transfer.evaluated_pose(source, depsgraph)
    of = (prepared.key, pose.tobytes(), settings.rotation_only)
    record = shown.by(ob.data)
    if record is None or record.of != of:
        offsets = prepared.transfer.apply(pose, settings.rotation_only) - mesh_data.rest(ob.data)
        shown.show(ob.data, offsets.ravel(), of)


def forget_owners():
    """Addresses mean others: after undo, redo and loading."""
    preparing.forget_owners()


def clear():
    preparing.clear()
