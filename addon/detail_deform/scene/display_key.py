# SPDX-License-Identifier: GPL-3.0-or-later
"""The shape key that displays the offsets of a mesh in place of the deformation's modifier (channel.py). It is the
add-on's own: whatever reads the shape keys of a mesh leaves it out."""

from . import actions

NAME = 'Detail Deform'
# Interpolation has no effect on relative keys, and a shape key can hold no custom property: this value tells the
# add-on's key, which keeps it when it is renamed, copied, saved and undone.
_MARK, _UNMARKED = 'KEY_BSPLINE', 'KEY_LINEAR'
_NAME = 'detail_deform_key'  # custom property of the mesh: the key's name when it was made


def find(mesh):
    """The ShapeKey, or None."""
    if not has_had_one(mesh) or mesh.shape_keys is None:
        return None
    named = mesh.shape_keys.key_blocks.get(mesh[_NAME])
    return named if named is not None and named.interpolation == _MARK else _marked(mesh)


def _marked(mesh):
    return next((key for key in mesh.shape_keys.key_blocks if key.interpolation == _MARK), None)


def of_another(mesh):
    """The key of another object's mesh that was joined to this one, which has none of its own; or None."""
    return _marked(mesh) if mesh.shape_keys and not has_had_one(mesh) else None


def has_had_one(mesh):
    """Whether the key was made and not removed by the add-on. Without a key it was removed or applied by hand."""
    return _NAME in mesh


def others(mesh):
    """[ShapeKey]: all but the add-on's; the reference key first."""
    if mesh.shape_keys is None:
        return []
    own = find(mesh)
    return [key for key in mesh.shape_keys.key_blocks if key != own]


def may_be_written(mesh, key):
    """Whether it is a key of all vertices, and not the reference of all keys."""
    return key != mesh.shape_keys.reference_key and len(key.data) == len(mesh.vertices)


def mark(mesh, key):
    """Makes a key the add-on's own."""
    key.interpolation, mesh[_NAME] = _MARK, key.name


def keep_alone(mesh, own):
    """Makes all other keys that were the add-on's, as copies of the key, the user's. own: a ShapeKey, or None."""
    for key in mesh.shape_keys.key_blocks if mesh.shape_keys else ():
        if key.interpolation == _MARK and key != own:
            key.interpolation = _UNMARKED


def forget(mesh):
    mesh.pop(_NAME, None)


def why_hidden(ob):
    """A sentence where the key doesn't display the deformation because of what was done in the list of shape keys; or
    ''."""
    key = find(ob.data)
    if key is None:
        return ""
    if key == ob.data.shape_keys.reference_key:
        return (f"Its shape key '{key.name}' has become the first, from which all others start, so nothing is "
                "computed: move it down in the list of shape keys.")
    alone = ob.active_shape_key if ob.show_only_shape_key else None
    if alone is not None and alone != key:
        return (f"The shape key '{alone.name}' is shown alone, so the deformation isn't seen, and nothing is computed: "
                "click the pin under the list of shape keys.")
    if key.mute:
        return f"Its shape key '{key.name}' is muted, so nothing is computed: switch it on in the list of shape keys."
    return ""


def factor(ob, key):
    """The factor by which the key displays the offsets."""
    if why_hidden(ob):
        return 0.0
    return 1.0 if ob.show_only_shape_key else key.value


# Animation of its value

_VARIABLE = 'detail_deform_factor'


def drive(key, ob, path):
    """Has the value follow the factor of the modifier, an animated property of the object. Only where it is animated:
    the driver makes Blender evaluate the mesh anew whenever the object moves. path: '': it is not, or no longer."""
    target = _own_target(key)
    if not path and target is not None:
        key.driver_remove('value')
    if not path or target is None and _driver(key) is not None:
        return
    if target is None:
        driver = key.driver_add('value').driver
        driver.type = 'AVERAGE'
        variable = driver.variables.new()
        variable.name, variable.type = _VARIABLE, 'SINGLE_PROP'
        target = variable.targets[0]
    if (target.id, target.data_path) != (ob, path):
        target.id, target.data_path = ob, path


def _driver(key):
    animation = key.id_data.animation_data
    return animation.drivers.find(key.path_from_id('value')) if animation else None


def _own_target(key):
    """The target of the driver that follows the modifier's factor, or None."""
    found = _driver(key)
    variables = list(found.driver.variables) if found is not None else ()
    return variables[0].targets[0] if len(variables) == 1 and variables[0].name == _VARIABLE else None


def is_driven(key):
    """Whether the value follows the modifier's factor."""
    return _own_target(key) is not None


def is_animated(key):
    """Whether the user has keyed or driven the value."""
    return actions.is_animated(key, 'value') or _driver(key) is not None and not is_driven(key)


def remove_animation(key):
    if _driver(key) is not None:
        key.driver_remove('value')
    actions.remove_curves(key, 'value')
