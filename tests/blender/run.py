# SPDX-License-Identifier: GPL-3.0-or-later
"""Installs the add-on's zip into this Blender and runs the tests beside this file.

    blender --background --factory-startup --python tests/blender/run.py -- ZIP [pytest arguments]
    python tests/blender/run.py -- ZIP [pytest arguments]          (bpy as a module)

The add-on is installed into the folder BLENDER_USER_RESOURCES, which has to be set; tests/run.sh makes a new one.
"""
import os
import sys
from pathlib import Path

import bpy
import pytest

HERE = Path(__file__).resolve().parent


def install(zip_path):
    """Installs and enables the add-on; returns its module's name."""
    if hasattr(bpy.ops, 'extensions') and bpy.app.version >= (4, 2, 0):
        bpy.ops.extensions.package_install_files(filepath=str(zip_path), repo='user_default',
                                                 enable_on_install=True)
        module = 'bl_ext.user_default.detail_deform'
    else:
        bpy.ops.preferences.addon_install(filepath=str(zip_path), overwrite=True)
        bpy.ops.preferences.addon_enable(module='detail_deform')
        module = 'detail_deform'
    # Both operators return FINISHED for a zip that they did not take.
    if module not in bpy.context.preferences.addons or module not in sys.modules:
        sys.exit(f"{zip_path} was not installed and enabled.")
    return module


def main(arguments):
    if 'BLENDER_USER_RESOURCES' not in os.environ:
        sys.exit("Set BLENDER_USER_RESOURCES to an empty folder, or your own add-ons are touched.")
    zip_path = Path(arguments[0]).resolve()
    module = install(zip_path)
    os.environ['DD_TEST_MODULE'] = module
    os.environ['DD_TEST_ZIP'] = str(zip_path)
    print(f"Blender {bpy.app.version_string}, add-on {module} from {zip_path.name}", flush=True)
    status = pytest.main([str(HERE), '-q', '-p', 'no:cacheprovider', *arguments[1:]])
    bpy.ops.preferences.addon_disable(module=module)
    sys.stdout.flush()
    # Blender's own exit would turn some of pytest's statuses into 0.
    os._exit(int(status))


if __name__ == '__main__':
    main(sys.argv[sys.argv.index('--') + 1:])
