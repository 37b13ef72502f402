# SPDX-License-Identifier: GPL-3.0-or-later
"""The healthy mesh that defects are made on, and its object in Blender."""

import bpy
import numpy as np

from . import checks

ROWS = 11
REGION, RIGHT = 'region', 'right'


class DoesNotCombine(Exception):
    """A kind can't be made on the present specimen, such as a hole in a mesh without faces."""


class Sheet:
    """A mesh as arrays, before Blender has it: a wavy sheet over the unit square, fixed on the left, with a handle on
    the right."""

    def __init__(self, n=ROWS):
        x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n), indexing='ij')
        self.positions = np.stack([x, y, 0.03 * np.sin(17 * x) * np.cos(13 * y)], -1).reshape(-1, 3)
        self.faces = [(i * n + j, (i + 1) * n + j, (i + 1) * n + j + 1, i * n + j + 1)
                      for i in range(n - 1) for j in range(n - 1)]
        self.edges = []
        self.regroup()

    def become(self, positions, faces, edges=()):
        """Replaces the whole mesh."""
        self.positions = np.asarray(positions, float).reshape(-1, 3)
        self.faces, self.edges = [tuple(map(int, face)) for face in faces], [tuple(map(int, e)) for e in edges]
        self.regroup()

    def regroup(self):
        """Groups the vertices anew: the left end along x is fixed, the right end is the handle."""
        if not len(self.positions):
            self.region, self.right = set(), set()
            return
        x = self.positions[:, 0]
        share = (x - x.min()) / max(np.ptp(x), 1e-300)
        self.region = set(np.flatnonzero(share > 0.15).tolist())
        self.right = set(np.flatnonzero(share > 0.85).tolist())

    def add(self, positions, faces=(), edges=()):
        """Adds vertices, which are in the region, faces and edges; returns the first new vertex's number. Negative
        numbers in faces and edges are new vertices: -1 is the first, -2 the next."""
        first = len(self.positions)
        self.positions = np.vstack([self.positions, np.reshape(positions, (-1, 3))])

        def number(v):
            return first - 1 - v if v < 0 else int(v)

        self.faces += [tuple(map(number, face)) for face in faces]
        self.edges += [tuple(map(number, edge)) for edge in edges]
        self.region |= set(range(first, len(self.positions)))
        return first

    def duplicate(self, faces):
        """Gives these faces new vertices in the same places and groups, which they share with no other face. Returns
        {old number: new number}."""
        old = sorted({v for f in faces for v in self.faces[f]})
        region, right = self.region.copy(), self.right.copy()
        first = self.add(self.positions[old])
        new = dict(zip(old, range(first, first + len(old))))
        for f in faces:
            self.faces[f] = tuple(new[v] for v in self.faces[f])
        self.region = region | {new[v] for v in old if v in region}
        self.right = right | {new[v] for v in old if v in right}
        return new

    def middle(self, count=1):
        """Numbers of free vertices with faces."""
        inside = sorted((self.region - self.right) & {v for face in self.faces for v in face})
        if len(inside) < count:
            raise DoesNotCombine
        start = (len(inside) - count) // 2
        return inside[start:start + count]

    def inner_faces(self):
        """Numbers of faces with only free vertices."""
        found = [f for f, face in enumerate(self.faces) if all(v in self.region and v not in self.right for v in face)]
        if not found:
            raise DoesNotCombine
        return found

    def size(self):
        finite = self.positions[np.isfinite(self.positions).all(1)]
        return float(np.ptp(finite, axis=0).max()) if len(finite) else 1.0


class Specimen:
    """The object in Blender, found by its name, because undo and loading invalidate references."""

    def __init__(self, name, size):
        self.name, self.size = name, size
        # Set by kinds for the checks.
        self.is_carried = False  # the places of handles don't depend on their empties alone, and aren't checked
        self.is_free_to_turn = False
        self.shows_own_faults = False  # a modifier or a shape key of the user's may display vertices that aren't finite
        self.shows_base = self.shows_a_share = False
        self.kept_start = None

    @classmethod
    def made(cls, sheet):
        with np.errstate(over='ignore'):
            positions = sheet.positions.astype(np.float32)
        mesh = bpy.data.meshes.new("Specimen")
        mesh.from_pydata(positions.tolist(), sheet.edges, sheet.faces)
        ob = bpy.data.objects.new("Specimen", mesh)
        bpy.context.scene.collection.objects.link(ob)
        of = cls(ob.name, sheet.size())
        of.weights(REGION, sheet.region)
        of.weights(RIGHT, sheet.right)
        ob.detail_deform.region = REGION
        bpy.context.view_layer.objects.active = ob
        ob.select_set(True)
        return of

    @classmethod
    def of(cls, ob):
        """The Specimen of an existing object."""
        extent = np.ptp(checks.own(ob), axis=0).max() if len(ob.data.vertices) else 1.0
        return cls(ob.name, float(extent))

    @property
    def ob(self):
        return bpy.data.objects[self.name]

    def start(self):
        """(n, 3): the shape that the binding starts from: the mesh's own coordinates, or the mix of its shape keys."""
        return checks.own(self.ob) if self.kept_start is None else self.kept_start

    @property
    def handle(self):
        if not len(self.ob.detail_deform.handles):
            raise DoesNotCombine
        return self.ob.detail_deform.handles[0]

    @property
    def empty(self):
        if self.handle.target is None:
            raise DoesNotCombine
        return self.handle.target

    def weights(self, name, members, weight=1.0):
        """Sets a group's members, and returns the group. members: numbers, or {number: weight}."""
        group = self.ob.vertex_groups.get(name) or self.ob.vertex_groups.new(name=name)
        group.remove(range(len(self.ob.data.vertices)))
        if isinstance(members, dict):
            for vertex, of_vertex in members.items():
                group.add([int(vertex)], of_vertex, 'REPLACE')
        else:
            group.add([int(vertex) for vertex in members], weight, 'REPLACE')
        return group

    def add_handle(self, name, members, at=None):
        """Adds a handle with a new group without the add-on's operators; returns its empty."""
        empty = bpy.data.objects.new(name, None)
        bpy.context.scene.collection.objects.link(empty)
        members = [int(v) for v in members]
        self.weights(name, members)
        if at is None and members:
            at = np.nan_to_num(np.array([self.ob.data.vertices[v].co for v in members]).mean(0)).tolist()
        empty.location = at or (0, 0, 0)
        handle = self.ob.detail_deform.handles.add()
        handle.name = handle.vertex_group = name
        handle.target = empty
        return empty

    def other(self, name, positions, faces):
        """Another mesh object in the scene."""
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata(np.reshape(positions, (-1, 3)).tolist(), [], faces)
        ob = bpy.data.objects.new(name, mesh)
        bpy.context.scene.collection.objects.link(ob)
        return ob


def update():
    bpy.context.view_layer.update()
