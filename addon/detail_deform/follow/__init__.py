# SPDX-License-Identifier: GPL-3.0-or-later
"""One life for all that follows: bound or fed by a source, noticed stale, restored, undone."""
