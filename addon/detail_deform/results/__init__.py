# SPDX-License-Identifier: GPL-3.0-or-later
"""What is made of results: caches, shape keys, files for other programs, transfers to other meshes."""
