# SPDX-License-Identifier: GPL-3.0-or-later
"""The project's home page, filled in by the build (DETAIL_DEFORM_WEBSITE), or ''. Reports go to its /issues."""

WEBSITE = ""
