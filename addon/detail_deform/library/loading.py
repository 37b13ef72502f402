# SPDX-License-Identifier: GPL-3.0-or-later
"""The C library: found, loaded, checked, and how its functions are called."""

import ctypes
import os
import sys
import threading
import time

import numpy as np

from . import structs
from .structs import NativeError

_WAIT_SECONDS = 0.001
_library = None
_loading = threading.Lock()


def library_path():
    """Where the library is looked for: beside the add-on unless the environment says otherwise."""
    override = os.environ.get('DETAIL_DEFORM_LIBRARY')
    if override:
        return override
    name = {'win32': 'detail_deform.dll', 'darwin': 'libdetail_deform.dylib'}.get(
        sys.platform, 'libdetail_deform.so')
    return os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), 'lib', name)


def library():
    """The loaded library. Raises NativeError with what is missing or does not fit."""
    global _library
    with _loading:
        if _library is None:
            _library = _load(library_path())
    return _library


def _load(path):
    if not os.path.exists(path):
        raise NativeError(f"The Detail Deform library is missing: there is no file {path}. "
                          "Install the add-on's zip for this operating system, or build the project.")
    try:
        lib = ctypes.CDLL(path)
        lib.dd_abi_version.restype = ctypes.c_int32
        version = lib.dd_abi_version()
    except (OSError, AttributeError) as error:
        raise NativeError(f"The Detail Deform library can't be loaded: {error}. "
                          "Install the add-on's zip for this operating system.") from error
    if version != structs.ABI_VERSION:
        raise NativeError(f"The Detail Deform library {path} is of another version (interface "
                          f"{version}, the add-on needs {structs.ABI_VERSION}). Install the add-on's zip "
                          "again and restart Blender.")
    for name, parameters in structs.SIGNATURES.items():
        function = getattr(lib, name)
        function.argtypes = parameters
        function.restype = structs.result_type(name)
    return lib


def version():
    return library().dd_version().decode()


def instruction_set():
    """'avx2' or 'baseline': what the per-frame kernels use on this machine."""
    return library().dd_instruction_set().decode()


def check(status):
    """Raises NativeError with the library's sentence unless the status is OK."""
    if status != structs.STATUS['OK']:
        raise NativeError(library().dd_last_message().decode('utf-8', 'replace'), status)


def call(function, *arguments):
    check(getattr(library(), function)(*arguments))


def call_when_free(function, *arguments):
    """Waits while another thread or an update that is a job uses the object."""
    while True:
        status = getattr(library(), function)(*arguments)
        if status != structs.STATUS['ERROR_BUSY']:
            return check(status)
        time.sleep(_WAIT_SECONDS)


def vertices(function, *arguments, call=call):
    """(k,) int32: what a function gives that tells a count where there is no room."""
    room = ctypes.c_size_t()
    call(function, *arguments, None, 0, room)
    found = np.empty(room.value, np.int32)
    if len(found):
        call(function, *arguments, found, len(found), room)
    return found


def count(array):
    """How many things an array is of: its first dimension; of None, none."""
    return 0 if array is None else len(array)


class Owned:
    """An object of the library that is released with this one. free: the function that does."""

    free = None
    _handle = None

    def close(self):
        handle, self._handle = self._handle, None
        if handle:
            getattr(library(), self.free)(handle)

    def __del__(self):
        self.close()
