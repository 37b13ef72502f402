# SPDX-License-Identifier: GPL-3.0-or-later
"""The modifiers that pose a mesh: its armatures and the deforming modifiers before them, or without armatures all
deforming modifiers. Example poses are evaluated with these alone; later modifiers, and those that change the vertex
count, act on the result of the examples as they did on the pose."""

from . import cache_modifier, deform_modifier, source_pose
from .partial_evaluation import MOVERS
from .mesh_data import MeshProblem

# Each of their copies of the mesh is posed differently, which one example mesh can't represent.
_COPY_MESH = {'ARRAY', 'MIRROR', 'SCREW'}


def of(ob):
    """[modifier]: those that pose the mesh. Raises MeshProblem if there are none, or a modifier before the last of them
    copies the mesh."""
    known = remembered(ob)
    shown = [m for m in _others(ob) if m.show_viewport or m in known]
    found = _of_type(shown, {'ARMATURE'}) or _of_type(shown, MOVERS) or _of_type(shown, {'NODES'})
    if not found:
        raise MeshProblem(f"No modifier poses '{ob.name}': give it an Armature, or another one that moves its "
                          "vertices, and show it in the viewport.")
    earlier = shown[:shown.index(found[-1]) + 1]
    for modifier in earlier:
        if modifier.type in _COPY_MESH:
            raise MeshProblem(f"'{modifier.name}' copies the mesh before '{found[-1].name}' poses it, so each copy has "
                              f"a pose of its own, which the mesh alone can't have: apply '{modifier.name}' first.")
    return [m for m in earlier if m in found or m.type in MOVERS]


def _of_type(modifiers, types):
    return [m for m in modifiers if m.type in types and (m.type != 'ARMATURE' or m.object)]


def rigs(ob):
    """[armature object] of the modifiers of of()."""
    return [m.object for m in of(ob) if m.type == 'ARMATURE']


def remembered(ob):
    """[modifier] from whose poses examples were made, by their stored types and names. For a name that no longer
    exists, as after renaming, the first other modifier of the same type is taken."""
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
    """[modifier]: all but the add-on's own."""
    return [m for m in ob.modifiers if m not in (deform_modifier.find(ob), cache_modifier.find(ob))]


def remember(ob):
    """Stores the modifiers of of() as those from whose poses the examples are made."""
    ob.detail_deform.posed_by = '\n'.join(f'{m.type} {m.name}' for m in of(ob))


def applied_twice(ob):
    """[str]: names of the shown modifiers from which examples were made: their pose is applied twice."""
    return [m.name for m in remembered(ob) if m.show_viewport] if ob.detail_deform.examples else []


def switch_off(ob):
    """Disables the modifiers from which examples were made, in renders too. Returns their names."""
    found = [m for m in remembered(ob) if m.show_viewport or m.show_render]
    for modifier in found:
        modifier.show_viewport = modifier.show_render = False
    return [m.name for m in found]


class OnlyPosers:
    """Context manager: of the modifiers only those of of() are shown in the viewport; shape keys keep their values."""

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
        """(n, 3) float32: evaluated positions of the mesh's vertices in its local space. Raises MeshProblem."""
        return source_pose.evaluated_pose(self._ob, depsgraph)
