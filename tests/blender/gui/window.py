# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests the add-on in Blender's window by real key and mouse events.

    xvfb-run -a -s "-screen 0 1280x800x24" blender --factory-startup --window-geometry 0 0 1280 800 \
        --python tests/blender/gui/window.py -- build/gui

Empties the folder, writes screenshots into it, and prints a line for each check; the exit status is 1 if a check failed
or the console has an exception. Names of ROWS behind the folder choose these rows; with a ~ before the name a row is
left out. Needs xdotool and ImageMagick's import.
"""

import os
import shutil
import sys
import time
import traceback
import warnings
from pathlib import Path

import bpy
import gpu

sys.path.insert(0, str(Path(__file__).parent))

import brushes
import curves
import everyday
import handles
import large
import pulls
import results
import sculpts
import transfers
from console import Console
from desk import OUT, ROOT, arrange, failures, screenshot


# Each row begins with a walk that opens or makes a scene; each later walk goes on with the scene that the one before it
# has left.
ROWS = {
    'handles': (handles.opening, handles.selecting_problems, handles.binding, handles.dragging, handles.undoing,
                handles.reopening),
    'transfers': (transfers.transferring, transfers.transferring_to_many),
    'pulls': (pulls.pulling, pulls.by_hand),
    'curves': (curves.by_curve,),
    'everyday': (everyday.pulling_what_is_posed, everyday.deleting_an_empty, everyday.pulling_inside,
                 everyday.pulling_across_the_middle, everyday.pulling_a_whole_part, everyday.editing_a_cage,
                 everyday.stiffening),
    'results': (results.expressing, results.rendering, results.baking),
    'sculpts': (sculpts.pulling_a_sculpt, sculpts.sculpting_on),
    'brushes': (brushes.sculpting_mode, brushes.by_brush, brushes.sculpting_what_was_pulled,
                brushes.applying_at_once),
    'large': (large.drafting, large.keeping_track),
}


def checks(rows):
    """Runs the walks. Yields the seconds to wait before going on, in which Blender handles its events."""
    platform = gpu.platform
    print(f"Blender {bpy.app.version_string}, {platform.backend_type_get()} {platform.version_get()}", flush=True)
    arrange()
    for row in rows:
        for walk in ROWS[row]:
            began, worked = time.monotonic(), time.process_time()
            yield from walk()
            took, worked = time.monotonic() - began, time.process_time() - worked
            print(f"{took:5.1f} s, of work {worked:5.1f} s: {row}.{walk.__name__}", flush=True)


def chosen_rows(names):
    unknown = {name.lstrip('~') for name in names} - {*ROWS}
    if unknown:
        sys.exit(f"No such rows: {', '.join(sorted(unknown))}. There are: {', '.join(ROWS)}.")
    wanted = [name for name in names if not name.startswith('~')] or ROWS
    return [row for row in ROWS if row in wanted and f'~{row}' not in names]


def main():
    sys.path.insert(0, str(ROOT / 'addon'))
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir(parents=True)
    console = Console(OUT / 'console.txt')
    warnings.filterwarnings('default', category=DeprecationWarning, module='detail_deform')
    import detail_deform
    detail_deform.register()
    steps = checks(chosen_rows(sys.argv[sys.argv.index('--') + 2:]))

    def go_on():
        try:
            return next(steps)
        except StopIteration:
            pass
        except Exception:
            traceback.print_exc()
            screenshot('exception')
        failures.extend(console.close())
        print("", *failures, f"window: {len(failures)} failed", sep='\n', flush=True)
        os._exit(1 if failures else 0)

    bpy.app.timers.register(go_on, first_interval=1.0, persistent=True)


main()
