# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes creatures.blend: two animals of different build, topology and number of triangles.

blender --background --factory-startup --python blend_fixtures/build_creatures.py
"""
import math
import sys
from pathlib import Path

import bmesh
import bpy
import numpy as np
from mathutils import Euler, Matrix, Vector

HERE = Path(__file__).resolve().parent
SIDES = (("L", 1), ("R", -1))

# Joints as (x forward, y to the left, z up) and radius; those of limbs are mirrored.
CALF = {
    "rump": (-0.62, 0, 1.00, 0.27), "belly": (-0.10, 0, 0.95, 0.30), "chest": (0.42, 0, 1.00, 0.27),
    "neck": (0.68, 0, 1.20, 0.15), "nape": (0.88, 0, 1.42, 0.13), "head": (1.02, 0, 1.44, 0.14),
    "muzzle": (1.28, 0, 1.33, 0.10), "tail": (-0.95, 0, 1.08, 0.06), "tail tip": (-1.15, 0, 0.62, 0.05),
    "shoulder": (0.45, 0.17, 0.82, 0.15), "knee": (0.46, 0.19, 0.46, 0.085), "fetlock": (0.44, 0.19, 0.12, 0.06),
    "hoof": (0.50, 0.19, 0.04, 0.07), "hip": (-0.62, 0.17, 0.80, 0.17), "hock": (-0.74, 0.19, 0.45, 0.08),
    "pastern": (-0.66, 0.19, 0.12, 0.06), "heel": (-0.60, 0.19, 0.04, 0.07), "ear": (0.94, 0.26, 1.60, 0.04),
}
# Long legs, long neck, short body, half as large again.
GIRAFFE = {
    "rump": (-0.55, 0, 1.95, 0.27), "belly": (-0.05, 0, 2.00, 0.31), "chest": (0.42, 0, 2.12, 0.32),
    "neck": (0.75, 0, 2.70, 0.19), "nape": (1.10, 0, 3.60, 0.14), "head": (1.22, 0, 3.72, 0.15),
    "muzzle": (1.55, 0, 3.50, 0.09), "tail": (-0.82, 0, 1.98, 0.05), "tail tip": (-0.95, 0, 1.35, 0.06),
    "shoulder": (0.48, 0.19, 1.75, 0.17), "knee": (0.52, 0.22, 0.98, 0.10), "fetlock": (0.50, 0.22, 0.22, 0.07),
    "hoof": (0.58, 0.22, 0.07, 0.09), "hip": (-0.52, 0.18, 1.65, 0.19), "hock": (-0.68, 0.22, 0.95, 0.095),
    "pastern": (-0.60, 0.22, 0.22, 0.07), "heel": (-0.52, 0.22, 0.07, 0.09), "ear": (1.12, 0.30, 3.84, 0.05),
}
BONES = (("rump", "belly"), ("belly", "chest"), ("chest", "neck"), ("neck", "nape"), ("nape", "head"),
         ("head", "muzzle"), ("rump", "tail"), ("tail", "tail tip"), ("chest", "shoulder"), ("shoulder", "knee"),
         ("knee", "fetlock"), ("fetlock", "hoof"), ("rump", "hip"), ("hip", "hock"), ("hock", "pastern"),
         ("pastern", "heel"), ("head", "ear"))
# Joint, and the direction from it in which the marked vertex lies.
MARKERS = (("muzzle", (1, 0, 0)), ("head", (0, 0, 1)), ("nape", (-1, 0, 1)), ("nape", (0, 0, -1)), ("neck", (0, 1, 0)),
           ("neck", (0, -1, 0)), ("neck", (-1, 0, 1)), ("chest", (1, 0, -1)), ("chest", (0, 0, 1)),
           ("belly", (0, 1, 0)), ("belly", (0, -1, 0)), ("belly", (0, 0, 1)), ("belly", (0, 0, -1)),
           ("rump", (-1, 0, 0)), ("rump", (0, 0, 1)), ("tail tip", (0, 0, -1)), ("tail", (0, 0, 1)),
           ("shoulder", (0, 1, 0)), ("knee", (1, 0, 0)), ("knee", (-1, 0, 0)), ("fetlock", (-1, 0, 0)),
           ("hoof", (1, 0, 0)), ("hip", (0, 1, 0)), ("hock", (1, 0, 0)), ("hock", (-1, 0, 0)), ("pastern", (-1, 0, 0)),
           ("heel", (1, 0, 0)), ("ear", (0, 1, 1)))
# Of each bone the turns about y (forward is down), in degrees, at frames 9, 17 and 24.
POSES = {
    ("belly", "chest"): (-8, 12, 25), ("chest", "neck"): (-25, 25, 40), ("neck", "nape"): (-15, 20, 35),
    ("nape", "head"): (20, -15, 10), ("rump", "tail"): (30, -10, 30), ("tail", "tail tip"): (25, -10, 20),
    ("shoulder.L", "knee.L"): (-55, -10, -25), ("knee.L", "fetlock.L"): (45, 15, 40),
    ("shoulder.R", "knee.R"): (10, -50, -25), ("knee.R", "fetlock.R"): (15, 50, 40),
    ("hip.L", "hock.L"): (40, 10, 15), ("hock.L", "pastern.L"): (-30, -15, -25),
    ("hip.R", "hock.R"): (15, 35, 15), ("hock.R", "pastern.R"): (-10, -40, -25),
}
FRAMES = (9, 17, 24)


def main():
    sys.path.insert(0, str(HERE.parent / "addon"))
    import detail_deform

    detail_deform.register()
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    calf, giraffe = creature("Calf", CALF, 0.022), creature("Giraffe", GIRAFFE, 0.026)
    # Other faces all over, and a coat of small bumps.
    decimate = giraffe.modifiers.new("Decimate", "DECIMATE")
    decimate.ratio = 0.45
    apply(giraffe, decimate)
    roughen(giraffe)
    mark(calf, CALF)
    mark(giraffe, GIRAFFE)
    animate(calf, CALF)
    giraffe.location.y = 2.4
    giraffe.detail_deform.transfer.source = calf
    giraffe.detail_deform.transfer.correspondence = "MARKERS"
    for ob, color in ((calf, (0.55, 0.36, 0.24, 1)), (giraffe, (0.82, 0.62, 0.30, 1))):
        ob.color = color
        ob.data.polygons.foreach_set("use_smooth", np.ones(len(ob.data.polygons), bool))
    dress(giraffe)
    path = HERE / "creatures.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True, check_existing=False)
    path.with_suffix(".blend1").unlink(missing_ok=True)
    for ob in (calf, giraffe):
        triangles = sum(len(p.vertices) - 2 for p in ob.data.polygons)
        print(f"{ob.name}: {triangles} triangles, {len(ob.data.vertices)} vertices", flush=True)
    print(path.stat().st_size, "bytes")
    detail_deform.unregister()


def joints(build):
    """{name: (place, radius)}, limbs on both sides."""
    found = {}
    for name, (x, y, z, radius) in build.items():
        for side, sign in SIDES if y else (("", 0),):
            found[f"{name}.{side}" if side else name] = (Vector((x, sign * y, z)), radius)
    return found


def bones(build):
    """Pairs of names of joints()."""
    for a, b in BONES:
        for side in "LR" if build[b][1] else ("",):
            yield (f"{a}.{side}" if build[a][1] else a), (f"{b}.{side}" if side else b)


def apply(ob, modifier):
    with bpy.context.temp_override(object=ob, active_object=ob):
        bpy.ops.object.modifier_apply(modifier=modifier.name)


def creature(name, build, voxel):
    """The hulls of the balls at both ends of each bone, grown together."""
    places, mesh, shape = joints(build), bpy.data.meshes.new(name), bmesh.new()
    for a, b in bones(build):
        hull = bmesh.new()
        for joint in (a, b):
            place, radius = places[joint]
            bmesh.ops.create_icosphere(hull, subdivisions=3, radius=radius, matrix=Matrix.Translation(place))
        bmesh.ops.delete(hull, geom=hull.edges[:], context="EDGES_FACES")
        bmesh.ops.convex_hull(hull, input=hull.verts)
        bmesh.ops.delete(hull, geom=[v for v in hull.verts if not v.link_faces], context="VERTS")
        hull.to_mesh(mesh)
        hull.free()
        shape.from_mesh(mesh)
    shape.to_mesh(mesh)
    shape.free()
    ob = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(ob)
    remesh = ob.modifiers.new("Remesh", "REMESH")
    remesh.mode, remesh.voxel_size = "VOXEL", voxel
    ob.modifiers.new("Smooth", "SMOOTH").iterations = 12
    for modifier in list(ob.modifiers):
        apply(ob, modifier)
    return ob


def coordinates(ob):
    values = np.empty(3 * len(ob.data.vertices), np.float32)
    ob.data.vertices.foreach_get("co", values)
    return values.reshape(-1, 3).astype(float)


def roughen(ob):
    points = coordinates(ob)
    normals = np.array([v.normal for v in ob.data.vertices])
    height = 0.006 * np.sin(31 * points).prod(axis=1)
    ob.data.vertices.foreach_set("co", (points + height[:, None] * normals).astype(np.float32).ravel())
    ob.data.update()


def mark(ob, build):
    """A numbered vertex group for each marker, one vertex in each."""
    points, places, number = coordinates(ob), joints(build), 0
    for joint, direction in MARKERS:
        for side, sign in SIDES if build[joint][1] else (("", 1),):
            place, radius = places[f"{joint}.{side}" if side else joint]
            toward = Vector((direction[0], sign * direction[1], direction[2])).normalized()
            nearest = np.linalg.norm(points - (place + 1.3 * radius * toward), axis=1).argmin()
            number += 1
            ob.vertex_groups.new(name=f"Marker {number}").add([int(nearest)], 1.0, "REPLACE")
    # What stays on the ground.
    lowest = points[:, 2].min()
    soles = ob.vertex_groups.new(name="Hooves")
    soles.add([int(v) for v in np.flatnonzero(points[:, 2] < lowest + 0.06 * np.ptp(points[:, 2]) / 1.6)], 1.0,
              "REPLACE")


def animate(ob, build):
    """An armature of the bones, weights by distance from them, and three poses."""
    places, names = joints(build), list(bones(build))
    rig = bpy.data.objects.new("Calf Rig", bpy.data.armatures.new("Calf Rig"))
    bpy.context.scene.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    made = {}
    for a, b in names:
        bone = rig.data.edit_bones.new(f"{a} - {b}")
        bone.head, bone.tail = places[a][0], places[b][0]
        bone.parent = next((made[other] for other in made if other[1] == a), None)
        made[a, b] = bone
    bpy.ops.object.mode_set(mode="OBJECT")

    points, weights = coordinates(ob), []
    for a, b in names:
        head, along = np.array(places[a][0]), np.array(places[b][0] - places[a][0])
        t = np.clip((points - head) @ along / (along @ along), 0, 1)
        radius = places[a][1] + t * (places[b][1] - places[a][1])
        weights.append((np.linalg.norm(points - head - t[:, None] * along, axis=1) / radius) ** -6)
    weights = np.array(weights)
    weights /= weights.sum(axis=0)
    for (a, b), row in zip(names, weights):
        group = ob.vertex_groups.new(name=f"{a} - {b}")
        for vertex in np.flatnonzero(row > 0.01):
            group.add([int(vertex)], float(row[vertex]), "REPLACE")
    ob.modifiers.new("Armature", "ARMATURE").object = rig

    for (a, b), turns in POSES.items():
        bone = rig.pose.bones[f"{a} - {b}"]
        bone.rotation_mode = "QUATERNION"
        rest = bone.bone.matrix_local.to_3x3()
        for frame, turn in ((1, 0), *zip(FRAMES, turns)):
            about_y = Euler((0, math.radians(turn), 0)).to_matrix()
            bone.rotation_quaternion = (rest.inverted() @ about_y @ rest).to_quaternion()
            bone.keyframe_insert("rotation_quaternion", frame=frame)
    rig.hide_render = True


def dress(ob):
    """Camera and render settings; the object active."""
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, FRAMES[-1]
    scene.frame_set(1)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    camera.location = (6.4, -10.0, 3.2)
    camera.rotation_euler = (Vector((0.2, 1.0, 1.75)) - camera.location).to_track_quat("-Z", "Y").to_euler()
    camera.data.lens = 62
    scene.camera = camera
    scene.render.engine = "BLENDER_WORKBENCH"
    scene.render.resolution_x, scene.render.resolution_y = 960, 720
    scene.view_settings.view_transform = "Standard"
    scene.world = bpy.data.worlds.new("World")
    scene.world.color = (0.13, 0.135, 0.145)
    shading = scene.display.shading
    shading.light, shading.color_type = "STUDIO", "OBJECT"
    shading.show_cavity, shading.cavity_type = True, "BOTH"
    for other in bpy.context.view_layer.objects:
        other.select_set(other == ob)
    bpy.context.view_layer.objects.active = ob


main()
