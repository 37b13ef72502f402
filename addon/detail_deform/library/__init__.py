# SPDX-License-Identifier: GPL-3.0-or-later
"""The C library through ctypes: loaded, checked, called. Nothing else in the add-on knows it."""
