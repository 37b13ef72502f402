# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh as its modifiers move its own vertices, below those that make others: before the first of these, with what
moves points behind it that goes by a point's place or groups alone, as an armature behind a Mirror does.

The modifiers are evaluated once more on Blender's evaluated copy of the object, of which others are switched off for
the time being: nothing in the file is touched or needed for it, so it works in a frame, in a render, and of an object
that is linked."""

import contextlib

from . import mesh_data, node_group

MOVERS = {'ARMATURE', 'CAST', 'CLOTH', 'CORRECTIVE_SMOOTH', 'CURVE', 'DISPLACE', 'HOOK', 'LAPLACIANDEFORM',
          'LAPLACIANSMOOTH', 'LATTICE', 'MESH_CACHE', 'MESH_DEFORM', 'MESH_SEQUENCE_CACHE', 'SHRINKWRAP',
          'SIMPLE_DEFORM', 'SMOOTH', 'SOFT_BODY', 'SURFACE_DEFORM', 'WARP', 'WAVE'}
_BY_POINT = {'ARMATURE', 'CURVE', 'LATTICE'}
_KEEPERS = {'DATA_TRANSFER', 'NORMAL_EDIT', 'TRIANGULATE', 'UV_PROJECT', 'UV_WARP', 'VERTEX_WEIGHT_EDIT',
            'VERTEX_WEIGHT_MIX', 'VERTEX_WEIGHT_PROXIMITY', 'WEIGHTED_NORMAL'}  # of vertices, where they are
_MAKERS = {'EXPLODE', 'MULTIRES', 'PARTICLE_INSTANCE', 'REMESH', 'SCREW', 'SKIN', 'SOLIDIFY', 'WIREFRAME'}


def _makes(modifier, flag):
    """Whether it makes other vertices, whatever the mesh."""
    if modifier.type == 'SUBSURF':
        return (modifier.render_levels if flag == 'show_render' else modifier.levels) > 0
    if modifier.type == 'MIRROR':
        return any(modifier.use_axis)
    if modifier.type == 'ARRAY':
        return modifier.fit_type != 'FIXED_COUNT' or modifier.count > 1
    return modifier.type in _MAKERS


def _flag(depsgraph):
    return 'show_render' if depsgraph.mode == 'RENDER' else 'show_viewport'


def _perhaps_makes(ob, modifier):
    if modifier.type == 'MESH_SEQUENCE_CACHE':
        return True
    return modifier.type not in MOVERS | _KEEPERS and modifier != node_group.find_modifier(ob)


def _chosen(ob, flag, cut):
    """Those that are followed where the one of that number is the first that makes vertices: (k,) bool."""
    own = node_group.find_modifier(ob)
    return [getattr(m, flag) and (k < cut or m.type in _BY_POINT or m == own) for k, m in enumerate(ob.modifiers)]


def _first(ob, flag):
    """The number of the first that is sure to make vertices; None where there is none."""
    return next((k for k, m in enumerate(ob.modifiers) if getattr(m, flag) and _makes(m, flag)), None)


_SHOWN_IN = ('show_viewport', 'show_render', 'levels', 'render_levels')


def differs_in_renders(ob, scene):
    """Whether renders may show other vertices of it than the viewport."""
    return bool(unlike_in_renders(ob, scene))


def unlike_in_renders(ob, scene):
    """The modifiers that may make other vertices in renders than in the viewport: by levels, by Simplify, by what is
    shown in one of them alone, by drivers of these, and by nodes that ask where they are."""
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
    """As Simplify leaves them; 0 of modifiers that have none."""
    if modifier.type not in {'SUBSURF', 'MULTIRES'}:
        return 0
    render, in_render = scene.render, flag == 'show_render'
    most = render.simplify_subdivision_render if in_render else render.simplify_subdivision
    levels = modifier.render_levels if in_render else modifier.levels
    return min(levels, most) if render.use_simplify else levels


def _asks_where(tree):
    """Whether nodes give something else in the viewport than in renders."""
    return any(node.bl_idname == 'GeometryNodeIsViewport' for node in node_group.all_nodes(tree))


@contextlib.contextmanager
def deformed(ob, evaluated, depsgraph):
    """While it lasts, the evaluated mesh with the mesh's own vertices, and (k,) bool, which of the modifiers have made
    it. None, and none, where there is no such mesh."""
    flag, count = _flag(depsgraph), len(ob.data.vertices)
    first = _first(ob, flag)
    is_edited = ob.mode == 'EDIT'  # where the evaluated mesh may be none that can be read
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
    """(n, 3) float32: what these of its modifiers alone make of the mesh's own vertices, or of so many; None where they
    make others. chosen: (k,) bool."""
    with _alone(ob, depsgraph, chosen) as mesh:
        return mesh_data.positions(mesh) if len(mesh.vertices) == (count or len(ob.data.vertices)) else None


def surface(ob, depsgraph, chosen):
    """((n, 3) float32, (m, 3) int32): vertices and triangles that these modifiers alone make."""
    with _alone(ob, depsgraph, chosen) as mesh:
        return mesh_data.positions(mesh), mesh_data.triangles(mesh)


def _alone(ob, depsgraph, chosen):
    return _with_alone(ob.evaluated_get(depsgraph), depsgraph, _flag(depsgraph), [bool(use) for use in chosen])


@contextlib.contextmanager
def _with_alone(evaluated, depsgraph, flag, chosen):
    before = [False] * len(evaluated.modifiers)
    evaluated.modifiers.foreach_get(flag, before)
    # Unlike a property's own way, this tells Blender of no change.
    evaluated.modifiers.foreach_set(flag, chosen)
    try:
        # With these arguments it is made anew of the modifiers.
        yield evaluated.to_mesh(preserve_all_data_layers=True, depsgraph=depsgraph)
    finally:
        evaluated.to_mesh_clear()
        evaluated.modifiers.foreach_set(flag, before)


def left_out(ob, depsgraph):
    """What is not followed of what moves it, for it comes behind what makes vertices: a sentence, or ''. Nodes there
    aren't asked whether they move any."""
    flag = 'show_viewport'
    first = _first(ob, flag)
    if first is None and len(ob.evaluated_get(depsgraph).data.vertices) != len(ob.data.vertices):
        # One of these has made them, and what comes behind the last is lost by any.
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
