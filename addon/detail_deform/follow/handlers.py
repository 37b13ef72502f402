# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's events: a handle moved, the frame changed, a mesh was edited, a step was undone."""

import bpy
from bpy.app.handlers import persistent

from ..scene.window import redraw_panels
from ..ui import marker_preview, preview
from . import binding, deformers, live_transfer, registry, shown, slow_results

# A paint stroke tags the mesh at every dab, a dragged slider of a shape key at every step: in the
# window comparing waits until that has paused for so long.
_PAUSE_SECONDS = 0.3
_to_compare = set()  # addresses of objects, which are only compared
_ALL = None  # among them: after undo objects may have other addresses


def _compare():
    chosen = [ob for ob in registry.members() if _ALL in _to_compare or ob.as_pointer() in _to_compare]
    _to_compare.clear()
    for ob in chosen:
        binding.check_content(ob)
    for ob in live_transfer.following(chosen):
        live_transfer.check(ob)
        live_transfer.refresh(ob, bpy.context.evaluated_depsgraph_get())
    redraw_panels()


def _forget_to_compare():
    if bpy.app.timers.is_registered(_compare):
        bpy.app.timers.unregister(_compare)


def _edited(ob):
    if bpy.app.background:
        binding.check_content(ob)
        live_transfer.check(ob)
        return
    _to_compare.add(ob.as_pointer())
    _forget_to_compare()
    bpy.app.timers.register(_compare, first_interval=_PAUSE_SECONDS)


def _note_edits(members, edited):
    """edited: data-blocks whose geometry was changed."""
    for ob in members:
        settings = ob.detail_deform
        source = settings.transfer.source if settings.transfer.live else None
        of_others = [other.data for other in (source, *(example.object for example in settings.examples)) if other]
        if ob.data in edited or any(mesh in edited for mesh in of_others):
            _edited(ob)  # the object alone is tagged by whatever its modifiers depend on
        base = settings.base_object
        if base and base.data in edited:
            binding.check_base(ob)


def _refresh(members, depsgraph):
    for ob in members:
        if ob.detail_deform.live:
            binding.refresh(ob, depsgraph)
    for ob in live_transfer.following(members):  # which may follow those
        live_transfer.refresh(ob, depsgraph)


# With nothing bound, neither of these two goes through what a scene has or what was changed.

@persistent
def _depsgraph_updated(scene, depsgraph):
    members = registry.members()
    if members or preview.is_in_use() or marker_preview.is_in_use():
        edited = {update.id.original for update in depsgraph.updates if update.is_updated_geometry}
        if edited:
            preview.forget(edited)
            marker_preview.forget(edited)
        members = registry.of_scene(depsgraph)
        if edited:
            _note_edits(members, edited)
        _refresh(members, depsgraph)


@persistent
def _frame_changed(scene, depsgraph):
    _refresh(registry.of_scene(depsgraph), depsgraph)


@persistent
def _data_is_replaced(*_):
    """Before undo, redo and loading: no object outlives them."""
    registry.forget()
    if _to_compare:
        _to_compare.add(_ALL)


@persistent
def _data_replaced(*_):
    """After undo, redo, loading: the meshes may hold any earlier result."""
    registry.forget()
    shown.clear()
    live_transfer.forget_owners()
    preview.forget()


_HANDLERS = (('depsgraph_update_post', _depsgraph_updated), ('frame_change_post', _frame_changed),
             ('undo_pre', _data_is_replaced), ('redo_pre', _data_is_replaced), ('load_pre', _data_is_replaced),
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
    _to_compare.clear()
    binding.stop_polling()
    live_transfer.stop_polling()
    slow_results.clear()
    deformers.clear()
    live_transfer.clear()
    shown.clear()
    registry.forget()
