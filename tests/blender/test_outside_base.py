# SPDX-License-Identifier: GPL-3.0-or-later
"""Base Object: the base is another object, deformed by any modifiers; a copy of the surface, or a cage of another
topology."""

import bmesh
import bpy
import numpy as np
import pytest
from mathutils import Matrix

from conftest import activate, bind, evaluated, group, in_a_collection, make_strip, own, refusal, update


def make_pair(n=25):
    """A wavy strip without handles and region, and the flat grid that is its base."""
    ob = make_strip(n)
    settings = ob.detail_deform
    settings.region = ""
    bpy.data.objects.remove(settings.handles[0].target)
    settings.handles.clear()
    mesh = ob.data.copy()
    flat = own(ob)
    flat[:, 2] = 0
    mesh.vertices.foreach_set('co', flat.astype(np.float32).ravel())
    base = bpy.data.objects.new("Base", mesh)
    bpy.context.scene.collection.objects.link(base)
    settings.base = 'OBJECT'
    settings.base_object = base
    update()
    return activate(ob), base


def armature(base):
    data = bpy.data.armatures.new("Rig")
    rig = bpy.data.objects.new("Rig", data)
    bpy.context.scene.collection.objects.link(rig)
    activate(rig)
    bpy.ops.object.mode_set(mode='EDIT')
    for name, start, end in (("a", 0, 0.5), ("b", 0.5, 1)):
        bone = data.edit_bones.new(name)
        bone.head, bone.tail = (start, 0.5, 0), (end, 0.5, 0)
    data.edit_bones["b"].parent = data.edit_bones["a"]
    bpy.ops.object.mode_set(mode='OBJECT')
    x = own(base)[:, 0]
    group(base, "a", np.flatnonzero(x < 0.5))
    group(base, "b", np.flatnonzero(x >= 0.5))
    modifier = base.modifiers.new("Rig", 'ARMATURE')
    modifier.object = rig

    def pose(angle):
        bone = rig.pose.bones["b"]
        bone.rotation_mode = 'XYZ'
        bone.rotation_euler = (angle, 0, 0)
    return pose


def lattice(base):
    data = bpy.data.lattices.new("Cage")
    cage = bpy.data.objects.new("Cage", data)
    cage.location, cage.scale = (0.5, 0.5, 0), (1.2, 1.2, 1)
    bpy.context.scene.collection.objects.link(cage)
    base.modifiers.new("Cage", 'LATTICE').object = cage

    def pose(amount):
        for point in data.points:
            point.co_deform[2] = point.co[2] + amount * max(point.co[0], 0)
        data.update_tag()
    return pose


def simple_deform(base):
    modifier = base.modifiers.new("Twist", 'SIMPLE_DEFORM')
    modifier.deform_method, modifier.deform_axis = 'TWIST', 'X'
    modifier.angle = 0

    def pose(angle):
        modifier.angle = angle
    return pose


@pytest.mark.parametrize('deformer', [armature, lattice, simple_deform])
def test_details_follow_whatever_deforms_the_base(deformer):
    ob, base = make_pair()
    pose = deformer(base)
    bind(ob)
    assert ob.detail_deform.status.startswith("Bound to the base 'Base': 625 vertices follow it.")
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-6
    pose(0.8)
    update()
    moved, moved_base = evaluated(ob), evaluated(base)
    assert np.abs(moved_base - own(base)).max() > 0.1
    # The distances from the base stay as at rest, in the mean to 0.02 and for each vertex to 0.1; relief 0.03, size 1.
    rest_height = np.linalg.norm(own(ob) - own(base), axis=1)
    height = np.linalg.norm(moved - moved_base, axis=1)
    assert abs(height.mean() - rest_height.mean()) < 0.02
    assert height.max() < rest_height.max() + 0.1
    pose(0)
    update()
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-6


def test_playback_follows_an_animated_base():
    ob, base = make_pair()
    simple_deform(base)
    modifier = base.modifiers[0]
    for frame, angle in ((1, 0), (10, 1)):
        modifier.angle = angle
        modifier.keyframe_insert('angle', frame=frame)
    bpy.context.scene.frame_set(1)
    bind(ob)
    shapes = []
    for frame in (1, 4, 7, 10):
        bpy.context.scene.frame_set(frame)
        shapes.append(evaluated(ob))
    for before, after in zip(shapes, shapes[1:]):
        assert np.abs(after - before).max() > 0.01
    bpy.context.scene.frame_set(4)
    assert np.abs(evaluated(ob) - shapes[1]).max() < 1e-6


def test_moving_the_base_object_moves_the_surface_with_it_but_a_common_parent_does_not():
    ob, base = make_pair()
    bind(ob)
    motion = Matrix.Translation((0.3, -0.1, 0.5)) @ Matrix.Rotation(0.7, 4, 'Y')
    base.matrix_world = motion
    update()
    expected = own(ob) @ np.array(motion)[:3, :3].T + np.array(motion)[:3, 3]
    assert np.abs(evaluated(ob) - expected).max() < 1e-5
    ob.matrix_world = motion
    update()
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-5


def test_handles_and_region_hold_their_vertices_all_the_same():
    ob = make_strip()
    mesh = ob.data.copy()
    base = bpy.data.objects.new("Base", mesh)
    bpy.context.scene.collection.objects.link(base)
    ob.detail_deform.base, ob.detail_deform.base_object = 'OBJECT', base
    pose = simple_deform(base)
    update()
    bind(activate(ob))
    assert "Bound to the base 'Base' and 'right': " in ob.detail_deform.status
    pose(0.6)
    ob.detail_deform.handles[0].target.location.z += 0.2
    update()
    moved = evaluated(ob) - own(ob)
    columns = np.repeat(np.arange(25), 25)
    assert (moved[columns < 3] == 0).all()
    assert np.allclose(moved[columns >= 22], (0, 0, 0.2), atol=1e-6)


def test_make_base_object_gives_the_computed_base_ready_to_be_rigged():
    ob = bind(make_strip())
    ob.detail_deform.output = 'BASE'
    update()
    shown = evaluated(ob)
    ob.detail_deform.output = 'RESULT'
    assert bpy.ops.object.detail_deform_base_make() == {'FINISHED'}
    base = ob.detail_deform.base_object
    assert ob.detail_deform.base == 'OBJECT' and base.name == "Strip Base"
    assert np.abs(own(base) - shown).max() < 1e-6
    assert [g.name for g in base.vertex_groups] == [g.name for g in ob.vertex_groups]
    assert 'detail_deform_offset' not in base.data.attributes
    update()
    bind(ob)
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-5


@pytest.mark.parametrize('hide', ['hide_render', 'hide_viewport', 'collection'])
def test_a_hidden_base_is_followed_in_renders(hide, tmp_path):
    ob, base = make_pair()
    pose = simple_deform(base)
    modifier = base.modifiers[0]
    for frame, angle in ((1, 0), (5, 1.5)):
        pose(angle)
        modifier.keyframe_insert('angle', frame=frame)
    if hide == 'collection':
        in_a_collection(base).hide_render = True
    bpy.context.scene.frame_set(1)
    bind(activate(ob))
    if hide != 'collection':
        setattr(base, hide, True)
    seen = []

    def look(scene, depsgraph=None):
        graph = depsgraph or bpy.context.evaluated_depsgraph_get()
        values = np.empty(3 * len(ob.data.vertices), np.float32)
        ob.data.attributes['detail_deform_offset'].data.foreach_get('vector', values)
        seen.append((graph.mode, scene.frame_current, float(np.abs(values).max())))

    scene = bpy.context.scene
    scene.render.engine = 'BLENDER_WORKBENCH'
    scene.render.resolution_x = scene.render.resolution_y = 16
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.frame_start, scene.frame_end = 1, 5
    scene.render.filepath = str(tmp_path / "f")
    bpy.app.handlers.frame_change_post.append(look)
    try:
        bpy.ops.render.render(animation=True)
    finally:
        bpy.app.handlers.frame_change_post.remove(look)
    sizes = {frame: size for mode, frame, size in seen if mode == 'RENDER'}
    assert sizes[1] < 1e-5 and 0.01 < sizes[2] < sizes[5], seen


def cage(n, height=0.0, below=0.0):
    """A flat grid of n × n faces over the unit square and 0.05 beyond, which is no copy of the strip."""
    x, y = (a.ravel() for a in np.meshgrid(*[np.linspace(-0.05, 1.05, n + 1)] * 2, indexing='ij'))
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n), indexing='ij'))
    a = i * (n + 1) + j
    mesh = bpy.data.meshes.new("Cage")
    mesh.from_pydata(np.stack([x, y, 0 * x + height - below], -1).tolist(), [],
                     np.stack([a, a + n + 1, a + n + 2, a + 1], -1).tolist())
    base = bpy.data.objects.new("Cage", mesh)
    bpy.context.scene.collection.objects.link(base)
    return base


def rolled(positions, angle):
    """Positions bent along an arc about y by an angle."""
    turn, arm = angle * (positions[:, 0] - 0.5), 1 / angle - positions[:, 2]
    return np.stack([arm * np.sin(turn) + 0.5, positions[:, 1], 1 / angle - arm * np.cos(turn)], -1)


def pose_key(base, positions):
    base.shape_key_add(name="Basis")
    key = base.shape_key_add(name="Posed")
    key.data.foreach_set('co', positions.astype(np.float32).ravel())
    key.value = 1


@pytest.mark.parametrize('refine', [0, 4])
def test_details_follow_a_coarse_cage_whose_faces_do_not_show(refine):
    ob, base = make_pair(61)
    bpy.data.objects.remove(base)
    base = cage(6, below=0.06)
    of = ob.detail_deform
    of.base_object, of.refine = base, refine
    activate(ob)
    bind(ob)
    assert "'Cage' is no copy" in of.status and 'far' not in of.status and 'between' not in of.status
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-6
    pose_key(base, rolled(own(base), 1.2))
    update()
    moved, meant = evaluated(ob), rolled(own(ob), 1.2)
    moved += (meant - moved).mean(0)  # up to a translation: without handles nothing but the cage gives the place
    assert np.linalg.norm(moved - meant, axis=1).max() < 0.03
    assert np.linalg.norm(meant - own(ob), axis=1).max() > 0.1


def test_a_cage_may_have_a_subdivision_and_its_shape_at_bind_is_kept():
    ob, base = make_pair()
    bpy.data.objects.remove(base)
    base = cage(4)
    smooth = base.modifiers.new("Smooth", 'SUBSURF')
    smooth.levels = smooth.render_levels = 2
    ob.detail_deform.base_object = base
    update()
    activate(ob)
    bind(ob)
    kept = ob.detail_deform.base_rest_mesh
    assert len(kept.vertices) == len(base.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.vertices) > 25
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-6
    base.rotation_euler.y = 0.7
    base.location = 0.2, 0.1, 0
    update()
    expected = own(ob) @ np.array(base.matrix_world.to_3x3()).T + np.array(base.location)
    assert np.abs(evaluated(ob) - expected).max() < 1e-5
    base.modifiers[0].levels = 1
    update()
    assert "were there when it was bound" in ob.detail_deform.status
    # A new Bind stores the cage's present shape as its rest shape.
    base.modifiers[0].render_levels = 1
    bind(ob, keep_rest=True)
    assert len(ob.detail_deform.base_rest_mesh.vertices) < len(own(ob)) and "Bound" in ob.detail_deform.status
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-6
    assert bpy.ops.object.detail_deform_unbind() == {'FINISHED'}
    assert not any(mesh.name.endswith('Rest') for mesh in bpy.data.meshes)


def off_in(base, flag):
    setattr(base.modifiers[0], flag, False)


def driven(base, flag):
    curve = base.modifiers[0].driver_add(flag)
    curve.driver.type = 'SCRIPTED'
    curve.driver.expression = "0"


def simplified(base, most):
    render = bpy.context.scene.render
    render.use_simplify, render.simplify_subdivision = True, most


DIFFERENT = {
    'levels': lambda base: setattr(base.modifiers[0], 'render_levels', 3),
    'off in the viewport': lambda base: off_in(base, 'show_viewport'),
    'off in renders': lambda base: off_in(base, 'show_render'),
    'driven': lambda base: driven(base, 'show_render'),
    'simplified': lambda base: simplified(base, 1),
    'simplified away': lambda base: simplified(base, 0),
}


def lifted_cage(copy):
    ob, base = make_pair()
    if not copy:
        bpy.data.objects.remove(base)
        base = cage(6)
        ob.detail_deform.base_object = base
    smooth = base.modifiers.new("Smooth", 'SUBSURF')
    smooth.levels = smooth.render_levels = 2
    pose_key(base, own(base) + np.outer(own(base)[:, 0] ** 2, (0, 0, 0.5)))
    key = base.data.shape_keys.key_blocks[-1]
    for frame, value in ((1, 0.0), (5, 1.0)):
        key.value = value
        key.keyframe_insert('value', frame=frame)
    bpy.context.scene.frame_set(1)
    return ob, base


@pytest.mark.parametrize('copy', [False, True])
@pytest.mark.parametrize('kind', DIFFERENT)
def test_a_base_with_other_vertices_in_renders_is_followed_below_the_modifiers_that_make_them(rendered, kind, copy):
    ob, base = lifted_cage(copy)
    DIFFERENT[kind](base)
    update()
    bind(activate(ob))
    seen = rendered()
    for frame in (1, 3, 5):
        bpy.context.scene.frame_set(frame)
        assert np.abs(seen[frame] - evaluated(ob)).max() < 1e-5, frame
    assert np.abs(seen[5] - own(ob)).max() > 0.3
    assert "render" not in ob.detail_deform.status


def test_the_status_reports_a_base_that_a_render_could_not_follow(rendered):
    """Such as where Simplify is enabled after Bind. The next render that follows it clears the report."""
    ob, _ = lifted_cage(copy=False)
    bind(activate(ob))
    render = bpy.context.scene.render
    render.use_simplify, render.simplify_subdivision_render = True, 1
    rendered()
    bpy.context.scene.frame_set(2)
    update()
    assert "A render could not follow it in frame 1: The modifiers of the base object" in ob.detail_deform.status
    render.use_simplify = False
    seen = rendered()
    bpy.context.scene.frame_set(5)
    assert np.abs(seen[5] - evaluated(ob)).max() < 1e-5 and "A render" not in ob.detail_deform.status


@pytest.mark.parametrize('hide', ['hide_viewport', 'collection'])
def test_a_hidden_cage_with_modifiers_is_bound(hide):
    ob, base = make_pair()
    bpy.data.objects.remove(base)
    base = cage(4)
    smooth = base.modifiers.new("Smooth", 'SUBSURF')
    smooth.levels = smooth.render_levels = 2
    ob.detail_deform.base_object = base
    if hide == 'collection':
        in_a_collection(base).hide_viewport = True
    else:
        base.hide_viewport = True
    update()
    activate(ob)
    bind(ob)
    assert ob.detail_deform.base_rest_mesh and not ob.detail_deform.problem
    base.location.z = 0.3
    update()
    assert np.abs(evaluated(ob) - own(ob) - (0, 0, 0.3)).max() < 1e-5


def test_another_base_object_has_a_rest_of_its_own():
    ob, first = make_pair()
    bpy.data.objects.remove(first)
    of = ob.detail_deform
    of.base_object = cage(4)
    smooth = of.base_object.modifiers.new("Smooth", 'SUBSURF')
    smooth.levels = smooth.render_levels = 1
    update()
    activate(ob)
    bind(ob)
    assert of.base_rest_mesh
    of.base_object = cage(5, below=0.05)
    update()
    assert of.stale and not of.base_rest_mesh
    bind(ob, keep_rest=True)
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-6 and "far" not in of.status
    bpy.data.objects.remove(of.base_object)
    assert of.status is not None  # it can be read before the next update
    update()
    assert "There is no base object" in of.status and not of.is_bound


def test_a_base_without_faces_is_refused():
    ob, base = make_pair()
    bpy.data.objects.remove(base)
    base = cage(4)
    group(base, "few", [0, 7])
    mask = base.modifiers.new("Mask", 'MASK')
    mask.vertex_group = "few"
    ob.detail_deform.base_object = base
    update()
    activate(ob)
    assert "leave no faces" in refusal(bpy.ops.object.detail_deform_bind, wait=True)
    base.modifiers.clear()
    update()
    bind(ob)
    assert [mesh.name for mesh in bpy.data.meshes if "Rest" in mesh.name] == [ob.detail_deform.base_rest_mesh.name]


def test_vertices_far_from_a_cage_are_reported():
    ob, base = make_pair()
    bpy.data.objects.remove(base)
    ob.detail_deform.base_object = cage(4, below=0.3)
    update()
    activate(ob)
    bind(ob)
    assert "far from the base (such as vertex " in ob.detail_deform.status


def test_unsuitable_bases_are_refused():
    ob, base = make_pair()
    bind_op = bpy.ops.object.detail_deform_bind
    other = bpy.data.objects.new("Other", bpy.data.meshes.new("Other"))
    bpy.context.scene.collection.objects.link(other)
    ob.detail_deform.base_object = other
    update()
    assert "'Other' has no faces" in refusal(bind_op, wait=True)
    ob.detail_deform.base_object = None
    assert "no base object" in refusal(bind_op, wait=True)
    ob.detail_deform.base_object = base
    bind(ob)
    base.modifiers.new("Thick", 'SOLIDIFY')  # the base is followed below it
    update()
    assert "Bound" in ob.detail_deform.status and np.abs(evaluated(ob) - own(ob)).max() < 1e-5
    base.modifiers.clear()
    base.modifiers.new("Fewer", 'MASK').vertex_group = base.vertex_groups[0].name
    base.modifiers.new("Remade", 'DECIMATE').ratio = 0.5
    update()
    assert "Bound" in ob.detail_deform.status
    base.modifiers.clear()
    update()
    assert "Bound" in ob.detail_deform.status


def put(ob, positions, faces):
    mesh = bpy.data.meshes.new(ob.name)
    mesh.from_pydata(positions.tolist(), [], faces)
    ob.data = mesh
    update()


def test_the_same_faces_in_another_order_are_a_copy():
    ob, base = make_pair(4)
    put(base, own(base), [tuple(p.vertices[1:]) + (p.vertices[0],) for p in base.data.polygons][::-1])
    bind(ob)
    assert "is no copy of this mesh" not in ob.detail_deform.status


def test_the_same_counts_joined_otherwise_are_no_copy():
    """A grid numbered from its other end: its faces join the same vertex numbers, but the vertices are elsewhere."""
    ob, base = make_pair(4)
    faces = [tuple(p.vertices) for p in base.data.polygons]
    put(base, own(base)[::-1], [tuple(15 - v for v in face) for face in faces])
    bind(ob)
    assert "is no copy of this mesh" in ob.detail_deform.status


def lift_some(base, by):
    base.data.vertices.foreach_set('co', (own(base) + own(base)[:, :1]**2 * (0, 0, by)).ravel())
    base.data.update()
    update()


def test_an_edit_of_the_base_deforms_and_stays_with_the_next_bind():
    ob, base = make_pair()
    bind(ob)
    lift_some(base, 0.2)
    lifted = evaluated(ob)
    assert ob.detail_deform.is_bound and not ob.detail_deform.stale
    assert np.allclose((lifted - own(ob))[:, 2], 0.2 * own(ob)[:, 0]**2, atol=0.02)
    assert bpy.ops.object.detail_deform_bind(wait=True, keep_rest=True) == {'FINISHED'}
    update()
    assert np.abs(evaluated(ob) - lifted).max() < 1e-6
    lift_some(base, -0.2)
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-5
    lift_some(base, 0.2)
    assert bpy.ops.object.detail_deform_bind(wait=True) == {'FINISHED'}  # without keep_rest: at rest as it is now
    update()
    assert np.abs(evaluated(ob) - own(ob)).max() < 1e-6


def test_a_cage_that_is_edited_is_followed_live():
    ob, base = make_pair()
    bind(ob)
    activate(base)
    bpy.ops.object.mode_set(mode='EDIT')
    mesh = bmesh.from_edit_mesh(base.data)
    for vertex in mesh.verts:
        vertex.co.z += 0.3
    bmesh.update_edit_mesh(base.data)
    update()
    assert np.allclose((evaluated(ob) - own(ob))[:, 2], 0.3, atol=1e-5) and not ob.detail_deform.problem
    bpy.ops.object.mode_set(mode='OBJECT')
    update()
    assert np.allclose((evaluated(ob) - own(ob))[:, 2], 0.3, atol=1e-5) and ob.detail_deform.is_bound


def test_a_base_with_another_number_of_vertices_needs_a_new_bind():
    ob, base = make_pair()
    bind(ob)
    activate(base)
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.mesh.select_all(action='SELECT')
    bpy.ops.mesh.subdivide()
    bpy.ops.object.mode_set(mode='OBJECT')
    update()
    assert "when it was bound: press Re-bind" in ob.detail_deform.status
    activate(ob)
    assert bpy.ops.object.detail_deform_bind(wait=True, keep_rest=True) == {'FINISHED'}
    update()
    assert "Bound" in ob.detail_deform.status and np.abs(evaluated(ob) - own(ob)).max() < 1e-5


def test_copies_of_an_object_do_not_share_the_rest_of_the_base():
    ob, base = make_pair()
    bind(ob)
    activate(ob)
    bpy.ops.object.duplicate()
    copy = bpy.context.view_layer.objects.active
    update()
    bpy.context.scene.cursor.location = (0.5, 0.5, 1)
    bpy.ops.object.origin_set(type='ORIGIN_CURSOR')
    update()
    bind(copy, keep_rest=True)
    base.location.z += 0.1
    update()
    for each in (ob, copy):
        assert np.allclose((evaluated(each) - own(each))[:, 2], 0.1, atol=1e-5)


def test_removing_the_base_is_noticed():
    ob, base = make_pair()
    bind(ob)
    bpy.data.objects.remove(base)
    update()
    assert "no base object" in ob.detail_deform.status


def test_the_status_says_that_gradient_editing_ignores_the_base():
    ob, _ = make_pair()
    bind(ob)
    ob.detail_deform.method = 'GRADIENT'
    update()
    assert "not by the base" in ob.detail_deform.status


def test_changing_the_choice_of_base_asks_for_a_new_bind():
    ob = bind(make_strip())
    ob.detail_deform.base = 'OBJECT'
    assert "base object" in ob.detail_deform.status
    ob.detail_deform.base = 'COMPUTED'
    assert ob.detail_deform.is_bound
