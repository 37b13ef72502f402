# SPDX-License-Identifier: GPL-3.0-or-later
"""What is read from and written to Blender's data."""
