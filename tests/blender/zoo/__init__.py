# SPDX-License-Identifier: GPL-3.0-or-later
"""A zoo of defects, driven through the add-on: see run.py."""
