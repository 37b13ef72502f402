# SPDX-License-Identifier: GPL-3.0-or-later
"""The manual's pictures: Blender's own window, and each panel by itself.

    xvfb-run -a -s "-screen 0 1280x1000x24" blender --factory-startup --window-geometry 0 0 1280 1000 \
        --python tests/figures/make_manual.py

Writes into addon/manual/. Needs a release build, xdotool, and ImageMagick's import and convert.
"""
import subprocess
import sys
from math import radians
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / 'addon'), str(ROOT / 'tests' / 'figures')]
import detail_deform  # noqa: E402
from detail_deform.scene import mesh_data  # noqa: E402
from detail_deform.setup import markers  # noqa: E402
from detail_deform.ui import examples_panel, panels, transfer_panel  # noqa: E402
import manual_sculpt  # noqa: E402
import manual_start  # noqa: E402
from manual_window import (  # noqa: E402
    OUT, VIEW_ONLY, activate, area, arrange, look, number, panel_picture, picture, run, settle, show_only)

def open_scene(name):
    bpy.ops.wm.open_mainfile(filepath=str(ROOT / 'blend_fixtures' / name), load_ui=False)


# Heights in overview.png of the status, Bind and its buttons, the method, the output, Apply and Remove, and the panels.
OVERVIEW = (54, 91, 187, 303, 376, 421, 447, 473, 499, 525)


def hide_cameras():
    for ob in bpy.context.scene.objects:
        if ob.type == 'CAMERA':
            ob.hide_set(True)


def turn_about_itself(empty, shift, degrees):
    place = empty.matrix_world.translation.copy()
    empty.matrix_world = (Matrix.Translation(Vector(shift) + place) @ Matrix.Rotation(radians(degrees), 4, 'Y')
                          @ Matrix.Translation(-place) @ empty.matrix_world)


def overview():
    """The main panel, and its subpanels closed."""
    main, *others = panels.OBJECT_PT_detail_deform, *(
        cls for cls in panels.CLASSES if getattr(cls, 'bl_parent_id', "") == 'OBJECT_PT_detail_deform')
    return main, *(type(f'{cls.__name__}_closed', (cls,), {'bl_options': {'DEFAULT_CLOSED'}}) for cls in others)


def suzanne():
    open_scene('suzanne.blend')
    yield 1.0
    yield from arrange()
    ob = bpy.data.objects["Suzanne"]
    activate(ob)
    bpy.ops.object.detail_deform_bind(wait=True)
    ear = ob.detail_deform.handles[0].target
    turn_about_itself(ear, (-0.45, -0.1, 0.6), 50)
    ear.empty_display_size = 0.4
    bpy.context.view_layer.update()
    hide_cameras()
    look((-1.2, -5.0, 0.9), (-0.25, 0, 0.25), 62)
    ob.select_set(False)  # its outline hides the details
    yield from settle()
    area('OUTLINER').type = 'INFO'  # an editor whose content doesn't change
    show_only(panels.OBJECT_PT_detail_deform, panels.OBJECT_PT_detail_deform_handles)
    yield from settle()
    picture('window.jpg', ('VIEW_3D', 'PROPERTIES'), ('-resize', '900x', '-quality', '72'))

    show_only(*overview())
    yield from settle()
    panel_picture('overview.png')
    number('overview.png', OVERVIEW)

    settings = ob.detail_deform
    settings.preview = True
    yield from settle()
    picture('vertices.jpg', ('VIEW_3D',), VIEW_ONLY)
    for name, cls in (('panel', panels.OBJECT_PT_detail_deform), ('handles', panels.OBJECT_PT_detail_deform_handles),
                      ('base', panels.OBJECT_PT_detail_deform_base),
                      ('advanced', panels.OBJECT_PT_detail_deform_advanced),
                      ('comparison', panels.OBJECT_PT_detail_deform_comparison)):
        show_only(cls)
        yield from settle()
        panel_picture(f'{name}.png')

    show_only(panels.OBJECT_PT_detail_deform)
    settings.handles[1].enabled = False  # differs from what is bound, which gives a message
    yield from settle()
    panel_picture('message.png')
    settings.handles[1].enabled = True

    for name, axis in (("Ear Up", 2), ("Ear Back", 1)):
        ear.location[axis] += 0.4
        bpy.context.view_layer.update()
        bpy.ops.object.detail_deform_save_key(name=name)
    ob.data.shape_keys.key_blocks["Ear Up"].value = 0.7
    show_only(panels.OBJECT_PT_detail_deform_expressions)
    yield from settle()
    panel_picture('expressions.png')

    activate(ear)
    show_only(panels.OBJECT_PT_detail_deform_empty)
    area('PROPERTIES').spaces[0].context = 'OBJECT'
    yield from settle()
    panel_picture('empty.png')


def creatures():
    open_scene('creatures.blend')
    yield 1.0
    giraffe, calf = bpy.data.objects["Giraffe"], bpy.data.objects["Calf"]
    area('PROPERTIES').spaces[0].context = 'MODIFIER'
    activate(giraffe)
    giraffe.select_set(False)
    show_only(transfer_panel.OBJECT_PT_detail_deform_transfer)
    hide_cameras()
    giraffe.location = (2.4, 0.4, 0)  # beside the calf
    look((3.2, -6.6, 2.6), (1.3, 0.2, 1.55), 62)
    yield from settle()
    picture('markers.jpg', ('VIEW_3D',), VIEW_ONLY)
    bpy.ops.object.detail_deform_transfer_match()
    giraffe.detail_deform.transfer.show_match, giraffe.detail_deform.transfer.show_markers = True, False
    yield from settle()
    picture('match.jpg', ('VIEW_3D',), VIEW_ONLY)
    giraffe.detail_deform.transfer.show_match = False
    bpy.ops.object.detail_deform_transfer_live()
    bpy.context.scene.frame_set(17)
    yield 2.0
    yield from settle()
    picture('following.jpg', ('VIEW_3D',), VIEW_ONLY)
    giraffe.detail_deform.transfer.show_markers = True
    yield from settle()
    panel_picture('transfer.png')
    bpy.ops.object.detail_deform_transfer_live(on=False)

    examples = examples_of(calf)
    bpy.data.objects.remove(giraffe)
    activate(calf)
    for example in examples:
        example.select_set(True)
    settings = calf.detail_deform
    settings.method = 'EXAMPLES'
    bpy.ops.object.detail_deform_examples_from_objects()
    for example in examples:
        example.hide_set(True)
    points, targets = mesh_data.positions(calf.data), {}
    for name, marker in (("muzzle", 1), ("hoof L", 26), ("hoof R", 27), ("heel L", 36), ("heel R", 37)):
        near = np.linalg.norm(points - points[markers.of(calf)[marker]], axis=1) < 0.09
        calf.vertex_groups.new(name=name).add(np.flatnonzero(near).tolist(), 1.0, 'REPLACE')
        bpy.ops.object.detail_deform_handle_add(vertex_group=name, align=False)
        targets[name] = settings.handles[-1].target
        targets[name].empty_display_size = 0.15
    bpy.context.view_layer.update()
    bpy.ops.object.detail_deform_bind(wait=True)
    targets["hoof L"].location += Vector((0.32, 0, 0.30))
    targets["muzzle"].location += Vector((-0.25, 0, -0.75))
    bpy.context.view_layer.update()
    show_only(examples_panel.OBJECT_PT_detail_deform_examples)
    yield from settle()
    panel_picture('examples.png')


def examples_of(calf):
    """Copies of the calf in three of its poses."""
    scene, found = bpy.context.scene, []
    for frame, name in ((9, "Head down"), (17, "Step"), (24, "Leap")):
        scene.frame_set(frame)
        mesh = bpy.data.meshes.new_from_object(calf.evaluated_get(bpy.context.evaluated_depsgraph_get()))
        found.append(bpy.data.objects.new(name, mesh))
        scene.collection.objects.link(found[-1])
    scene.frame_set(1)
    calf.modifiers.remove(calf.modifiers["Armature"])
    return found


def steps():
    """Yields the seconds to wait before going on: in between Blender draws."""
    subprocess.run([bpy.app.binary_path, '--background', '--factory-startup', '--python-exit-code', '1', '--python',
                    str(ROOT / 'tests' / 'figures' / 'manual_shapes.py')], check=True)
    yield from manual_start.make(ROOT)
    yield from manual_sculpt.make(ROOT)
    yield from suzanne()
    yield from creatures()


def main():
    for cls in (*panels.CLASSES, transfer_panel.OBJECT_PT_detail_deform_transfer):
        if issubclass(cls, bpy.types.Panel):
            cls.bl_options = set()  # all of them open
    detail_deform.register()
    bpy.context.preferences.view.show_splash = False
    OUT.mkdir(exist_ok=True)
    run(steps())


main()
