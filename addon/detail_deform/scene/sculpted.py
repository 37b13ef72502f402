# SPDX-License-Identifier: GPL-3.0-or-later
"""What Sculpt Mode stores in a mesh: its mask, its face sets, and what is hidden."""

import numpy as np

from . import mesh_data
from .mesh_data import MeshProblem

_MASKED = 0.5  # from this value of the mask on a vertex is fixed: as with groups, half is the border
_MASK, _FACE_SETS, _HIDDEN_VERTICES, _HIDDEN_FACES = '.sculpt_mask', '.sculpt_face_set', '.hide_vert', '.hide_poly'
_LONE_SET = 1  # the set of all faces where none was made


def check(ob):
    """Raises MeshProblem where the mesh isn't what Sculpt Mode shows."""
    if ob.use_dynamic_topology_sculpting:
        raise MeshProblem(f"'{ob.name}' is sculpted with dynamic topology, whose mesh can't be read: switch Dyntopo "
                          "off first.")


def are_fixed(mesh):
    """(n,) bool: the vertices that brushes leave in place, as they are masked or hidden. Of Multires the mask is that
    of the base mesh alone: scripts can't read what is masked in its levels."""
    return (_mask(mesh) >= _MASKED) | _flags(mesh, _HIDDEN_VERTICES, len(mesh.vertices))


def hidden_faces(mesh):
    """(faces,) bool"""
    return _flags(mesh, _HIDDEN_FACES, len(mesh.polygons))


def vertices_of_face_set(mesh, face):
    """(n,) bool: the vertices of all faces that are in the same face set as the given one."""
    sets = _face_sets(mesh)
    corners, begins = mesh_data.faces(mesh)
    is_in = np.repeat(sets == sets[face], np.diff(begins, append=len(corners)))
    result = np.zeros(len(mesh.vertices), bool)
    result[corners[is_in]] = True
    return result


def signature(ob):
    """A hash of all that Sculpt Mode changes; None where scripts can't read it, as the levels of Multires."""
    mesh = ob.data
    if any(modifier.type == 'MULTIRES' for modifier in ob.modifiers):
        return None
    content = [mesh_data.positions(mesh), _mask(mesh), _face_sets(mesh), hidden_faces(mesh),
               _flags(mesh, _HIDDEN_VERTICES, len(mesh.vertices)), *_colours(mesh)]
    return '.'.join(map(mesh_data.signature, content))


def _colours(mesh):
    """[values] of the active colour attribute; none if there is none."""
    active = mesh.color_attributes.active_color
    if active is None:
        return []
    values = np.empty(4 * len(active.data), np.float32)
    active.data.foreach_get('color', values)
    return [values]


def _face_sets(mesh):
    """(faces,) int32"""
    sets = np.full(len(mesh.polygons), _LONE_SET, np.int32)
    mesh_data.read_attribute_into(mesh, _FACE_SETS, 'value', sets)
    return sets


def _mask(mesh):
    values = np.zeros(len(mesh.vertices), np.float32)
    if not mesh_data.read_attribute_into(mesh, _MASK, 'value', values):
        for layer in getattr(mesh, 'vertex_paint_masks', ()):  # until 4.0, where it is no attribute
            layer.data.foreach_get('value', values)
    return values


def _flags(mesh, name, count):
    values = np.zeros(count, bool)
    mesh_data.read_attribute_into(mesh, name, 'value', values)
    return values
