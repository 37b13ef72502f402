# SPDX-License-Identifier: GPL-3.0-or-later
"""The signature of a binding's content: equal signatures mean equal mesh, roles and options."""

from typing import Any, NamedTuple

import numpy as np

from ..library import native
from ..library.options import BIND, FALLOFF_ORDERS, arguments_of
from ..library.structs import BindOptions
from ..scene import examples, handle_matrices, loose, mesh_data, outside_base, proportions, split, start
from ..scene.mesh_data import MeshProblem
from . import reaches

_EXAMPLES = 'examples-'  # precedes the part of a signature that stands for the examples
BASE_CHANGED = "The base object, its mesh or its choice was changed since Bind."
TOPOLOGY_CHANGED = "The mesh's vertices or faces were changed since Bind."
VERTICES_MOVED = "The mesh's vertices were moved since Bind."


def check_groups(ob):
    """Raises MeshProblem if the region or a handle refers to a missing vertex group. Cheap enough for every frame."""
    settings = ob.detail_deform
    reaches = reaches_of(settings)
    mesh_data.check_groups(ob, _region(settings, reaches), handle_groups(settings))
    there = set(ob.vertex_groups.keys()) if any(reaches) else ()
    for handle, reach in zip(handle_matrices.enabled_handles(settings), reaches):
        if reach and reach not in there:
            raise MeshProblem(f"Handle '{handle.name}': its reach refers to the vertex group '{reach}', which "
                              f"'{ob.name}' does not have: choose another group, or none.")


def _region(settings, reaches):
    """The region's group; '' if all handles have reaches of their own. reaches: of reaches_of()."""
    return settings.region if not reaches or "" in reaches else ""


def handle_groups(settings):
    return [(h.name, h.vertex_group) for h in handle_matrices.enabled_handles(settings)]


def order_of_handles(settings):
    """A text that changes when handles are added, removed or reordered. Blender doesn't notify add-ons when a script
    does that, so it is compared at every update, and cheap enough for that."""
    return '\n'.join(f"{group}\t{reach}" if reach else group
                     for (_, group), reach in zip(handle_groups(settings), reaches_of(settings)))


def options(ob):
    """The options of native.Bind that a binding depends on, beside mesh and roles."""
    settings = ob.detail_deform
    if settings.base == 'OBJECT':
        return outside_base.rest(ob)
    told = arguments_of(BIND, settings)
    made = {name: told[name] for name in BindOptions.kinds if name in told}  # in the order of saved signatures
    try:
        poses = examples.positions(ob)
    except MeshProblem:
        if settings.method == 'EXAMPLES':
            raise
        poses = None  # other methods don't use them
    return made if poses is None else {**made, 'examples': poses}


class Roles(NamedTuple):
    """The roles of vertices in a binding."""
    of_all: Any  # (n,) int32: index of a handle, ROLE_FREE if free in any part, or ROLE_FIXED
    parts: list  # of Part


class Part(NamedTuple):
    """The handles of one reach, and the roles of vertices for these."""
    numbers: Any  # (k,) indices of the handles among all
    vertices: Any  # (m,) those that aren't fixed, ascending; None: all vertices, if the handles have no reach
    roles: Any  # (m,) int32, or (n,): handles are counted from 0
    smoothness: int = 0  # the order of the part's base energy; 0: the object's

    @property
    def is_whole(self):
        """Whether its handles have no reach, and so move the region."""
        return self.vertices is None


def roles(ob, entries=None, joined=None):
    """(n,) int32: roles_of().of_all."""
    return roles_of(ob, entries, joined).of_all


def roles_of(ob, entries=None, joined=None):
    """The object's Roles. entries: the function that reads groups, as for mesh_data.roles. joined: the object's
    split.WeldedMesh, if the caller has one. Raises MeshProblem naming the group or handle."""
    settings, joined = ob.detail_deform, joined or split.WeldedMesh(ob)
    check_groups(ob)
    names = reaches_of(settings)
    of_all = mesh_data.roles(ob, _region(settings, names), handle_groups(settings), settings.base == 'COMPUTED',
                             entries)
    if not any(names):
        of_all = joined.roles(of_all)
        return Roles(of_all, [Part(np.arange(len(names)), None, of_all)])
    # The part of the region comes first, then reaches by descending size, as small corrections are made on top of large
    # motions. The vertices of handles of later parts are free in earlier ones.
    reaches = [name for name in ("", *dict.fromkeys(filter(None, names))) if name in names]
    groups = [name or settings.region for name in reaches]
    inside = mesh_data.members_of_each(ob, groups, entries)
    order = sorted(range(len(reaches)), key=lambda place: (reaches[place] != "", -len(inside[place])))
    reaches, inside = [reaches[place] for place in order], [inside[place] for place in order]
    part_of = np.array([reaches.index(name) for name in names])[np.maximum(of_all, 0)]
    enabled = handle_matrices.enabled_handles(settings)
    parts, moves, edges = [], np.zeros(len(of_all), bool), joined.representatives(mesh_data.edges(ob.data))
    for place, (name, free) in enumerate(zip(reaches, inside)):
        free = free[(of_all[free] < 0) | (part_of[free] > place)]
        numbers = np.flatnonzero([other == name for other in names])
        moves[free] = True
        held = (of_all >= 0) & (part_of == place)
        of_part = np.full(len(of_all), native.ROLE_FIXED, np.int32)
        of_part[free] = native.ROLE_FREE
        of_part[held] = np.searchsorted(numbers, of_all[held])
        of_part = joined.roles(of_part)
        ends = of_part[edges]
        if name and not ((ends == native.ROLE_FREE).any(axis=1) & (ends >= 0).any(axis=1)).any():
            raise MeshProblem(f"Handle '{enabled[numbers[0]].name}': no vertex that is free to follow is beside it "
                              "within its reach. Give its Reach more vertices, or none.")
        vertices = np.flatnonzero(of_part != native.ROLE_FIXED) if name else None
        smoothness = FALLOFF_ORDERS[enabled[numbers[0]].falloff] if name else 0
        parts.append(Part(numbers, vertices, of_part if vertices is None else of_part[vertices], smoothness))
    of_all = np.where(of_all >= 0, of_all, np.where(moves, native.ROLE_FREE, native.ROLE_FIXED)).astype(np.int32)
    return Roles(joined.roles(of_all), parts)


def reaches_of(settings):
    """The group of each enabled handle's reach; '' if it has none and moves the region."""
    handles = handle_matrices.enabled_handles(settings)
    return [handle.reach for handle in handles] if settings.base == 'COMPUTED' else [""] * len(handles)


def shape_signature(ob, topology=None):
    """[positions, topology]: hashes of the shape that is bound, in the proportions of the object's scale, and of its
    faces. topology: that hash, if the caller has it."""
    shape = proportions.bound(ob.detail_deform).to(start.shape(ob))
    return [mesh_data.signature(shape), topology or mesh_data.topology_signature(ob.data)]


def signature(shape, known, told):
    """The whole signature. shape: of shape_signature(). known: Roles. told: of options()."""
    told_apart = [known.of_all]
    for part in known.parts[len(known.parts) == 1 and known.parts[0].is_whole:]:
        told_apart += [[len(part.numbers), len(part.roles)], part.numbers, part.roles]
        told_apart += [] if part.is_whole else [part.vertices]
        told_apart += [[part.smoothness]] if part.smoothness else []
    return '.'.join([*shape, mesh_data.signature(np.concatenate(told_apart).astype(np.int32)), _texts(told)])


def _texts(values):
    texts = {'examples': lambda value: _EXAMPLES + mesh_data.signature(value), 'base': mesh_data.signature,
             'base_triangles': mesh_data.signature}
    return '.'.join(texts.get(name, _text)(value) for name, value in values.items())


def _text(value):
    return f"{value:g}" if isinstance(value, float) else str(value)


def parts_to_bind(ob, known, joined, triangles, hung_ones):
    """[reaches.Part] of the object, in proportions.bound(). known: Roles. joined: the object's split.WeldedMesh.
    triangles: of its mesh. hung_ones: of hung(); these vertices are fixed here, and follow the deformed surface
    (placed.py)."""
    positions, triangles = proportions.bound(ob.detail_deform).to(start.shape(ob)), joined.representatives(triangles)
    surface, found = reaches.Surface(positions, triangles), []
    for part in known.parts:
        hung = hung_ones if part.is_whole else hung_ones[part.vertices]
        of_part = np.where(hung, native.ROLE_FIXED, part.roles).astype(np.int32)
        found.append(reaches.Part(part.numbers, positions, triangles, of_part) if part.is_whole else
                     surface.part(part.numbers, part.vertices, of_part, part.smoothness))
    return found


def hung(ob, roles_of_vertices, triangles):
    """(n,) bool: vertices in no face that are connected with the surface by edges, and are free or in the same handle
    as the vertex of the surface where that connection ends."""
    on = loose.roots(len(roles_of_vertices), triangles, mesh_data.edges(ob.data))
    is_hung = (on >= 0) & (on != np.arange(len(on)))
    follows = (roles_of_vertices == native.ROLE_FREE) | (
        (roles_of_vertices >= 0) & (roles_of_vertices == roles_of_vertices[on]))
    return is_hung & follows


def is_of_base(ob):
    """Whether the base object's mesh is the one that was bound. Raises MeshProblem."""
    return ob.detail_deform.signature.endswith('.' + _texts(outside_base.rest(ob)))


def difference(ob):
    """How the object's content differs from that of its binding: a sentence, or ''."""
    settings = ob.detail_deform
    parts = settings.signature.split('.', 3)
    if len(parts) != 4:  # not a signature of this add-on
        return TOPOLOGY_CHANGED
    positions, topology, bound_roles, bound_options = parts
    shape = shape_signature(ob)
    if shape[1] != topology:
        return TOPOLOGY_CHANGED
    if shape[0] != positions:
        return VERTICES_MOVED
    try:
        current = signature(shape, roles_of(ob, joined=split.WeldedMesh(ob, topology)), options(ob)).split('.', 3)
    except MeshProblem as problem:
        return str(problem)
    if current[2] != bound_roles:
        return "The region, the handles or their vertex groups were changed since Bind."
    if current[3] == bound_options:
        return ""
    if settings.method != 'EXAMPLES' and _without_examples(current[3]) == _without_examples(bound_options):
        return ""
    if settings.base == 'OBJECT':
        return BASE_CHANGED
    return "Settings or examples that need a new Bind were changed."


def _without_examples(text):
    return text.split(f'.{_EXAMPLES}')[0]
