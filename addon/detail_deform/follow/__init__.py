# SPDX-License-Identifier: GPL-3.0-or-later
"""The life cycle of followers, meshes that follow handles or a source: made, updated, found stale, ended."""
