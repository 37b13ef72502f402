# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles, regions, markers and correspondences, made and changed."""
