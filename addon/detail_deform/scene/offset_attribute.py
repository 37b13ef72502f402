# SPDX-License-Identifier: GPL-3.0-or-later
"""The one attribute that a mesh is given: by what each vertex is moved."""

import itertools
import uuid

import numpy as np

from .mesh_data import MeshProblem

NAME = 'detail_deform_offset'
_KIND = ('FLOAT_VECTOR', 'POINT')
# Beside the attribute a mesh keeps a token that no other writing of offsets ever has. Both are copied, saved and
# undone with the mesh, so equal tokens mean equal offsets, whatever objects and meshes are called by now.
_TOKEN = 'detail_deform_written'
_session = uuid.uuid4().hex[:12]
_numbers = itertools.count()


def find(mesh):
    """The attribute, or None: one of that name but of another kind is not ours."""
    attribute = mesh.attributes.get(NAME)
    return attribute if attribute is not None and (attribute.data_type, attribute.domain) == _KIND else None


def check_name(ob):
    """Raises MeshProblem where something of the user's has the attribute's name, and would be shown or lost."""
    mesh, what = ob.data, ""
    if NAME in ob.vertex_groups:
        what = "vertex group"
    elif NAME in mesh.uv_layers:
        what = "UV map"
    elif NAME in mesh.attributes and find(mesh) is None:
        what = "attribute"
    if what:
        raise MeshProblem(f"'{ob.name}' has {'an' if what == 'attribute' else 'a'} {what} '{NAME}', the name under "
                          "which the deformation is stored: rename it.")


def write(mesh, offsets):
    """offsets: (3 n,) float32. Creates the attribute where there is none; the caller has checked its name. Returns
    the token by which the mesh is known to hold these."""
    attribute = find(mesh) or mesh.attributes.new(NAME, *_KIND)
    attribute.data.foreach_set('vector', offsets)
    mesh[_TOKEN] = written = f"{_session}-{next(_numbers)}"
    mesh.update_tag()
    return written


def token(mesh):
    """That of the offsets which the mesh holds; None where it holds none that are known."""
    return mesh.get(_TOKEN) if find(mesh) is not None else None


def read(mesh):
    """(n, 3) float32; zero where there is no attribute."""
    values = np.zeros(3 * len(mesh.vertices), np.float32)
    attribute = find(mesh)
    if attribute is not None:
        attribute.data.foreach_get('vector', values)
    return values.reshape(-1, 3)


def remove(mesh):
    """A missing attribute reads as zero: the mesh shows its rest shape."""
    if _TOKEN in mesh:
        del mesh[_TOKEN]
    attribute = find(mesh)
    if attribute is not None:
        mesh.attributes.remove(attribute)
        mesh.update_tag()
