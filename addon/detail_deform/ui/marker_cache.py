# SPDX-License-Identifier: GPL-3.0-or-later
"""Caches of what is needed of markers at every redraw, until their meshes are edited: their vertices, those in doubt,
and trees of the faces that may occlude them."""

import time

import bmesh
import bpy
from mathutils.bvhtree import BVHTree

from .. import session, timers
from ..library import native
from ..scene.mesh_data import MeshProblem
from ..scene.window import redraw_panels
from ..setup import marker_check, markers

_SLICE_SECONDS = 0.02  # of a search in each call of the timer, so that the window responds
_found = session.kept({}, session.Until.REPLACED)  # {object's name: (key of the content, {number: vertex})}
_trees = session.kept({}, session.Until.REPLACED)  # {object's name: BVHTree of its evaluated faces}
# {(source's name, target's name): (common markers, numbers in doubt)}
_doubts = session.kept({}, session.Until.REPLACED)
_searches = session.kept({}, session.Until.REPLACED)  # {the same: (common markers, generator)}


def is_in_use():
    """Whether anything is cached that forget() could drop."""
    return bool(_found or _trees)


def forget(edited):
    """Drops what is cached of edited meshes, and the trees of edited objects, whose evaluated shape may differ now."""
    for name in [*_found, *_trees]:
        ob = bpy.data.objects.get(name)
        if ob is None or ob in edited or ob.data in edited:
            _trees.pop(name, None)
            if ob is None or ob.data in edited:
                _found.pop(name, None)
                for pair in [pair for pair in (*_doubts, *_searches) if name in pair]:
                    _doubts.pop(pair, None)
                    _searches.pop(pair, None)


def forget_shapes():
    """Drops the trees, as another frame may show other shapes."""
    _trees.clear()


def markers_of(ob):
    """As markers.of(), memoized until groups or empties change; {} while the markers are invalid, which the search
    reports."""
    if ob.type != 'MESH':  # it was converted to another type
        return {}
    made_of = (*ob.vertex_groups.keys(), len(ob.data.vertices), ob.mode,
               *((child.name, *child.matrix_local.translation) for child in ob.children if child.type == 'EMPTY'))
    known = _found.get(ob.name)
    if known is None or known[0] != made_of:
        try:
            known = (made_of, markers.of(ob))
        except MeshProblem:
            known = (made_of, {})
        _found[ob.name] = known
    return known[1]


def followers(ob):
    """The mesh objects whose source this object is."""
    # With one user, its collection, it is nobody's source, and the search through all objects is spared.
    return [other for other in bpy.data.objects if other.type == 'MESH' and
            other.detail_deform.transfer.source == ob] if ob.users > 1 else []


# Markers in doubt

def doubts(source, target):
    """Numbers of the markers in doubt. Starts a search in the background if need be; () until it has ended."""
    of_source, of_target = markers_of(source), markers_of(target)
    made_of = tuple((number, of_source[number], of_target[number]) for number in of_source if number in of_target)
    pair = (source.name, target.name)
    known = _doubts.get(pair)
    if known and known[0] == made_of:
        return known[1]
    if pair not in _searches or _searches[pair][0] != made_of:
        _searches[pair] = (made_of, marker_check.search(source, target, of_source, of_target))
        _timer.start()
    return ()


def _search_on():
    """Timer: continues the searches. Returns the seconds to the next call, None to end."""
    for pair, (made_of, search) in list(_searches.items()):
        numbers = ()
        try:
            until = time.monotonic() + _SLICE_SECONDS
            while time.monotonic() < until:
                next(search)
            return 0.0
        except StopIteration as end:
            numbers = end.value
        except (MeshProblem, native.NativeError, ReferenceError):  # the transfer reports it; an object was deleted
            pass
        del _searches[pair]
        _doubts[pair] = (made_of, numbers)
        redraw_panels()
    return None


_timer = timers.Timer(_search_on, 0.0)


# Occlusion

def _tree(ob, depsgraph):
    if ob.name not in _trees:  # entering or leaving Edit Mode counts as an edit, which drops it
        _trees[ob.name] = (BVHTree.FromBMesh(bmesh.from_edit_mesh(ob.data)) if ob.mode == 'EDIT' else
                           BVHTree.FromObject(ob, depsgraph))
    return _trees[ob.name]


def is_hidden(point, eye, obs, depsgraph):
    """Whether the surface of one of these objects occludes a point on one of them from the eye; both in world space."""
    for ob in obs:
        to_local = ob.matrix_world.inverted_safe()
        start = to_local @ eye
        direction = to_local @ point - start
        # The ray ends 0.5% of the object's largest dimension before the point, whose own faces don't occlude it.
        length = direction.length - 0.005 * max(ob.dimensions) / max(max(ob.matrix_world.to_scale()), 1e-9)
        if length > 0 and _tree(ob, depsgraph).ray_cast(start, direction, length)[0] is not None:
            return True
    return False
