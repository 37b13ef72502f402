# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of the markers of meshes, until these are edited, for whatever draws them many times a second: the
vertices, which are in doubt, and what hides them."""

import time

import bmesh
import bpy
from mathutils.bvhtree import BVHTree

from ..library import native
from ..scene.mesh_data import MeshProblem
from ..scene.window import redraw_panels
from ..setup import marker_check, markers

_SLICE_SECONDS = 0.02  # of a search, before the window goes on
_found = {}  # by object: what they were found in, and the vertex of each number
_trees = {}  # by object: its faces as they are seen
_doubts = {}  # by the names of source and target: what they were searched in, and the numbers
_searches = {}  # the same: what is searched in, and the generator


def is_in_use():
    """Whether anything is kept that forget() could forget."""
    return bool(_found or _trees)


def forget(edited):
    """It is looked for anew where these meshes, or what their modifiers make of them, were edited."""
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
    """Another frame may show others."""
    _trees.clear()


def clear():
    for known in (_found, _trees, _doubts, _searches):
        known.clear()
    if bpy.app.timers.is_registered(_search_on):
        bpy.app.timers.unregister(_search_on)


def of(ob):
    """As markers.of(), looked for only when groups or empties are others; none while something is wrong with them,
    which the search says."""
    if ob.type != 'MESH':  # it has been converted
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
    """The meshes that have this one for their source."""
    # All objects are gone through only for one that more refers to than a collection.
    return [other for other in bpy.data.objects if other.type == 'MESH' and
            other.detail_deform.transfer.source == ob] if ob.users > 1 else []


# In doubt

def doubts(source, target):
    """Numbers of the markers in doubt; none while that is searched."""
    of_source, of_target = of(source), of(target)
    made_of = tuple((number, of_source[number], of_target[number]) for number in of_source if number in of_target)
    pair = (source.name, target.name)
    known = _doubts.get(pair)
    if known and known[0] == made_of:
        return known[1]
    if pair not in _searches or _searches[pair][0] != made_of:
        _searches[pair] = (made_of, marker_check.search(source, target, of_source, of_target))
        if not (bpy.app.background or bpy.app.timers.is_registered(_search_on)):
            bpy.app.timers.register(_search_on, first_interval=0.0)
    return ()


def _search_on():
    """Timer: goes on with what was asked for. Returns the seconds to the next call, None to end."""
    for pair, (made_of, search) in list(_searches.items()):
        numbers = ()
        try:
            until = time.monotonic() + _SLICE_SECONDS
            while time.monotonic() < until:
                next(search)
            return 0.0
        except StopIteration as end:
            numbers = end.value
        except (MeshProblem, native.NativeError, ReferenceError):  # the transfer says it; it was deleted
            pass
        del _searches[pair]
        _doubts[pair] = (made_of, numbers)
        redraw_panels()
    return None


# Hidden

def _tree(ob, depsgraph):
    if ob.name not in _trees:  # entering and leaving Edit Mode is an edit, too
        _trees[ob.name] = (BVHTree.FromBMesh(bmesh.from_edit_mesh(ob.data)) if ob.mode == 'EDIT' else
                           BVHTree.FromObject(ob, depsgraph))
    return _trees[ob.name]


def is_hidden(place, eye, obs, depsgraph):
    """Whether the surface of one of these objects lies between the eye and a place on one, both in the world."""
    for ob in obs:
        to_local = ob.matrix_world.inverted_safe()
        start = to_local @ eye
        way = to_local @ place - start
        # The place's own faces don't hide it.
        reach = way.length - 0.005 * max(ob.dimensions) / max(max(ob.matrix_world.to_scale()), 1e-9)
        if reach > 0 and _tree(ob, depsgraph).ray_cast(start, way, reach)[0] is not None:
            return True
    return False
