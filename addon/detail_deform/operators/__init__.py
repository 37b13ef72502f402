# SPDX-License-Identifier: GPL-3.0-or-later
"""What users and scripts call: bpy.ops.object.detail_deform_..."""
