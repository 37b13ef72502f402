# SPDX-License-Identifier: GPL-3.0-or-later
"""What a binding is made for, as a signature: equal signatures, equal mesh, roles and options."""

from typing import Any, NamedTuple

import numpy as np

from ..library import native
from ..library.options import BIND, FALLOFF_ORDERS, asked
from ..library.structs import BindOptions
from ..scene import examples, handle_matrices, loose, mesh_data, outside_base, proportions, split, start
from ..scene.mesh_data import MeshProblem
from . import reaches

_EXAMPLES = 'examples-'  # before their part of a signature
BASE_CHANGED = "The base object, its mesh or its choice was changed since Bind."
TOPOLOGY_CHANGED = "The mesh's vertices or faces were changed since Bind."
VERTICES_MOVED = "The mesh's vertices were moved since Bind."


def check_groups(ob):
    """Raises MeshProblem where the region or a handle refers to no group of the object. Cheap enough for every frame.
    """
    settings = ob.detail_deform
    reaches = reaches_of(settings)
    mesh_data.check_groups(ob, _region(settings, reaches), handle_groups(settings))
    there = set(ob.vertex_groups.keys()) if any(reaches) else ()
    for handle, reach in zip(handle_matrices.enabled_handles(settings), reaches):
        if reach and reach not in there:
            raise MeshProblem(f"Handle '{handle.name}': its reach refers to the vertex group '{reach}', which "
                              f"'{ob.name}' does not have: choose another group, or none.")


def _region(settings, reaches):
    """Its group; '' where all handles have reaches of their own. reaches: of reaches_of()."""
    return settings.region if not reaches or "" in reaches else ""


def handle_groups(settings):
    return [(h.name, h.vertex_group) for h in handle_matrices.enabled_handles(settings)]


def order_of_handles(settings):
    """A text that is another one where handles have come, gone or changed places. Blender tells nobody when a script
    does that, so it is cheap enough for every update."""
    return '\n'.join(f"{group}\t{reach}" if reach else group
                     for (_, group), reach in zip(handle_groups(settings), reaches_of(settings)))


def options(ob):
    """Of native.Bind: what a binding depends on beside mesh and roles."""
    settings = ob.detail_deform
    if settings.base == 'OBJECT':
        return outside_base.rest(ob)
    told = asked(BIND, settings)
    made = {name: told[name] for name in BindOptions.kinds if name in told}  # in the order that files hold
    try:
        poses = examples.positions(ob)
    except MeshProblem:
        if settings.method == 'EXAMPLES':
            raise
        poses = None  # they matter to that method alone
    return made if poses is None else {**made, 'examples': poses}


class Roles(NamedTuple):
    """What vertices are to a binding."""
    of_all: Any  # (n,) int32: a handle's, free to follow any of them, or fixed
    parts: list  # of Part


class Part(NamedTuple):
    """The handles of one reach, and what vertices are to these."""
    numbers: Any  # (k,) of the handles among all
    vertices: Any  # (m,) those that aren't fixed, in their order; None: all, of handles that go by the region
    roles: Any  # (m,) int32, or (n,): handles counted from 0
    smoothness: int = 0  # the order of its base energy; 0: as the object's

    @property
    def is_whole(self):
        """Whether it goes by the region."""
        return self.vertices is None


def roles(ob, entries=None, joined=None):
    """(n,) int32: of roles_of(), those of all vertices."""
    return roles_of(ob, entries, joined).of_all


def roles_of(ob, entries=None, joined=None):
    """Roles. entries: what reads the groups, as of mesh_data.roles. joined: the object's split.Joined, if there is one.
    Raises MeshProblem naming the group or handle."""
    settings, joined = ob.detail_deform, joined or split.Joined(ob)
    check_groups(ob)
    names = reaches_of(settings)
    of_all = mesh_data.roles(ob, _region(settings, names), handle_groups(settings), settings.base == 'COMPUTED',
                             entries)
    if not any(names):
        of_all = joined.roles(of_all)
        return Roles(of_all, [Part(np.arange(len(names)), None, of_all)])
    # Those that go by the region come first, then the larger reaches: small fixes are of what larger motions have made.
    # Handles of later parts are free in those before.
    reaches = [name for name in ("", *dict.fromkeys(filter(None, names))) if name in names]
    groups = [name or settings.region for name in reaches]
    inside = mesh_data.members_of_each(ob, groups, entries)
    order = sorted(range(len(reaches)), key=lambda place: (reaches[place] != "", -len(inside[place])))
    reaches, inside = [reaches[place] for place in order], [inside[place] for place in order]
    part_of = np.array([reaches.index(name) for name in names])[np.maximum(of_all, 0)]
    enabled = handle_matrices.enabled_handles(settings)
    parts, moves, edges = [], np.zeros(len(of_all), bool), joined.between(mesh_data.edges(ob.data))
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
    """Of each enabled handle the group of its own reach, '' where it goes by the region."""
    handles = handle_matrices.enabled_handles(settings)
    return [handle.reach for handle in handles] if settings.base == 'COMPUTED' else [""] * len(handles)


def shape_signature(ob, topology=None):
    """[positions, topology] of what is bound, as it was proportioned in the scene, as short texts: equal texts, equal
    content. topology: if it is known."""
    shape = proportions.bound(ob.detail_deform).to(start.shape(ob))
    return [mesh_data.signature(shape), topology or mesh_data.topology_signature(ob.data)]


def signature(shape, known, told):
    """shape: as of shape_signature; known: Roles; told: as of options."""
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
    """[reaches.Part] of the object, in proportions.bound(). What hangs on the surface is placed when the surface is.
    known: Roles. joined: the object's split.Joined. triangles: of its mesh. hung_ones: of hung()."""
    positions, triangles = proportions.bound(ob.detail_deform).to(start.shape(ob)), joined.between(triangles)
    surface, found = reaches.Surface(positions, triangles), []
    for part in known.parts:
        hung = hung_ones if part.is_whole else hung_ones[part.vertices]
        of_part = np.where(hung, native.ROLE_FIXED, part.roles).astype(np.int32)
        found.append(reaches.Part(part.numbers, positions, triangles, of_part) if part.is_whole else
                     surface.part(part.numbers, part.vertices, of_part, part.smoothness))
    return found


def hung(ob, roles_of_vertices, triangles):
    """(n,) bool: vertices in no face that follow, or are in one handle with the vertex that they hang on by edges."""
    on = loose.roots(len(roles_of_vertices), triangles, mesh_data.edges(ob.data))
    is_hung = (on >= 0) & (on != np.arange(len(on)))
    follows = (roles_of_vertices == native.ROLE_FREE) | (
        (roles_of_vertices >= 0) & (roles_of_vertices == roles_of_vertices[on]))
    return is_hung & follows


def is_of_base(ob):
    """Whether the binding is made for the base object's mesh as it is. Raises MeshProblem."""
    return ob.detail_deform.signature.endswith('.' + _texts(outside_base.rest(ob)))


def difference(ob):
    """How the object differs from what its binding is made for: a sentence, or ''."""
    settings = ob.detail_deform
    parts = settings.signature.split('.', 3)
    if len(parts) != 4:  # no signature that was made here
        return TOPOLOGY_CHANGED
    positions, topology, bound_roles, bound_options = parts
    shape = shape_signature(ob)
    if shape[1] != topology:
        return TOPOLOGY_CHANGED
    if shape[0] != positions:
        return VERTICES_MOVED
    try:
        current = signature(shape, roles_of(ob, joined=split.Joined(ob, topology)), options(ob)).split('.', 3)
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
