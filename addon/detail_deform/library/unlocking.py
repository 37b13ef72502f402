# SPDX-License-Identifier: GPL-3.0-or-later
"""Windows locks the file of a loaded library, so that its folder can't be removed, as by an update of an add-on in
Blender up to 4.1. But the file may be renamed: the loaded one goes to the folder for temporary files, and a copy takes
its place. What earlier runs left there is removed."""

import glob
import os
import shutil
import sys
import tempfile

_NAME = 'detail_deform-{}.dll.loaded'


def unlock(path):
    """After path was loaded. Where this isn't possible, as in a folder that may not be written or on another drive, all
    stays as it is."""
    if sys.platform == 'win32':
        remove_left()
        set_aside(path)


def remove_left():
    for left in glob.glob(os.path.join(glob.escape(tempfile.gettempdir()), _NAME.format('*'))):
        try:
            os.remove(left)
        except OSError:  # still loaded, here or by another Blender
            pass


def set_aside(path):
    """Whether a copy stands at path now."""
    copy = f'{path}.copy'
    aside = os.path.join(tempfile.gettempdir(), _NAME.format(f'{os.getpid()}-{os.urandom(4).hex()}'))
    try:
        shutil.copyfile(path, copy)
        os.rename(path, aside)
    except OSError:
        if os.path.exists(copy):
            os.remove(copy)
        return False
    os.rename(copy, path)
    return True
