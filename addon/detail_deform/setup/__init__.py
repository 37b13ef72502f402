# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles, regions, markers and correspondences, and what is made of results."""
