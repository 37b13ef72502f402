# SPDX-License-Identifier: GPL-3.0-or-later
"""Evaluates a mesh with those modifiers alone that keep its vertices: all modifiers before the first that changes the
vertex count, and after it those that depend on a point's position and groups alone, as an Armature after a Mirror.

The modifiers are re-evaluated on Blender's evaluated copy of the object, with the other modifiers temporarily disabled.
Nothing in the file is changed, so it works during a frame change, in a render, and for a linked object."""

import contextlib

from . import mesh_data, node_group

# Modifiers that move vertices. All but MESH_SEQUENCE_CACHE keep the vertex count.
MOVERS = {'ARMATURE', 'CAST', 'CLOTH', 'CORRECTIVE_SMOOTH', 'CURVE', 'DISPLACE', 'HOOK', 'LAPLACIANDEFORM',
          'LAPLACIANSMOOTH', 'LATTICE', 'MESH_CACHE', 'MESH_DEFORM', 'MESH_SEQUENCE_CACHE', 'SHRINKWRAP',
          'SIMPLE_DEFORM', 'SMOOTH', 'SOFT_BODY', 'SURFACE_DEFORM', 'WARP', 'WAVE'}
# Those whose effect on a point depends on its position and vertex groups alone, not on other points.
_BY_POINT = {'ARMATURE', 'CURVE', 'LATTICE'}
_KEEPERS = {'DATA_TRANSFER', 'NORMAL_EDIT', 'TRIANGULATE', 'UV_PROJECT', 'UV_WARP', 'VERTEX_WEIGHT_EDIT',
            'VERTEX_WEIGHT_MIX', 'VERTEX_WEIGHT_PROXIMITY', 'WEIGHTED_NORMAL'}  # keep vertices and their positions
# Those that are taken to change the vertex count whatever their settings; for SUBSURF, MIRROR and ARRAY see _makes().
_MAKERS = {'EXPLODE', 'MULTIRES', 'PARTICLE_INSTANCE', 'REMESH', 'SCREW', 'SKIN', 'SOLIDIFY', 'WIREFRAME'}


def _makes(modifier, flag):
    """Whether a modifier with these settings changes the vertex count, whatever the mesh. flag: of _flag()."""
    if modifier.type == 'SUBSURF':
        return (modifier.render_levels if flag == 'show_render' else modifier.levels) > 0
    if modifier.type == 'MIRROR':
        return any(modifier.use_axis)
    if modifier.type == 'ARRAY':
        return modifier.fit_type != 'FIXED_COUNT' or modifier.count > 1
    return modifier.type in _MAKERS


def _flag(depsgraph):
    return 'show_render' if depsgraph.mode == 'RENDER' else 'show_viewport'


# Whether a modifier may change the vertex count: any type but those known to keep it, and the deformation's own.
def _perhaps_makes(ob, modifier):
    if modifier.type == 'MESH_SEQUENCE_CACHE':
        return True
    return modifier.type not in MOVERS | _KEEPERS and modifier != node_group.find_modifier(ob)


def _chosen(ob, flag, cut):
    """(k,) bool: the enabled modifiers that are evaluated if modifier number cut is the first to change the vertex
    count: all before it, and after it those of _BY_POINT and the deformation's own."""
    own = node_group.find_modifier(ob)
    return [getattr(m, flag) and (k < cut or m.type in _BY_POINT or m == own) for k, m in enumerate(ob.modifiers)]


def _first(ob, flag):
    """Index of the first enabled modifier that certainly changes the vertex count; None if there is none."""
    return next((k for k, m in enumerate(ob.modifiers) if getattr(m, flag) and _makes(m, flag)), None)


_SHOWN_IN = ('show_viewport', 'show_render', 'levels', 'render_levels')


def differs_in_renders(ob, scene):
    """Whether renders may evaluate the object to other vertices than the viewport does."""
    return bool(unlike_in_renders(ob, scene))


def unlike_in_renders(ob, scene):
    """[modifier] whose vertices may differ between renders and the viewport: through subdivision levels, Simplify,
    being enabled in one of them alone, drivers on these properties, or an Is Viewport node."""
    paths = [curve.data_path for curve in ob.animation_data.drivers] if ob.animation_data else ()
    driven = {path for path in paths if path.startswith('modifiers[') and path.rpartition('.')[2] in _SHOWN_IN}

    def is_unlike(modifier):
        return (modifier.show_viewport != modifier.show_render
                or _levels(modifier, scene, 'show_viewport') != _levels(modifier, scene, 'show_render')
                or modifier.type == 'NODES' and _asks_where(modifier.node_group))
    return [m for m in ob.modifiers if _perhaps_makes(ob, m) and (
        any(path.rpartition('.')[0] == m.path_from_id() for path in driven)
        or (m.show_viewport or m.show_render) and is_unlike(m))]


def _levels(modifier, scene, flag):
    """The subdivision levels as limited by Simplify; 0 for modifiers without levels."""
    if modifier.type not in {'SUBSURF', 'MULTIRES'}:
        return 0
    render, in_render = scene.render, flag == 'show_render'
    most = render.simplify_subdivision_render if in_render else render.simplify_subdivision
    levels = modifier.render_levels if in_render else modifier.levels
    return min(levels, most) if render.use_simplify else levels


def _asks_where(tree):
    """Whether a node tree contains an Is Viewport node, so that its result may differ in renders."""
    return any(node.bl_idname == 'GeometryNodeIsViewport' for node in node_group.all_nodes(tree))


@contextlib.contextmanager
def deformed(ob, evaluated, depsgraph):
    """Context manager: (evaluated mesh with the original's vertex count, (k,) bool of the modifiers that produced it).
    (None, []) where no cut of the stack keeps the count. The mesh is valid inside the context only."""
    flag, count = _flag(depsgraph), len(ob.data.vertices)
    first = _first(ob, flag)
    is_edited = ob.mode == 'EDIT'  # in Edit Mode the evaluated mesh may have no readable data
    if first is None and len(evaluated.data.vertices) == count and not is_edited:
        yield evaluated.data, [getattr(m, flag) for m in ob.modifiers]
        return
    cuts = [k for k, m in enumerate(ob.modifiers)
            if getattr(m, flag) and _perhaps_makes(ob, m) and (first is None or k < first)]
    if first is not None or is_edited:
        cuts.append(len(ob.modifiers) if first is None else first)
    for cut in reversed(cuts):
        chosen = _chosen(ob, flag, cut)
        with _with_alone(evaluated, depsgraph, flag, chosen) as mesh:
            if len(mesh.vertices) == count:
                yield mesh, chosen
                return
    yield None, []


def by(ob, depsgraph, chosen, count=None):
    """(n, 3) float32: the positions with the chosen modifiers alone; None if their result doesn't have count vertices,
    by default those of the mesh. chosen: (k,) bool."""
    with _alone(ob, depsgraph, chosen) as mesh:
        return mesh_data.positions(mesh) if len(mesh.vertices) == (count or len(ob.data.vertices)) else None


def surface(ob, depsgraph, chosen):
    """((n, 3) float32, (m, 3) int32): positions and triangles with the chosen modifiers alone. chosen: (k,) bool."""
    with _alone(ob, depsgraph, chosen) as mesh:
        return mesh_data.positions(mesh), mesh_data.triangles(mesh)


def _alone(ob, depsgraph, chosen):
    return _with_alone(ob.evaluated_get(depsgraph), depsgraph, _flag(depsgraph), [bool(use) for use in chosen])


@contextlib.contextmanager
def _with_alone(evaluated, depsgraph, flag, chosen):
    before = [False] * len(evaluated.modifiers)
    evaluated.modifiers.foreach_get(flag, before)
    # foreach_set, unlike assignment, triggers no update.
    evaluated.modifiers.foreach_set(flag, chosen)
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
    first = _first(ob, flag)
    if first is None and len(ob.evaluated_get(depsgraph).data.vertices) != len(ob.data.vertices):
        # One of several has changed the count. What comes after the last of them is lost whichever it was.
        first = max((k for k, m in enumerate(ob.modifiers) if getattr(m, flag) and _perhaps_makes(ob, m)), default=None)
    if first is None:
        return ""
    chosen = _chosen(ob, flag, first)
    lost = [m.name for k, m in enumerate(ob.modifiers)
            if k > first and getattr(m, flag) and m.type in MOVERS | {'NODES'} and not chosen[k]]
    if not lost:
        return ""
    return (f"What {', '.join(map(repr, lost))} of '{ob.name}' does is left out, for it comes behind "
            f"'{ob.modifiers[first].name}', which makes vertices: move it before that if it matters.")
