# SPDX-License-Identifier: GPL-3.0-or-later
"""What a binding is made for, as a signature: equal signatures, equal mesh, roles and options."""

import numpy as np

from ..library import native
from ..library.options import BIND, asked
from ..library.structs import BindOptions
from ..scene import examples, handle_matrices, loose, mesh_data, outside_base, proportions, split, start
from ..scene.mesh_data import MeshProblem

_EXAMPLES = 'examples-'  # before their part of a signature
BASE_CHANGED = "The base object, its mesh or its choice was changed since Bind."
TOPOLOGY_CHANGED = "The mesh's vertices or faces were changed since Bind."
VERTICES_MOVED = "The mesh's vertices were moved since Bind."


def handle_groups(settings):
    return [(h.name, h.vertex_group) for h in handle_matrices.enabled_handles(settings)]


def order_of_handles(settings):
    """A text that is another one where handles have come, gone or changed places. Blender tells nobody when a script
    does that, so it is cheap enough for every update."""
    return '\n'.join(group for _, group in handle_groups(settings))


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


def roles(ob, entries=None, joined=None):
    """entries: what reads the groups, as of mesh_data.roles. joined: the object's split.Joined, if there is one."""
    settings = ob.detail_deform
    of_vertices = mesh_data.roles(ob, settings.region, handle_groups(settings), settings.base == 'COMPUTED', entries)
    return (joined or split.Joined(ob)).roles(of_vertices)


def shape_signature(ob, topology=None):
    """[positions, topology] of what is bound, as it was proportioned in the scene, as short texts: equal texts, equal
    content. topology: if it is known."""
    shape = proportions.bound(ob.detail_deform).to(start.shape(ob))
    return [mesh_data.signature(shape), topology or mesh_data.topology_signature(ob.data)]


def signature(shape, roles_of_vertices, told):
    """shape: as of shape_signature; told: as of options."""
    return '.'.join([*shape, mesh_data.signature(roles_of_vertices), _texts(told)])


def _texts(values):
    texts = {'examples': lambda value: _EXAMPLES + mesh_data.signature(value), 'base': mesh_data.signature,
             'base_triangles': mesh_data.signature}
    return '.'.join(texts.get(name, _text)(value) for name, value in values.items())


def _text(value):
    return f"{value:g}" if isinstance(value, float) else str(value)


def bind_arguments(ob, roles_of_vertices, joined, triangles, hung_ones):
    """Of native.Bind, without its options, in proportions.bound(). What hangs on the surface is placed when the surface
    is. joined: the object's split.Joined. triangles: of its mesh. hung_ones: of hung()."""
    roles_of_vertices = np.where(hung_ones, native.ROLE_FIXED, roles_of_vertices).astype(np.int32)
    return (proportions.bound(ob.detail_deform).to(start.shape(ob)), joined.between(triangles), roles_of_vertices,
            len(handle_matrices.enabled_handles(ob.detail_deform)))


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
        current = signature(shape, roles(ob, joined=split.Joined(ob, topology)), options(ob)).split('.', 3)
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
