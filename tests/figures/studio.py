# SPDX-License-Identifier: GPL-3.0-or-later
"""Shared by the scripts that make pictures: objects, a camera, a studio's light, pictures and sheets of them."""
import tempfile
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector


def add_object(name, points, faces, colours=None):
    """A mesh object, smooth, active and alone selected. colours: (n, 3), of the vertices."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(np.asarray(points).tolist(), [], [list(face) for face in faces])
    mesh.polygons.foreach_set('use_smooth', np.ones(len(mesh.polygons), bool))
    ob = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(ob)
    if colours is not None:
        colour(mesh, colours)
        mesh.materials.append(matte())
    return activate(ob)


def activate(ob):
    bpy.context.view_layer.update()  # the view layer may still hold what was removed
    for other in bpy.context.view_layer.objects:
        other.select_set(other == ob)
    bpy.context.view_layer.objects.active = ob
    return ob


def colour(mesh, colours):
    """Colours of vertices, (n, 3), named Colour."""
    found = mesh.color_attributes.get("Colour") or mesh.color_attributes.new("Colour", 'FLOAT_COLOR', 'POINT')
    found.data.foreach_set('color', np.hstack([colours, np.ones((len(colours), 1))]).astype(np.float32).ravel())
    mesh.update()


def add_markers(ob, places, count=None):
    """Numbered markers at the vertices nearest to places. count: among the first so many vertices alone."""
    points = np.array([vertex.co for vertex in ob.data.vertices[:count]])
    for number, place in enumerate(places, 1):
        nearest = int(np.linalg.norm(points - np.array(place), axis=1).argmin())
        ob.vertex_groups.new(name=f"Marker {number}").add([nearest], 1.0, 'REPLACE')


def look(eye, at, lens):
    camera = bpy.context.scene.camera
    camera.location, camera.data.lens = eye, lens
    camera.rotation_euler = (Vector(at) - Vector(eye)).to_track_quat('-Z', 'Y').to_euler()


def picture(size):
    """(rows, columns, 4) of the scene as it is now; its rows begin at the bottom."""
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y = size
    with tempfile.TemporaryDirectory() as folder:
        render.filepath = str(Path(folder) / "picture.png")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(render.filepath)
        pixels = np.array(image.pixels[:], np.float32).reshape(size[1], size[0], 4)
    bpy.data.images.remove(image)
    return pixels


def sheet(rows):
    """Rows of pictures, the first on top."""
    return np.concatenate([np.concatenate(row, axis=1) for row in rows[::-1]], axis=0)


def save(pixels, path, quality=90):
    image = bpy.data.images.new(Path(path).stem, pixels.shape[1], pixels.shape[0])
    image.pixels.foreach_set(np.ascontiguousarray(pixels, np.float32).ravel())
    settings, view = bpy.context.scene.render.image_settings, bpy.context.scene.view_settings
    settings.file_format, settings.color_mode, settings.quality = 'JPEG', 'RGB', quality
    for stamp in (name for name in dir(bpy.context.scene.render) if name.startswith('use_stamp')):
        setattr(bpy.context.scene.render, stamp, False)  # so that a picture made again has the same bytes
    view.view_transform, view.look, view.exposure = 'Standard', 'None', 0  # the pixels went through a view already
    image.save_render(str(path))


# ---------------------------------------------------------------- a studio: soft light, a floor that takes shadows

BACKGROUND = ((0.80, 0.81, 0.83), (0.93, 0.935, 0.94))  # colours at the bottom and at the top, after the view transform


def prepare(samples=48):
    """An empty scene in Cycles, whose pictures have an alpha: see on_paper()."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    scene = bpy.context.scene
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(scene.camera)
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes['Background'].inputs['Color'].default_value = (0.75, 0.82, 0.92, 1)
    scene.world.node_tree.nodes['Background'].inputs['Strength'].default_value = 0.45
    scene.render.engine = 'CYCLES'
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.max_bounces = samples, False, 3
    scene.cycles.use_adaptive_sampling = False
    scene.render.film_transparent = True
    scene.view_settings.view_transform, scene.view_settings.look = 'Filmic', 'High Contrast'


def add_light(name, place, at, size, watts, tint=(1, 1, 1), shadow=True):
    light = bpy.data.lights.new(name, 'AREA')
    light.size, light.energy, light.color = size, watts, tint
    light.cycles.cast_shadow = shadow
    ob = bpy.data.objects.new(name, light)
    ob.location = place
    ob.rotation_euler = (Vector(at) - Vector(place)).to_track_quat('-Z', 'Y').to_euler()
    bpy.context.scene.collection.objects.link(ob)


def prepare_limbs():
    """An empty scene with two lights, for limbs that stand at the origin."""
    prepare(samples=32)
    add_light("Key", (4, -7, 8), (0, 0, 2), 4, 900)
    add_light("Fill", (-6, -5, 3), (0, 0, 2), 5, 300)


def add_floor(size=200):
    """A floor of which shadows alone are seen."""
    corners = size * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    add_object("Floor", corners, [[0, 1, 2, 3]]).is_shadow_catcher = True


def matte():
    """A rough material in the vertices' colours."""
    found = bpy.data.materials.get("Matte")
    if not found:
        found = bpy.data.materials.new("Matte")
        found.use_nodes = True
        nodes, surface = found.node_tree.nodes, found.node_tree.nodes['Principled BSDF']
        surface.inputs['Roughness'].default_value = 0.55
        attribute = nodes.new('ShaderNodeAttribute')
        attribute.attribute_name = "Colour"
        found.node_tree.links.new(attribute.outputs['Color'], surface.inputs['Base Color'])
    return found


def on_paper(pixels):
    """The pixels over the background, opaque."""
    height = np.linspace(0, 1, len(pixels), dtype=np.float32)[:, None, None]
    paper = (1 - height) * np.float32(BACKGROUND[0]) + height * np.float32(BACKGROUND[1])
    alpha = pixels[..., 3:]
    seen = pixels[..., :3] * alpha + np.broadcast_to(paper, pixels[..., :3].shape) * (1 - alpha)
    return np.concatenate([seen, np.ones_like(alpha)], axis=-1)
