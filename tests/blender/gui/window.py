# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on in Blender's own window, driven by real key and mouse events.

    xvfb-run -a -s "-screen 0 1280x800x24" blender --factory-startup --window-geometry 0 0 1280 800 \
        --python tests/blender/gui/window.py -- build/gui

Writes a screenshot of each state into the folder, which is emptied first, and one line a check; ends with 1
if one failed. Needs xdotool and ImageMagick's import.
"""

import os
import shutil
import sys
import traceback
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))

import handles
import large
import pulls
import results
import transfers
from desk import OUT, ROOT, failures, screenshot


def checks():
    """Yields the seconds to wait before going on: in between Blender handles its events."""
    yield from handles.opening()
    yield from handles.selecting_problems()
    yield from handles.binding()
    yield from handles.dragging()
    yield from handles.undoing()
    yield from handles.reopening()
    yield from transfers.transferring()
    yield from transfers.transferring_to_many()
    yield from pulls.pulling()
    yield from pulls.by_hand()
    yield from results.expressing()
    yield from results.rendering()
    yield from results.baking()
    yield from large.drafting()
    yield from large.keeping_track()


def main():
    sys.path.insert(0, str(ROOT / 'addon'))
    import detail_deform
    detail_deform.register()
    bpy.context.preferences.view.show_splash = False
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir(parents=True)
    steps = checks()

    def go_on():
        try:
            return next(steps)
        except StopIteration:
            pass
        except Exception:
            traceback.print_exc()
            failures.append("an exception")
            screenshot('exception')
        print(f"window: {len(failures)} failed", flush=True)
        os._exit(1 if failures else 0)

    bpy.app.timers.register(go_on, first_interval=1.0, persistent=True)


main()
