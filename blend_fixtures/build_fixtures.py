# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the .blend files beside this script, always the same ones.

blender --background --factory-startup --python blend_fixtures/build_fixtures.py
"""
import math
import sys
from pathlib import Path

import bmesh
import bpy
import numpy as np
from mathutils import Matrix, Vector, kdtree

HERE = Path(__file__).resolve().parent
SIZE_LIMIT = 3_000_000
FRAMES = (1, 24)


def main():
    sys.path.insert(0, str(HERE.parent / "addon"))
    import detail_deform

    detail_deform.register()
    try:
        for build, name in ((bumpy_plane, "bumpy_plane"), (suzanne, "suzanne"),
                            (tentacle, "animated")):
            # With no objects and no add-on's leftovers, only what is made below gets saved.
            bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
            save(build(), name)
    finally:
        detail_deform.unregister()


# ---------------------------------------------------------------- the three scenes

def bumpy_plane():
    """Fig. 1 of the paper: round bumps on a plane, the right side to be lifted."""
    n, bumps, steepness = 201, 12, 0.55
    x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n))
    # Distance to the centre of the grid cell's own bump, in units of the bump's radius.
    r = np.hypot((x * bumps) % 1 - 0.5, (y * bumps) % 1 - 0.5) / 0.47
    # At x = 1 or y = 1 the remainder starts the next cell, whose corner is flat: that is wanted.
    z = steepness * 0.47 / bumps * np.clip(1 - r ** 2.6, 0, None) ** 2
    positions = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    ob = mesh_object("Bumpy Plane", positions, grid_quads(n, n), (0.84, 0.58, 0.30, 1))

    column = np.tile(np.arange(n), n)
    group(ob, "region", (column >= 23) & (column <= 177))
    group(ob, "right", column >= 178)
    right = empty("Right", (0.5 * (178 + 200) / 200, 0.5, 0.0), Matrix.Identity(3), 0.2)
    handles(ob, [("right", right)])
    dress(ob, eye=(-0.10, -1.72, 1.22), look_at=(0.52, 0.47, 0.16), lens=60)
    return ob


def suzanne():
    """Blender's monkey with scales: three loose parts and relief all over."""
    bpy.ops.mesh.primitive_monkey_add(calc_uvs=False)
    ob = bpy.context.object
    ob.name = ob.data.name = "Suzanne"
    ob.color = (0.36, 0.52, 0.33, 1)
    ob.modifiers.new("Subdivision", "SUBSURF").levels = 3
    bpy.ops.object.modifier_apply(modifier="Subdivision")
    # The face has much shorter edges than the skull: split the long ones, or the scales there
    # would be a few triangles each.
    split_long_edges(ob.data, 0.022, passes=2)

    rest, normals = coordinates(ob.data), vertex_normals(ob.data)
    head = loose_part(ob.data, int(np.argmax(rest[:, 2])))
    size = scale_size(rest)
    height = scales(rest, normals, head, size) * room(ob.data, rest, normals)
    ob.data.vertices.foreach_set("co", (
        rest + height[:, None] * normals).astype(np.float32).ravel())
    smooth(ob.data)

    def near(centre, radius):
        return np.linalg.norm(rest - centre, axis=1) < radius

    # Viewer's left is the monkey's own right: x < 0. The cut runs level through both eyeballs on
    # purpose, so that each of the small parts is partly free.
    upper = rest[:, 2] + 0.12 * rest[:, 1] > 0.16
    ear_root = near((-1.05, 0.38, 0.18), 0.48)
    other_ear = rest[:, 0] > 0.82
    ear = head & (rest[:, 0] < -1.10)
    brow = head & near((-0.30, -0.80, 0.60), 0.20) & (normals[:, 1] < -0.1)
    group(ob, "region", (upper | ear_root) & ~other_ear)
    group(ob, "ear", ear)
    group(ob, "brow", brow)
    # Local Z points the way one would pull: out of the ear, up along the forehead.
    handles(ob, [
        ("ear", empty("Ear", rest[ear].mean(axis=0), facing((-1, 0.25, 0.2)), 0.35)),
        ("brow", empty("Brow", rest[brow].mean(axis=0), facing((0, -0.5, 1)), 0.3)),
    ])
    dress(ob, eye=(-1.7, -6.0, 1.0), look_at=(-0.24, 0.0, 0.05), lens=65)
    return ob


def tentacle():
    """A thorny tentacle whose tip is animated along a circular arc."""
    around, along, height, base = 112, 150, 3.0, 0.25
    t = np.linspace(0, 1, along)
    z = height * t
    radius = girth(t)
    radius[-1] = 0
    angle = np.arange(around) * (2 * math.pi / around)
    positions = np.stack([np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle)),
                          np.repeat(z[:, None], around, axis=1)], axis=-1).reshape(-1, 3)
    # The last ring is a single point at the top.
    last = (along - 1) * around
    faces = [f for f in grid_quads(along, around, closed=True) if max(f) < last]
    ring = np.arange(last - around, last)
    faces += [(int(a), int(b), last) for a, b in zip(ring, np.roll(ring, -1))]
    faces.append(tuple(range(around - 1, -1, -1)))
    positions = positions[:last + 1]

    ob = mesh_object("Tentacle", positions, faces, (0.20, 0.46, 0.50, 1))
    bumped = positions + thorns_and_suckers(positions, vertex_normals(ob.data), height)
    ob.data.vertices.foreach_set("co", bumped.astype(np.float32).ravel())
    ob.data.update()

    tip_at = 2.72
    group(ob, "region", positions[:, 2] > base)
    group(ob, "tip", positions[:, 2] > tip_at)
    tip = empty("Tip", (0, 0, tip_at), Matrix.Identity(3), 0.5)
    tip.rotation_mode = "XYZ"
    length, bend = tip_at - base, math.radians(70)
    first, last_frame = FRAMES
    for k in range(6):
        s = k / 5
        theta = bend * s * s * (3 - 2 * s)
        arc = length / theta if theta else 0
        tip.location = ((arc * (1 - math.cos(theta)), 0, base + arc * math.sin(theta)) if theta
                        else (0, 0, tip_at))
        tip.rotation_euler = (0, theta, 0)
        frame = first + (last_frame - first) * s
        tip.keyframe_insert("location", frame=frame)
        tip.keyframe_insert("rotation_euler", frame=frame)
    handles(ob, [("tip", tip)])
    dress(ob, eye=(3.6, -7.0, 2.5), look_at=(0.56, 0, 1.50), lens=63)
    return ob


# ---------------------------------------------------------------- relief

def scale_size(rest):
    """Spacing of the scales: fine on face and ears, coarse at the back of the skull."""
    back = np.clip((rest[:, 1] + 0.75) / 1.3, 0, 1)
    size = 0.085 + 0.065 * back
    return np.where(np.abs(rest[:, 0]) > 0.86, 0.08, size)


def room(mesh, rest, normals, reach=0.12):
    """1 where the surface is open, towards 0 in folds, where scales would grow into each other.

    It is the radius of the largest ball that touches a vertex from outside and is empty otherwise.
    """
    tree = kdtree.KDTree(len(rest))
    for i, co in enumerate(rest):
        tree.insert(co, i)
    tree.balance()
    radius = np.full(len(rest), reach)
    for i, (co, normal) in enumerate(zip(rest, normals)):
        for _ in range(12):
            hit, _, distance = tree.find(co + radius[i] * normal)
            to_hit = np.array(hit) - co
            if distance > 0.98 * radius[i] or to_hit @ normal <= 0:
                break
            radius[i] = to_hit @ to_hit / (2 * to_hit @ normal)
    # Averaged, so that scales fade into a fold instead of ending at a step.
    a, b = edge_ends(mesh)
    for _ in range(8):
        total = np.bincount(a, radius[b], len(rest)) + np.bincount(b, radius[a], len(rest))
        radius = 0.5 * radius + 0.5 * total / np.bincount(np.append(a, b), minlength=len(rest))
    return radius / reach


def scales(rest, normals, where, size):
    """Height of overlapping round scales, one around each of the scattered seeds."""
    seeds = scatter(rest, np.flatnonzero(where), size)
    height = np.zeros(len(rest))
    for part in np.array_split(np.flatnonzero(where), 60):
        d = np.linalg.norm(rest[part, None] - rest[None, seeds], axis=2)
        # Seeds on the other side of a thin ear are close in space: their normals tell.
        d += 0.15 * (1 - normals[part] @ normals[seeds].T)
        near, other = np.sort(np.partition(d, 1, axis=1)[:, :2], axis=1).T
        groove = np.clip((other - near) / (0.55 * size[part]), 0, 1)
        height[part] = 0.30 * size[part] * (1 - (1 - groove) ** 2)
    return height


def scatter(rest, candidates, size):
    """Random points no closer to each other than size: darts thrown in a fixed order."""
    tree = kdtree.KDTree(len(candidates))
    for i in candidates:
        tree.insert(rest[i], int(i))
    tree.balance()
    taken = np.zeros(len(rest), bool)
    seeds = []
    for i in np.random.RandomState(7).permutation(candidates):
        if not taken[i]:
            seeds.append(i)
            taken[[hit[1] for hit in tree.find_range(rest[i], size[i])]] = True
    return np.array(seeds)


def girth(t):
    """Radius of the tentacle at t = 0 (base) .. 1 (tip): a flared foot, then a long taper."""
    return 0.03 + 0.35 * (1 - t) ** 1.1 + 0.16 * np.exp(-t / 0.06)


def thorns_and_suckers(rest, normals, height):
    """Displacement: hooked thorns on the back, two rows of ring-shaped suckers in front (+x)."""
    displacement = np.zeros_like(rest)
    t = 0.10
    while t < 0.955:
        width = 0.25 + girth(t)
        for k, angle in enumerate(np.radians([75, 110, 145, 180, 215, 250, 285])):
            # Thorns stand in staggered rows, as scales and leaves do.
            centre = on_axis(t + 0.5 * (k % 2) * 0.13 * width, angle, height)
            q = np.clip(1 - np.linalg.norm(rest - centre, axis=1) / (0.155 * width), 0, 1)
            # The point of the thorn leans up: not a height field, as in real creatures.
            displacement += (0.26 * width * q ** 1.5)[:, None] * normals
            displacement[:, 2] += 0.13 * width * q ** 2
        for angle, shift in ((-0.45, 0), (0.45, 0.065)):
            centre = on_axis(t + shift * width, angle, height)
            d = np.linalg.norm(rest - centre, axis=1) / (0.15 * width)
            displacement += (0.08 * width * np.exp(-((d - 0.68) / 0.26) ** 2))[:, None] * normals
        t += 0.13 * width
    return displacement


def on_axis(t, angle, height):
    r = girth(t)
    return np.array([r * math.cos(angle), r * math.sin(angle), t * height])


# ---------------------------------------------------------------- meshes and groups

def mesh_object(name, positions, faces, color):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(positions.tolist(), [], faces)
    smooth(mesh)
    ob = bpy.data.objects.new(name, mesh)
    ob.color = color
    bpy.context.collection.objects.link(ob)
    return ob


def grid_quads(rows, columns, closed=False):
    i = np.arange(rows * columns).reshape(rows, columns)
    right = np.roll(i, -1, axis=1)
    quads = np.stack([i[:-1], right[:-1], right[1:], i[1:]], axis=-1)
    return (quads if closed else quads[:, :-1]).reshape(-1, 4).tolist()


def smooth(mesh):
    mesh.polygons.foreach_set("use_smooth", np.ones(len(mesh.polygons), bool))
    mesh.update()


def coordinates(mesh):
    co = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", co)
    return co.reshape(-1, 3).astype(float)


def edge_ends(mesh):
    ends = np.empty(2 * len(mesh.edges), np.int32)
    mesh.edges.foreach_get("vertices", ends)
    return ends.reshape(-1, 2).T


def vertex_normals(mesh):
    """Area-weighted. Blender's own differ in the last bits from run to run."""
    mesh.calc_loop_triangles()
    corners = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("vertices", corners)
    corners = corners.reshape(-1, 3)
    a, b, c = (coordinates(mesh)[corners[:, k]] for k in range(3))
    normals = np.zeros((len(mesh.vertices), 3))
    for k in range(3):
        np.add.at(normals, corners[:, k], np.cross(b - a, c - a))
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def split_long_edges(mesh, longest, passes):
    bm = bmesh.new()
    bm.from_mesh(mesh)
    for _ in range(passes):
        bmesh.ops.subdivide_edges(bm, edges=[e for e in bm.edges if e.calc_length() > longest],
                                  cuts=1, use_grid_fill=True, use_single_edge=True)
    bmesh.ops.triangulate(bm, faces=[f for f in bm.faces if len(f.verts) > 4])
    bm.to_mesh(mesh)
    bm.free()
    mesh.update()


def loose_part(mesh, start):
    """Mask of the vertices connected to start."""
    a, b = edge_ends(mesh)
    mask = np.zeros(len(mesh.vertices), bool)
    mask[start] = True
    while (grow := mask[a] != mask[b]).any():
        mask[a[grow]] = mask[b[grow]] = True
    return mask


def group(ob, name, mask):
    ob.vertex_groups.new(name=name).add(np.flatnonzero(mask).tolist(), 1.0, "REPLACE")


def facing(direction):
    """Rotation whose local Z is the given direction."""
    return Vector(direction).to_track_quat("Z", "Y").to_matrix()


def empty(name, location, rotation, size):
    ob = bpy.data.objects.new(name, None)
    ob.empty_display_type, ob.empty_display_size = "ARROWS", size
    ob.show_in_front = ob.show_name = True
    ob.matrix_world = Matrix.Translation(location) @ rotation.to_4x4()
    bpy.context.collection.objects.link(ob)
    return ob


def handles(ob, pairs):
    ob.detail_deform.region = "region"
    for vertex_group, target in pairs:
        handle = ob.detail_deform.handles.add()
        handle.name = target.name
        handle.vertex_group = vertex_group
        handle.target = target
        handle.enabled = True


# ---------------------------------------------------------------- camera, light, saving

def dress(ob, eye, look_at, lens):
    """Camera and shading, the same in render and viewport, so a still shows what a user sees."""
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = FRAMES
    scene.frame_set(FRAMES[0])
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.lens, camera.data.clip_end = lens, 50
    camera.location = eye
    camera.rotation_euler = (Vector(look_at) - Vector(eye)).to_track_quat("-Z", "Y").to_euler()
    scene.collection.objects.link(camera)
    scene.camera = camera

    scene.render.engine = "BLENDER_WORKBENCH"
    scene.render.resolution_x, scene.render.resolution_y = 960, 720
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGB"
    scene.render.dither_intensity = 0
    scene.view_settings.view_transform = "Standard"
    scene.world = bpy.data.worlds.new("World")
    scene.world.color = (0.13, 0.135, 0.145)
    scene.display.render_aa = "16"
    scene.display.light_direction = Vector((-0.45, 0.55, 0.70)).normalized()
    scene.display.shadow_shift = 0.1

    views = [a.spaces.active for s in bpy.data.screens for a in s.areas if a.type == "VIEW_3D"]
    for shading in [scene.display.shading] + [view.shading for view in views]:
        shading.light, shading.color_type = "STUDIO", "OBJECT"
        shading.show_cavity, shading.cavity_type = True, "BOTH"
        shading.cavity_ridge_factor, shading.cavity_valley_factor = 0.6, 1.2
        shading.curvature_ridge_factor, shading.curvature_valley_factor = 0.5, 0.9
        shading.show_shadows, shading.shadow_intensity = True, 0.45
        shading.show_specular_highlight = True
    for view in views:
        view.region_3d.view_perspective = "CAMERA"
    bpy.context.view_layer.objects.active = ob
    ob.select_set(True)


def save(ob, name):
    path = HERE / f"{name}.blend"
    triangles = sum(len(p.vertices) - 2 for p in ob.data.polygons)
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True, check_existing=False)
    path.with_suffix(".blend1").unlink(missing_ok=True)
    size = path.stat().st_size
    print(f"{path.name}: {triangles} triangles, {len(ob.data.vertices)} vertices, {size} bytes",
          flush=True)
    if size > SIZE_LIMIT:
        raise SystemExit(f"{path.name} is over {SIZE_LIMIT} bytes")


main()
