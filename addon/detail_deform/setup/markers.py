# SPDX-License-Identifier: GPL-3.0-or-later
"""Markers: numbered vertex groups, or empties parented to the mesh. Equal numbers mark corresponding vertices."""

import re

import numpy as np

from ..scene import mesh_data, selection
from ..scene.mesh_data import MeshProblem

NAME = "Marker {}"
_NUMBERED = re.compile(r'marker[\s._-]*(\d+)', re.IGNORECASE)  # "Marker 3", "marker.003", "Marker 3.001"
MIN_COMMON = 3  # common markers for Automatic, where nobody confirms the match; fewer can't be checked (marker_check)


def _number(name):
    found = _NUMBERED.match(name)
    return int(found.group(1)) if found else None


def _by_groups(ob):
    """{number: vertex}: the vertex with the largest weight in each numbered group. Raises MeshProblem."""
    groups = [(group.name, _number(group.name)) for group in ob.vertex_groups if _number(group.name) is not None]
    found = {}
    if not groups:  # spares reading the weights, which is slow
        return found
    for (name, number), weights in zip(groups, mesh_data.group_weights(ob, [name for name, _ in groups])):
        if weights.max(initial=0) <= 0:
            raise MeshProblem(f"The group '{name}' of '{ob.name}' has no vertex: assign the one that it marks.")
        if number in found:
            raise MeshProblem(f"'{ob.name}' has two markers with the number {number}: rename one of the groups.")
        found[number] = int(weights.argmax())
    return found


def _by_empties(ob):
    """{number: vertex}: the vertex nearest to each numbered empty that is a child of the object. Raises MeshProblem."""
    found, points = {}, None
    for child in ob.children:
        number = _number(child.name) if child.type == 'EMPTY' else None
        if number is None:
            continue
        if number in found:
            raise MeshProblem(f"'{ob.name}' has two markers with the number {number}: rename one of the empties.")
        points = mesh_data.positions(ob.data) if points is None else points
        place = ob.matrix_world.inverted_safe() @ child.matrix_world.translation
        found[number] = int(np.linalg.norm(points - np.array(place, np.float32), axis=1).argmin())
    return found


def of(ob):
    """{number: vertex} of all markers of a mesh object. Raises MeshProblem."""
    if not ob.data.vertices:
        raise MeshProblem(f"'{ob.name}' has no vertices to mark: choose another mesh.")
    groups, empties = _by_groups(ob), _by_empties(ob)
    twice = groups.keys() & empties.keys()
    if twice:
        raise MeshProblem(f"'{ob.name}' has a group and an empty for marker {min(twice)}: rename one of them.")
    return {**groups, **empties}


def counts(ob, source):
    """Numbers of markers on ob, on the source, and with the same number on both, by names alone: cheap enough for the
    panel."""
    here, there = _numbers(ob), _numbers(source) if source else set()
    return len(here), len(there), len(here & there)


def _numbers(ob):
    """{number} of the markers of an object, by names alone."""
    names = [*ob.vertex_groups.keys(), *(child.name for child in ob.children if child.type == 'EMPTY')]
    return {_number(name) for name in names} - {None}


def are_enough(source, target):
    """Whether source and target have at least MIN_COMMON numbers in common, by names alone."""
    return counts(target, source)[2] >= MIN_COMMON


def pairs(source, target):
    """(k, 2) int32: the vertices of source and target with the same marker number, by ascending numbers; k may be 0.
    Raises MeshProblem."""
    of_source, of_target = of(source), of(target)
    both = sorted(of_source.keys() & of_target.keys())
    if of_source and of_target and not both:
        raise MeshProblem(f"'{source.name}' has {len(of_source)} markers and '{target.name}' {len(of_target)}, none "
                          "with the same number: give the same number to the same place on both.")
    return np.array([[of_source[number], of_target[number]] for number in both], np.int32).reshape(-1, 2)


def add(ob, number):
    """Marks the selected vertex, or the one nearest to the mean of several, with a number; 0: the least free one.
    Returns the name of the new group. Raises MeshProblem."""
    chosen = np.flatnonzero(selection.selected(ob))
    if not len(chosen):
        raise MeshProblem("No vertex is selected: select the one to mark.")
    used = _numbers(ob)
    number = number or next(k for k in range(1, len(used) + 2) if k not in used)
    if number in used:
        raise MeshProblem(f"'{ob.name}' has a marker {number} already: choose another number.")
    points = mesh_data.positions(ob.data)[chosen]
    middle = chosen[np.linalg.norm(points - points.mean(0), axis=1).argmin()]
    only = np.zeros(len(ob.data.vertices), bool)
    only[middle] = True
    return selection.new_group(ob, NAME.format(number), only).name


def select(ob, number):
    """Selects the vertex of a marker in Edit Mode, or returns the empty that marks it, if one does. Raises
    MeshProblem."""
    if ob.mode == 'EDIT':
        ob.update_from_editmode()
    vertex = of(ob).get(number)
    if vertex is None:
        raise MeshProblem(f"'{ob.name}' has no marker {number}.")
    empty = next((child for child in ob.children if child.type == 'EMPTY' and _number(child.name) == number), None)
    if empty is None:
        only = np.zeros(len(ob.data.vertices), bool)
        only[vertex] = True
        selection.select(ob, only, extend=False)
    return empty
