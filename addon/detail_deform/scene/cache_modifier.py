# SPDX-License-Identifier: GPL-3.0-or-later
"""The Mesh Cache modifier that plays a bake in place of the deformation's."""

import os

NAME = 'Detail Deform Cache'


def find(ob):
    """The Mesh Cache modifier that plays a bake in place of the deformation's; None if there is none."""
    cache = ob.modifiers.get(ob.detail_deform.cache_modifier)
    return cache if cache and cache.type == 'MESH_CACHE' else None


def set_up(cache, path, start):
    """Sets up a Mesh Cache modifier to play a point cache from frame start on."""
    cache.cache_format = 'PC2'
    # Blender and Python resolve relative paths against different folders.
    cache.filepath = path if path.startswith('//') else os.path.abspath(path)
    cache.frame_start = start
    cache.interpolation = 'LINEAR'
