# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps through a range of frames, and updates followers in each."""

from ..follow import lifecycle
from ..scene.mesh_data import MeshProblem


def check_range(start, end):
    if end < start:
        raise MeshProblem(f"The last frame, {end}, is before the first, {start}: put them in order.")


def check_time(scene):
    """Raises MeshProblem if the scene remaps its time, so that baked frames would play at other times."""
    if scene.render.frame_map_old != scene.render.frame_map_new:
        raise MeshProblem("The scene remaps its time (Output > Frame Range > Time Stretching), so what is baked would "
                          "play at other times than it was taken at: set Old and New alike to bake.")


def settle(context, ob):
    """Updates a bound object to the present pose of its handles, and waits for slow results."""
    if ob.detail_deform.signature:
        lifecycle.refresh(ob, context.evaluated_depsgraph_get())
        lifecycle.settle(ob)
        context.view_layer.update()


def walk(context, ob, start, end):
    """Generator of the frames from start to end, with scene and object updated to each. Restores the scene's frame at
    the end."""
    check_range(start, end)
    with RestoredFrame(context.scene):
        for frame in range(start, end + 1):
            context.scene.frame_set(frame)
            settle(context, ob)
            yield frame


class RestoredFrame:
    """Context that restores the scene's frame at its end."""

    def __init__(self, scene):
        self._scene = scene

    def __enter__(self):
        self._frame = (self._scene.frame_current, self._scene.frame_subframe)

    def __exit__(self, *_):
        self._scene.frame_set(self._frame[0], subframe=self._frame[1])
