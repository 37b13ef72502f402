# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that are read, those that are not finished, and what they may be called. Nothing here knows Blender."""

import contextlib
import os
import re
import sys
import unicodedata

_UNFINISHED = '.unfinished'
_UNITS = 'utf-16-le' if sys.platform == 'win32' else 'utf-8'  # what the system counts in a name: two bytes, or one
_MOST = 2 * 255 if sys.platform == 'win32' else 255  # bytes of these
_MOST_OF_A_NAME = 200  # bytes of a data-block's name as that of a file, to which more is added
_MOST_OF_A_PATH = 259  # for programs on Windows that nothing else is set up for
_DRIVE = re.compile(r'^([\\/]{2}[?.][\\/])?([A-Za-z]:)?')  # and what comes before one, or before a device
_FORBIDDEN = '<>:"|?*'  # in names on Windows
_DEVICES = {'CON', 'PRN', 'AUX', 'NUL', *(f'{kind}{number}' for kind in ('COM', 'LPT') for number in range(1, 10))}


def check(path):
    """Raises OSError where a path, which another's file may hold, leads to what has no end or waits for a writer."""
    if sys.platform == 'win32':
        _check_names(path)
    if os.path.exists(path) and not os.path.isfile(path):
        raise OSError(0, "it is no file")


def read_lines(path):
    """Generator: the lines of a text in UTF-8. Raises OSError, also where it is in another encoding."""
    check(path)
    try:
        with open(path, encoding='utf-8-sig') as file:
            for line in file:
                if '\0' in line:  # UTF-16 without a mark
                    raise UnicodeError
                yield line
    except UnicodeError as error:
        raise OSError(0, "it is no text in UTF-8: save it in this encoding") from error


def unfinished(path, ending=''):
    """Where a file is written until it is complete, by a name that is longer. Raises OSError where the system would not
    take the name."""
    if sys.platform == 'win32':
        _check_names(path)
    name = os.path.basename(path)
    most = len(_beginning(name, _MOST - len((_UNFINISHED + ending).encode(_UNITS)), _UNITS))
    if most < len(name):
        raise OSError(0, f"its name has {len(name):,} characters, of which {most:,} would fit: choose a shorter one")
    return path + _UNFINISHED + ending


def _check_names(path):
    """Raises OSError where Windows takes a part of a path for something else."""
    for name in re.split(r'[\\/]', _DRIVE.sub('', path)):
        if _is_device(name):
            raise OSError(0, f"'{name}' is the name of a device on Windows: choose another one")
        for letter in _FORBIDDEN:
            if letter in name:
                raise OSError(0, f"Windows allows no {letter} in a name: choose another one")


def _is_device(name):
    return name.split('.')[0].rstrip().upper() in _DEVICES


def _beginning(name, most, encoding='utf-8'):
    """As much of a name as has so many bytes."""
    encoded = name.encode(encoding, 'surrogateescape' if encoding == 'utf-8' else 'surrogatepass')
    return name if len(encoded) <= most else encoded[:most].decode(encoding, 'ignore')


def reason(error, path):
    """Why the system refuses a file, in words."""
    if sys.platform == 'win32' and isinstance(error, FileNotFoundError) and len(path) > _MOST_OF_A_PATH:
        return (f"its path has {len(path):,} characters, and Windows takes {_MOST_OF_A_PATH} of them: choose a shorter "
                "one")
    return error.strerror or str(error)


def name_for(name):
    """A data-block's name as that of a file, on any system."""
    name = ''.join('_' if letter in _FORBIDDEN + '\\/' or ord(letter) < 32 else letter for letter in name)
    return _beginning('_' + name if _is_device(name) else name, _MOST_OF_A_NAME)


def folded(path):
    """Equal of paths that Windows or macOS take for the same, which know no case and more than one way to write an
    accent: what is made on another system may be opened there."""
    return unicodedata.normalize('NFC', unicodedata.normalize('NFC', path).casefold())


def name_on_disk(path):
    """Of the file that a path leads to, which may be spelled in another way; '' where there is none."""
    folder, name = os.path.split(path)
    names = os.listdir(folder or '.') if os.path.exists(path) else []
    return name if name in names else next((each for each in names if folded(each) == folded(name)), "")


def take_away(path):
    """An unfinished file, as far as the disk lets: what went wrong before is what is said."""
    with contextlib.suppress(OSError):
        os.remove(path)
