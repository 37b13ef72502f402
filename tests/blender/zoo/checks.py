# SPDX-License-Identifier: GPL-3.0-or-later
"""The checks of results, and of meshes after a refusal. They share no code with the add-on."""

import bpy
import numpy as np

OFFSET = 'detail_deform_offset'
EPS = float(np.finfo(np.float32).eps)
# Parts of sentences in the status that explain why free vertices stay at rest or are left behind.
STAYS = ("at rest", "Nothing follows", "is hidden", "baked cache", "next to no area", "single row",
         "goes by the handles", "overhang", "between parts of the base", "far from the base")


class Failure(Exception):
    """The outcome is neither a right result nor a sentence."""


def own(ob):
    """(n, 3): the mesh's own coordinates."""
    values = np.empty(3 * len(ob.data.vertices), np.float32)
    ob.data.vertices.foreach_get('co', values)
    return values.reshape(-1, 3).astype(float)


def offsets(ob):
    """(n, 3): the stored offsets, or None where there are none."""
    found = ob.data.attributes.get(OFFSET)
    if found is None or found.data_type != 'FLOAT_VECTOR':
        return None
    values = np.empty(3 * len(found.data), np.float32)
    found.data.foreach_get('vector', values)
    return values.reshape(-1, 3).astype(float)


def _faces(mesh):
    corners = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get('vertex_index', corners)
    return corners


def stored(ob):
    """The user's data: bytes of coordinates, faces and shape keys, and the groups with their weights."""
    keys, mesh = ob.data.shape_keys, ob.data
    blocks = {}
    for block in keys.key_blocks if keys else ():
        values = np.empty(3 * len(block.data), np.float32)
        block.data.foreach_get('co', values)
        blocks[block.name] = values.tobytes()
    blocks.pop(mesh.get('detail_deform_key'), None)  # the add-on's own, which displays the deformation
    if mesh.get('detail_deform_key_reference') and np.array_equal(
            np.frombuffer(blocks[keys.reference_key.name], np.float32), own(ob).ravel(), equal_nan=True):
        del blocks[keys.reference_key.name]  # made for it
    weights = repr([[(g.group, g.weight) for g in v.groups] for v in ob.data.vertices])
    return {'coordinates': own(ob).tobytes(), 'faces': _faces(ob.data).tobytes(), 'shape keys': blocks,
            'groups': [g.name for g in ob.vertex_groups], 'weights': weights}


def own_is_kept(ob, before):
    now = stored(ob)
    for what, value in before.items():
        if now[what] != value:
            raise Failure(f"the mesh's {what} changed")


def evaluated(ob):
    if bpy.context.view_layer.objects.get(ob.name) is None:
        return None
    mesh = ob.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    values = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get('co', values)
    return values.reshape(-1, 3).astype(float)


def is_finite(of):
    """Fails where offsets are not finite, or displayed vertices of a mesh that is."""
    moved = offsets(of.ob)
    if moved is not None and not np.isfinite(moved).all():
        raise Failure("offsets that are not finite")
    shown = evaluated(of.ob)
    if shown is not None and np.isfinite(own(of.ob)).all() and not np.isfinite(shown).all() and not of.shows_own_faults:
        raise Failure("vertices shown are not finite")


def _roles(ob):
    """(n,) handle of each vertex, -1 free, -2 fixed; by the manual's rules."""
    settings, count = ob.detail_deform, len(ob.data.vertices)
    groups = {g.name: g.index for g in ob.vertex_groups}
    weights = np.zeros((len(groups) + 1, count))
    for v in ob.data.vertices:
        for g in v.groups:
            weights[g.group, v.index] = g.weight
    roles = np.full(count, -1)
    if settings.region:
        roles[~(weights[groups[settings.region]] > 0.5)] = -2
    best = np.full(count, 0.5)
    for k, handle in enumerate(h for h in settings.handles if h.enabled):
        of_handle = weights[groups[handle.vertex_group]]
        larger = of_handle > best
        roles[larger], best[larger] = k, of_handle[larger]
    return roles


def _is_held(mesh, roles):
    """(n,) bool: vertices that edges connect with one of a handle."""
    edges = np.empty(2 * len(mesh.edges), np.int32)
    mesh.edges.foreach_get('vertices', edges)
    one, other = edges.reshape(-1, 2).T
    held, count = roles >= 0, -1
    while held.sum() != count:
        count = held.sum()
        held[one] |= held[other]
        held[other] |= held[one]
    return held


def _place(ob, handle, depsgraph):
    """(4, 4): the empty in the object's space, before modifiers pose the mesh."""
    world = np.array(ob.evaluated_get(depsgraph).matrix_world, float)
    pose = np.array(handle.pose_matrix, float).reshape(4, 4) if any(handle.pose_matrix) else np.eye(4)
    return np.linalg.inv(world @ pose) @ np.array(handle.target.evaluated_get(depsgraph).matrix_world, float)


def motions(of):
    """({number: (4, 4)}, float): the motions from rest in the object's space, of handles that follow an empty's place
    alone; and a bound for their error by single precision."""
    ob, depsgraph = of.ob, bpy.context.evaluated_depsgraph_get()
    found, open_by = {}, 0.0
    for k, handle in enumerate(h for h in ob.detail_deform.handles if h.enabled):
        if handle.mirrors or handle.target is None or of.is_carried:
            continue
        now, rest = _place(ob, handle, depsgraph), np.array(handle.rest_matrix, float).reshape(4, 4)
        found[k] = now @ np.linalg.inv(rest)
        if of.is_free_to_turn:
            found[k] = np.eye(4)
            found[k][:3, 3] = (now - rest)[:3, 3]
        world = np.array(ob.matrix_world, float)
        far = np.abs(np.linalg.inv(world)[:3, :3]).max() * np.abs(
            [world[:3, 3], np.array(handle.target.matrix_world, float)[:3, 3]]).max()
        size = np.abs(found[k][:3, :3]).max()
        open_by = max(open_by, 8 * EPS * (1 + size) * (far + np.abs(rest[:3, 3]).max() + np.abs(now[:3, 3]).max()))
    return found, open_by


def is_result(of, status, moved):
    """Fails where fixed vertices or handles are not where they have to be, or free ones don't follow. moved: whether
    handles were moved."""
    ob, found = of.ob, offsets(of.ob)
    if any(words in status for words in ("is hidden", "nothing is shown", "baked cache")):
        return
    if found is None or len(found) != len(ob.data.vertices):
        raise Failure("it says that it is bound and has no offsets")
    rest = of.start()
    size = max(np.ptp(rest, axis=0).max(), 1e-300)
    with np.errstate(all='ignore'):
        wanted, open_by = motions(of)
        roles = _roles(ob)
        amplitude = 0.0
        tolerance = 2e-4 * size + 16 * EPS * np.abs(rest).max() + open_by
        is_outside = ob.detail_deform.base == 'OBJECT'
        fixed = roles == -2
        if "along with what is beneath" in ob.detail_deform.status:
            fixed &= _is_held(ob.data, roles)  # loose parts ride
        if np.abs(found[fixed]).max(initial=0) > 0 and not (is_outside and of.shows_base):
            raise Failure("what is fixed moved")
        if is_outside:  # handles' motions are added to the base's, which isn't known here
            wanted = {}
        for k, motion in wanted.items():
            inside = np.flatnonzero(roles == k)
            there = rest[inside] @ motion[:3, :3].T + motion[:3, 3]
            amplitude = max(amplitude, np.abs(there - rest[inside]).max(initial=0))
            wrong = np.abs(rest[inside] + found[inside] - there).max(initial=0)
            if not of.is_free_to_turn and wrong > tolerance + 1e-5 * amplitude:
                raise Failure(f"a constraint is not kept: handle {k} is off by {wrong:.3g} of {size:.3g}")
        is_still = not moved and not of.shows_base and wanted and amplitude < tolerance
        if is_still and np.abs(found).max(initial=0) > 2 * tolerance:
            raise Failure(f"at rest something moves by {np.abs(found).max():.3g} of {size:.3g}")
        is_mirrored = any(handle.mirrors for handle in ob.detail_deform.handles)  # may go far, across a distant plane
        if wanted and not is_mirrored and (amplitude > tolerance or not of.shows_base):
            _follows(of, roles, wanted, rest, found, tolerance, status)


def _follows(of, roles, wanted, rest, found, tolerance, status):
    """Fails where free vertices move much farther in the world than the handles, or stay at rest beside one that
    moves."""
    linear, into = np.array(of.ob.matrix_world, float)[:3, :3], np.eye(4)
    into[:3, :3] = linear / np.linalg.norm(linear, 2)
    rest, found = rest @ into[:3, :3].T, found @ into[:3, :3].T
    wanted = {k: into @ motion @ np.linalg.inv(into) for k, motion in wanted.items()}
    amplitude = max(np.abs(rest[roles == k] @ (motion[:3, :3] - np.eye(3)).T + motion[:3, 3]).max(initial=0)
                    for k, motion in wanted.items())
    moved = np.linalg.norm(found, axis=1)
    # Vertices far from the others, such as the tip of a spike, turn like their neighbours and so may move farther.
    away = np.linalg.norm(rest - np.median(rest, axis=0), axis=1)
    turned = max(np.abs(motion[:3, :3] - np.eye(3)).max() for motion in wanted.values())
    reach = amplitude + turned * np.median(away) + tolerance
    allowed = 4 * np.sqrt(3) * reach * (1 + away / max(np.median(away), 1e-300))
    if "next to no area" in status:  # triangles without area spoil the smoothness of the vertices around them
        allowed *= 10
        allowed[_of_needles(of.ob.data, rest)] = np.inf
    if (moved > allowed).any():
        worst = np.argmax(moved / allowed)
        raise Failure(f"vertex {worst} is thrown {moved[worst] / max(reach, 1e-300):.3g} times as far as its handle")
    if any(excuse in status for excuse in STAYS) or amplitude < 100 * tolerance:
        return
    edges = np.empty(2 * len(of.ob.data.edges), np.int32)
    of.ob.data.edges.foreach_get('vertices', edges)
    edges = edges.reshape(-1, 2)
    for k, motion in wanted.items():
        if np.abs(rest[roles == k] @ (motion[:3, :3] - np.eye(3)).T + motion[:3, 3]).max(initial=0) < 0.5 * amplitude:
            continue
        beside = np.unique(np.concatenate([edges[roles[edges[:, i]] == k, 1 - i] for i in (0, 1)]))
        free = beside[roles[beside] == -1]
        if len(free) and moved[free].max() < 1e-3 * amplitude:
            raise Failure(f"it stays at rest beside handle {k} and says nothing")
    # Other methods may tear vertices far from the base.
    if of.ob.detail_deform.method == 'TRANSFER' and not of.shows_base:
        _is_whole(of.ob, roles, rest, found)


def _corners(mesh):
    """(m, 3): corners of the mesh's triangles."""
    mesh.calc_loop_triangles()
    corners = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get('vertices', corners)
    return corners.reshape(-1, 3)


def _of_needles(mesh, rest):
    """Vertices of triangles whose height is at most a thousandth of their longest edge."""
    corners = _corners(mesh)
    sides = [rest[corners[:, (k + 1) % 3]] - rest[corners[:, k]] for k in range(3)]
    longest = np.max([np.linalg.norm(side, axis=1) for side in sides], axis=0)
    return np.unique(corners[np.linalg.norm(np.cross(sides[0], sides[1]), axis=1) <= 1e-3 * longest ** 2])


def _is_whole(ob, roles, rest, found):
    """Fails where an edge of a face becomes half as long again in the world, by more than 0.9 of the largest motion:
    the surface is torn there."""
    corners, world = _corners(ob.data), np.array(ob.matrix_world, float)[:3, :3]
    rest, found = rest @ world.T, found @ world.T
    amplitude = np.abs(found[roles >= 0]).max(initial=0)
    ends = np.concatenate([corners[:, [k, (k + 1) % 3]] for k in range(3)])
    before, now = (np.linalg.norm(shape[ends[:, 0]] - shape[ends[:, 1]], axis=1) for shape in (rest, rest + found))
    growth, held = now - before, (roles[ends] != -1).all(1)
    if growth[held].max(initial=0) > 0.1 * amplitude:
        return  # neighbouring held vertices move apart themselves, and a smooth surface continues this beyond them
    growth[held | (growth < 0.5 * before)] = 0
    if growth.max(initial=0) > 0.9 * amplitude:
        raise Failure(f"the edge between vertices {ends[growth.argmax()].tolist()} takes "
                      f"{growth.max() / amplitude:.3g} of the motion")


def was_applied(of, expected):
    ob = of.ob
    shape = own(ob)
    if not np.isfinite(shape).all():
        raise Failure("Apply leaves coordinates that are not finite")
    if ob.data.shape_keys or of.shows_a_share:
        expected = shape
    if np.abs(shape - expected).max(initial=0) > 4 * EPS * np.abs(expected).max(initial=0):
        raise Failure("Apply gives another shape than was shown")
    if offsets(ob) is not None:
        raise Failure("Apply leaves the deformation behind")
