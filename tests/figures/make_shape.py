# SPDX-License-Identifier: GPL-3.0-or-later
"""Effects of the settings of the shape, each switched off and by default: rims, single vertices, turns and densities.

    blender --background --factory-startup --python-exit-code 1 --python tests/figures/make_shape.py

Writes shape.jpg beside this file and prints what was measured. Needs a release build.
"""
import sys
import tempfile
from math import cos, pi, radians, sin
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / "addon")]

import detail_deform  # noqa: E402
import shapes  # noqa: E402
from detail_deform.library import native  # noqa: E402
from detail_deform.library.deformer import Bind  # noqa: E402
from detail_deform.scene import mesh_data  # noqa: E402
from make_figures import Subject  # noqa: E402

WIDTH = 1200  # of a row of panels
BAR, CYLINDER = 1.2, 1.6  # lengths
DEFAULT = dict(rim_smoothing=0.05, rotation_smoothing=0.009, base_deformer='AUTOMATIC', steps=1)


# ---------------------------------------------------------------- the cases

def held_subject(name, shape, region, handle):
    """A bound subject and its handle's empty. region, handle: map positions to the vertices in it."""
    positions, faces = shape
    subject = Subject(name, positions, faces)
    subject.group("region", region(positions))
    subject.settings.region = "region"
    empty = subject.handle("handle", handle(positions))
    subject.bind()
    subject.roles = mesh_data.roles(subject.object, "region", [("handle", "handle")])
    return subject, empty


def sheet(name, radius, side):
    """A sheet whose border is fixed, and a disc in its middle pulled up."""
    subject, empty = held_subject(name, shapes.sheet(side), lambda p: (abs(p[:, :2] - 0.5) < 0.499).all(1),
                                  lambda p: np.linalg.norm(p[:, :2] - 0.5, axis=1) < radius)
    empty.location.z += 0.3
    return subject


def twisted_bar(degrees, density=1):
    """A bar, a tenth fixed at one end and a tenth in a handle at the other, which the empty's Euler angle turns."""
    shape = shapes.tube(60 * density + 1, 96 * density, BAR, shapes.square)
    subject, empty = held_subject(f"Bar {len(shape[0])}", shape, lambda p: p[:, 0] > 0.1 * BAR + 1e-6,
                                  lambda p: p[:, 0] > 0.9 * BAR - 1e-6)
    empty.rotation_euler.x = radians(degrees)
    subject.motion = np.array(Matrix.Rotation(radians(degrees), 4, 'X'))[:3]
    return subject


def posed(subject, **options):
    """The subject's surface deformed by the library alone, without the limits of the panel."""
    triangles = mesh_data.triangles(subject.object.data)
    offsets = Bind(subject.rest, triangles, subject.roles, 1).finish().offsets(subject.motion[None], **options)
    made = Subject(f"{subject.object.name} posed", subject.rest + offsets.reshape(-1, 3), triangles)
    made.rest, made.roles = subject.rest, subject.roles
    return made


def bent_cylinder(degrees):
    """A cylinder bent along an arc as long as its free part."""
    ends = 0.1 * CYLINDER, 0.9 * CYLINDER
    subject, empty = held_subject("Cylinder", shapes.tube(81, 60, CYLINDER, shapes.circle),
                                  lambda p: p[:, 0] > ends[0] + 1e-6, lambda p: p[:, 0] > ends[1] - 1e-6)
    angle = radians(degrees)
    radius = (ends[1] - ends[0]) / angle
    arrival = Vector((ends[0] + radius * sin(angle), 0, radius * (1 - cos(angle))))
    empty.location = arrival + Matrix.Rotation(-angle, 3, 'Y') @ (empty.location - Vector((ends[1], 0, 0)))
    empty.rotation_euler.y = -angle
    return subject


def pulled_limb(turns):
    """A cylinder whose end is moved to a side."""
    subject, empty = held_subject(f"Limb {turns}", shapes.tube(81, 60, CYLINDER, shapes.circle),
                                  lambda p: p[:, 0] > 0.1 * CYLINDER, lambda p: p[:, 0] > 0.9 * CYLINDER)
    subject.settings.handles[0].turns = turns
    empty.location += Vector((-0.4, 0, 0.85))
    return subject


def caged():
    """A bumpy plane, and its cage, a sheet of 6 × 6 faces that is rolled."""
    plane, cage = Subject("Bumpy", *shapes.bumpy_plane(161, 8)), Subject("Cage", *shapes.sheet(7))
    turn, arm = 2.2 * (cage.rest[:, 0] - 0.5), 1 / 2.2 - cage.rest[:, 2]
    posed = np.stack([arm * np.sin(turn) + 0.5, cage.rest[:, 1], 1 / 2.2 - arm * np.cos(turn)], -1)
    cage.object.shape_key_add(name="Basis")
    key = cage.object.shape_key_add(name="Rolled")
    key.data.foreach_set('co', posed.astype(np.float32).ravel())
    plane.settings.base, plane.settings.base_object = 'OBJECT', cage.object
    plane.bind()
    key.value = 1
    for subject in (plane, cage):
        subject.roles = np.full(len(subject.rest), native.ROLE_FREE, np.int32)
    return plane, cage


def rows():
    """The panels of each row: subject, title, settings and camera."""
    profile = dict(view=(-0.25, -1, 0.04), centre=(0.403, 0.524, 0.29), height=0.05, pixels=240)
    mirrored = dict(view=(0, -1, 0.5), centre=(0.5, 0.5, 0.287), height=0.26, pixels=280, reflected=True)
    over = dict(view=(-0.35, -1, 0.3), centre=(0.5, 0.5, 0.17), height=0.4, pixels=220)
    rims = ("Rim Smoothing 0", 0.0), ("the default", 0.05)
    disc = sheet("Disc", 0.13, 241)
    for what, look in (("A disc's rim", profile), ("Its reflections", mirrored)):
        yield [(disc, f"{what}, {title}", dict(DEFAULT, rim_smoothing=rim), look) for title, rim in rims]
    vertex = sheet("Vertex", 1e-6, 121)
    yield [(vertex, f"A single vertex, {title}", dict(DEFAULT, rim_smoothing=rim), over) for title, rim in rims]
    along = dict(view=(-1, -1, 0.7), centre=(0.5 * BAR, 0, 0), height=0.62, pixels=270)
    bar = twisted_bar(360)
    yield [(bar, f"Twisted by 360°, {title}", dict(DEFAULT, **settings), along)
           for title, settings in (("Linear", dict(base_deformer='LINEAR')),
                                   ("Linear in 12 steps", dict(base_deformer='LINEAR', steps=12)),
                                   ("the default", {}))]
    bent = bent_cylinder(200)
    aside = dict(view=(0.15, -1, 0.2), centre=(0.2, 0, 0.45), height=1.15, pixels=310)
    yield [(bent, f"Bent by 200°, {title}", dict(DEFAULT, **settings), aside)
           for title, settings in (("Linear", dict(base_deformer='LINEAR')), ("the default", {}),
                                   ("Bend Length 0.03", dict(rotation_smoothing=0.03)))]
    beside = dict(view=(0.15, -1, 0.2), centre=(0.65, 0, 0.38), height=1.15, pixels=310)
    yield [(pulled_limb(turns), f"Pulled to a side, Turns {title}", DEFAULT, beside)
           for turns, title in (('TARGET', "As Empty"), ('FREE', "Freely"))]
    plane, cage = caged()
    above = dict(view=(-0.5, -1, 0.75), centre=(0.5, 0.5, 0.12), height=0.95, pixels=330)
    yield [(cage, "A cage", DEFAULT, above), (plane, "What follows it", DEFAULT, above)]
    densities = 1, 2, 4
    bars = [twisted_bar(135, density) for density in densities]
    # A length of as many edges at each density, as smoothing from triangle to triangle would have it.
    by_edges = [posed(one, rotation_smoothing=DEFAULT['rotation_smoothing'] / density)
                for one, density in zip(bars, densities)]
    for what, subjects in (("smoothed by edges", by_edges), ("the default", bars)):
        yield [(one, f"{len(one.rest):,} vertices, {what}", DEFAULT, along) for one in subjects]


# ---------------------------------------------------------------- what is measured

def report(subject, title):
    """Prints the measures; returns the one that tells most of the case."""
    deformed = subject.evaluated()
    triangles = mesh_data.triangles(subject.object.data)
    found = native.measure(subject.rest, deformed, triangles, subject.roles)
    name = subject.object.name
    if name == "Vertex":
        said = f"slope {slope_at_handle(subject, deformed, triangles):.0f}°"
    elif name == "Disc":
        said = f"angle at its edges {crease_at_rim(subject, deformed, triangles):.0f}°"
    elif title.startswith("Twisted"):
        said = twist(deformed)
    elif title.startswith("Bent"):
        said = f"{thickness(deformed):.2f} as thick in the middle"
    elif title.startswith("Pulled"):
        said = f"stretched by {100 * found.stretch:.1f}%"
    elif name in {"Cage", "Bumpy"}:
        said = f"{len(triangles):,} triangles"
    else:
        said = f"{found.intersecting_triangles:,} faces intersect"
    print(f"{title}: {said} ({found.intersecting_triangles} faces intersect, stretch {found.stretch:.3f})", flush=True)
    return said


def normals(p, triangles):
    a, b, c = (p[triangles[:, k]].astype(float) for k in range(3))
    n = np.cross(b - a, c - a)
    return n / np.linalg.norm(n, axis=1)[:, None]


def slope_at_handle(subject, deformed, triangles):
    """Mean slope of the triangles around the handle, in degrees."""
    around = (subject.roles[triangles] >= 0).any(1)
    return np.degrees(np.arccos(normals(deformed, triangles)[around, 2].clip(-1, 1))).mean()


def crease_at_rim(subject, deformed, triangles):
    """Mean angle, in degrees, at the edges between the handle's triangles and free ones."""
    beside, held = {}, (subject.roles[triangles] >= 0)
    for j in np.flatnonzero(held.sum(1) >= 2):
        for k in range(3):
            if held[j, k] and held[j, (k + 1) % 3]:
                beside.setdefault(frozenset(triangles[j, [k, (k + 1) % 3]].tolist()), []).append(j)
    n = normals(deformed, triangles)
    pairs = np.array([pair for pair in beside.values() if len(pair) == 2 and held[pair].all(1).sum() == 1])
    return np.degrees(np.arccos((n[pairs[:, 0]] * n[pairs[:, 1]]).sum(1).clip(-1, 1))).mean()


def twist(deformed):
    """How evenly the bar's rings turn. deformed: of the coarsest bar."""
    rings = deformed[:61 * 96].reshape(61, 96, 3)[..., 1:].astype(float)
    across = rings[:, 0] - rings[:, 48]
    angles = np.degrees(np.unwrap(np.arctan2(across[:, 1], across[:, 0])))
    steps = np.abs(np.diff(angles))[6:54]  # those between the held ends
    if steps.sum() < 1:
        return "nothing turns"
    return f"at most {steps.max() / steps.mean():.1f} times the mean rate"


def thickness(deformed):
    """The diameter in the middle of the cylinder, in the plane of its bend, as a fraction of that at rest."""
    ring = deformed[40 * 60:41 * 60].astype(float)
    return np.linalg.norm(ring[15] - ring[45]) / 0.16


# ---------------------------------------------------------------- the sheet

def paint(subject):
    """Free and held faces in two colours, shaded smoothly but for edges that are sharp at rest."""
    mesh = subject.object.data
    for name, colour in (("Free", (0.84, 0.58, 0.30, 1)), ("Held", (0.45, 0.47, 0.52, 1))):
        material = bpy.data.materials.get(name) or bpy.data.materials.new(name)
        material.diffuse_color = colour
        mesh.materials.append(material)
    is_held = subject.roles != native.ROLE_FREE
    mesh.polygons.foreach_set('material_index', [int(is_held[list(p.vertices)].all()) for p in mesh.polygons])
    mesh.polygons.foreach_set('use_smooth', [True] * len(mesh.polygons))
    beside = {}
    for polygon in mesh.polygons:
        for key in polygon.edge_keys:
            beside.setdefault(key, []).append(polygon.normal)
    for edge in mesh.edges:
        one, *others = beside[edge.key]
        edge.use_edge_sharp = any(one.angle(other) > radians(40) for other in others)
    if hasattr(mesh, 'use_auto_smooth'):  # up to Blender 4.0; later sharp edges are always regarded
        mesh.use_auto_smooth, mesh.auto_smooth_angle = True, pi


def prepare_scene():
    scene = bpy.context.scene
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.camera.data.type = 'ORTHO'
    scene.camera.data.sensor_fit = 'VERTICAL'
    scene.collection.objects.link(scene.camera)
    scene.world = bpy.data.worlds.new("White")
    scene.world.color = (1, 1, 1)
    shading = scene.display.shading
    shading.light, shading.color_type = 'STUDIO', 'MATERIAL'
    shading.show_cavity, shading.cavity_type = True, 'WORLD'
    scene.view_settings.view_transform = 'Standard'
    render = scene.render
    render.engine = 'BLENDER_WORKBENCH'
    render.film_transparent = False
    text = bpy.data.curves.new("Title", 'FONT')
    text.materials.append(bpy.data.materials.new("Ink"))
    text.materials[0].diffuse_color = (0.05, 0.05, 0.05, 1)
    sign = bpy.data.objects.new("Title", text)
    sign.parent = scene.camera
    scene.collection.objects.link(sign)
    return sign


def picture(folder, sign, title, width, view, centre, height, pixels, reflected=False):
    """(rows, columns, 4) of the scene as it is now. reflected: shaded as stripes reflected, which show bends."""
    scene = bpy.context.scene
    shading = scene.display.shading
    shading.light = 'MATCAP' if reflected else 'STUDIO'
    shading.studio_light = 'reflection_check_horizontal.exr' if reflected else 'Default'
    scene.camera.data.ortho_scale = height
    scene.camera.matrix_world = (Matrix.Translation(Vector(centre) + 5 * Vector(view).normalized())
                                 @ Vector(view).to_track_quat('Z', 'Y').to_matrix().to_4x4())
    sign.data.body = title
    pixel = height / pixels
    sign.location = ((12 - width / 2) * pixel, (pixels / 2 - 24) * pixel, -1)
    sign.scale = [20 * pixel] * 3
    scene.render.resolution_x, scene.render.resolution_y = width, pixels
    scene.render.filepath = str(Path(folder) / "picture.png")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    values = np.array(image.pixels[:], np.float32).reshape(pixels, width, 4)
    bpy.data.images.remove(image)
    return values


def main():
    detail_deform.register()
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    sign = prepare_scene()
    sheet_rows = []
    with tempfile.TemporaryDirectory() as folder:
        for panels in rows():
            pictures = []
            for subject in {panel[0].object.name: panel[0] for panel in panels}.values():
                paint(subject)
            for subject, title, settings, look in panels:
                for other in bpy.data.objects:
                    other.hide_render = other.type == 'MESH' and other != subject.object
                subject.shown(**settings)
                title = f"{title}\n{report(subject, title)}"
                pictures.append(picture(folder, sign, title, WIDTH // len(panels), **look))
            sheet_rows.append(np.concatenate(pictures, axis=1))
    pixels = np.concatenate(sheet_rows[::-1], axis=0)  # images begin at the bottom
    image = bpy.data.images.new("shape", pixels.shape[1], pixels.shape[0])
    image.pixels.foreach_set(pixels.ravel())
    settings = bpy.context.scene.render.image_settings
    settings.file_format, settings.quality = 'JPEG', 85
    image.save_render(str(HERE / "shape.jpg"))
    detail_deform.unregister()


main()
