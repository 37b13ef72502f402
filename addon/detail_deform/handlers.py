# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's events: a handle moved, the frame changed, a mesh was edited, a step was undone."""

import bpy
from bpy.app.handlers import persistent

from . import binding, deformers


def _refresh_scene(scene, depsgraph):
    for ob in binding.bound_objects(scene.objects):
        if ob.detail_deform.live:
            binding.refresh(ob, depsgraph)


@persistent
def _depsgraph_updated(scene, depsgraph):
    edited = {update.id.original for update in depsgraph.updates if update.is_updated_geometry}
    for ob in binding.bound_objects(scene.objects):
        if ob in edited or ob.data in edited:
            binding.check_content(ob)
    _refresh_scene(scene, depsgraph)


@persistent
def _frame_changed(scene, depsgraph):
    _refresh_scene(scene, depsgraph)


@persistent
def _data_replaced(*_):
    """Undo, redo, loading: the attributes may hold any earlier result."""
    deformers.forget_shown()


_HANDLERS = (('depsgraph_update_post', _depsgraph_updated), ('frame_change_post', _frame_changed),
             ('undo_post', _data_replaced), ('redo_post', _data_replaced), ('load_post', _data_replaced))


def register():
    for name, function in _HANDLERS:
        getattr(bpy.app.handlers, name).append(function)


def unregister():
    for name, function in _HANDLERS:
        handlers = getattr(bpy.app.handlers, name)
        if function in handlers:
            handlers.remove(function)
    binding.stop_polling()
    deformers.clear()
