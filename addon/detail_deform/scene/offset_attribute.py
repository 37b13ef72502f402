# SPDX-License-Identifier: GPL-3.0-or-later
"""The attributes that a mesh is given: by what each vertex is moved, and where a binding starts from."""

import itertools
import uuid

import bmesh
import numpy as np

from .mesh_data import MeshProblem

NAME = 'detail_deform_offset'  # what the modifier shows
KEPT, KEYED = 'detail_deform_kept', 'detail_deform_keyed'  # as start.py has them
_KIND = ('FLOAT_VECTOR', 'POINT')
# Beside the attribute a mesh keeps a token that no other writing of offsets ever has. Both are copied, saved and
# undone with the mesh, so equal tokens mean equal offsets, whatever objects and meshes are called by now.
_TOKEN = 'detail_deform_written'
_session = uuid.uuid4().hex[:12]
_numbers = itertools.count()


def find(mesh, name=NAME):
    """The attribute, or None: one of that name but of another kind is not ours."""
    attribute = mesh.attributes.get(name)
    return attribute if attribute is not None and (attribute.data_type, attribute.domain) == _KIND else None


def check_name(ob):
    """Raises MeshProblem where something of the user's has an attribute's name, and would be shown or lost."""
    mesh = ob.data
    for name in (NAME, KEPT, KEYED):
        what = ""
        if name in ob.vertex_groups:
            what = "vertex group"
        elif name in mesh.uv_layers:
            what = "UV map"
        elif name in mesh.attributes and find(mesh, name) is None:
            what = "attribute"
        if what:
            raise MeshProblem(f"'{ob.name}' has {'an' if what == 'attribute' else 'a'} {what} '{name}', the name under "
                              "which the deformation is stored: rename it.")


def write(mesh, offsets):
    """offsets: (3 n,) float32. Creates the attribute where there is none; the caller has checked its name. Returns
    the token by which the mesh is known to hold these."""
    put(mesh, NAME, offsets)
    mesh[_TOKEN] = written = f"{_session}-{next(_numbers)}"
    mesh.update_tag()
    return written


def put(mesh, name, vectors):
    """vectors: (3 n,) float32."""
    attribute = find(mesh, name) or mesh.attributes.new(name, *_KIND)
    attribute.data.foreach_set('vector', vectors)


def token(mesh):
    """That of the offsets which the mesh holds; None where it holds none that are known."""
    return mesh.get(_TOKEN) if find(mesh) is not None else None


def read(mesh, name=NAME):
    """(n, 3) float32; zero where there is no attribute."""
    attribute = find(mesh, name)
    if attribute is None:
        return np.zeros((len(mesh.vertices), 3), np.float32)
    if mesh.is_editmode:  # attributes are empty there
        edited = bmesh.from_edit_mesh(mesh)
        layer = edited.verts.layers.float_vector[name]
        values = itertools.chain.from_iterable(vertex[layer] for vertex in edited.verts)
        return np.fromiter(values, np.float32, 3 * len(edited.verts)).reshape(-1, 3)
    values = np.empty(3 * len(mesh.vertices), np.float32)
    attribute.data.foreach_get('vector', values)
    return values.reshape(-1, 3)


def remove(mesh):
    """A missing attribute reads as zero: the mesh shows its rest shape."""
    if _TOKEN in mesh:
        del mesh[_TOKEN]
    if take_away(mesh, NAME):
        mesh.update_tag()


def take_away(mesh, name):
    """Whether there was one."""
    attribute = find(mesh, name)
    if attribute is not None:
        mesh.attributes.remove(attribute)
    return attribute is not None
