# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes addon/manual/shirt.jpg: a shirt over a body at rest, and following it into a pose, from before and behind.

blender --background --factory-startup --python-exit-code 1 --python tests/figures/make_shirt.py
"""
import sys
from pathlib import Path

import bpy

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / 'addon'), str(Path(__file__).parent)]
import clothes  # noqa: E402
import detail_deform  # noqa: E402
import studio  # noqa: E402

SIZE = (500, 540)


def dress(shirt, body):
    """The shirt follows the body from now on."""
    studio.activate(shirt)
    settings = shirt.detail_deform.transfer
    settings.source, settings.correspondence, settings.keep_outside = body, 'NEAREST', True
    bpy.ops.object.detail_deform_transfer_live()


def light():
    studio.add_light("Key", (1.6, 4.6, 3.6), (0, 0, 1.3), 1.6, 230, (1, 0.95, 0.88))
    studio.add_light("Fill", (4, -4, 1.5), (0, 0, 1.2), 3, 22, (0.85, 0.92, 1))
    studio.add_light("Behind", (-4, -2.5, 3.2), (0, 0, 1.4), 1.6, 170)


def main():
    detail_deform.register()
    studio.prepare()
    body, shirt = clothes.add_body(), clothes.add_shirt()
    clothes.add_rig(body)
    bpy.context.scene.frame_set(1)
    dress(shirt, body)
    light()
    row = []
    for frame, eye in ((1, (6, 1.6, 1.7)), (2, (6, 1.6, 1.7)), (2, (-5.5, 2.2, 1.9))):
        bpy.context.scene.frame_set(frame)
        studio.look(eye, (0, 0, 1.34 if frame == 1 else 1.47), 132)
        row.append(studio.on_paper(studio.picture(SIZE)))
    studio.save(studio.sheet([row]), ROOT / 'addon' / 'manual' / 'shirt.jpg')
    detail_deform.unregister()


main()
