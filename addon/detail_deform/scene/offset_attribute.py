# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's attributes of a mesh: the displayed offsets, and the offsets from which a binding starts."""

import itertools
import uuid

import bmesh
import numpy as np

from .mesh_data import MeshProblem

DISPLAYED_OFFSETS = 'detail_deform_offset'  # the offsets that the modifier displays
PREVIOUS_OFFSETS, SHAPE_KEY_OFFSETS = 'detail_deform_kept', 'detail_deform_keyed'  # see start.py
_KIND = ('FLOAT_VECTOR', 'POINT')
# Custom property of the mesh: a token unique to each write of offsets. It is copied, saved and undone together with the
# attribute, so equal tokens mean equal offsets, whatever the names of objects and meshes are by now.
_TOKEN = 'detail_deform_written'
_session = uuid.uuid4().hex[:12]
_numbers = itertools.count()


def find(mesh, name=DISPLAYED_OFFSETS):
    """The attribute of this name; None if there is none, or one of another type or domain, which is the user's."""
    attribute = mesh.attributes.get(name)
    return attribute if attribute is not None and (attribute.data_type, attribute.domain) == _KIND else None


def check_name(ob):
    """Raises MeshProblem where a group, UV map or other attribute of the user's has one of the add-on's names: it
    would be displayed as offsets, or overwritten."""
    mesh = ob.data
    for name in (DISPLAYED_OFFSETS, PREVIOUS_OFFSETS, SHAPE_KEY_OFFSETS):
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
    """Writes the displayed offsets, (3 n,) float32, with a new token, and creates the attribute if missing; the caller
    has called check_name()."""
    put(mesh, DISPLAYED_OFFSETS, offsets)
    mesh[_TOKEN] = f"{_session}-{next(_numbers)}"
    mesh.update_tag()


def put(mesh, name, vectors):
    """Writes vectors, (3 n,) float32, to the attribute of this name; creates it if missing."""
    attribute = find(mesh, name) or mesh.attributes.new(name, *_KIND)
    attribute.data.foreach_set('vector', vectors)


def token(mesh):
    """The token of the offsets that the mesh holds; None if it holds none, or some without a token."""
    return mesh.get(_TOKEN) if find(mesh) is not None else None


def read(mesh, name=DISPLAYED_OFFSETS):
    """(n, 3) float32: the attribute of this name; zero if there is none."""
    attribute = find(mesh, name)
    if attribute is None:
        return np.zeros((len(mesh.vertices), 3), np.float32)
    if mesh.is_editmode:  # attributes are empty in Edit Mode
        edited = bmesh.from_edit_mesh(mesh)
        layer = edited.verts.layers.float_vector[name]
        values = itertools.chain.from_iterable(vertex[layer] for vertex in edited.verts)
        return np.fromiter(values, np.float32, 3 * len(edited.verts)).reshape(-1, 3)
    values = np.empty(3 * len(mesh.vertices), np.float32)
    attribute.data.foreach_get('vector', values)
    return values.reshape(-1, 3)


def remove(mesh):
    """Removes the displayed offsets. A missing attribute reads as zero: the mesh shows its rest shape."""
    if _TOKEN in mesh:
        del mesh[_TOKEN]
    if remove_attribute(mesh, DISPLAYED_OFFSETS):
        mesh.update_tag()


def remove_attribute(mesh, name):
    """Removes the attribute of this name. Returns whether there was one."""
    attribute = find(mesh, name)
    if attribute is not None:
        mesh.attributes.remove(attribute)
    return attribute is not None
