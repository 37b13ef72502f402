# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh that follows the deformation of another one, live: in the viewport, in playback, in renders."""

import bpy

from . import binding, correspondence, mesh_data, native, node_group, transfer
from .mesh_data import MeshProblem


class _Prepared:
    """A factored transfer, what it was made of, whose that was, and the pose that the target shows."""

    def __init__(self, made_of, owners, transfer_, rest):
        self.made_of, self.owners, self.transfer, self.rest = made_of, owners, transfer_, rest
        self.shown = None


_prepared = {}  # by name of the target


def following(objects):
    """Those that follow a source."""
    return [ob for ob in objects if ob.type == 'MESH' and ob.detail_deform.transfer.live]


def start(context, ob, source):
    """Raises MeshProblem or native.NativeError; nothing is changed then."""
    settings = ob.detail_deform
    if settings.signature:
        raise MeshProblem(f"'{ob.name}' is bound to handles, which move it already: Unbind first.")
    _matched(source, ob)
    settings.transfer.source = source
    settings.transfer.live = True
    modifier = node_group.ensure_modifier(ob)
    node_group.set_base(modifier, source)  # evaluated where it is hidden, too
    binding.influence_changed(ob)
    refresh(ob, context.evaluated_depsgraph_get(), force=True)
    problem = settings.transfer.problem
    if problem:
        stop(ob)
        raise MeshProblem(problem)


def stop(ob):
    """The mesh shows its rest shape again."""
    settings = ob.detail_deform.transfer
    settings.live = False
    settings.problem = ""
    forget(ob)
    modifier = node_group.find_modifier(ob)
    if modifier:
        node_group.set_base(modifier, None)
    mesh_data.remove_offsets(ob.data)


def _matched(source, ob):
    how = ob.detail_deform.transfer.correspondence
    if how == 'TOPOLOGY':
        return correspondence.by_topology(source, ob)
    if not correspondence.is_stored(ob):
        raise MeshProblem(f"'{ob.name}' holds no correspondences yet: find them by markers, or transfer by a list once.")
    return correspondence.stored(source, ob)


def _made_of(source, ob):
    """Of what a prepared transfer depends on; cheap beside preparing it, too dear for every frame."""
    settings = ob.detail_deform.transfer
    anchors = ""
    if settings.anchor_group in ob.vertex_groups and settings.anchor in {'VERTICES', 'PINNED'}:
        anchors = mesh_data.signature(mesh_data.members(ob, settings.anchor_group))
    return (*mesh_data.shape_signature(source.data), *mesh_data.shape_signature(ob.data),
            settings.correspondence, settings.anchor, settings.anchor_group, anchors)


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
    if not settings.live or ob.mode == 'EDIT' or not (force or node_group.is_shown(ob, depsgraph)):
        return
    try:
        _follow(ob, settings, depsgraph)
        problem = ""
    except (MeshProblem, native.NativeError) as error:
        problem = str(error)
    if settings.problem != problem:
        settings.problem = problem


def _follow(ob, settings, depsgraph):
    source = settings.source
    mesh_data.check_object(ob)
    if source is None or source.mode == 'EDIT':
        if source is None:
            raise MeshProblem("The source was deleted: choose another one, or stop following.")
        return
    known = _prepared.get(ob.name)
    if known and known.owners != _owners(source, ob):
        check(ob)
        known = _prepared.get(ob.name)
    if known is None:
        made_of = _made_of(source, ob)
        # Single precision is what a viewport shows, and takes half the time.
        prepared = transfer.prepare(source, ob, _matched(source, ob), settings.anchor, settings.anchor_group,
                                    precision='SINGLE')
        known = _prepared[ob.name] = _Prepared(made_of, _owners(source, ob), prepared, mesh_data.positions(ob.data))
    pose = transfer.evaluated_pose(source, depsgraph)
    shown = (pose.tobytes(), settings.rotation_only)
    if known.shown != shown:
        mesh_data.write_offsets(ob.data, (known.transfer.apply(pose, settings.rotation_only) - known.rest).ravel())
        known.shown = shown


def forget_shown():
    """What meshes hold is not known any more: after undo, redo and loading."""
    for ob in following(bpy.data.objects):
        check(ob)
    for known in _prepared.values():
        known.shown = None


def clear():
    _prepared.clear()
