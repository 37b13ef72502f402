# SPDX-License-Identifier: GPL-3.0-or-later
"""The shape key that displays the offsets of a mesh in place of the deformation's modifier (channel.py). It is the
add-on's own: whatever reads the shape keys of a mesh leaves it out."""

NAME = 'Detail Deform'
# Interpolation has no effect on relative keys, and a shape key can hold no custom property: this value tells the
# add-on's key, which keeps it when it is renamed, copied, saved and undone.
_MARK = 'KEY_BSPLINE'
_NAME = 'detail_deform_key'  # custom property of the mesh: the key's name when it was made


def find(mesh):
    """The ShapeKey, or None."""
    if not has_had_one(mesh) or mesh.shape_keys is None:
        return None
    keys = mesh.shape_keys
    named = keys.key_blocks.get(mesh[_NAME])
    return next((key for key in (named, *keys.key_blocks)
                 if key is not None and key.interpolation == _MARK and key != keys.reference_key), None)


def has_had_one(mesh):
    """Whether the key was made and not removed by the add-on. Without a key it was removed or applied by hand."""
    return _NAME in mesh


def others(mesh):
    """[ShapeKey]: all but the add-on's; the reference key first."""
    if mesh.shape_keys is None:
        return []
    own = find(mesh)
    return [key for key in mesh.shape_keys.key_blocks if key != own]


def mark(mesh, key):
    """Makes a key the add-on's own."""
    key.interpolation, mesh[_NAME] = _MARK, key.name


def forget(mesh):
    mesh.pop(_NAME, None)


def why_hidden(ob):
    """A sentence where the user has switched the key off, in the list of shape keys; or ''."""
    key = find(ob.data)
    if key is None:
        return ""
    if ob.show_only_shape_key and ob.active_shape_key != key:
        return (f"The shape key '{ob.active_shape_key.name}' is shown alone, so the deformation isn't seen, and "
                "nothing is computed: click the pin under the list of shape keys.")
    if key.mute:
        return f"Its shape key '{key.name}' is muted, so nothing is computed: switch it on in the list of shape keys."
    return ""


def factor(ob, key):
    """The factor by which the key displays the offsets."""
    if why_hidden(ob):
        return 0.0
    return 1.0 if ob.show_only_shape_key else key.value
