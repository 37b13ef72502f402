# SPDX-License-Identifier: GPL-3.0-or-later
"""Where modifiers show a mesh's own vertices, and the similarity by which those behind the deformation take some of
them there. With it an empty stands on the surface that is seen and pulls the way it is moved, whatever poses the mesh:
curves, lattices, hooks, several armatures. Where one armature alone does, the bone that carries the empty gives its
motion in every frame (skin.py); this one is measured when the empty is placed."""

import numpy as np

from . import below, mesh_data, node_group, skin, stack, start

# They add something of their own to the vertices' places, so that what is pulled goes the way it is pulled; all others
# map places to places, and turn what is pulled with the rest.
_ADDERS = {'CORRECTIVE_SMOOTH', 'DISPLACE', 'LAPLACIANSMOOTH', 'SHRINKWRAP', 'SMOOTH', 'CLOTH', 'SOFT_BODY'}


def _movers(ob):
    """The numbers of the modifiers that are shown and may move vertices, the deformation's own left out."""
    own = node_group.find_modifier(ob)
    return [k for k, m in enumerate(ob.modifiers)
            if m.show_viewport and m != own and (m.type in below.MOVERS or m.type == 'NODES')]


def needs_measuring(ob):
    """Whether anything but one plain armature poses it."""
    modifiers = [ob.modifiers[k] for k in _movers(ob)]
    return bool(modifiers) and not (len(modifiers) == 1 and skin.is_plain(ob, modifiers[0]))


def positions(ob, depsgraph):
    """(n, 3) float32: where the modifiers show the mesh's own vertices, in the object's space; None where they make
    others of them in a way that can't be followed."""
    if not _movers(ob):
        return start.visible(ob)
    with below.deformed(ob, ob.evaluated_get(depsgraph), depsgraph) as (mesh, _):
        return None if mesh is None else mesh_data.positions(mesh)


def motions(ob, parts, depsgraph):
    """(4, 4) float64 for each of some arrays of vertices: from where the mesh's own shape has them to where they are
    seen. None for each where that is the same, where bones tell it, or where it can't be known."""
    unknown = [None] * len(parts)
    if not needs_measuring(ob):
        return unknown
    with below.deformed(ob, ob.evaluated_get(depsgraph), depsgraph) as (mesh, used):
        if mesh is None or not any(used[k] for k in _movers(ob)):
            return unknown
        after = mesh_data.positions(mesh)
    # Before the first pull there is no modifier of its own: as if it stood where it will.
    modifiers, own = list(ob.modifiers), node_group.find_modifier(ob)
    end = modifiers.index(own) + 1 if own else stack.place_of(ob)
    adders = [use and k >= end and m.type in _ADDERS for k, (m, use) in enumerate(zip(modifiers, used))]
    before = below.by(ob, depsgraph, [use and k < end for k, use in enumerate(used)])
    mapped = below.by(ob, depsgraph, np.array(used) & ~np.array(adders)) if any(adders) else after
    if before is None or mapped is None or not np.isfinite([before, mapped, after]).all():
        return unknown
    visible = start.visible(ob)
    return [_through(similarity, visible[part].mean(axis=0), after[part].mean(axis=0))
            for part, similarity in zip(parts, start.similarities(ob, parts, before, mapped))]


def _through(motion, place, there):
    """(4, 4): the same turn and size, so that it takes one place to another."""
    result = motion.copy()
    result[:3, 3] = there - motion[:3, :3] @ place
    return result
