# SPDX-License-Identifier: GPL-3.0-or-later
"""The C library: found, loaded, checked, how its functions are called, and let go."""

import _ctypes
import contextlib
import ctypes
import os
import shlex
import sys
import threading
import time
import weakref

import numpy as np

from . import packed, structs, unlocking
from .structs import NativeError

OVERRIDE = 'DETAIL_DEFORM_LIBRARY'
_WAIT_SECONDS = 0.001
_LEAVE_SECONDS = 10  # for calls of other threads to end: an update, the bind of a render
_library = None
_leaving = False
_users = []  # an entry for each call under way, of all threads
_defaults = {}  # {type of a struct of options: its bytes with the loaded library's defaults}
# Of these four. Reentrant: collecting garbage meanwhile may call Owned.close() in the same thread.
_guard = threading.RLock()
_owned = weakref.WeakSet()


def library_path():
    """Where the library is looked for: as it was packed unless the environment says otherwise."""
    names = {'win32': 'detail_deform.dll', 'darwin': 'libdetail_deform.dylib'}
    return os.environ.get(OVERRIDE) or packed.place(names.get(sys.platform, 'libdetail_deform.so'))


def library():
    """The loaded library. Raises NativeError with what is missing or does not fit."""
    global _library
    with _guard:
        if _library is None:
            _library = _load(library_path())
        return _library


def unload():
    """Frees what is left of the library's objects and lets go of its file, so that another version can take its place;
    the next call loads it again. False where a call of another thread doesn't end: then it stays."""
    global _leaving
    _leaving = True
    try:
        until = time.monotonic() + _LEAVE_SECONDS
        while True:
            with _guard:
                if not _users:
                    _let_go()
                    return True
            if time.monotonic() > until:
                return False
            time.sleep(_WAIT_SECONDS)
    finally:
        _leaving = False


def _let_go():
    global _library
    for owned in list(_owned):
        Owned.close(owned)  # a thread that has the object's own lock waits for ours
    left, _library = _library, None
    _defaults.clear()
    if left:
        (_ctypes.FreeLibrary if sys.platform == 'win32' else _ctypes.dlclose)(left._handle)


@contextlib.contextmanager
def staying(also_leaving=False):
    """While it lasts, the library isn't unloaded. also_leaving: also where that waits already."""
    with _guard:
        if _leaving and not also_leaving:
            raise NativeError("Detail Deform is being switched off.")
        users = _users  # this module may be loaded again before a long call ends
        users.append(None)
    try:
        yield
    finally:
        users.pop()


def _load(path):
    if not os.path.exists(path):
        cure = f"{packed.AGAIN}." if packed.PACKAGE else (
            "Install the add-on's zip for this operating system, or build the project.")
        raise NativeError(f"The Detail Deform library is missing: there is no file {path}. {cure}")
    try:
        packed.check(path)
        lib = ctypes.CDLL(path)
        lib.dd_abi_version.restype = ctypes.c_int32
        version = lib.dd_abi_version()
    except (OSError, AttributeError) as error:
        cure = "Install the add-on's zip for this operating system"
        if sys.platform == 'darwin':
            cure += ("; where macOS keeps it in quarantine, this line in a terminal lets it go: "
                     f"xattr -dr com.apple.quarantine {shlex.quote(os.path.dirname(path))}")
        raise NativeError(f"The Detail Deform library can't be loaded: {error}. {cure}.") from error
    if version != structs.ABI_VERSION:
        raise NativeError(f"The Detail Deform library {path} is of another version (interface "
                          f"{version}, the add-on needs {structs.ABI_VERSION}). {packed.AGAIN} "
                          "and restart Blender.")
    for name, parameters in structs.SIGNATURES.items():
        function = getattr(lib, name)
        function.argtypes = parameters
        function.restype = structs.result_type(name)
    # Blender 4.2 and later find a way for their extensions when files are locked.
    if not os.environ.get(OVERRIDE) and not __name__.startswith('bl_ext.'):
        unlocking.unlock(path)
    return lib


def version():
    return library().dd_version().decode()


def instruction_set():
    """'avx2' or 'baseline': what the per-frame kernels use on this machine."""
    return library().dd_instruction_set().decode()


def call(function, *arguments):
    """Raises NativeError with the library's sentence unless the status is OK."""
    with staying():
        lib = library()
        status = getattr(lib, function)(*arguments)
        if status != structs.STATUS['OK']:
            raise _failure(lib, status)


def _failure(lib, status):
    failure = structs.Failure()
    lib.dd_last_error(failure)
    return NativeError(lib.dd_last_message().decode('utf-8', 'replace'), status,
                       message=failure.message.decode('utf-8', 'replace'),
                       subject=structs.name_of('dd_subject', failure.subject), index=failure.index,
                       remedy=structs.name_of('dd_remedy', failure.remedy))


def filled(kind, **values):
    """A struct of options with the library's defaults, and with these values in their place; None: the default."""
    if kind not in _defaults:
        made = kind()
        call(f'{kind.__name__}_init', made, ctypes.sizeof(made))
        _defaults[kind] = bytes(made)
    return kind.from_buffer_copy(_defaults[kind]).fill(**values)


def call_when_free(function, *arguments):
    """Waits while another thread or an update that is a job uses the object."""
    while True:
        try:
            return call(function, *arguments)
        except NativeError as error:
            if error.status != structs.STATUS['ERROR_BUSY']:
                raise
        time.sleep(_WAIT_SECONDS)


def vertices(function, *arguments, call=call):
    """(k,) int32: the vertices that a function lists. Called without room, it tells how many there are."""
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
    """An object of the library that is released with this one, or with the library. free: the function that does."""

    free = None
    _handle = _made_by = None

    def _make(self, function, *arguments, call=call):
        """By a function that gives an object by its last parameter."""
        made = ctypes.c_void_p()
        with staying():
            call(function, *arguments, made)
            self._handle, self._made_by = made, _library
            _owned.add(self)

    @property
    def _as_parameter_(self):
        """What ctypes passes for it, looked up by the call: it may have been closed a moment ago."""
        return self._handle

    def close(self):
        with staying(also_leaving=True):
            handle, self._handle = self._handle, None
            # One that couldn't be let go before this module was loaded again keeps what it made.
            if handle and _library and _library is self._made_by:
                getattr(_library, self.free)(handle)

    def __del__(self):
        self.close()
