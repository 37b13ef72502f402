# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether what is computed reaches the modifier that shows it."""

from . import node_group, offset_attribute

# Modifiers that may put another mesh, without its attributes, in the place of the one they get. All others hand
# them on.
_MAY_REPLACE = {'NODES', 'REMESH', 'SKIN', 'MESH_SEQUENCE_CACHE', 'OCEAN', 'FLUID', 'EXPLODE', 'PARTICLE_INSTANCE',
                'VOLUME_TO_MESH'}


def why_not(ob, depsgraph):
    """A sentence where the modifiers before Detail Deform leave nothing of the mesh that it could deform, or ''.
    Cheap enough for every update."""
    ours = node_group.find_modifier(ob)
    shown = [m for m in ob.modifiers if m == ours or _may_replace(m, depsgraph)]
    before = shown[:shown.index(ours)] if ours else []
    # Where one behind Detail Deform may take the offsets away again, nothing is known.
    if not before or shown[-1] != ours:
        return ""
    into, out_of = ob.data.evaluated_get(depsgraph), ob.evaluated_get(depsgraph).data
    if offset_attribute.find(into) is None or out_of is None or offset_attribute.find(out_of) is not None:
        return ""
    names = ' or '.join(f"'{m.name}'" for m in before)
    return (f"Modifier {names} before Detail Deform makes another mesh, which the deformation does not reach: move "
            "Detail Deform in front of it.")


def influence_gone(ob):
    """A sentence where the influence refers to no group of the object, or ''."""
    name, invert = ob.detail_deform.influence, ob.detail_deform.invert_influence
    if not name or name in ob.vertex_groups or name in ob.data.attributes:
        return ""
    return (f"Influence refers to the vertex group '{name}', which '{ob.name}' does not have, so that "
            f"{'all' if invert else 'nothing'} of the deformation is shown: choose another group, or none.")


def _may_replace(modifier, depsgraph):
    return modifier.type in _MAY_REPLACE and (
        modifier.show_render if depsgraph.mode == 'RENDER' else modifier.show_viewport)
