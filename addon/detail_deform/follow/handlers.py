# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's events: a handle moved, the frame changed, a mesh was edited, a step was undone."""

import bpy
from bpy.app.handlers import persistent

from ..ui import marker_preview, preview
from . import binding, deformers, live_transfer, slow_results

# A paint stroke tags the mesh at every dab, a dragged slider of a shape key at every step: in the
# window comparing waits until that has paused for so long.
_PAUSE_SECONDS = 0.3
_to_compare = set()


def _compare():
    for ob in binding.bound_objects(bpy.data.objects):
        if ob.name in _to_compare:
            binding.check_content(ob)
    for ob in live_transfer.following(bpy.data.objects):
        if ob.name in _to_compare:
            live_transfer.check(ob)
            live_transfer.refresh(ob, bpy.context.evaluated_depsgraph_get())
    _to_compare.clear()
    binding.redraw_panels()


def _forget_to_compare():
    if bpy.app.timers.is_registered(_compare):
        bpy.app.timers.unregister(_compare)


def _edited(ob):
    if bpy.app.background:
        binding.check_content(ob)
        live_transfer.check(ob)
        return
    _to_compare.add(ob.name)
    _forget_to_compare()
    bpy.app.timers.register(_compare, first_interval=_PAUSE_SECONDS)


def _refresh(objects, depsgraph):
    for ob in objects:
        if ob.detail_deform.live:
            binding.refresh(ob, depsgraph)


@persistent
def _depsgraph_updated(scene, depsgraph):
    edited = {update.id.original for update in depsgraph.updates if update.is_updated_geometry}
    if edited:
        preview.forget(edited)
        marker_preview.forget(edited)
    objects = binding.bound_objects(scene.objects)
    for ob in objects:
        if ob.data in edited:  # the object alone is tagged by whatever its modifiers depend on
            _edited(ob)
        if any(example.object and example.object.data in edited for example in ob.detail_deform.examples):
            _edited(ob)
        base = ob.detail_deform.base_object
        if base and base.data in edited:
            binding.check_base(ob)
    _refresh(objects, depsgraph)
    for ob in live_transfer.following(scene.objects):  # which may follow those
        source = ob.detail_deform.transfer.source
        if ob.data in edited or (source and source.data in edited):
            _edited(ob)
        live_transfer.refresh(ob, depsgraph)


@persistent
def _frame_changed(scene, depsgraph):
    _refresh(binding.bound_objects(scene.objects), depsgraph)
    for ob in live_transfer.following(scene.objects):
        live_transfer.refresh(ob, depsgraph)


@persistent
def _data_replaced(*_):
    """Undo, redo, loading: the attributes may hold any earlier result."""
    deformers.forget_shown()
    live_transfer.forget_shown(bpy.data.objects)
    preview.forget()


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
    _forget_to_compare()
    binding.stop_polling()
    slow_results.clear()
    deformers.clear()
    live_transfer.clear()
