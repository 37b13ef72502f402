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
    """Whether a shape key is to display the deformation. One whose value is animated stays, as that would be lost."""
    how, key = ob.detail_deform.show_as, display_key.find(ob.data)
    if key is not None and display_key.is_animated(key):
        return True
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
        if not wanted:
            remove_key(ob)
            key = None
        elif key is None and offset_attribute.find(ob.data) is not None:
            key = _add_key(ob)
        if key is not None:
            display_key.drive(key, ob, deform_modifier.animated_factor_path(ob, modifier))
    if modifier is not None:
        deform_modifier.set_passing(modifier, key is not None)
    if key is None or not wanted or not display_key.may_be_written(ob.data, key):
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
    if (key is not None and modifier is not None and _HELD in ob.data
            and display_key.may_be_written(ob.data, key)):
        _hold(ob, modifier, key, offsets.reshape(-1, 3))


def show_rest(ob):
    """Removes the offsets. A key whose value is animated stays, at rest, as the modifier does."""
    offset_attribute.remove(ob.data)
    key = display_key.find(ob.data)
    if key is None or not display_key.is_animated(key):
        remove_key(ob)
    elif display_key.may_be_written(ob.data, key):
        _show_rest(ob.data, key)


def remove(ob):
    """Removes the modifier, and the shape key with the reference key that was made for it."""
    remove_key(ob)
    deform_modifier.remove(ob)


def take_in_edits(ob):
    """To be called when the mesh may have been edited: what the key holds may have been changed with it. ob: may be
    written to, and is not in Edit Mode."""
    mesh, key, modifier = ob.data, display_key.find(ob.data), deform_modifier.find(ob)
    if key is None or not display_key.may_be_written(mesh, key):
        return
    display_key.keep_alone(mesh, key)
    if _HELD in mesh and modifier is not None:
        held = mesh_data.rest_positions(mesh) + _masked(ob, modifier, offset_attribute.read(mesh))
        if not np.array_equal(mesh_data.key_positions(key), held.astype(np.float32), equal_nan=True):
            mesh[_HELD] = ""  # to be written anew


def take_in_moved_vertices(ob):
    """To be called when the mesh's own vertices were moved, and nothing else. Scripts, for which the mesh has no keys,
    move these alone, and then the reference key that was made for ours has to go along."""
    mesh, key = ob.data, display_key.find(ob.data)
    if (key is not None and display_key.may_be_written(mesh, key) and _MADE_REFERENCE in mesh
            and len(mesh.shape_keys.key_blocks) == 2 and ob.active_shape_key != key):
        own = mesh_data.positions(mesh)
        if not np.array_equal(own, mesh_data.rest_positions(mesh), equal_nan=True):
            _set_points(mesh, mesh.shape_keys.reference_key, own)
            if _HELD in mesh:
                mesh[_HELD] = ""


def take_in_joined(ob):
    """To be called when the mesh has other vertices. Removes the key of another object that was joined to this one,
    whose offsets the modifier displays with its own."""
    joined = display_key.of_another(ob.data)
    if joined is not None:
        _take_out(ob, joined)
        _take_out_lone_reference(ob)


_MULTIPLIED = " multiplied"  # ends the property where the offsets were multiplied by weights


def _mask(ob, modifier):
    """(the vertex group that is to mask the key, whether the offsets are to be multiplied by weights instead). A key
    has no inverted mask, and counts a missing group as none."""
    name, invert = deform_modifier.influence(modifier)
    is_there = name in ob.vertex_groups
    return (name, False) if is_there and not invert else ("", bool(name))


def _masked(ob, modifier, offsets):
    return offsets * deform_modifier.influence_weights(ob, modifier) if _mask(ob, modifier)[1] else offsets


def _to_hold(ob, modifier):
    group, multiplied = _mask(ob, modifier)
    return f"{offset_attribute.token(ob.data)} {group}{_MULTIPLIED * multiplied}"


def _hold(ob, modifier, key, offsets):
    mesh, group = ob.data, _mask(ob, modifier)[0]
    if key.vertex_group != group:
        key.vertex_group = group
    if key.relative_key != mesh.shape_keys.reference_key:
        key.relative_key = mesh.shape_keys.reference_key
    display_key.keep_alone(mesh, key)
    _set_points(mesh, key, mesh_data.rest_positions(mesh) + _masked(ob, modifier, offsets))
    mesh[_HELD] = _to_hold(ob, modifier)


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
    _set_points(mesh, key, mesh_data.rest_positions(mesh))  # the vertices, which it has, may be others
    if hasattr(key, 'lock_shape'):
        key.lock_shape = True  # the next update would overwrite what is edited
    ob.active_shape_key_index = active
    mesh.pop(_HELD, None)
    return key


def remove_key(ob):
    """Has the modifier display the offsets, if a shape key does."""
    mesh, key, modifier = ob.data, display_key.find(ob.data), deform_modifier.find(ob)
    if not display_key.has_had_one(mesh):
        return
    if key is not None:
        if modifier is not None and not display_key.is_driven(key):
            deform_modifier.set_factor(modifier, key.value)
        if modifier is not None and key.mute:
            modifier.show_viewport = modifier.show_render = False
        _take_out(ob, key)
        if _MADE_REFERENCE in mesh:
            _take_out_lone_reference(ob)
    if modifier is not None:
        deform_modifier.set_passing(modifier, False)
    if _SHOWN_IN_EDIT_MODE in mesh:
        ob.use_shape_key_edit_mode = False
    display_key.forget(mesh)
    for name in (_HELD, _MADE_REFERENCE, _SHOWN_IN_EDIT_MODE):
        mesh.pop(name, None)


def _take_out(ob, key):
    """Removes the key, and the animation of its value, which another key of its name would get."""
    position, active = ob.data.shape_keys.key_blocks.find(key.name), ob.active_shape_key_index
    if active == position:
        ob.show_only_shape_key = False  # another key would be shown alone
    display_key.remove_animation(key)
    ob.shape_key_remove(key)
    ob.active_shape_key_index = max(active - (active >= position), 0)


def _take_out_lone_reference(ob):
    """Removes a reference key without others. The vertices are left where it had them: after an edit with another key
    active they may be elsewhere."""
    mesh = ob.data
    if mesh.shape_keys is None or len(mesh.shape_keys.key_blocks) > 1:
        return
    rest = mesh_data.rest_positions(mesh)
    ob.shape_key_clear()
    if len(rest) == len(mesh.vertices) and not np.array_equal(mesh_data.positions(mesh), rest, equal_nan=True):
        mesh.vertices.foreach_set('co', rest.ravel())
        mesh.update()
