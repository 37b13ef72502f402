# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers of Blender's events: a handle moved, the frame changed, a mesh was edited, a step was undone."""

import bpy
from bpy.app.handlers import persistent

from . import session
from .follow import auto_bind, drag, edits, lifecycle, registry
from .scene import render_thread
from .ui import marker_cache, preview

# While nothing is bound and no preview is drawn, neither of the next two handlers iterates over a scene's objects or
# over the updates.


@persistent
@render_thread.repeated
def _depsgraph_updated(scene, depsgraph):
    members = registry.members()
    if members or preview.is_in_use() or marker_cache.is_in_use():
        edited = {update.id.original for update in depsgraph.updates if update.is_updated_geometry}
        if edited:
            preview.forget(edited)
            marker_cache.forget(edited)
        members = registry.of_scene(depsgraph)
        if edited:
            edits.note(members, edited)
        drag.updated()
        lifecycle.refresh_all(members, depsgraph)


@persistent
@render_thread.repeated
def _frame_changed(scene, depsgraph):
    marker_cache.forget_shapes()
    _show_whole(depsgraph)


@persistent
@render_thread.repeated
def _render_begins(*_):
    lifecycle.render_begins(registry.members())


@persistent
def _before_saving(*_):
    """Replaces a quick result of a drag by the refined one, so that the file holds that. While a bind is under way,
    the file holds the draft."""
    _show_whole(bpy.context.evaluated_depsgraph_get())


def _show_whole(depsgraph):
    members = registry.of_scene(depsgraph)
    lifecycle.end_drag(members)
    lifecycle.refresh_all(members, depsgraph)


@persistent
def _data_replaced(*_):
    """Runs before and after undo, redo and loading: handlers of other add-ons may run in between."""
    session.ended(session.Until.REPLACED)


@persistent
def _file_loaded(*_):
    session.ended(session.Until.LOADED)


_HANDLERS = (('depsgraph_update_post', _depsgraph_updated), ('frame_change_post', _frame_changed),
             ('render_init', _render_begins), ('save_pre', _before_saving),
             *((name, _data_replaced) for name in ('undo_pre', 'undo_post', 'redo_pre', 'redo_post', 'load_pre')),
             ('load_post', _file_loaded))


def register():
    for name, function in _HANDLERS:
        getattr(bpy.app.handlers, name).append(function)
    lifecycle.when_stale.append(auto_bind.soon)


def unregister():
    for name, function in _HANDLERS:
        handlers = getattr(bpy.app.handlers, name)
        if function in handlers:
            handlers.remove(function)
    session.ended(session.Until.DISABLED)
