# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the offset attribute and the influence reach the modifier that displays them."""

from . import deform_modifier, display_key, offset_attribute

# Modifiers that may replace their input by another mesh without its attributes. All others keep the attributes.
_MAY_REPLACE = {'NODES', 'REMESH', 'SKIN', 'MESH_SEQUENCE_CACHE', 'OCEAN', 'FLUID', 'EXPLODE', 'PARTICLE_INSTANCE',
                'VOLUME_TO_MESH'}


def why_not(subject):
    """A sentence where modifiers before Detail Deform replace the mesh, so that the offsets don't reach it; or ''.
    Fast enough for every update."""
    ours, depsgraph = subject.modifier, subject.depsgraph
    shown = [m for m in subject.ob.modifiers if m == ours or _may_replace(m, depsgraph)]
    before = shown[:shown.index(ours)] if ours else []
    # If one after Detail Deform may remove the attribute again, its absence proves nothing.
    if not before or shown[-1] != ours or display_key.find(subject.mesh):
        return ""
    into, out_of = subject.mesh.evaluated_get(depsgraph), subject.ob.evaluated_get(depsgraph).data
    if offset_attribute.find(into) is None or out_of is None or offset_attribute.find(out_of) is not None:
        return ""
    names = ' or '.join(f"'{m.name}'" for m in before)
    return (f"Modifier {names} before Detail Deform makes another mesh, which the deformation does not reach: move "
            "Detail Deform in front of it.")


def influence_gone(ob):
    """A sentence where the influence names neither a vertex group nor an attribute of the object; or ''."""
    name, invert = ob.detail_deform.influence, ob.detail_deform.invert_influence
    if not name or name in ob.vertex_groups or name in ob.data.attributes:
        return ""
    return (f"Influence refers to the vertex group '{name}', which '{ob.name}' does not have, so that "
            f"{'all' if invert else 'nothing'} of the deformation is shown: choose another group, or none.")


def _may_replace(modifier, depsgraph):
    return modifier.type in _MAY_REPLACE and deform_modifier.is_shown(modifier, depsgraph)
