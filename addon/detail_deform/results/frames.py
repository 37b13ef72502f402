# SPDX-License-Identifier: GPL-3.0-or-later
"""A walk over a range of frames, with what is followed brought to each."""

from ..follow import life
from ..scene.mesh_data import MeshProblem


def check_range(start, end):
    if end < start:
        raise MeshProblem(f"The last frame, {end}, is before the first, {start}: put them in order.")


def check_time(scene):
    """Raises MeshProblem where what is baked would play at other times than it was taken at."""
    if scene.render.frame_map_old != scene.render.frame_map_new:
        raise MeshProblem("The scene remaps its time (Output > Frame Range > Time Stretching), so what is baked would "
                          "play at other times than it was taken at: set Old and New alike to bake.")


def settle(context, ob):
    """Brings an object that is bound to the end of what its handles ask for, slow results included."""
    if ob.detail_deform.signature:
        life.refresh(ob, context.evaluated_depsgraph_get())
        life.settle(ob)
        context.view_layer.update()


def walk(context, ob, start, end):
    """Generator of the frames from start to end, with scene and object brought to each. Leaves the scene at the frame
    where it was."""
    check_range(start, end)
    with Present(context.scene):
        for frame in range(start, end + 1):
            context.scene.frame_set(frame)
            settle(context, ob)
            yield frame


class Present:
    """While it lasts other frames may be gone to."""

    def __init__(self, scene):
        self._scene = scene

    def __enter__(self):
        self._frame = (self._scene.frame_current, self._scene.frame_subframe)

    def __exit__(self, *_):
        self._scene.frame_set(self._frame[0], subframe=self._frame[1])
