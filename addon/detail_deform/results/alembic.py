# SPDX-License-Identifier: GPL-3.0-or-later
"""Export of an object, evaluated with all its modifiers, to an Alembic file."""

import os

import bpy

from ..scene import deform_modifier, files, pc2
from ..scene.mesh_data import MeshProblem
from . import bake, frames, point_cache

_COMPLETE = b'Ogawa\xff'  # begins a complete file: the exporter writes the sixth byte last


def write(context, ob, start, end, path):
    """Writes the object, evaluated with all its modifiers, for other programs. Raises MeshProblem."""
    bake.modifier_of(ob)
    if not bpy.app.build_options.alembic:
        raise MeshProblem("This Blender was built without Alembic: bake a Mesh Cache, or use an official build.")
    path = point_cache.absolute(path)
    frames.check_range(start, end)
    for _ in bake.over_frames(context, ob, start, start):
        pass  # goes to the first frame alone, so that its errors are raised before the export begins
    with point_cache.disk(path, "written"):
        unfinished = files.unfinished(path, '.abc')  # Blender would add this ending
        # A full disk during the export would terminate Blender, so the room is checked before.
        pc2.check_room(path, (end + 1 - start) * _bytes_a_frame(ob, context))
    try:
        with _Exported(context, ob), point_cache.disk(path, "written"):
            bpy.ops.wm.alembic_export(filepath=unfinished, start=start, end=end, selected=True,
                                      as_background_job=False)
            _check_complete(unfinished, 3 * min(len(ob.data.vertices), len(_evaluated(ob, context).vertices)))
            os.replace(unfinished, path)
        ob.detail_deform.baked_file = path
    except RuntimeError as error:
        raise MeshProblem(f"'{path}' can't be written: {str(error).strip()}") from error
    finally:
        files.remove_unfinished(unfinished)


def _bytes_a_frame(ob, context):
    """float32 positions of vertices and normals of face corners."""
    mesh = _evaluated(ob, context)
    return 12 * (len(mesh.vertices) + len(mesh.loops))


def _evaluated(ob, context):
    return ob.evaluated_get(context.evaluated_depsgraph_get()).data


def _check_complete(path, least):
    """Raises OSError if the exporter stopped early, as on a full disk, or wrote no mesh; it reports neither. least: a
    file of fewer bytes is taken for one without the mesh, whose positions take four times as many."""
    with open(path, 'rb') as file:
        if file.read(len(_COMPLETE)) != _COMPLETE:
            raise OSError(0, "the export has stopped before its end, as it does when the disk is full")
    if os.path.getsize(path) < least:
        raise OSError(0, "the export has left the object out, as where it is disabled in renders")


def _collections_around(scene, ob):
    """The collections with the object that are disabled in renders and can be enabled. Raises MeshProblem if a linked
    one, which can't be, hides the object."""
    found = [collection for collection in scene.collection.children_recursive
             if collection.hide_render and ob in collection.all_objects[:]]
    linked = [collection for collection in found if collection.library]
    if linked and not _is_in(scene.collection, ob, linked):
        raise MeshProblem(f"'{ob.name}' is in the linked collection '{linked[0].name}', which is disabled in renders, "
                          "so that an export leaves it out: enable it in its file, or put the object into another "
                          "collection, too.")
    return [collection for collection in found if collection not in linked]


def _is_in(collection, ob, without):
    """Whether the object is in the collection, also by way of children, but not through those in `without`."""
    return ob in collection.objects[:] or any(_is_in(child, ob, without) for child in collection.children
                                              if child not in without)


class _Exported:
    """Context in which only the object is selected, and is visible to an exporter and updated live."""

    def __init__(self, context, ob):
        self._context, self._ob, self._modifier = context, ob, deform_modifier.find(ob)
        self._around = _collections_around(context.scene, ob)

    def __enter__(self):
        ob = self._ob
        self._selected = list(self._context.selected_objects)
        self._kept = [(owner, name, getattr(owner, name)) for owner, name in (
            (ob, 'hide_select'), (ob, 'hide_viewport'), (ob, 'hide_render'), (ob.detail_deform, 'live'),
            (self._modifier, 'show_render'), (self._modifier, 'show_viewport'),
            *((collection, 'hide_render') for collection in self._around))]
        self._hidden = ob.hide_get()
        ob.hide_select = ob.hide_viewport = ob.hide_render = False
        for collection in self._around:
            collection.hide_render = False
        ob.hide_set(False)
        ob.detail_deform.live = self._modifier.show_render = self._modifier.show_viewport = True
        for other in self._selected:
            other.select_set(False)
        ob.select_set(True)

    def __exit__(self, *_):
        self._ob.select_set(False)
        for other in self._selected:
            other.select_set(True)
        for owner, name, value in self._kept:
            setattr(owner, name, value)
        self._ob.hide_set(self._hidden)
