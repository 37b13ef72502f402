# SPDX-License-Identifier: GPL-3.0-or-later
"""The state of a binding, stored and restored where the bind that replaces it is cancelled."""

from typing import NamedTuple

from ..scene import dependency, handle_rests, offset_attribute
from . import binding, registry

_STATE = ('signature', 'stale', 'problem', 'bound_points', 'compared_handles', 'proportions')
_OF_MESHES = (offset_attribute.PREVIOUS_OFFSETS, offset_attribute.SHAPE_KEY_OFFSETS)


class BindingState(NamedTuple):
    """The state of a binding, to be restored if the bind that replaces it is cancelled."""
    state: list  # values of _STATE
    places: list  # values of handle_rests.BINDING_PROPERTIES, for each handle
    attributes: list  # vectors of the attributes _OF_MESHES; None for each that the mesh lacks


def present(ob):
    """The BindingState, for restore()."""
    settings = ob.detail_deform
    return BindingState(
        [getattr(settings, name) for name in _STATE],
        [[getattr(handle, name)[:] for name in handle_rests.BINDING_PROPERTIES] for handle in settings.handles],
        [offset_attribute.read(ob.data, name) if offset_attribute.find(ob.data, name) else None
         for name in _OF_MESHES])


def restore(ob, earlier):
    """earlier: the BindingState to go back to."""
    settings = ob.detail_deform
    for handle, places in zip(settings.handles, earlier.places):
        for name, place in zip(handle_rests.BINDING_PROPERTIES, places):
            setattr(handle, name, place)
    for name, vectors in zip(_OF_MESHES, earlier.attributes):
        if vectors is None:
            offset_attribute.remove_attribute(ob.data, name)
        else:
            offset_attribute.put(ob.data, name, vectors.ravel())
    for name, value in zip(_STATE, earlier.state):
        setattr(settings, name, value)
    if settings.signature:
        binding.targets_changed(ob)
    else:
        dependency.release(ob)
    registry.forget()
