# SPDX-License-Identifier: GPL-3.0-or-later
"""The package of the wheel that holds the library, where Blender unpacks one: make_zip.py writes its name here. Without
one the library is in the add-on's own folder."""

PACKAGE = ""
