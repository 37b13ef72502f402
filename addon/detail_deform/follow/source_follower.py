# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes that follow a source by a transfer, as a kind.Kind. When their content changes, the transfer is prepared again
automatically."""

from ..library.options import NEAREST
from ..scene import correspondence, mesh_data, mirror_plane, saved_match, source_pose
from ..scene.mesh_data import MeshProblem
from . import job_cache, prepared_transfer, written_offsets

GONE = "The source was deleted: choose another one in Source, or press Follow to stop."
_NO_MESH = "The source is no mesh: choose another one in Source, or press Follow to stop."
_NOT_SHOWN = "Its modifier was removed or applied by hand: press Follow to stop, and again to go on."

cache = job_cache.Cache(spare=2)  # of prepared_transfer.Prepared


def has(ob):
    return ob.detail_deform.transfer.live


def settings(ob):
    return ob.detail_deform.transfer


def content_of(ob):
    return ob.detail_deform.transfer.prepared_for


def is_live(ob):
    return True


def others(ob):
    """Other objects whose meshes are part of the content: the source."""
    source = ob.detail_deform.transfer.source
    return [source] if source else []


def depth(ob):
    """The number of followers in the chain from this object to a source that follows nothing; cut off at ten, as the
    chain may be a cycle."""
    found = 0
    while ob is not None and ob.detail_deform.transfer.live and found < 10:
        ob, found = ob.detail_deform.transfer.source, found + 1
    return found


# Content

_FOUND = {'MARKERS': "a match is searched", 'LIST': "a list is read", NEAREST: "what is nearest is found"}


def matched(source, ob):
    """The correspondence that the settings choose. Raises MeshProblem."""
    how = ob.detail_deform.transfer.correspondence
    if how == 'TOPOLOGY':
        return correspondence.by_topology(source, ob)
    if how in _FOUND and not (how == NEAREST and saved_match.is_by_nearest(ob)):
        raise MeshProblem(f"'{ob.name}' follows by its Saved Match: {_FOUND[how]} only when following starts. Press "
                          "Follow to stop, and again to start.")
    return saved_match.stored(source, ob)


def content(source, ob, to_keep=None):
    """A signature of all that a prepared transfer depends on: equal texts mean equal content. It is cheap compared with
    preparing a transfer, but too expensive for every frame. to_keep: a correspondence that is about to be stored."""
    of = ob.detail_deform.transfer
    how, kept, worn = of.correspondence, saved_match.digest(ob), saved_match.is_by_nearest(ob)
    if to_keep:
        how, kept, worn = 'STORED', correspondence.digest_of(to_keep), to_keep.relative_transform is not None
    by = 'TOPOLOGY' if how == 'TOPOLOGY' else f"STORED.{kept}"
    return prepared_transfer.content(source, ob, by, of, worn)


def _owner(ob):
    """Pointers that differ once an object has another mesh or source. They are compared, never dereferenced."""
    source = ob.detail_deform.transfer.source
    return tuple(block.as_pointer() for block in (source, source.data, ob, ob.data))


def compare(ob):
    """Computes the signature of the present meshes and settings, and stores it as that of the transfer needed."""
    of = ob.detail_deform.transfer
    if of.source is not None and of.source.type == 'MESH':
        saved_match.carry_relative_transform(of.source, ob)
        needed = content(of.source, ob)
        if of.prepared_for != needed:
            of.prepared_for = needed
        entry = cache.find(needed)
        if entry:
            entry.owners.add(_owner(ob))
    return ""


def is_outdated(subject):
    return False


def is_fit(subject):
    """Whether there is a source to follow and a modifier that shows the result; else the problem is stored. False, too,
    while the source is in Edit Mode."""
    of, problem = subject.settings.transfer, ""
    if of.source is None or not _is_in_a_scene(of.source, subject.depsgraph):
        problem = GONE
    elif of.source.type != 'MESH':  # the property's poll function is not called for scripts
        problem = _NO_MESH
    elif subject.modifier is None:
        problem = _NOT_SHOWN
    if of.problem != problem and (problem or of.problem in {GONE, _NO_MESH, _NOT_SHOWN}):
        of.problem = problem
    return not problem and of.source.mode != 'EDIT'


def _is_in_a_scene(ob, depsgraph):
    # The first test is quick and nearly always sufficient; the others go through all scenes. An object of an instanced
    # collection, as linked ones often are, is in no scene itself.
    return ob.visible_get(view_layer=depsgraph.view_layer) or bool(ob.users_scene or ob.users_collection)


def is_for(ob, entry):
    """Whether a transfer of the cache fits these objects for certain."""
    return _owner(ob) in entry.owners


# Made and lost

def begin(source, ob, used):
    """The job that prepares the transfer. used: the correspondence."""
    of = ob.detail_deform.transfer
    # Single precision is what a viewport shows, and takes half the time.
    return prepared_transfer.Preparation(source, ob, used, of, precision='SINGLE')


def job(ob):
    source = ob.detail_deform.transfer.source
    return begin(source, ob, matched(source, ob))


def refuse(ob, sentence):
    """Stores why the transfer could not be prepared."""
    ob.detail_deform.transfer.problem = sentence


def forget(ob):
    """Ends following, and clears all that is stored for it."""
    of = ob.detail_deform.transfer
    of.live = False
    of.problem = of.prepared_for = ob.detail_deform.render_problem = ""


# A frame

def check_frame(subject):
    pass


def _pose(subject, wide):
    """The pose of the source. One that this add-on doesn't deform is evaluated once for all its followers in a call."""
    source = subject.settings.transfer.source
    of = source.detail_deform
    if of.signature or of.transfer.live:
        return source_pose.evaluated_pose(source, subject.depsgraph, wide)
    key = source.as_pointer(), wide and wide.count
    if key not in subject.poses:
        subject.poses[key] = source_pose.evaluated_pose(source, subject.depsgraph, wide)
    return subject.poses[key]


class Frame:
    """The source's present pose, as kind.Frame."""

    def __init__(self, subject, transfer, record):
        of = subject.settings.transfer
        self._ob, self._transfer, self._rotation_only = subject.ob, transfer, of.rotation_only
        self._pose = _pose(subject, transfer.wide)
        self.key = (of.prepared_for, self._pose.tobytes(), of.rotation_only, mirror_plane.signature(subject.ob))

    is_hurried = is_draft = False

    def offsets(self, share):
        moved = self._transfer.apply(self._pose, self._rotation_only) - mesh_data.rest_positions(self._ob.data)
        return written_offsets.followed(self._ob, self.key[0], moved.ravel())

    def written(self, record, wait):
        pass
