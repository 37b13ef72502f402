# SPDX-License-Identifier: GPL-3.0-or-later
"""Detail Deform: pull a bumpy surface by a few empties; its bumps turn with it and keep their shape."""

import sys

bl_info = {
    'name': "Detail Deform",
    'author': "The Detail Deform developers",
    'version': (1, 0, 0),
    'blender': (3, 4, 0),
    'location': "Properties > Modifiers > Detail Deform",
    'description': "Deform surfaces by empties; bumps, scales and thorns turn with them instead of shearing",
    'category': "Mesh",
}

if any(name.startswith(f'{__name__}.') for name in sys.modules):
    # Blender executes only this file again: the other modules in memory may be of another version.
    from importlib import reload

    from . import reloading
    reload(reloading).reload_modules(__name__, __path__[0])


def _parts():
    try:
        import numpy  # noqa: F401
    except ModuleNotFoundError as error:
        raise RuntimeError("Detail Deform needs numpy, which Blender's own builds bring along and this "
                           "one does not: install the system's package python3-numpy.") from error
    from . import handlers, properties
    from .operators import (bake_operators, brush_operator, drag_operators, example_operators, operators,
                            pose_operators, problem_operators, pull_operator, setup_operators,
                            transfer_many_operators, transfer_operators)
    from .ui import (brush_tool, handle_gizmos, marker_preview, panels, preferences, preview, sidebar, tool,
                     transfer_panel)
    return (properties, operators, setup_operators, problem_operators, pull_operator, drag_operators, brush_operator,
            bake_operators, example_operators, pose_operators, transfer_operators, transfer_many_operators, panels,
            sidebar, transfer_panel, tool, brush_tool, handle_gizmos, preferences, preview, marker_preview, handlers)


_is_registered = False


def register():
    global _is_registered
    for part in _parts():
        part.register()
    _is_registered = True
    import bpy
    if getattr(bpy.app, 'module', False):
        # As a Python module, Blender 4.2 crashes and 4.5 hangs at exit unless everything is unregistered.
        import atexit
        atexit.register(unregister)


def unregister():
    """Does nothing the second time: at exit, Blender as a Python module disables its add-ons after atexit has called
    this."""
    global _is_registered
    if not _is_registered:
        return
    _is_registered = False
    import atexit
    atexit.unregister(unregister)
    for part in reversed(_parts()):
        part.unregister()
    from .library import native
    native.unload()
