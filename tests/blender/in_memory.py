# SPDX-License-Identifier: GPL-3.0-or-later
"""The shared libraries that this process has loaded, by the operating system's own account."""

import ctypes
import sys


def libraries(name):
    """Paths, as of when they were loaded, of the libraries with this text in their file's name; None on systems that
    can't be asked."""
    if sys.platform == 'linux':
        with open('/proc/self/maps', encoding='utf-8') as file:
            found = {line.split(maxsplit=5)[5].strip() for line in file if '/' in line}
    elif sys.platform == 'win32':
        found = set(_of_windows())
    else:
        return None
    return sorted(path for path in found if name in path.replace('\\', '/').rsplit('/', 1)[-1])


def _of_windows():
    from ctypes import wintypes
    kernel = ctypes.WinDLL('kernel32')
    kernel.GetCurrentProcess.restype = wintypes.HANDLE
    kernel.K32EnumProcessModules.argtypes = (wintypes.HANDLE, ctypes.c_void_p, wintypes.DWORD, ctypes.c_void_p)
    kernel.GetModuleFileNameW.argtypes = (wintypes.HMODULE, wintypes.LPWSTR, wintypes.DWORD)
    modules, needed = (wintypes.HMODULE * 4096)(), wintypes.DWORD()
    assert kernel.K32EnumProcessModules(kernel.GetCurrentProcess(), modules, ctypes.sizeof(modules),
                                        ctypes.byref(needed))
    for module in modules[:needed.value // ctypes.sizeof(wintypes.HMODULE)]:
        path = ctypes.create_unicode_buffer(32768)
        kernel.GetModuleFileNameW(module, path, len(path))
        yield path.value
