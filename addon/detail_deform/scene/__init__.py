# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads from and writes to Blender's data: meshes, groups, attributes, modifiers, matrices, caches."""
