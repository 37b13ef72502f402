# SPDX-License-Identifier: GPL-3.0-or-later
"""Writing to data from the thread of a render.

While Blender draws panels, lists and menus it forbids scripts to change data, by one flag for all threads. A render
from the window calls the handlers in a thread of its own, where the same is forbidden whenever the window happens to
draw."""

import functools
import threading
import time

_REFUSAL = "Writing to ID classes in this context is not allowed"  # the beginning of Blender's sentence, 3.4 to 5.2
_PAUSE_SECONDS = 0.001  # leaves the interpreter to the drawing
_LONGEST_SECONDS = 10.0  # far longer than a panel is drawn; then it is not drawing that refuses


def repeated(handler):
    """The handler, called again in the thread of a render as long as the window's drawing forbids it to write. A call
    may have ended anywhere, so the handler has to begin with a comparison of what is there."""
    @functools.wraps(handler)
    def call(*args):
        end = time.monotonic() + _LONGEST_SECONDS
        while True:
            try:
                return handler(*args)
            except AttributeError as error:
                if (threading.current_thread() is threading.main_thread() or time.monotonic() > end
                        or not str(error).startswith(_REFUSAL)):
                    raise
            time.sleep(_PAUSE_SECONDS)
    return call
