# SPDX-License-Identifier: GPL-3.0-or-later
"""What displays the offsets: the deformation's modifier, or a shape key.

The modifier adds the offset attribute where it stands in the stack. Blender lets no nodes stand before a modifier that
wants the mesh itself, such as Multires, and what is displaced behind it isn't turned with the surface. A shape key acts
before all modifiers. It holds a copy of the attribute, which is what was computed in either case; its value is the
factor. The modifier then passes the geometry on, and is what is switched off or removed to switch off or remove the
deformation.
"""

import numpy as np

from . import deform_modifier, display_key, mesh_data, offset_attribute, stack

# Custom properties of the mesh. The offsets that the key holds: their token, and how they were masked; missing where
# the key is at rest. Whether the reference key was made for it, and whether Edit Mode was made to show keys.
_HELD, _MADE_REFERENCE = 'detail_deform_key_holds', 'detail_deform_key_reference'
_SHOWN_IN_EDIT_MODE = 'detail_deform_key_in_edit_mode'


def wants_key(ob):
    """Whether a shape key is to display the deformation."""
    how = ob.detail_deform.show_as
    if how == 'MODIFIER' or how == 'AUTO' and not stack.wanting_mesh(ob):
        return False
    return not stack.why_no_key(ob)


def is_shown(ob, modifier, depsgraph):
    """Whether the deformation is displayed, in the viewport, or in renders where the depsgraph is a render's."""
    return deform_modifier.is_shown(modifier, depsgraph) and not display_key.why_hidden(ob)


def is_lost(mesh):
    """Whether the key was removed or applied by hand."""
    return display_key.has_had_one(mesh) and display_key.find(mesh) is None


def settle(ob, depsgraph):
    """Displays the offsets by what is wanted now, and hides or shows them with the modifier. Does nothing where all is
    as it should be. Shape keys are made and removed in the viewport's updates only. ob: may be written to, and is not
    in Edit Mode."""
    modifier, key = deform_modifier.find(ob), display_key.find(ob.data)
    wanted = modifier is not None and wants_key(ob)
    if depsgraph.mode != 'RENDER':
        if key is not None and not wanted:
            remove_key(ob)
        elif key is None and wanted and offset_attribute.find(ob.data) is not None:
            key = _add_key(ob)
    if key is None or not wanted:
        return
    if not is_shown(ob, modifier, depsgraph):
        _show_rest(ob.data, key)
    elif ob.data.get(_HELD) != _to_hold(ob, modifier):
        _hold(ob, modifier, key, offset_attribute.read(ob.data))


def settle_copy(ob):
    """The same for an object that shares its mesh with the one that deforms it."""
    modifier = deform_modifier.find(ob)
    if modifier is not None:
        deform_modifier.set_passing(modifier, display_key.find(ob.data) is not None)


def write(ob, offsets):
    """Writes the offsets, (3 n,) float32, as offset_attribute.write(), and displays them."""
    offset_attribute.write(ob.data, offsets)
    key, modifier = display_key.find(ob.data), deform_modifier.find(ob)
    if key is not None and modifier is not None and _HELD in ob.data:
        _hold(ob, modifier, key, offsets.reshape(-1, 3))


def show_rest(ob):
    """Removes the offsets. The key stays, as the modifier does, since its value may be animated."""
    offset_attribute.remove(ob.data)
    key = display_key.find(ob.data)
    if key is not None:
        _show_rest(ob.data, key)


def remove(ob):
    """Removes the modifier, and the shape key with the reference key that was made for it."""
    remove_key(ob)
    deform_modifier.remove(ob)


def weights_changed(mesh):
    """To be called when vertex groups may have been painted: weights that the key's offsets were multiplied by."""
    if str(mesh.get(_HELD, "")).endswith(_MASKED):
        mesh[_HELD] = ""  # held, but to be written anew


_MASKED = " masked"  # ends the property where the offsets were multiplied by weights


def _mask(ob, modifier):
    """(the vertex group that is to mask the key, whether the offsets are to be multiplied by weights instead). A key
    has no inverted mask, and counts a missing group as none."""
    name, invert = deform_modifier.influence(modifier)
    is_there = name in ob.vertex_groups
    return (name, False) if is_there and not invert else ("", bool(name))


def _to_hold(ob, modifier):
    group, multiplied = _mask(ob, modifier)
    return f"{offset_attribute.token(ob.data)} {group if not multiplied else ''}{_MASKED * multiplied}"


def _hold(ob, modifier, key, offsets):
    group, multiplied = _mask(ob, modifier)
    if multiplied:
        offsets = offsets * deform_modifier.influence_weights(ob, modifier)
    if key.vertex_group != group:
        key.vertex_group = group
    _set_points(ob.data, key, mesh_data.rest_positions(ob.data) + offsets)
    ob.data[_HELD] = _to_hold(ob, modifier)


def _show_rest(mesh, key):
    if _HELD in mesh:
        _set_points(mesh, key, mesh_data.rest_positions(mesh))
        del mesh[_HELD]


def _set_points(mesh, key, positions):
    getattr(key, 'points', key.data).foreach_set('co', np.asarray(positions, np.float32).ravel())
    mesh.shape_keys.update_tag()
    mesh.update_tag()


def _add_key(ob):
    mesh, modifier = ob.data, deform_modifier.ensure(ob)
    factor = deform_modifier.factor(ob, modifier)
    if mesh.shape_keys is None:
        ob.shape_key_add(name="Basis", from_mix=False)
        mesh[_MADE_REFERENCE] = True
        if not ob.use_shape_key_edit_mode:
            # So that selecting for the next pull happens on the displayed surface. Keys of the user's own are edited
            # as the user has it.
            ob.use_shape_key_edit_mode = mesh[_SHOWN_IN_EDIT_MODE] = True
    active = ob.active_shape_key_index
    key = ob.shape_key_add(name=display_key.NAME, from_mix=False)
    display_key.mark(mesh, key)
    key.relative_key, key.value = mesh.shape_keys.reference_key, factor
    if hasattr(key, 'lock_shape'):
        key.lock_shape = True  # the next update would overwrite what is edited
    ob.active_shape_key_index = active
    mesh.pop(_HELD, None)
    deform_modifier.set_passing(modifier, True)
    return key


def remove_key(ob):
    """Has the modifier display the offsets, if a shape key does."""
    if not display_key.has_had_one(ob.data):
        return
    mesh, key, modifier = ob.data, display_key.find(ob.data), deform_modifier.find(ob)
    if modifier is not None:
        if key is not None:
            deform_modifier.set_factor(modifier, key.value)
        deform_modifier.set_passing(modifier, False)
    if key is not None:
        active = ob.active_shape_key_index
        position = mesh.shape_keys.key_blocks.find(key.name)
        ob.shape_key_remove(key)
        ob.active_shape_key_index = active - (active > position)
        if len(mesh.shape_keys.key_blocks) == 1 and _MADE_REFERENCE in mesh:
            ob.shape_key_clear()
    if _SHOWN_IN_EDIT_MODE in mesh:
        ob.use_shape_key_edit_mode = False
    display_key.forget(mesh)
    for name in (_HELD, _MADE_REFERENCE, _SHOWN_IN_EDIT_MODE):
        mesh.pop(name, None)
