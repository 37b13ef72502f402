# SPDX-License-Identifier: GPL-3.0-or-later
"""The C library for the rest of the add-on: all of its names in one place."""

from .deformer import ROLE_FIXED, ROLE_FREE, Bind, Deformer, Draft, Update, at_rest  # noqa: F401
from .loading import filled, instruction_set, library, library_path, unload, version  # noqa: F401
from .structs import NativeError, UpdateInfo  # noqa: F401
from .tools import distances, measure, vertex_gradients  # noqa: F401
from .transfer import Match, Transfer, TransferJob  # noqa: F401
