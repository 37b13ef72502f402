# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes that several test files deform."""

import bpy
import numpy as np


def tube(name, radius, low, high, around, along, keep=None):
    """An object in the scene: a tube about the z axis, with normals outwards. keep: the function of its (n, 3)
    positions that gives the mask of the vertices to keep; those within 1e-6 of a coordinate plane are then put on
    it."""
    turn, z = np.meshgrid(np.linspace(0, 2 * np.pi, around, endpoint=False), np.linspace(low, high, along + 1))
    points = np.stack([radius * np.cos(turn), radius * np.sin(turn), z], -1).reshape(-1, 3)
    faces = [[i * around + k, i * around + (k + 1) % around, (i + 1) * around + (k + 1) % around, (i + 1) * around + k]
             for i in range(along) for k in range(around)]
    if keep is not None:
        kept = keep(points)
        number = np.cumsum(kept) - 1
        faces = [[number[v] for v in face] for face in faces if all(kept[v] for v in face)]
        points = points[kept]
        points[np.abs(points) < 1e-6] = 0
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points.tolist(), [], faces)
    ob = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(ob)
    bpy.context.view_layer.update()
    return ob
