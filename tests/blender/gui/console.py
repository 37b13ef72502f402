# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's console: kept in a file beside the screenshots, and searched for faults that no check asks for.

Exceptions in drawing, handlers and timers are printed there and nowhere else, and so are most of the complaints of
Blender's interface about properties and operators that panels ask for.
"""

import os
import re
import subprocess
import sys

# Second line: Blender's messages about panels that draw a missing property or operator, of which 5.2 prints only the
# file and line. Third line: messages about a modifier that can't be evaluated, but for those behind Multires in Sculpt
# Mode, where Blender has none of them.
_FAULTS = re.compile(r'Traceback \(most recent call last\)|DeprecationWarning|Error: Python|'
                     r'property not found|unknown operator|operator missing|detail_deform\S+\.py:\d+$|'
                     r'(?:bke\.modifier|object\.modifier )(?!.*Not supported in sculpt mode)')
_FOLLOWING = 20  # lines that are shown from a fault on


class Console:
    """Copies everything that this process prints to a file, until close()."""

    def __init__(self, path):
        self._path = path
        # By another process. A thread of this one could deadlock: Blender writes from C too, holding the interpreter
        # that the thread would wait for while Blender waits for the full pipe.
        self._tee = subprocess.Popen(['tee', str(path)], stdin=subprocess.PIPE, start_new_session=True)
        self._before = [os.dup(number) for number in (1, 2)]
        self._lead_to([self._tee.stdin.fileno()] * 2)
        self._tee.stdin.close()

    def close(self):
        """Returns the faults, [str], each with the lines that follow it."""
        self._lead_to(self._before)
        try:
            self._tee.wait(10)
        except subprocess.TimeoutExpired:  # processes that Blender started to compile shaders may hold the pipe open
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
