# SPDX-License-Identifier: GPL-3.0-or-later
"""Output of results: caches, shape keys, files for other programs, transfers to other meshes."""
