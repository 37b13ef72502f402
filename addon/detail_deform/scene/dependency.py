# SPDX-License-Identifier: GPL-3.0-or-later
"""Keeps the empties and curves of a bound object evaluated even where they are hidden.

A render doesn't evaluate objects that are disabled in renders, or are in a disabled collection, as those of rigs often
are, so their transforms and shapes stay as they were. A driver on the bound object is a dependency on every object that
it reads, which Blender then evaluates. The driver's value is not used.
"""

_PROPERTY = 'dependency'
_GEOMETRY = 'dimensions[0]'  # for which Blender evaluates the object's geometry, with its modifiers


def depend_on(ob, wanted):
    """Makes the object depend on these, and on no others. wanted: [(variable type, object, bone)]: TRANSFORMS of an
    object, or of its bone; SINGLE_PROP for its geometry. Only differences are written: each change makes Blender
    rebuild the relations of the scene's dependency graph, and a new variable's name is compared with those of all
    others."""
    needed = _needed(ob)
    if needed is None:
        release(ob)
        driver = ob.detail_deform.driver_add(_PROPERTY).driver
        driver.type = 'SUM'
        needed = []
    else:
        driver = _find(ob).driver
    for _ in needed[len(wanted):]:
        driver.variables.remove(driver.variables[-1])
    for number, (kind, target, bone) in enumerate(wanted):
        if needed[number:number + 1] == [(kind, target, bone)]:
            continue
        variable = driver.variables[number] if number < len(needed) else driver.variables.new()
        variable.type = kind
        variable.targets[0].id = target
        if kind == 'TRANSFORMS':
            variable.targets[0].transform_type, variable.targets[0].bone_target = 'LOC_X', bone
        else:
            variable.targets[0].bone_target = ""
            variable.targets[0].data_path = _GEOMETRY


def _find(ob):
    animation = ob.animation_data
    return animation and animation.drivers.find(f'detail_deform.{_PROPERTY}')


def _needed(ob):
    """[(variable type, object, bone)] that the driver reads; None without a working driver."""
    found = _find(ob)
    if found is None or found.mute or found.driver.type != 'SUM':
        return None
    return [(variable.type, variable.targets[0].id, variable.targets[0].bone_target)
            for variable in found.driver.variables]


def release(ob):
    """Removes the driver, and the object's animation data if nothing else is in it."""
    animation = ob.animation_data
    if _find(ob) is None:
        return
    ob.detail_deform.driver_remove(_PROPERTY)
    if not (animation.drivers or animation.action or animation.nla_tracks):
        ob.animation_data_clear()
