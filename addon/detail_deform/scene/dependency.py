# SPDX-License-Identifier: GPL-3.0-or-later
"""Keeps the empties of a bound object evaluated wherever they are hidden.

A render leaves out objects that are disabled in renders, or whose collection is, as those of a rig
often are; nothing then moves them from frame to frame. A driver is something that the object visibly
needs, so Blender evaluates what it reads. Its value is of no use.
"""

_PROPERTY = 'dependency'


def depend_on(ob, targets):
    """Makes the object need these objects' places, and no others as before. Only what differs is written: for each
    thing written Blender finds out anew what all objects of the scene need, and it compares the name of a new variable
    with all others."""
    needed = _needed(ob)
    if needed is None:
        release(ob)
        driver = ob.detail_deform.driver_add(_PROPERTY).driver
        driver.type = 'SUM'
        needed = []
    else:
        driver = _find(ob).driver
    for _ in needed[len(targets):]:
        driver.variables.remove(driver.variables[-1])
    for number, target in enumerate(targets):
        if needed[number:number + 1] == [('TRANSFORMS', target)]:
            continue
        variable = driver.variables[number] if number < len(needed) else driver.variables.new()
        variable.type = 'TRANSFORMS'
        variable.targets[0].id = target
        variable.targets[0].transform_type = 'LOC_X'


def _find(ob):
    animation = ob.animation_data
    return animation and animation.drivers.find(f'detail_deform.{_PROPERTY}')


def _needed(ob):
    """In which ways it needs which objects so far; None without a driver that works."""
    found = _find(ob)
    if found is None or found.mute or found.driver.type != 'SUM':
        return None
    return [(variable.type, variable.targets[0].id) for variable in found.driver.variables]


def release(ob):
    """Leaves the object's animation data as it would be without the driver."""
    animation = ob.animation_data
    if _find(ob) is None:
        return
    ob.detail_deform.driver_remove(_PROPERTY)
    if not (animation.drivers or animation.action or animation.nla_tracks):
        ob.animation_data_clear()
