# SPDX-License-Identifier: GPL-3.0-or-later
"""The modifiers that pose a mesh: its armatures with what else moves vertices before them, or where there is none, all
that move vertices. Examples of its poses are made with these alone; what comes behind them, and what makes vertices,
works on the result of the examples as it did on the pose."""

from . import node_group, source_pose
from .below import MOVERS
from .mesh_data import MeshProblem

# Whose copies of the mesh each go a way of their own, which one mesh can't.
_COPIERS = {'ARRAY', 'MIRROR', 'SCREW'}


def of(ob):
    """Raises MeshProblem where there are none, or what they make is more than a pose of the mesh."""
    known = remembered(ob)
    shown = [m for m in _others(ob) if m.show_viewport or m in known]
    found = _of_type(shown, {'ARMATURE'}) or _of_type(shown, MOVERS) or _of_type(shown, {'NODES'})
    if not found:
        raise MeshProblem(f"No modifier poses '{ob.name}': give it an Armature, or another one that moves its "
                          "vertices, and show it in the viewport.")
    earlier = shown[:shown.index(found[-1]) + 1]
    for modifier in earlier:
        if modifier.type in _COPIERS:
            raise MeshProblem(f"'{modifier.name}' copies the mesh before '{found[-1].name}' poses it, so each copy has "
                              f"a pose of its own, which the mesh alone can't have: apply '{modifier.name}' first.")
    return [m for m in earlier if m in found or m.type in MOVERS]


def _of_type(modifiers, types):
    return [m for m in modifiers if m.type in types and (m.type != 'ARMATURE' or m.object)]


def rigs(ob):
    """The armature objects among what poses it."""
    return [m.object for m in of(ob) if m.type == 'ARMATURE']


def remembered(ob):
    """The modifiers of whose poses there are examples. For each of those that has lost its name, as by being renamed,
    another one of its type is taken."""
    others, found, gone = _others(ob), [], []
    for line in ob.detail_deform.posed_by.split('\n'):
        kind, _, name = line.partition(' ')
        named = [m for m in others if (m.type, m.name) == (kind, name)]
        found += named
        gone += [kind] * (not named)
    for kind in gone:
        found += [m for m in others if m.type == kind and m not in found][:1]
    return [m for m in others if m in found]


def _others(ob):
    """All its modifiers but the add-on's own."""
    return [m for m in ob.modifiers if m not in (node_group.find_modifier(ob), node_group.find_cache(ob))]


def remember(ob):
    """That its examples are made of what these modifiers do."""
    ob.detail_deform.posed_by = '\n'.join(f'{m.type} {m.name}' for m in of(ob))


def twice(ob):
    """Names of the modifiers that are seen to do once more what examples have been made of."""
    return [m.name for m in remembered(ob) if m.show_viewport] if ob.detail_deform.examples else []


def switch_off(ob):
    """In renders too. Returns their names."""
    found = [m for m in remembered(ob) if m.show_viewport or m.show_render]
    for modifier in found:
        modifier.show_viewport = modifier.show_render = False
    return [m.name for m in found]


class Alone:
    """While it lasts, these modifiers are shown and no others; shape keys keep their values."""

    def __init__(self, ob):
        self._ob, self._names = ob, {m.name for m in of(ob)}

    def __enter__(self):
        self._shown = {m.name: m.show_viewport for m in self._ob.modifiers}
        self._set({name: name in self._names for name in self._shown})
        return self

    def __exit__(self, *_):
        self._set(self._shown)

    def _set(self, shown):
        for modifier in self._ob.modifiers:
            if modifier.show_viewport != shown[modifier.name]:
                modifier.show_viewport = shown[modifier.name]

    def pose(self, depsgraph):
        """(n, 3) float32: of the mesh's vertices, in its own space. Raises MeshProblem."""
        return source_pose.evaluated_pose(self._ob, depsgraph)
