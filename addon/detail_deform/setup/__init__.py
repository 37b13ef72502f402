# SPDX-License-Identifier: GPL-3.0-or-later
"""Creates and changes handles, regions, markers and correspondences."""
