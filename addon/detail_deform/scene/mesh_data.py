# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads from Blender meshes what the library needs: positions, faces, keys, groups, roles."""

import hashlib
import itertools
import os

import numpy as np

from ..library import native
from . import display_key

MEMBER_WEIGHT = 0.5  # a vertex is a member of a group if its weight is larger; tooltips and messages say so
_INVISIBLE = 1e-6  # fraction of the mesh's largest extent: offsets up to it count as none, too small to be seen


class MeshProblem(Exception):
    """A sentence about an object or mesh that can't be used as it is."""


_MAKE_LOCAL = "Object > Relations > Make Local > Selected Objects and Data"
_MAKE_ALL_LOCAL = "Object > Relations > Make Local > All, for its collection is linked, too"


def _file(library):
    return os.path.basename(library.filepath.replace('\\', '/'))


def why_not_editable(ob):
    """A sentence where a mesh object or its mesh is linked from another file or an override; otherwise ''."""
    mesh, library = ob.data, ob.library or ob.data.library
    if ob.override_library or mesh.override_library:
        file = f" of '{_file(library)}'" if library else ""
        return (f"'{ob.name}' is a library override{file}, whose settings, groups and mesh can't be changed: make it "
                f"local ({_MAKE_LOCAL}).")
    if ob.library:
        # Made local alone it would be in no scene.
        with_all = ob.users_collection and all(collection.library for collection in ob.users_collection)
        return (f"'{ob.name}' is linked from another file, '{_file(library)}', so nothing can be stored in its mesh: "
                f"make it local ({_MAKE_ALL_LOCAL if with_all else _MAKE_LOCAL}).")
    if library:
        return (f"The mesh of '{ob.name}', '{mesh.name}', is linked from another file, '{_file(library)}', so nothing "
                f"can be stored in it: make it local ({_MAKE_LOCAL}).")
    return ""


def check_editable(ob):
    """Raises MeshProblem where the object is no mesh object, or why_not_editable()."""
    if ob is None or ob.type != 'MESH':
        raise MeshProblem("Select a mesh object: only meshes can be deformed.")
    problem = why_not_editable(ob)
    if problem:
        raise MeshProblem(problem)


def is_shared(mesh):
    return mesh.users > 1 + bool(mesh.use_fake_user)


def check_object(ob):
    """Raises MeshProblem where the mesh can't be written to, is shared with other objects, or is in Edit Mode."""
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
    if not read_attribute_into(mesh, 'position', 'vector', values):
        mesh.vertices.foreach_get('co', values)
    return values.reshape(-1, 3)


def rest_positions(mesh):
    """(n, 3) float32: the reference shape key, from which Blender evaluates keys, else the mesh's own vertices."""
    return key_positions(mesh.shape_keys.reference_key) if mesh.shape_keys else positions(mesh)


def sample_rest_positions(mesh, count=16):
    """(k, 3) float64: at most count points of rest_positions(), evenly spaced by index, without reading all of them."""
    points = mesh.shape_keys.reference_key.data if mesh.shape_keys else mesh.vertices
    chosen = np.linspace(0, len(points) - 1, min(count, len(points))).astype(np.intp).tolist()
    return np.array([points[k].co for k in chosen]).reshape(-1, 3)


def key_positions(key):
    """(n, 3) float32 of a shape key."""
    points = getattr(key, 'points', key.data)  # points, from 4.1 on, are copied in bulk; data are read one by one
    values = np.empty(3 * len(points), np.float32)
    points.foreach_get('co', values)
    return values.reshape(-1, 3)


def relative_keys(ob):
    """[ShapeKey] of the user, without the reference key. Raises MeshProblem where they are absolute."""
    keys = ob.data.shape_keys
    blocks = [key for key in display_key.others(ob.data) if key != keys.reference_key]
    if blocks and not keys.use_relative:
        raise MeshProblem(f"'{ob.name}' has absolute shape keys: make them relative first.")
    return blocks


def key_masks(ob, keys):
    """{group name: (n,) float32 weights} of the vertex groups that mask these keys."""
    names = list({key.vertex_group for key in keys if key.vertex_group in ob.vertex_groups})
    return dict(zip(names, group_weights(ob, names))) if names else {}


def key_change(key, masks):
    """(n, 3) float32: offsets of the vertices by the key at the value 1. masks: of key_masks(); {} ignores the key's
    mask."""
    change = key_positions(key) - key_positions(key.relative_key)
    if key.vertex_group in masks:
        change *= masks[key.vertex_group][:, None]
    return change


def key_shape(ob, key, masks=None):
    """(n, 3) float32: rest_positions() plus key_change() of this key, whatever key it is relative to. masks: as for
    key_change(); None: they are read."""
    return rest_positions(ob.data) + key_change(key, key_masks(ob, [key]) if masks is None else masks)


def are_invisible(mesh, vectors):
    """Whether these (n, 3) offsets are too small to be seen: at most _INVISIBLE."""
    largest = np.abs(vectors).max(initial=0)
    return bool(not largest or largest <= _INVISIBLE * np.ptp(positions(mesh), axis=0).max())


def key_mix(ob, without=()):
    """(n, 3) float32: offsets of the mesh's own vertices by the user's shape keys at their present values. Zero for
    absolute keys, which have no values. without: names of keys to leave out."""
    keys, own = ob.data.shape_keys, display_key.find(ob.data)
    pinned = ob.active_shape_key if ob.show_only_shape_key else None
    if not keys or not keys.use_relative or pinned is not None and pinned == own:
        return np.zeros((len(ob.data.vertices), 3), np.float32)
    if pinned and pinned.name not in without:  # shown at full value, whatever key it is relative to
        mix = rest_positions(ob.data)
        mix += (key_positions(pinned) - mix) * key_masks(ob, [pinned]).get(pinned.vertex_group, np.ones(1))[:, None]
    else:
        mix = rest_positions(ob.data)
        shown = [key for key in display_key.others(ob.data)
                 if key != keys.reference_key and not key.mute and key.value and key.name not in without]
        masks = key_masks(ob, shown)
        for key in shown:
            mix += key.value * key_change(key, masks)
    return mix - positions(ob.data)


def triangles(mesh):
    """(m, 3) int32: Blender's own triangulation of the faces."""
    mesh.calc_loop_triangles()
    return _indices(mesh.loop_triangles, 'vertices', 3).reshape(-1, 3)


def touching(elements, chosen):
    """(m,) bool: which triangles or edges, (m, k), have one of the chosen vertices, (n,) bool. Column by column, as
    numpy's any() along so short an axis takes several times as long."""
    result = chosen[elements[:, 0]]
    for column in elements.T[1:]:
        result |= chosen[column]
    return result


def faces_of_triangles(mesh):
    """(m,) int32: index of the face that each triangle of triangles() is part of."""
    mesh.calc_loop_triangles()
    return _indices(mesh.loop_triangles, 'polygon_index')


def faces(mesh):
    """(corners,) int32 vertices at the corners of all faces, and (faces,) int32 index of each face's first corner."""
    corners = np.empty(len(mesh.loops), np.int32)
    if not read_attribute_into(mesh, '.corner_vert', 'value', corners):
        corners = _indices(mesh.loops, 'vertex_index')
    return corners, _indices(mesh.polygons, 'loop_start')


def _indices(items, name, each=1):
    """(each × items,) int32. Read as uint32, the type that Blender declares, they are copied in bulk; to any other type
    they are converted one by one, which takes ten times as long."""
    values = np.empty(each * len(items), np.uint32)
    items.foreach_get(name, values)
    return values.view(np.int32)


def read_attribute_into(mesh, name, field, values):
    """Fills values from an attribute, in bulk; vertices and corners are read one by one. Returns False if there is
    none: 3.4 has no such attributes, and in Edit Mode they are empty."""
    attribute = mesh.attributes.get(name)
    if attribute is None or not len(attribute.data):
        return False
    attribute.data.foreach_get(field, values)
    return True


def group_entries(ob, names):
    """(vertices, indices, weights): an entry for each vertex in each named group; indices are the groups' indices in
    names. A group that is named twice has entries for both."""
    if not len(names):
        return np.empty(0, np.intp), np.empty(0, int), np.empty(0, np.float32)
    indices = {}
    for position, name in enumerate(names):
        indices.setdefault(ob.vertex_groups[name].index, []).append(position)
    # No version has foreach_get for vertex groups, so this is a slow loop (group_columns.py is faster, for Bind). It
    # runs at Bind and when something is edited, never in a frame.
    vertices, groups, weights = [], [], []
    for index, vertex in enumerate(ob.data.vertices):
        for element in vertex.groups[:]:  # in 5.2 slicing is faster than iterating
            if (group := element.group) in indices:
                vertices.append(index)
                groups.append(group)
                weights.append(element.weight)
    times = max(map(len, indices.values()), default=1)
    index_of = np.full((max(indices, default=0) + 1, times), -1)
    for group, of_group in indices.items():
        index_of[group, :len(of_group)] = of_group
    found = index_of[np.array(groups, np.intp)]
    entry, time = np.nonzero(found >= 0)
    return np.array(vertices, np.intp)[entry], found[entry, time], np.array(weights, np.float32)[entry]


def group_weights(ob, names):
    """(groups, n) float32: weights of all vertices in the named groups, 0 for non-members."""
    vertices, indices, weights = group_entries(ob, names)
    result = np.zeros((len(names), len(ob.data.vertices)), np.float32)
    result[indices, vertices] = weights
    return result


def members(ob, *names, entries=None):
    """(n,) bool: the vertices that are members of at least one of these groups. entries: as for
    handles_of_vertices()."""
    vertices, _, weights = (entries or group_entries)(ob, names)
    result = np.zeros(len(ob.data.vertices), bool)
    result[vertices[weights > MEMBER_WEIGHT]] = True
    return result


def members_of_each(ob, groups, entries=None):
    """[vertices]: the members of each group; all vertices for ''. entries: as for handles_of_vertices()."""
    named = list(dict.fromkeys(filter(None, groups)))
    vertices, indices, weights = (entries or group_entries)(ob, named)
    is_member = weights > MEMBER_WEIGHT
    vertices, indices = vertices[is_member], indices[is_member]
    order = np.argsort(indices, kind='stable')
    ends = np.cumsum(np.bincount(indices, minlength=len(named)))[:-1]
    found = dict(zip(named, np.split(vertices[order], ends)))
    return [found[name] if name else np.arange(len(ob.data.vertices)) for name in groups]


def handles_of_vertices(ob, region, groups, entries=None):
    """(winner, inside, has_any). winner: (n,) index of the group of which the vertex is a member with the largest
    weight; -1 for none. inside: (n,) bool, members of the region; all if that is ''. has_any: (groups,) bool, whether a
    group has members. entries: the function that reads the groups, group_entries() by default."""
    vertices, indices, weights = (entries or group_entries)(ob, [*groups, *[region] * bool(region)])
    is_member = weights > MEMBER_WEIGHT
    vertices, indices, weights = vertices[is_member], indices[is_member], weights[is_member]
    in_handle = indices < len(groups)
    inside = np.full(len(ob.data.vertices), not region)
    inside[vertices[~in_handle]] = True
    has_any = np.zeros(len(groups), bool)
    has_any[indices[in_handle]] = True
    # The last assignment counts: the largest weight comes last, and of equal weights the first group.
    order = np.lexsort((-indices[in_handle], weights[in_handle]))
    winner = np.full(len(ob.data.vertices), -1)
    winner[vertices[in_handle][order]] = indices[in_handle][order]
    return winner, inside, has_any


def edges(mesh):
    """(e, 2) int32: vertices of the edges."""
    return _indices(mesh.edges, 'vertices', 2).reshape(-1, 2)


def check_groups(ob, region, handles):
    """Raises MeshProblem where the region or a handle refers to no vertex group of the object.

    region: group name, '' for the whole mesh. handles: [(handle name, group name)]."""
    present = set(ob.vertex_groups.keys())  # a lookup in vertex_groups is linear in their number
    for what, group in [("The region", region)] * bool(region) + [
            (f"Handle '{name}'", group) for name, group in handles]:
        if not group:
            raise MeshProblem(f"{what} has no vertex group: choose that of its vertices in Vertices (Handles).")
        if group not in present:
            raise MeshProblem(f"{what} refers to the vertex group '{group}', which '{ob.name}' does "
                              "not have: choose another group.")


def roles(ob, region, handles, need_handles=True, entries=None):
    """(n,) int32 roles for native.Bind. region and handles: as for check_groups(); entries: for handles_of_vertices().

    A vertex is in a group if its weight is over 0.5. In two handles it belongs to the one with the larger weight;
    outside the region and every handle it is fixed. Raises MeshProblem that names the group or handle.
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
    """A hash of an array's values as short text. −0 counts as 0, which it becomes where Blender applies a transform."""
    array = np.asarray(array)
    return _digest(array + 0 if array.dtype.kind == 'f' else array)


# Comparison of two meshes with the same vertices

# Corners of a face that is_same_topology() recognizes triangulated in the other mesh. Bounds the memory: all triples of
# corners are listed, 220 for 12.
_MAX_CORNERS = 12


def is_same_topology(mesh, other):
    """Whether the faces of two meshes join the same vertices. Faces may differ in order, first corner and winding, and
    may be triangulated in one of the meshes."""
    if len(mesh.vertices) != len(other.vertices):
        return False
    return topology_signature(mesh) == topology_signature(other) or _faces_correspond(mesh, other)


def is_copy(mesh, other):
    """Whether other is a copy of mesh, possibly deformed, so that vertices with the same index correspond. Stricter
    than is_same_topology(): unless the faces are in the same order, the shapes must be similar too. A grid whose
    vertices are numbered from the other end has the same topology, but its vertices correspond in reverse."""
    if len(mesh.vertices) != len(other.vertices):
        return False
    return topology_signature(mesh) == topology_signature(other) or (
        _shapes_correspond(rest_positions(mesh), rest_positions(other)) and _faces_correspond(mesh, other))


def _faces_correspond(mesh, other):
    return _is_triangulation_of(mesh, triangles(other)) or _is_triangulation_of(other, triangles(mesh))


def _shapes_correspond(shape, other):
    """Whether vertices with the same index are nearer to one another than to the centroid, in the root mean square,
    with both shapes centred and scaled to the same size."""
    sides = [side.astype(np.float64) - side.mean(axis=0) for side in (shape, other)]
    one, another = (side / max(np.linalg.norm(side), 1e-300) for side in sides)
    return np.linalg.norm(one - another) < 1


def _is_triangulation_of(mesh, parts):
    """Whether these (m, 3) triangles are a triangulation of the faces: k - 2 lie in each face of k corners."""
    corners, begins = faces(mesh)
    sizes = np.diff(begins, append=len(corners))
    if not len(sizes) or sizes.max() > _MAX_CORNERS or (sizes - 2).sum() != len(parts):
        return False
    triples, owners = [], []
    for size in np.unique(sizes):
        of_size = np.flatnonzero(sizes == size)
        each = corners[begins[of_size][:, None] + np.arange(size)]
        for chosen in itertools.combinations(range(size), 3):
            triples.append(each[:, chosen])
            owners.append(of_size)
    labels = _triple_labels(np.concatenate([*triples, parts]), len(mesh.vertices))
    of_faces, of_parts = labels[:-len(parts)], labels[-len(parts):]
    order = np.argsort(of_faces, kind='stable')
    at = np.minimum(np.searchsorted(of_faces, of_parts, sorter=order), len(of_faces) - 1)
    if (of_faces[order[at]] != of_parts).any():
        return False
    found = np.bincount(np.concatenate(owners)[order[at]], minlength=len(sizes))
    return bool((found == sizes - 2).all())


def _triple_labels(triples, vertex_count):
    """(m,) int64 keys, equal for the same three vertices in any order."""
    low, middle, high = np.sort(triples, axis=1).astype(np.int64).T
    _, ranks = np.unique(low * vertex_count + middle, return_inverse=True)  # so that ranks * n fits in 64 bits
    return ranks * vertex_count + high
