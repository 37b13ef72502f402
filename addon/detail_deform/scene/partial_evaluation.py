# SPDX-License-Identifier: GPL-3.0-or-later
"""Evaluates a mesh with those modifiers alone that keep its vertices: all modifiers before the first that changes the
vertex count, and after it those that depend on a point's position and groups alone, as an Armature after a Mirror.

The modifiers are re-evaluated on Blender's evaluated copy of the object, with the other modifiers temporarily disabled.
Nothing in the file is changed, so it works during a frame change, in a render, and for a linked object."""

import contextlib

from . import deform_modifier, mesh_data, node_group

# Modifiers that move vertices. All but MESH_SEQUENCE_CACHE keep the vertex count.
MOVERS = {'ARMATURE', 'CAST', 'CLOTH', 'CORRECTIVE_SMOOTH', 'CURVE', 'DISPLACE', 'HOOK', 'LAPLACIANDEFORM',
          'LAPLACIANSMOOTH', 'LATTICE', 'MESH_CACHE', 'MESH_DEFORM', 'MESH_SEQUENCE_CACHE', 'SHRINKWRAP',
          'SIMPLE_DEFORM', 'SMOOTH', 'SOFT_BODY', 'SURFACE_DEFORM', 'WARP', 'WAVE'}
# Those whose effect on a point depends on its position and vertex groups alone, not on other points.
_POINTWISE = {'ARMATURE', 'CURVE', 'LATTICE'}
# Those that keep vertices and their positions.
_KEEP_POSITIONS = {'DATA_TRANSFER', 'NORMAL_EDIT', 'TRIANGULATE', 'UV_PROJECT', 'UV_WARP', 'VERTEX_WEIGHT_EDIT',
                   'VERTEX_WEIGHT_MIX', 'VERTEX_WEIGHT_PROXIMITY', 'WEIGHTED_NORMAL'}
# Those that are taken to change the vertex count whatever their settings; for SUBSURF, MIRROR and ARRAY see
# _changes_count().
_CHANGE_COUNT = {'EXPLODE', 'MULTIRES', 'PARTICLE_INSTANCE', 'REMESH', 'SCREW', 'SKIN', 'SOLIDIFY', 'WIREFRAME'}


def _changes_count(modifier, flag):
    """Whether a modifier with these settings changes the vertex count, whatever the mesh. flag: of _show_property()."""
    if modifier.type == 'SUBSURF':
        return (modifier.render_levels if flag == 'show_render' else modifier.levels) > 0
    if modifier.type == 'MIRROR':
        return any(modifier.use_axis)
    if modifier.type == 'ARRAY':
        return modifier.fit_type != 'FIXED_COUNT' or modifier.count > 1
    return modifier.type in _CHANGE_COUNT


def _show_property(depsgraph):
    return 'show_render' if depsgraph.mode == 'RENDER' else 'show_viewport'


# Whether a modifier may change the vertex count: any type but those known to keep it, and the deformation's own.
def _may_change_count(ob, modifier):
    if modifier.type == 'MESH_SEQUENCE_CACHE':
        return True
    return modifier.type not in MOVERS | _KEEP_POSITIONS and modifier != deform_modifier.find(ob)


def _used_with_cut(ob, flag, cut):
    """(k,) bool: the enabled modifiers that are evaluated if modifier number cut is the first to change the vertex
    count: all before it, and after it those of _POINTWISE and the deformation's own."""
    own = deform_modifier.find(ob)
    return [getattr(m, flag) and (k < cut or m.type in _POINTWISE or m == own) for k, m in enumerate(ob.modifiers)]


def _first_changing_count(ob, flag):
    """Index of the first enabled modifier that certainly changes the vertex count; None if there is none."""
    return next((k for k, m in enumerate(ob.modifiers) if getattr(m, flag) and _changes_count(m, flag)), None)


_RENDER_PROPERTIES = ('show_viewport', 'show_render', 'levels', 'render_levels')


def differs_in_renders(ob, scene):
    """Whether renders may evaluate the object to other vertices than the viewport does."""
    return bool(differing_in_renders(ob, scene))


def differing_in_renders(ob, scene):
    """[modifier] whose vertices may differ between renders and the viewport: through subdivision levels, Simplify,
    being enabled in one of them alone, drivers on these properties, or an Is Viewport node."""
    paths = [curve.data_path for curve in ob.animation_data.drivers] if ob.animation_data else ()
    driven = {path for path in paths if path.startswith('modifiers[') and path.rpartition('.')[2] in _RENDER_PROPERTIES}

    def is_unlike(modifier):
        return (modifier.show_viewport != modifier.show_render
                or _levels(modifier, scene, 'show_viewport') != _levels(modifier, scene, 'show_render')
                or modifier.type == 'NODES' and _has_is_viewport(modifier.node_group))
    return [m for m in ob.modifiers if _may_change_count(ob, m) and (
        any(path.rpartition('.')[0] == m.path_from_id() for path in driven)
        or (m.show_viewport or m.show_render) and is_unlike(m))]


def _levels(modifier, scene, flag):
    """The subdivision levels as limited by Simplify; 0 for modifiers without levels."""
    if modifier.type not in {'SUBSURF', 'MULTIRES'}:
        return 0
    render, in_render = scene.render, flag == 'show_render'
    limit = render.simplify_subdivision_render if in_render else render.simplify_subdivision
    levels = modifier.render_levels if in_render else modifier.levels
    return min(levels, limit) if render.use_simplify else levels


def _has_is_viewport(tree):
    """Whether a node tree contains an Is Viewport node, so that its result may differ in renders."""
    return any(node.bl_idname == 'GeometryNodeIsViewport' for node in node_group.nodes_of(tree))


@contextlib.contextmanager
def deformed(ob, evaluated, depsgraph):
    """Context manager: (evaluated mesh with the original's vertex count, (k,) bool of the modifiers that produced it).
    (None, []) where no cut of the stack keeps the count. The mesh is valid inside the context only."""
    flag, count = _show_property(depsgraph), len(ob.data.vertices)
    first = _first_changing_count(ob, flag)
    is_edited = ob.mode == 'EDIT'  # in Edit Mode the evaluated mesh may have no readable data
    if first is None and len(evaluated.data.vertices) == count and not is_edited:
        yield evaluated.data, [getattr(m, flag) for m in ob.modifiers]
        return
    cuts = [k for k, m in enumerate(ob.modifiers)
            if getattr(m, flag) and _may_change_count(ob, m) and (first is None or k < first)]
    if first is not None or is_edited:
        cuts.append(len(ob.modifiers) if first is None else first)
    for cut in reversed(cuts):
        used = _used_with_cut(ob, flag, cut)
        with _evaluated_mesh_with(evaluated, depsgraph, flag, used) as mesh:
            if len(mesh.vertices) == count:
                yield mesh, used
                return
    yield None, []


def positions_with(ob, depsgraph, used, count=None):
    """(n, 3) float32: the positions with the chosen modifiers alone; None if their result doesn't have count vertices,
    by default those of the mesh. used: (k,) bool."""
    with _mesh_with(ob, depsgraph, used) as mesh:
        return mesh_data.positions(mesh) if len(mesh.vertices) == (count or len(ob.data.vertices)) else None


def surface_with(ob, depsgraph, used):
    """((n, 3) float32, (m, 3) int32): positions and triangles with the chosen modifiers alone. used: (k,) bool."""
    with _mesh_with(ob, depsgraph, used) as mesh:
        return mesh_data.positions(mesh), mesh_data.triangles(mesh)


def _mesh_with(ob, depsgraph, used):
    return _evaluated_mesh_with(ob.evaluated_get(depsgraph), depsgraph, _show_property(depsgraph),
                                [bool(use) for use in used])


@contextlib.contextmanager
def _evaluated_mesh_with(evaluated, depsgraph, flag, used):
    before = [False] * len(evaluated.modifiers)
    evaluated.modifiers.foreach_get(flag, before)
    # foreach_set, unlike assignment, triggers no update.
    evaluated.modifiers.foreach_set(flag, used)
    try:
        # With these arguments to_mesh() re-evaluates the modifiers.
        yield evaluated.to_mesh(preserve_all_data_layers=True, depsgraph=depsgraph)
    finally:
        evaluated.to_mesh_clear()
        evaluated.modifiers.foreach_set(flag, before)


def left_out(ob, depsgraph):
    """A sentence that names the modifiers whose motion is not followed, as they come after one that changes the vertex
    count; or ''. Geometry Nodes there are always named, whether or not they move vertices."""
    flag = 'show_viewport'
    first = _first_changing_count(ob, flag)
    if first is None and len(ob.evaluated_get(depsgraph).data.vertices) != len(ob.data.vertices):
        # One of several has changed the count. What comes after the last of them is lost whichever it was.
        first = max((k for k, m in enumerate(ob.modifiers)
                     if getattr(m, flag) and _may_change_count(ob, m)), default=None)
    if first is None:
        return ""
    used = _used_with_cut(ob, flag, first)
    lost = [m.name for k, m in enumerate(ob.modifiers)
            if k > first and getattr(m, flag) and m.type in MOVERS | {'NODES'} and not used[k]]
    if not lost:
        return ""
    return (f"What {', '.join(map(repr, lost))} of '{ob.name}' does is left out, for it comes behind "
            f"'{ob.modifiers[first].name}', which makes vertices: move it before that if it matters.")
