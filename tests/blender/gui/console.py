# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender writes to its console: kept in a file beside the screenshots, and searched for what no check asks for.

Exceptions in drawing, handlers and timers end there and nowhere else, and so do most of the complaints that Blender's
interface has about what it is asked to draw.
"""

import os
import re
import subprocess
import sys

# On the second line are Blender's own words about an interface that asks for what isn't there, of which 5.2 prints no
# more than the place, and on the third about a modifier that can't do its work.
_FAULTS = re.compile(r'Traceback \(most recent call last\)|DeprecationWarning|Error: Python|'
                     r'property not found|unknown operator|operator missing|detail_deform\S+\.py:\d+$|'
                     r'bke\.modifier|object\.modifier ')
_FOLLOWING = 20  # lines of context that are shown with a fault


class Console:
    """From now on, until it is closed, everything that is written to it."""

    def __init__(self, path):
        self._path = path
        # Another process has to do it: Blender writes from C too, and would wait forever for a thread of its own that
        # waits for the interpreter.
        self._tee = subprocess.Popen(['tee', str(path)], stdin=subprocess.PIPE, start_new_session=True)
        self._before = [os.dup(number) for number in (1, 2)]
        self._lead_to([self._tee.stdin.fileno()] * 2)
        self._tee.stdin.close()

    def close(self):
        """Returns what was wrong, [str], each with the lines that follow it."""
        self._lead_to(self._before)
        try:
            self._tee.wait(10)
        except subprocess.TimeoutExpired:  # what Blender has started to compile shaders may hold the other end
            self._tee.terminate()
        lines, found, shown = self._path.read_text(errors='replace').splitlines(), [], 0
        for number, line in enumerate(lines):
            if number >= shown and _FAULTS.search(line):
                shown = number + _FOLLOWING
                found.append('\n'.join(lines[number:shown]))
        return found

    @staticmethod
    def _lead_to(numbers):
        sys.stdout.flush()
        sys.stderr.flush()
        for number, other in zip((1, 2), numbers):
            os.dup2(other, number)
