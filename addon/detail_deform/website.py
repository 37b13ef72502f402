# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the project is at home, if the build was told so (DETAIL_DEFORM_WEBSITE): reports go to its /issues."""

WEBSITE = ""
