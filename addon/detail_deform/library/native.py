# SPDX-License-Identifier: GPL-3.0-or-later
"""The C library for the rest of the add-on, and for programs without Blender: all of its names in one place."""

from .deformer import ROLE_FIXED, ROLE_FREE, Bind, Deformer, Draft, Update, at_rest
from .loading import filled, instruction_set, library, library_path, unload, version
from .riders import Riders
from .structs import NativeError, UpdateInfo
from .tools import distances, measure, vertex_gradients
from .transfer import Match, Transfer, TransferJob

__all__ = ('ROLE_FIXED', 'ROLE_FREE', 'Bind', 'Deformer', 'Draft', 'Match', 'NativeError', 'Riders', 'Transfer',
           'TransferJob', 'Update', 'UpdateInfo', 'at_rest', 'distances', 'filled', 'instruction_set', 'library',
           'library_path', 'measure', 'unload', 'version', 'vertex_gradients')
