# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh that follows the deformation of another one, live: in the viewport, in playback, in renders."""

from ..library import native
from ..scene import mesh_data, node_group
from ..setup import correspondence, transfer
from . import binding
from ..scene.mesh_data import MeshProblem


class _Prepared:
    """A factored transfer, what it was made of, whose that was, and the pose that the target shows."""

    def __init__(self, source, ob):
        settings = ob.detail_deform.transfer
        self.made_of, self.owners = _made_of(source, ob), _owners(source, ob)
        # Single precision is what a viewport shows, and takes half the time.
        self.transfer = transfer.prepare(source, ob, _matched(source, ob), settings.anchor, settings.anchor_group,
                                         settings.formulation, precision='SINGLE')
        self.rest = mesh_data.rest(ob.data)
        self.shown = None


_prepared = {}  # by name of the target


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


def start(context, ob, source):
    """Raises MeshProblem or native.NativeError; nothing is changed then."""
    settings = ob.detail_deform
    if settings.signature:
        raise MeshProblem(f"'{ob.name}' is bound to handles, which move it already: Unbind first.")
    _check_circle(source, ob)
    transfer.check_not_shown(ob)
    prepared = _Prepared(source, ob)
    transfer.evaluated_pose(source, context.evaluated_depsgraph_get())
    modifier = node_group.ensure_modifier(ob)
    _prepared[ob.name] = prepared
    settings.transfer.live = True
    if settings.transfer.source != source:
        settings.transfer.source = source
    node_group.set_base(modifier, source)  # evaluated where it is hidden, too
    binding.influence_changed(ob)
    refresh(ob, context.evaluated_depsgraph_get(), force=True)


def _check_circle(source, ob):
    seen, follower = {ob}, source
    while follower is not None and follower.detail_deform.transfer.live:
        follower = follower.detail_deform.transfer.source
        if follower in seen:
            raise MeshProblem(f"'{source.name}' follows '{ob.name}' already, itself or by way of others: "
                              "stop that first.")
        seen.add(follower)


def stop(ob):
    """The mesh shows its rest shape again."""
    settings = ob.detail_deform.transfer
    if not settings.live:
        return
    settings.live = False
    settings.problem = ""
    forget(ob)
    modifier = node_group.find_modifier(ob)
    if modifier:
        node_group.set_base(modifier, None)
    mesh_data.remove_offsets(ob.data)
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
    return settings.problem or (f"Follows '{settings.source.name}'." if settings.source else _GONE)


_GONE = "The source was deleted: choose another one, or stop following."


def _matched(source, ob):
    how = ob.detail_deform.transfer.correspondence
    if how == 'TOPOLOGY':
        return correspondence.by_topology(source, ob)
    if not correspondence.is_stored(ob):
        raise MeshProblem(f"'{ob.name}' holds no correspondences yet: find them by markers, "
                          "or transfer by a list once.")
    return correspondence.stored(source, ob)


def _made_of(source, ob):
    """Of what a prepared transfer depends on; cheap beside preparing it, too dear for every frame."""
    settings = ob.detail_deform.transfer
    anchors = ""
    if settings.anchor_group in ob.vertex_groups and settings.anchor in {'VERTICES', 'PINNED'}:
        anchors = mesh_data.signature(mesh_data.members(ob, settings.anchor_group))
    return (*(mesh_data.signature(mesh_data.rest(mesh)) + mesh_data.topology_signature(mesh)
              for mesh in (source.data, ob.data)),
            settings.correspondence, correspondence.digest(ob), settings.anchor, settings.anchor_group, anchors,
            settings.formulation,
            *(tuple(transfer.proportions(side)) for side in (source, ob)))


def _owners(source, ob):
    """To notice that names stand for others now: never followed, only compared."""
    return tuple(block.as_pointer() for block in (source, source.data, ob, ob.data))


def forget(ob):
    """What was prepared for it is made anew when it is next needed."""
    _prepared.pop(ob.name, None)


def check(ob):
    """Forgets what was prepared where the meshes are no longer what it was made of."""
    known, source = _prepared.get(ob.name), ob.detail_deform.transfer.source
    if known and (source is None or known.made_of != _made_of(source, ob)):
        forget(ob)
    elif known:
        known.owners = _owners(source, ob)


def refresh(ob, depsgraph, force=False):
    """Brings the object's offsets up to date with its source. Does nothing when the source did not move, or,
    unless forced to, while the modifier is not shown.

    Never raises for what the user can cause: the sentence goes to the settings."""
    settings = ob.detail_deform.transfer
    if not settings.live or ob.mode == 'EDIT':
        return
    try:
        if settings.source is None or not settings.source.users_scene:
            raise MeshProblem(_GONE)
        if node_group.find_modifier(ob) is None:
            raise MeshProblem("Its modifier was removed or applied by hand: press Follow to stop, and again to go on.")
        if force or node_group.is_shown(ob, depsgraph):
            _follow(ob, settings, depsgraph)
        problem = ""
    except (MeshProblem, native.NativeError) as error:
        problem = str(error)
    if settings.problem != problem:
        settings.problem = problem


def _follow(ob, settings, depsgraph):
    source = settings.source
    if source.mode == 'EDIT':
        return
    mesh_data.check_object(ob)
    known = _prepared.get(ob.name)
    if known and known.owners != _owners(source, ob):
        check(ob)
        known = _prepared.get(ob.name)
    if known is None:
        known = _prepared[ob.name] = _Prepared(source, ob)
    pose = transfer.evaluated_pose(source, depsgraph)
    shown = (pose.tobytes(), settings.rotation_only)
    if known.shown != shown:
        mesh_data.write_offsets(ob.data, (known.transfer.apply(pose, settings.rotation_only) - known.rest).ravel())
        known.shown = shown


def forget_shown(objects):
    """What meshes hold is not known any more: after undo, redo and loading."""
    for ob in following(objects):
        check(ob)
    for known in _prepared.values():
        known.shown = None


def clear():
    _prepared.clear()
