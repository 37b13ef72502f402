# SPDX-License-Identifier: GPL-3.0-or-later
"""The signature of a binding's content: equal signatures mean equal mesh, roles and options."""

import numpy as np

from ..library import native
from ..library.options import BIND, arguments_of
from ..library.structs import BindOptions
from ..scene import examples, handle_curves, mesh_data, outside_base, split, start
from ..scene.mesh_data import MeshProblem
from . import reaches, roles

# Precede the parts of a signature that stand for the examples and the stiffness.
_EXAMPLES, _STIFFNESS = 'examples-', 'stiffness-'
BASE_CHANGED = "The base object, its mesh or its choice was changed since Bind."
TOPOLOGY_CHANGED = "The mesh's vertices or faces were changed since Bind."
VERTICES_MOVED = "The mesh's vertices were moved since Bind."


def order_of_handles(subject):
    """A text that changes when handles are added, removed or reordered. Blender doesn't notify add-ons when a script
    does that, so it is compared at every update, and cheap enough for that."""
    return '\n'.join(f"{group}\t{reach}" if reach else group
                     for (_, group), reach in zip(subject.groups, subject.reaches))


def options(subject, entries=None):
    """The options of native.Bind that a binding depends on, beside mesh and roles. entries: as for roles.of(). Raises
    MeshProblem."""
    settings = subject.settings
    if settings.base == 'OBJECT':
        return outside_base.rest(subject.ob)
    of_bind = arguments_of(BIND, settings)
    made = {name: of_bind[name] for name in BindOptions.kinds if name in of_bind}  # in the order of saved signatures
    try:
        poses = examples.positions(subject.ob)
    except MeshProblem:
        if settings.method == 'EXAMPLES':
            raise
        poses = None  # other methods don't use them
    if settings.stiff_parts:
        made['stiffness'] = stiffness(subject.ob, entries)
    return made if poses is None else {**made, 'examples': poses}


def stiffness(ob, entries=None):
    """(n,) float32: the weights in the group by which parts are stiff, which the settings name. entries: as for
    roles.of(). Raises MeshProblem."""
    group = ob.detail_deform.stiff_parts
    if group not in ob.vertex_groups:
        raise MeshProblem(f"'{ob.name}' has no vertex group '{group}', by which parts are to be stiff: choose another "
                          "one in Stiff Parts, or none.")
    vertices, _, weights = (entries or mesh_data.group_entries)(ob, [group])
    result = np.zeros(len(ob.data.vertices), np.float32)
    result[vertices] = np.clip(weights, 0, 1)
    return result


def shape_signature(subject, topology=None):
    """[positions, topology]: hashes of the shape that is bound, in the proportions of the object's scale, and of its
    faces. topology: that hash, if the caller has it."""
    shape = subject.space.to(start.shape(subject.ob))
    return [mesh_data.signature(shape), topology or mesh_data.topology_signature(subject.mesh)]


def signature(shape, roles, bind_options):
    """The whole signature. shape: of shape_signature(). roles: roles.Roles. bind_options: of options()."""
    numbers = [roles.of_all]
    for part in roles.parts[len(roles.parts) == 1 and roles.parts[0].is_whole:]:
        numbers += [[len(part.numbers), len(part.roles)], part.numbers, part.roles]
        numbers += [] if part.is_whole else [part.vertices]
        numbers += [[part.smoothness]] if part.smoothness else []
    return '.'.join([*shape, mesh_data.signature(np.concatenate(numbers).astype(np.int32)), _texts(bind_options)])


def _texts(values):
    texts = {'examples': lambda value: _EXAMPLES + mesh_data.signature(value),
             'stiffness': lambda value: _STIFFNESS + mesh_data.signature(value),
             'base': mesh_data.signature, 'base_triangles': mesh_data.signature}
    return '.'.join(texts.get(name, _text)(value) for name, value in values.items())


def _text(value):
    return f"{value:g}" if isinstance(value, float) else str(value)


def parts_to_bind(subject, roles, welded, triangles, hung_ones):
    """[reaches.Part] in the subject's space. roles: roles.Roles. welded: the object's split.WeldedMesh. triangles: of
    its mesh. hung_ones: of roles.hung(); these vertices are fixed here, and follow the deformed surface: see
    written_offsets.py."""
    positions, triangles = subject.space.to(start.shape(subject.ob)), welded.representatives(triangles)
    surface, found = reaches.Surface(positions, triangles), []
    for part in roles.parts:
        hung = hung_ones if part.is_whole else hung_ones[part.vertices]
        of_part = np.where(hung, native.ROLE_FIXED, part.roles).astype(np.int32)
        found.append(reaches.Part(part.numbers, positions, triangles, of_part) if part.is_whole else
                     surface.part(part.numbers, part.vertices, of_part, part.smoothness))
    return found


def is_of_base(ob):
    """Whether the base object's mesh is the one that was bound. Raises MeshProblem."""
    return ob.detail_deform.signature.endswith('.' + _texts(outside_base.rest(ob)))


def difference(subject):
    """How the object's content differs from that of its binding: a sentence, or ''."""
    settings = subject.settings
    parts = settings.signature.split('.', 3)
    if len(parts) != 4:  # not a signature of this add-on
        return TOPOLOGY_CHANGED
    positions, topology, bound_roles, bound_options = parts
    shape = shape_signature(subject)
    if shape[1] != topology:
        return TOPOLOGY_CHANGED
    if shape[0] != positions:
        return VERTICES_MOVED
    try:
        found = roles.of(subject, welded=split.WeldedMesh(subject.ob, topology))
        current = signature(shape, found, options(subject)).split('.', 3)
    except MeshProblem as problem:
        return str(problem)
    for handle in subject.handles:
        if handle_curves.is_new(handle):
            return f"Handle '{handle.name}' has got a curve since Bind, which it follows from the next one on."
    if current[2] != bound_roles:
        return "The region, the handles or their vertex groups were changed since Bind."
    if current[3] == bound_options:
        return ""
    current, bound = _of_options(current[3]), _of_options(bound_options)
    if settings.method != 'EXAMPLES' and current[:2] == bound[:2]:
        return ""
    if settings.base == 'OBJECT':
        return BASE_CHANGED
    if current[0] == bound[0] and current[1] != bound[1]:
        return "Stiff Parts, or the weights of its group, were changed since Bind."
    return "Settings or examples that need a new Bind were changed."


def _of_options(text):
    """(the settings, the stiffness, the examples) of a signature's last part."""
    settings, _, of_examples = text.partition(f'.{_EXAMPLES}')
    settings, _, of_stiffness = settings.partition(f'.{_STIFFNESS}')
    return settings, of_stiffness, of_examples
