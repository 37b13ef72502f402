# SPDX-License-Identifier: GPL-3.0-or-later
"""The displayed positions of a mesh's own vertices, and the similarities by which the modifiers after the deformation
take parts of it there. With them an empty stands on the displayed surface and pulls in the direction in which it is
moved, whether curves, lattices, hooks or several armatures pose the mesh. The similarity is measured once, when the
empty is placed. With a single armature the motion of the empty's bone is used instead, in every frame (skin.py)."""

import numpy as np

from . import channel, deform_modifier, mesh_data, partial_evaluation, skin, stack, start

# These add displacements of their own to the positions, so a pull keeps its direction through them. All others map
# positions to positions, and so rotate a pull too.
_ADD_DISPLACEMENTS = {'CORRECTIVE_SMOOTH', 'DISPLACE', 'LAPLACIANSMOOTH', 'SHRINKWRAP', 'SMOOTH', 'CLOTH', 'SOFT_BODY'}


def _movers(ob):
    """[int]: indices of the shown modifiers that may move vertices, without the deformation's own."""
    own = deform_modifier.find(ob)
    return [k for k, m in enumerate(ob.modifiers)
            if m.show_viewport and m != own and (m.type in partial_evaluation.MOVERS or m.type == 'NODES')]


def has_movers(ob):
    """Whether shown modifiers other than the deformation's own may move vertices."""
    return bool(_movers(ob))


def needs_measuring(ob):
    """Whether modifiers other than a single plain armature (skin.is_plain) pose the mesh."""
    modifiers = [ob.modifiers[k] for k in _movers(ob)]
    return bool(modifiers) and not (len(modifiers) == 1 and skin.is_plain(ob, modifiers[0]))


def positions(ob, depsgraph):
    """(n, 3) float32: displayed positions of the mesh's own vertices, in local space; None if the modifiers change the
    vertex count in a way that can't be followed."""
    if not _movers(ob):
        return start.deformed_positions(ob)
    with partial_evaluation.deformed(ob, ob.evaluated_get(depsgraph), depsgraph) as (mesh, _):
        return None if mesh is None else mesh_data.positions(mesh)


def similarities(ob, parts, depsgraph):
    """[(4, 4) float64]: for each array of vertices in parts the similarity from start.deformed_positions() to the
    displayed positions. [None, …] where they are the same, a bone's motion is used instead, or it can't be measured."""
    unknown = [None] * len(parts)
    if not needs_measuring(ob):
        return unknown
    with partial_evaluation.deformed(ob, ob.evaluated_get(depsgraph), depsgraph) as (mesh, used):
        if mesh is None or not any(used[k] for k in _movers(ob)):
            return unknown
        after = mesh_data.positions(mesh)
    own = deform_modifier.find(ob)
    # Before the first pull the deformation has no modifier: take the place at which it will be added.
    earlier = [*deform_modifier.before(ob), own] if own else (
        [] if channel.wants_key(ob) else list(ob.modifiers)[:stack.index_of_its_place(ob)])
    adders = [use and m not in earlier and m.type in _ADD_DISPLACEMENTS for m, use in zip(ob.modifiers, used)]
    before = partial_evaluation.positions_with(
        ob, depsgraph, [use and m in earlier for m, use in zip(ob.modifiers, used)])
    mapped = partial_evaluation.positions_with(
        ob, depsgraph, np.array(used) & ~np.array(adders)) if any(adders) else after
    if before is None or mapped is None or not np.isfinite([before, mapped, after]).all():
        return unknown
    visible = start.deformed_positions(ob)
    return [_mapping_point(similarity, visible[part].mean(axis=0), after[part].mean(axis=0))
            for part, similarity in zip(parts, start.similarities(ob, parts, before, mapped))]


def _mapping_point(similarity, point, image):
    """(4, 4): the similarity with another translation, so that it takes point to image, (3,) each."""
    result = similarity.copy()
    result[:3, 3] = image - similarity[:3, :3] @ point
    return result
