# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading files, names of unfinished files, and rules for file names. Independent of Blender."""

import contextlib
import os
import re
import sys
import unicodedata

_UNFINISHED = '.unfinished'
# Limits of the systems: a file name has at most 255 UTF-16 code units on Windows, 255 bytes elsewhere.
_UNITS = 'utf-16-le' if sys.platform == 'win32' else 'utf-8'
_MAX_NAME_BYTES = 2 * 255 if sys.platform == 'win32' else 255  # bytes in _UNITS
# Bytes of a data-block's name within a file name: leaves at least 55 for what is appended. Safety: a longer file name
# is refused.
_MAX_BLOCK_NAME_BYTES = 200
_MAX_PATH = 259  # characters: Windows' limit (MAX_PATH without the final zero) unless long paths are enabled
_DRIVE = re.compile(r'^([\\/]{2}[?.][\\/])?([A-Za-z]:)?')  # device prefix and drive, both optional
_FORBIDDEN = '<>:"|?*'  # characters that Windows refuses in names
_DEVICES = {'CON', 'PRN', 'AUX', 'NUL', *(f'{kind}{number}' for kind in ('COM', 'LPT') for number in range(1, 10))}


def check(path):
    """Raises OSError where a path, possibly from an untrusted file, is no regular file: reading a device or pipe may
    never end. On Windows also for names that it reserves."""
    if sys.platform == 'win32':
        _check_names(path)
    if os.path.exists(path) and not os.path.isfile(path):
        raise OSError(0, "it is no file")


def read_lines(path):
    """Generator: the lines of a text file. Raises OSError, also where it is not in UTF-8."""
    check(path)
    try:
        with open(path, encoding='utf-8-sig') as file:
            for line in file:
                if '\0' in line:  # UTF-16 without a byte order mark
                    raise UnicodeError
                yield line
    except UnicodeError as error:
        raise OSError(0, "it is no text in UTF-8: save it in this encoding") from error


def unfinished(path, ending=''):
    """The temporary path that a file is written to until it is complete. Raises OSError where its name, which is
    longer, exceeds the system's limit."""
    if sys.platform == 'win32':
        _check_names(path)
    name = os.path.basename(path)
    most = len(_beginning(name, _MAX_NAME_BYTES - len((_UNFINISHED + ending).encode(_UNITS)), _UNITS))
    if most < len(name):
        raise OSError(0, f"its name has {len(name):,} characters, of which {most:,} would fit: choose a shorter one")
    return path + _UNFINISHED + ending


def _check_names(path):
    """Raises OSError where a part of a path is a device name or has a character that Windows refuses."""
    for name in re.split(r'[\\/]', _DRIVE.sub('', path)):
        if _is_device(name):
            raise OSError(0, f"'{name}' is the name of a device on Windows: choose another one")
        for letter in _FORBIDDEN:
            if letter in name:
                raise OSError(0, f"Windows allows no {letter} in a name: choose another one")


def _is_device(name):
    return name.split('.')[0].rstrip().upper() in _DEVICES


def _beginning(name, most, encoding='utf-8'):
    """The longest prefix of a name with at most this many encoded bytes."""
    encoded = name.encode(encoding, 'surrogateescape' if encoding == 'utf-8' else 'surrogatepass')
    return name if len(encoded) <= most else encoded[:most].decode(encoding, 'ignore')


def reason(error, path):
    """The reason of an OSError, as part of a sentence for users."""
    if sys.platform == 'win32' and isinstance(error, FileNotFoundError) and len(path) > _MAX_PATH:
        return (f"its path has {len(path):,} characters, and Windows takes {_MAX_PATH} of them: choose a shorter "
                "one")
    return error.strerror or str(error)


def name_for(name):
    """A data-block's name made valid as a file name on every system."""
    name = ''.join('_' if letter in _FORBIDDEN + '\\/' or ord(letter) < 32 else letter for letter in name)
    return _beginning('_' + name if _is_device(name) else name, _MAX_BLOCK_NAME_BYTES)


def folded(path):
    """A key that is equal for paths that differ in case or Unicode normalization alone: Windows and macOS take them for
    the same, and a file made on another system may be opened there."""
    return unicodedata.normalize('NFC', unicodedata.normalize('NFC', path).casefold())


def name_on_disk(path):
    """The name of an existing file as its folder lists it, which may differ by folded() alone; '' if there is none."""
    folder, name = os.path.split(path)
    names = os.listdir(folder or '.') if os.path.exists(path) else []
    return name if name in names else next((each for each in names if folded(each) == folded(name)), "")


def remove_unfinished(path):
    """Removes an unfinished file. Errors are suppressed, so that the original error is reported."""
    with contextlib.suppress(OSError):
        os.remove(path)
