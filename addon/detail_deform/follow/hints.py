# SPDX-License-Identifier: GPL-3.0-or-later
"""Warnings for the status: regions, examples and empties that will give unexpected results."""

import numpy as np

from .. import session
from ..library import native
from ..scene import components, examples, feedback, mesh_data, split, world_transforms
from ..scene.mesh_data import MeshProblem
from ..scene.subject import Subject, enabled_handles, with_empties
from . import binding_content, misshapen, registry, roles

# Largest displacement by an example of fixed vertices beside the region, as a fraction of that of the region. Above it
# a warning: lower values warn of examples that fade out, higher ones miss visible stubs.
_BESIDE = 0.2
# Entries of _of_regions, a few sentences each: more than objects are bound at a time, so that each is looked at once.
_MOST = 256
_of_regions = session.Memo(_MOST)  # {(signature, method): sentences}, as reading groups is slow


def of_region(ob, found=None, welded=None, stiffness=None):
    """Warnings about the region, the stiff parts and the examples of a bound object; memoized. found: its roles.Roles,
    welded: its split.WeldedMesh, stiffness: of binding_content.stiffness(), if the caller has them."""
    key = (ob.detail_deform.signature, ob.detail_deform.method)
    if key not in _of_regions:
        try:
            welded = welded or split.WeldedMesh(ob)
            found = found or roles.of(Subject(ob), welded=welded)
            if stiffness is None and ob.detail_deform.stiff_parts and ob.detail_deform.base == 'COMPUTED':
                stiffness = binding_content.stiffness(ob)
            edges = welded.representatives(mesh_data.edges(ob.data))
            sentences = list(_of_region(ob, found, edges, stiffness))
        except MeshProblem:  # the object is stale, or about to be
            return ()
        return _of_regions.put(key, sentences)
    return _of_regions.get(key)


def _of_region(ob, found, edges, stiffness):
    settings = ob.detail_deform
    if settings.base == 'OBJECT':
        return
    handles, owner, rigid = enabled_handles(settings), found.pieces.owner, []
    for part in found.parts:
        of_part, near = _around(part, edges)
        free, fixed = of_part == native.ROLE_FREE, of_part == native.ROLE_FIXED
        row = _beside(near, fixed) & _beside(near, of_part >= 0)
        if (fixed & _beside(near, free)).any() and row[free].all():
            if part.is_whole:
                yield ("The region is a single row of vertices between handle and rest, which takes all of the motion: "
                       "enlarge it (By Radius).")
            else:
                name = handles[owner[part.numbers[0]]].name
                yield (f"The reach of handle '{name}' is a single row of vertices between handle and rest, which "
                       "takes all of the motion: give its Reach more vertices, or none.")
        if not part.is_whole or settings.region and fixed.any():
            rigid += [handles[owner[part.numbers[number]]].name for number in _move_as_a_whole(of_part, near)]
    if rigid:
        names = ', '.join(f"'{name}'" for name in rigid)
        yield (f"Region or Reach hold all of the loose part that these handles are on, one each, so the part moves as "
               f"a whole: {names}. To bend it make them smaller (By Radius), or add a handle that stays.")
    if stiffness is not None:
        free = [(stiffness if part.is_whole else stiffness[part.vertices])[part.roles == native.ROLE_FREE]
                for part in found.parts]
        if not any(len(of_part) and np.ptp(of_part) for of_part in free):
            yield (f"Vertex group '{settings.stiff_parts}' has one weight on all that may deform, so Stiff Parts "
                   "changes nothing: paint what is to bend less more than the rest.")
    if settings.method == 'EXAMPLES' and found.parts[0].is_whole:
        fixed = found.of_all == native.ROLE_FIXED
        yield from _of_examples(ob, ~fixed, fixed & _beside(edges, found.of_all == native.ROLE_FREE))


def _around(part, edges):
    """(k,) roles and (e, 2) edges of a part's vertices and their one-ring, which is fixed; renumbered from 0."""
    if part.is_whole:
        return part.roles, edges
    inside = np.zeros(edges.max(initial=-1) + 1, bool)
    inside[part.vertices[part.vertices < len(inside)]] = True
    near = edges[mesh_data.touching(edges, inside)]
    vertices = np.union1d(near, part.vertices)
    of_part = np.full(len(vertices), native.ROLE_FIXED, np.int32)
    of_part[np.searchsorted(vertices, part.vertices)] = part.roles
    return of_part, np.searchsorted(vertices, near)


def _move_as_a_whole(roles, edges):
    """Numbers of the handles that are alone on a connected component with free vertices and without fixed ones."""
    inside = roles != native.ROLE_FIXED
    parts = components.labels(len(roles), edges[inside[edges].all(axis=1)])
    is_held = np.zeros(len(roles), bool)  # by a component's number: whether a fixed vertex is beside it
    is_held[parts[inside & _beside(edges, ~inside)]] = True
    follows = np.zeros(len(roles), bool)
    follows[parts[roles == native.ROLE_FREE]] = True
    of_handles = np.unique(np.stack([parts[roles >= 0], roles[roles >= 0]], axis=1), axis=0)
    alone = np.bincount(of_handles[:, 0], minlength=len(roles)) == 1
    return [int(number) for part, number in of_handles if alone[part] and follows[part] and not is_held[part]]


def _beside(edges, chosen):
    """(n,) bool: the neighbours of the chosen vertices, and the chosen ones that have an edge."""
    a, b = edges.T
    touched = chosen[a] | chosen[b]
    found = np.zeros(len(chosen), bool)
    found[a[touched]] = found[b[touched]] = True
    return found


def _of_examples(ob, region, border):
    rest, chosen = mesh_data.rest_positions(ob.data), examples.enabled(ob.detail_deform)
    if not chosen:
        return
    flaw_of = misshapen.Flaws(rest, mesh_data.triangles(ob.data), region).of
    for example, pose in zip(chosen, examples.positions(ob)):
        title = examples.title(example)
        moved = np.linalg.norm(pose - rest, axis=1)
        if border.any() and moved[border].max() > _BESIDE * moved[region].max():
            # The example bends more of the mesh than the region: where it is cut off it leaves a stub.
            vertex = int(np.flatnonzero(border)[moved[border].argmax()])
            yield (f"Example '{title}' also moves what lies beside the region (such as vertex "
                   f"{vertex}), which stays: of the pose a flat stub may be left. Make the region larger, to where the "
                   "example begins to move.")
        flaw = flaw_of(pose)
        if flaw:
            yield f"Example '{title}' {flaw}, which is no pose to mix with others: correct its shape, or untick it."


def goes_by_its_mesh(ob):
    """(which, reason) of an empty or curve that depends on vertices that it moves (a feedback loop), or None."""
    search = feedback.FeedbackSearch(ob)
    for handle in with_empties(ob.detail_deform):
        if handle.target is None:
            continue
        what, why = 'empty', search.through_transform(handle.target)
        if handle.target.type == 'CURVE':
            what, why = 'curve', why or search.through_shape(handle.target)
        if why:
            return f"{what} of handle '{handle.name}'", why
    return None


def gone_empties(ob, depsgraph):
    """Names of handles whose empties were deleted."""
    whereabouts = world_transforms.ObjectPresence(depsgraph)
    return [handle.name for handle in with_empties(ob.detail_deform)
            if whereabouts.is_deleted(handle.target)]


def is_posed_alike(ob, other):
    """Whether the empties that ob shares are children of other: then motions are relative to other, and both get the
    same pose."""
    return all(handle.target.parent == other for handle in enabled_handles(ob.detail_deform)
               if handle.target and handle.target == handle.own_target and handle.target.parent != ob)


def shares_empties_with(ob):
    """The object of which ob is a copy, or a copy of ob, if both have the same empties; None if ob has its own."""
    for handle in enabled_handles(ob.detail_deform):
        empty = handle.target
        if empty is None or empty.parent == ob or handle.own_target != empty:
            continue
        parent = empty.parent
        others = [parent] if parent and parent.type == 'MESH' else registry.members()
        for other in others:
            if other != ob and any(h.target == h.own_target == empty for h in other.detail_deform.handles):
                return other
    return None
