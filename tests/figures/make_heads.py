# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes addon/manual/heads.jpg: one head's keys above, carried over to a head of other topology and shape below.

blender --background --factory-startup --python-exit-code 1 --python tests/figures/make_heads.py
"""
import sys
from pathlib import Path

import bpy

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / 'addon'), str(Path(__file__).parent)]
import detail_deform  # noqa: E402
import heads  # noqa: E402
import studio  # noqa: E402

SIZE = (320, 400)


def light():
    studio.add_light("Key", (6, 5, 5), (0, 0, -0.4), 2.5, 400, (1, 0.95, 0.88))
    studio.add_light("Fill", (6, -6, 1), (0, 0, -0.4), 5, 70, (0.85, 0.92, 1))
    studio.add_light("Rim", (-6, -3, 5), (0, 0, 0), 3, 170)


def show(ob, name):
    for key in ob.data.shape_keys.key_blocks[1:]:
        key.value = key.name == name


def main():
    detail_deform.register()
    studio.prepare()
    young, old = heads.add_young(), heads.add_old()
    heads.mark(young, heads.YOUNG)
    heads.mark(old, heads.OLD)
    studio.activate(old)
    bpy.ops.object.detail_deform_transfer_match(source=young.name)
    bpy.ops.object.detail_deform_transfer(source=young.name, what='ALL_KEYS')
    light()
    rows = []
    for ob, middle in ((young, -0.30), (old, -0.40)):
        young.hide_render, old.hide_render = ob != young, ob != old
        studio.look((13, 5.2, 0.2 + middle), (0.05, 0.02, middle), 152 if ob == young else 142)
        rows.append([])
        for name in ("", *heads.KEYS):
            show(ob, name)
            rows[-1].append(studio.on_paper(studio.picture(SIZE)))
    studio.save(studio.sheet(rows), ROOT / 'addon' / 'manual' / 'heads.jpg')
    detail_deform.unregister()


main()
