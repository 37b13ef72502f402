# SPDX-License-Identifier: GPL-3.0-or-later
"""What the library needs from a Blender mesh."""

import hashlib
import itertools
import os

import numpy as np

from ..library import native

MEMBER_WEIGHT = 0.5
# Of the size of the mesh.
_NOTHING = 1e-6


class MeshProblem(Exception):
    """A sentence about an object or mesh that can't be used as it is."""


_MAKE_LOCAL = "Object > Relations > Make Local > Selected Objects and Data"
_MAKE_ALL_LOCAL = "Object > Relations > Make Local > All, for its collection is linked, too"


def _file(library):
    return os.path.basename(library.filepath.replace('\\', '/'))


def why_not_editable(ob):
    """A sentence where a mesh object's settings or mesh belong to another file, or ''."""
    mesh, library = ob.data, ob.library or ob.data.library
    if ob.override_library or mesh.override_library:
        file = f" of '{_file(library)}'" if library else ""
        return (f"'{ob.name}' is a library override{file}, whose settings, groups and mesh can't be changed: make it "
                f"local ({_MAKE_LOCAL}).")
    if ob.library:
        # It alone would be local and in no scene.
        with_all = ob.users_collection and all(collection.library for collection in ob.users_collection)
        return (f"'{ob.name}' is linked from another file, '{_file(library)}', so nothing can be stored in its mesh: "
                f"make it local ({_MAKE_ALL_LOCAL if with_all else _MAKE_LOCAL}).")
    if library:
        return (f"The mesh of '{ob.name}', '{mesh.name}', is linked from another file, '{_file(library)}', so nothing "
                f"can be stored in it: make it local ({_MAKE_LOCAL}).")
    return ""


def check_editable(ob):
    """Raises MeshProblem when the object's settings or mesh belong to another file."""
    if ob is None or ob.type != 'MESH':
        raise MeshProblem("Select a mesh object: only meshes can be deformed.")
    problem = why_not_editable(ob)
    if problem:
        raise MeshProblem(problem)


def is_shared(mesh):
    return mesh.users > 1 + bool(mesh.use_fake_user)


def check_object(ob):
    """Raises MeshProblem when the object's mesh must not or can't be written to."""
    check_editable(ob)
    mesh = ob.data
    if is_shared(mesh):
        raise MeshProblem(f"Mesh '{mesh.name}' is used by {mesh.users - bool(mesh.use_fake_user)} "
                          "objects, which would all be deformed: make it single-user (Object > "
                          "Relations > Make Single User > Object & Data).")
    check_left_edit_mode(ob)


def check_left_edit_mode(ob):
    if ob.mode == 'EDIT':
        raise MeshProblem(f"'{ob.name}' is in Edit Mode: leave it (Tab) first.")


def positions(mesh):
    """(n, 3) float32"""
    values = np.empty(3 * len(mesh.vertices), np.float32)
    if not copied(mesh, 'position', 'vector', values):
        mesh.vertices.foreach_get('co', values)
    return values.reshape(-1, 3)


def rest(mesh):
    """(n, 3) float32: without shape keys, which start from their basis and not from the mesh's own vertices."""
    return key_positions(mesh.shape_keys.reference_key) if mesh.shape_keys else positions(mesh)


def some_of_rest(mesh, count=16):
    """(k, 3) float64: a few of these, evenly through the mesh's list, without reading them all."""
    points = mesh.shape_keys.reference_key.data if mesh.shape_keys else mesh.vertices
    chosen = np.linspace(0, len(points) - 1, min(count, len(points))).astype(np.intp).tolist()
    return np.array([points[k].co for k in chosen]).reshape(-1, 3)


def key_positions(key):
    """(n, 3) float32 of a shape key."""
    points = getattr(key, 'points', key.data)  # from 4.1 on, and copied at once, where data are asked one by one
    values = np.empty(3 * len(points), np.float32)
    points.foreach_get('co', values)
    return values.reshape(-1, 3)


def relative_keys(ob):
    """The shape keys beside the basis. Raises MeshProblem where they are absolute."""
    keys = ob.data.shape_keys
    blocks = [key for key in keys.key_blocks if key != keys.reference_key] if keys else []
    if blocks and not keys.use_relative:
        raise MeshProblem(f"'{ob.name}' has absolute shape keys: make them relative first.")
    return blocks


def key_masks(ob, keys):
    """{name: (n,) float32 weights} of the vertex groups that mask some of these keys."""
    names = list({key.vertex_group for key in keys if key.vertex_group in ob.vertex_groups})
    return dict(zip(names, group_weights(ob, names))) if names else {}


def key_change(key, masks):
    """(n, 3) float32: by how much the key moves each vertex at the value 1. masks: as of key_masks, or none of them for
    a key without its mask."""
    change = key_positions(key) - key_positions(key.relative_key)
    if key.vertex_group in masks:
        change *= masks[key.vertex_group][:, None]
    return change


def key_shape(ob, key, masks=None):
    """(n, 3) float32: the rest as this key alone deforms it, whatever it is relative to. masks: as of key_change, read
    where they aren't given."""
    return rest(ob.data) + key_change(key, key_masks(ob, [key]) if masks is None else masks)


def is_nothing(mesh, vectors):
    """Whether these (n, 3) vectors move nothing that could be seen."""
    largest = np.abs(vectors).max(initial=0)
    return bool(not largest or largest <= _NOTHING * np.ptp(positions(mesh), axis=0).max())


def key_mix(ob, without=()):
    """(n, 3) float32: by how much the shape keys, as their values are now, move the mesh's own vertices. Zero for
    absolute ones, which have no values. without: names of keys that don't count."""
    keys = ob.data.shape_keys
    if not keys or not keys.use_relative:
        return np.zeros((len(ob.data.vertices), 3), np.float32)
    if ob.show_only_shape_key and ob.active_shape_key and ob.active_shape_key.name not in without:
        pinned = ob.active_shape_key  # as it is, whatever it is relative to
        mix = rest(ob.data)
        mix += (key_positions(pinned) - mix) * key_masks(ob, [pinned]).get(pinned.vertex_group, np.ones(1))[:, None]
    else:
        mix = rest(ob.data)
        shown = [key for key in keys.key_blocks
                 if key != keys.reference_key and not key.mute and key.value and key.name not in without]
        masks = key_masks(ob, shown)
        for key in shown:
            mix += key.value * key_change(key, masks)
    return mix - positions(ob.data)


def triangles(mesh):
    """(m, 3) int32: Blender's own triangulation of the faces."""
    mesh.calc_loop_triangles()
    return _indices(mesh.loop_triangles, 'vertices', 3).reshape(-1, 3)


def faces_of_triangles(mesh):
    """(m,) int32: the number of the face that each of triangles() is of."""
    mesh.calc_loop_triangles()
    return _indices(mesh.loop_triangles, 'polygon_index')


def faces(mesh):
    """(corners,) int32 and (faces,) int32: the vertices at the corners of all faces, and where each face starts."""
    corners = np.empty(len(mesh.loops), np.int32)
    if not copied(mesh, '.corner_vert', 'value', corners):
        corners = _indices(mesh.loops, 'vertex_index')
    return corners, _indices(mesh.polygons, 'loop_start')


def _indices(items, name, each=1):
    """(each × items,) int32. Blender has them without a sign, and copies them to the same at once; to any others one by
    one, which takes ten times as long."""
    values = np.empty(each * len(items), np.uint32)
    items.foreach_get(name, values)
    return values.view(np.int32)


def copied(mesh, name, field, values):
    """Whether values could be filled from an attribute, which Blender copies at once where it asks vertices and corners
    one by one. 3.4 has none, nor has a mesh in Edit Mode."""
    attribute = mesh.attributes.get(name)
    if attribute is None or not len(attribute.data):
        return False
    attribute.data.foreach_get(field, values)
    return True


def group_entries(ob, names):
    """What the named groups hold: vertices, for each the place of its group among the names, and the weight. A group
    that is named twice counts for each."""
    places = {}
    for place, name in enumerate(names):
        places.setdefault(ob.vertex_groups[name].index, []).append(place)
    # There is no foreach_get for vertex groups in any version, so this is the slow way (group_columns.py has a faster
    # one for Bind); it runs when something is bound or edited, never in a frame.
    vertices, groups, weights = [], [], []
    for index, vertex in enumerate(ob.data.vertices):
        for element in vertex.groups[:]:  # in 5.2 a slice takes less than an iterator
            if (group := element.group) in places:
                vertices.append(index)
                groups.append(group)
                weights.append(element.weight)
    times = max(map(len, places.values()), default=1)
    place_of = np.full((max(places, default=0) + 1, times), -1)
    for group, of_group in places.items():
        place_of[group, :len(of_group)] = of_group
    found = place_of[np.array(groups, np.intp)]
    entry, time = np.nonzero(found >= 0)
    return np.array(vertices, np.intp)[entry], found[entry, time], np.array(weights, np.float32)[entry]


def group_weights(ob, names):
    """(groups, n) float32: the weight of every vertex in the named groups, 0 outside."""
    vertices, places, weights = group_entries(ob, names)
    result = np.zeros((len(names), len(ob.data.vertices)), np.float32)
    result[places, vertices] = weights
    return result


def members(ob, *names):
    """(n,) bool: the vertices of a group, or of any of several."""
    vertices, _, weights = group_entries(ob, names)
    result = np.zeros(len(ob.data.vertices), bool)
    result[vertices[weights > MEMBER_WEIGHT]] = True
    return result


def members_of_each(ob, groups, entries=None):
    """[vertices] of each of these groups, in their order; of '' all. entries: what reads the groups."""
    named = list(dict.fromkeys(filter(None, groups)))
    vertices, places, weights = (entries or group_entries)(ob, named)
    is_member = weights > MEMBER_WEIGHT
    vertices, places = vertices[is_member], places[is_member]
    order = np.argsort(places, kind='stable')
    ends = np.cumsum(np.bincount(places, minlength=len(named)))[:-1]
    found = dict(zip(named, np.split(vertices[order], ends)))
    return [found[name] if name else np.arange(len(ob.data.vertices)) for name in groups]


def handles_of_vertices(ob, region, groups, entries=None):
    """Of each vertex the number of the group, among these, that it belongs to, the one with the largest weight; -1:
    none. And (n,) bool, whether it is in the region, which may be '': then all are; and of each group, whether it has
    any vertex at all. entries: what reads the groups, group_entries where it isn't given."""
    vertices, places, weights = (entries or group_entries)(ob, [*groups, *[region] * bool(region)])
    is_member = weights > MEMBER_WEIGHT
    vertices, places, weights = vertices[is_member], places[is_member], weights[is_member]
    in_handle = places < len(groups)
    inside = np.full(len(ob.data.vertices), not region)
    inside[vertices[~in_handle]] = True
    has_any = np.zeros(len(groups), bool)
    has_any[places[in_handle]] = True
    # The largest weight last, of equal ones the first group.
    order = np.lexsort((-places[in_handle], weights[in_handle]))
    winner = np.full(len(ob.data.vertices), -1)
    winner[vertices[in_handle][order]] = places[in_handle][order]
    return winner, inside, has_any


def edges(mesh):
    """(e, 2) int32: the vertices of every edge."""
    return _indices(mesh.edges, 'vertices', 2).reshape(-1, 2)


def check_groups(ob, region, handles):
    """Raises MeshProblem when the region or a handle refers to no group of the object.

    region: group name, '' for the whole mesh. handles: [(handle name, group name)]."""
    there = set(ob.vertex_groups.keys())  # asked one by one, each would go through all names
    for what, group in [("The region", region)] * bool(region) + [
            (f"Handle '{name}'", group) for name, group in handles]:
        if not group:
            raise MeshProblem(f"{what} has no vertex group: choose that of its vertices in Vertices (Handles).")
        if group not in there:
            raise MeshProblem(f"{what} refers to the vertex group '{group}', which '{ob.name}' does "
                              "not have: choose another group.")


def roles(ob, region, handles, need_handles=True, entries=None):
    """(n,) int32 roles for native.Bind; region and handles as of check_groups, entries of handles_of_vertices.

    A vertex is in a group when its weight is over 0.5; in two handles it belongs to the one with
    the larger weight; outside the region and every handle it is fixed.
    Raises MeshProblem naming the group or handle.
    """
    check_groups(ob, region, handles)
    winner, inside, has_any = handles_of_vertices(ob, region, [group for _, group in handles], entries)
    result = np.full(len(ob.data.vertices), native.ROLE_FREE, np.int32)
    if region and not inside.any():
        raise MeshProblem(f"The region group '{region}' has no vertex with a weight over "
                          f"{MEMBER_WEIGHT}: assign the vertices that may deform.")
    result[~inside] = native.ROLE_FIXED
    if not handles:
        if need_handles:
            raise MeshProblem("There is no handle: add one for the vertices to pull (Handles).")
        return result
    result[winner >= 0] = winner[winner >= 0]
    wins = np.bincount(winner[winner >= 0], minlength=len(handles)) > 0
    for number in np.flatnonzero(~wins):
        name, group = handles[number]
        if not has_any[number]:
            raise MeshProblem(f"Handle '{name}': its group '{group}' has no vertex with a weight over "
                              f"{MEMBER_WEIGHT}: select vertices in Edit Mode and press Assign Selected.")
        raise MeshProblem(f"Handle '{name}': every vertex of its group '{group}' has a larger "
                          "weight in another handle: take some of them out of the other group.")
    if not (result == native.ROLE_FREE).any():
        raise MeshProblem("No vertex is free to follow: every vertex of the region is in a handle. "
                          "Make the region larger (By Radius), or give the handles fewer vertices.")
    return result


def _digest(*arrays):
    state = hashlib.blake2b(digest_size=8)
    for array in arrays:
        state.update(np.ascontiguousarray(array))
    return state.hexdigest()


def topology_signature(mesh):
    return _digest(*faces(mesh))


def signature(array):
    """A short text: equal texts, equal content."""
    return _digest(array)


# Two meshes of the same vertices

_MOST_CORNERS = 12  # of a face that may be triangulated in the other mesh: it has 220 triples of corners


def is_same_topology(mesh, other):
    """Whether the faces of two meshes join the same vertices: in any order, begun at any corner and wound either way,
    and triangulated in one of them."""
    if len(mesh.vertices) != len(other.vertices):
        return False
    return topology_signature(mesh) == topology_signature(other) or _join_alike(mesh, other)


def is_copy(mesh, other):
    """The same of meshes of which nobody has said so. Where faces come in another order, as of a grid whose vertices
    are numbered from its other end, the vertices of one number have to lie about at the same places, too."""
    if len(mesh.vertices) != len(other.vertices):
        return False
    return topology_signature(mesh) == topology_signature(other) or (
        _lie_alike(rest(mesh), rest(other)) and _join_alike(mesh, other))


def _join_alike(mesh, other):
    return _is_made_of(mesh, triangles(other)) or _is_made_of(other, triangles(mesh))


def _lie_alike(shape, other):
    """Whether vertices of one number are nearer to one another than to the middle, at the same size."""
    sides = [side.astype(np.float64) - side.mean(axis=0) for side in (shape, other)]
    one, another = (side / max(np.linalg.norm(side), 1e-300) for side in sides)
    return np.linalg.norm(one - another) < 1


def _is_made_of(mesh, parts):
    """Whether these (m, 3) triangles are a triangulation of the mesh's faces."""
    corners, begins = faces(mesh)
    sizes = np.diff(begins, append=len(corners))
    if not len(sizes) or sizes.max() > _MOST_CORNERS or (sizes - 2).sum() != len(parts):
        return False
    triples, owners = [], []
    for size in np.unique(sizes):
        of_size = np.flatnonzero(sizes == size)
        each = corners[begins[of_size][:, None] + np.arange(size)]
        for chosen in itertools.combinations(range(size), 3):
            triples.append(each[:, chosen])
            owners.append(of_size)
    keys = _keys_of_triples(np.concatenate([*triples, parts]), len(mesh.vertices))
    of_faces, of_parts = keys[:-len(parts)], keys[-len(parts):]
    order = np.argsort(of_faces, kind='stable')
    at = np.minimum(np.searchsorted(of_faces, of_parts, sorter=order), len(of_faces) - 1)
    if (of_faces[order[at]] != of_parts).any():
        return False
    found = np.bincount(np.concatenate(owners)[order[at]], minlength=len(sizes))
    return bool((found == sizes - 2).all())


def _keys_of_triples(triples, vertex_count):
    """(m,) int64: equal for the same three vertices in any order."""
    low, middle, high = np.sort(triples, axis=1).astype(np.int64).T
    _, ranks = np.unique(low * vertex_count + middle, return_inverse=True)  # so that the next product fits
    return ranks * vertex_count + high
