# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's figures 1, 3, 4 and 5, by the add-on: a rendered sheet and a table of numbers each.

    blender --background --factory-startup --python-exit-code 1 --python tests/figures/make_figures.py
    ... -- 3 5 to make only these, --check to fail where a figure doesn't show what the paper's does

Writes fig1.jpg ... and numbers.md beside this file. Needs a release build.
"""
import sys
import time
from math import radians
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1] / "addon")]

import detail_deform  # noqa: E402
import shapes  # noqa: E402
from detail_deform.library import native  # noqa: E402
from detail_deform.scene import mesh_data  # noqa: E402

COLUMNS = ("panel", "intersecting pairs (new)", "normal error, °", "mean ‖S − R‖", "area", "volume", "update, ms")
PAPERS_LINEAR = {'method': 'TRANSFER', 'rotation_only': True, 'refine': 0, 'rim_smoothing': 0.0,
                 'base_deformer': 'LINEAR'}
REFINED = {'method': 'TRANSFER', 'rotation_only': True, 'refine': 4, 'rim_smoothing': 0.05,
           'base_deformer': 'AUTOMATIC'}


# ---------------------------------------------------------------- one surface and its deformations

class Subject:
    """A bound object, posed; each panel of a figure is one choice of settings."""

    def __init__(self, name, positions, faces):
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata(positions.tolist(), [], faces.tolist())
        self.object = bpy.data.objects.new(name, mesh)
        bpy.context.scene.collection.objects.link(self.object)
        self.settings = self.object.detail_deform
        self.rest = mesh_data.positions(mesh)
        self.panels, self.rows = [("S", self.rest)], []
        self.is_closed = False

    def group(self, name, mask):
        self.object.vertex_groups.new(name=name).add(np.flatnonzero(mask).tolist(), 1.0, 'REPLACE')

    def handle(self, name, mask):
        """Returns its empty, at the middle of the vertices."""
        self.group(name, mask)
        empty = bpy.data.objects.new(name, None)
        empty.location = self.rest[mask].mean(0).tolist()
        bpy.context.scene.collection.objects.link(empty)
        item = self.settings.handles.add()
        item.name = item.vertex_group = name
        item.target = empty
        return empty

    def bind(self):
        bpy.context.view_layer.objects.active = self.object
        bpy.context.view_layer.update()
        bpy.ops.object.detail_deform_bind(wait=True)

    def evaluated(self):
        mesh = self.object.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        return mesh_data.positions(mesh)

    def shown(self, **settings):
        for name, value in settings.items():
            setattr(self.settings, name, value)
        bpy.context.view_layer.update()
        return self.evaluated()

    def panel(self, title, **settings):
        """Adds a panel and its row of numbers; returns the measures."""
        deformed_base = self.shown(output='BASE')
        deformed = self.shown(output='RESULT', **settings)
        # Updated once more: the first update by a method prepares it.
        start = time.perf_counter()
        bpy.ops.object.detail_deform_update()
        slow = self.settings.method == 'VOLUMES'
        milliseconds = 1e3 * (time.perf_counter() - start) if slow else self.settings.update_ms
        roles = mesh_data.roles(self.object, self.settings.region,
                                [(h.name, h.vertex_group) for h in self.settings.handles], False)
        found = native.measure(self.rest, deformed, mesh_data.triangles(self.object.data), roles,
                               self.rest_base(), deformed_base)
        self.panels.append((title, deformed))
        self.rows.append((title, f"{found.intersecting_pairs} ({found.new_intersecting_pairs})",
                          f"{found.normal_error:.1f}", f"{found.stretch:.3f}", f"{found.area_ratio:.3f}",
                          f"{found.volume_ratio:.3f}" if self.is_closed else "–", f"{milliseconds:.0f}"))
        return found

    def rest_base(self):
        if self.settings.base == 'OBJECT':
            return mesh_data.positions(self.settings.base_object.data)
        return self._rest_base

    def note_rest_base(self):
        self._rest_base = self.shown(output='BASE')
        self.shown(output='RESULT')


def plane_subject(name, motion):
    """The bumpy plane, fixed on the left, its right side moved."""
    positions, faces = shapes.bumpy_plane()
    subject = Subject(name, positions, faces)
    column = np.repeat(np.arange(201), 201)
    subject.group("region", (column >= 23) & (column <= 177))
    subject.settings.region = "region"
    empty = subject.handle("right", column >= 178)
    subject.bind()
    subject.note_rest_base()
    empty.matrix_world = motion @ Matrix.Translation(empty.location)
    return subject


# ---------------------------------------------------------------- the figures

def figure_1():
    """A pure translation of the right side: what happens to the bumps."""
    subject = plane_subject("Bumps", Matrix.Translation((0, 0, 0.38)))
    sheared = subject.panel("VarMin", method='VARIATIONAL')
    subject.panel("Normal displacements", method='NORMAL')
    subject.panel("Gradient editing", method='GRADIENT', rotation_only=True)
    turned = subject.panel("Detail transfer", **PAPERS_LINEAR)
    refined = subject.panel("Transfer, refined", **REFINED)
    yield subject, dict(columns=3, view=(-0.6, -1.6, 1.1))
    yield "transfer turns the details", turned.normal_error < 0.6 * sheared.normal_error
    yield "nothing intersects", turned.intersecting_pairs + refined.intersecting_pairs == 0


def figure_3():
    """Hooked thorns, no height field: the right side is lifted and turned."""
    positions, faces = shapes.thorns()
    subject = Subject("Thorns", positions, faces)
    x = positions[:, 0]
    # Borders run between the thorns, where the plate is calm.
    subject.group("region", x > 1.7 / 7)
    subject.settings.region = "region"
    # Under thorns that overhang, stiffness is better measured on the base, as the paper has it.
    subject.settings.base_metric = 'BASE'
    empty = subject.handle("right", x > 6 * 1.7 / 7)
    subject.bind()
    subject.note_rest_base()
    empty.matrix_world = (Matrix.Translation((-0.2, 0, 0.5)) @ Matrix.Translation(empty.location)
                          @ Matrix.Rotation(radians(-60), 4, 'Y'))
    normal = subject.panel("Normal displacements", method='NORMAL')
    status = subject.settings.status
    transfer = subject.panel("Detail transfer", **PAPERS_LINEAR)
    refined = subject.panel("Transfer, refined", **REFINED)
    subject.settings.base_metric = 'SURFACE'
    bpy.ops.object.detail_deform_bind(wait=True, keep_rest=True)
    for title, settings in (("Transfer, stiffness from surface", PAPERS_LINEAR), ("the same, refined", REFINED)):
        subject.panel(title, **settings)
        subject.panels.pop()  # numbers only
    print("status:", status)
    yield subject, dict(columns=2, view=(-0.3, -1.7, 0.8))
    yield "normal displacements fail", normal.new_intersecting_pairs > 50 and 'overhang' in status
    yield "transfer makes no new intersection", transfer.new_intersecting_pairs == 0
    yield "nor does its refinement", refined.new_intersecting_pairs == 0


def figure_4():
    """A cylinder over a base of half its radius, which is bent explicitly by 90 degrees."""
    positions, faces = shapes.cylinder()
    subject = Subject("Cylinder", positions, faces)
    subject.is_closed = True
    base = bpy.data.objects.new("Base", subject.object.data.copy())
    narrow = positions * (0.5, 0.5, 1)
    base.data.vertices.foreach_set('co', narrow.ravel())
    base.hide_render = True
    bpy.context.scene.collection.objects.link(base)
    subject.settings.base, subject.settings.base_object = 'OBJECT', base
    subject.bind()
    base.shape_key_add(name="Rest")
    key = base.shape_key_add(name="Bent")
    key.data.foreach_set('co', shapes.bent(narrow, 90).astype(np.float32).ravel())
    key.value = 1
    normal = subject.panel("Normal displacements", method='NORMAL')
    whole = subject.panel("Detail transfer", method='TRANSFER', rotation_only=False)
    rotations = subject.panel("Transfer, rotations", **PAPERS_LINEAR)
    volumes = subject.panel("Displacement volumes", method='VOLUMES')
    yield subject, dict(columns=5, view=(0, -1, 0.25))
    yield "normal displacements intersect", normal.intersecting_pairs > 50
    yield "transfer doesn't", whole.intersecting_pairs + rotations.intersecting_pairs == 0
    yield "displacement volumes keep the volume", abs(volumes.volume_ratio - 1) < 0.05
    yield "and don't intersect", volumes.intersecting_pairs == 0


def figure_5():
    """A concave bend of the bumpy plane."""
    turn = (Matrix.Translation((0.3, 0, 0.32)) @ Matrix.Rotation(radians(-110), 4, 'Y')
            @ Matrix.Translation((-0.5, 0, -0.0)))
    subject = plane_subject("Bend", turn)
    normal = subject.panel("Normal displacements", method='NORMAL')
    subject.panel("Gradient editing", method='GRADIENT', rotation_only=True)
    transfer = subject.panel("Detail transfer", **PAPERS_LINEAR)
    refined = subject.panel("Transfer, refined", **REFINED)
    yield subject, dict(columns=3, view=(-1.3, -1.0, 0.75))
    yield "transfer stretches details less", transfer.stretch < normal.stretch
    yield "its refinement still less", refined.stretch < transfer.stretch


FIGURES = {'1': figure_1, '3': figure_3, '4': figure_4, '5': figure_5}


# ---------------------------------------------------------------- sheets and tables

def render_sheet(subject, path, columns, view):
    """All panels in rows, with their titles, in one picture."""
    scene = bpy.context.scene
    subject.object.hide_render = True
    view = Vector(view).normalized()
    right = view.cross((0, 0, -1)).normalized()
    up = right.cross(-view)
    points = np.concatenate([p for _, p in subject.panels])
    spans = [points @ np.array(axis) for axis in (right, up)]
    width, height = (1.12 * np.ptp(s) for s in spans)
    label = 0.055 * width
    height += 2.2 * label
    faces = [tuple(p.vertices) for p in subject.object.data.polygons]
    rotation = Matrix((right, up, view)).transposed().to_4x4()
    for number, (title, positions) in enumerate(subject.panels):
        column, row = number % columns, number // columns
        place = Vector(right) * column * width - Vector(up) * row * height
        mesh = bpy.data.meshes.new(title)
        mesh.from_pydata(positions.tolist(), [], faces)
        mesh.polygons.foreach_set('use_smooth', [True] * len(faces))
        ob = bpy.data.objects.new(title, mesh)
        own = [positions @ np.array(axis) for axis in (right, up)]
        middle = [0.5 * (s.max() + s.min()) - 0.5 * (o.max() + o.min()) for s, o in zip(spans, own)]
        ob.location = place + Vector(right) * middle[0] + Vector(up) * middle[1]
        ob.color = (0.84, 0.58, 0.30, 1)
        scene.collection.objects.link(ob)
        text = bpy.data.curves.new(title, 'FONT')
        text.body, text.size, text.align_x = title, label, 'CENTER'
        sign = bpy.data.objects.new(title, text)
        centre = [0.5 * (s.max() + s.min()) for s in spans]
        depth = (points @ np.array(view)).max()
        sign.matrix_world = Matrix.Translation(
            place + Vector(right) * centre[0] + Vector(up) * (spans[1].min() - 1.4 * label)
            + view * depth) @ rotation
        sign.color = (0.05, 0.05, 0.05, 1)
        scene.collection.objects.link(sign)
    rows = -(-len(subject.panels) // columns)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.type = 'ORTHO'
    camera.data.ortho_scale = max(columns * width, rows * height)
    camera.data.clip_end = 1000
    centre = [0.5 * (s.max() + s.min()) for s in spans]
    middle = (Vector(right) * (centre[0] + 0.5 * (columns - 1) * width)
              + Vector(up) * (centre[1] - 1.1 * label - 0.5 * (rows - 1) * height))
    camera.matrix_world = Matrix.Translation(middle + view * 50) @ rotation
    scene.collection.objects.link(camera)
    scene.camera = camera
    render = scene.render
    render.engine = 'BLENDER_WORKBENCH'
    render.resolution_x = 1500
    render.resolution_y = int(1500 * rows * height / (columns * width))
    render.film_transparent = False
    scene.world = bpy.data.worlds.new("White")
    scene.world.color = (1, 1, 1)
    scene.display.shading.light = 'STUDIO'
    scene.display.shading.color_type = 'OBJECT'
    scene.display.shading.show_cavity = True
    scene.display.shading.cavity_type = 'WORLD'
    scene.view_settings.view_transform = 'Standard'
    render.image_settings.file_format = 'JPEG'
    render.image_settings.quality = 85
    render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


def table(rows):
    lines = [COLUMNS, ['---'] + ['--:'] * (len(COLUMNS) - 1), *rows]
    return '\n'.join('| ' + ' | '.join(line) + ' |' for line in lines)


def main(arguments):
    check = '--check' in arguments
    chosen = [a for a in arguments if a in FIGURES] or list(FIGURES)
    detail_deform.register()
    failures, texts = [], []
    try:
        for name in chosen:
            bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
            steps = FIGURES[name]()
            subject, layout = next(steps)
            for claim, holds in steps:
                print(f"Fig. {name}: {claim}: {'yes' if holds else 'NO'}", flush=True)
                if not holds:
                    failures.append(f"Fig. {name}: {claim}")
            triangles = len(mesh_data.triangles(subject.object.data))
            texts.append(f"**Fig. {name}**, {triangles:,} triangles. {FIGURES[name].__doc__}\n\n"
                         f"{table(subject.rows)}\n")
            print(texts[-1], flush=True)
            if not check:
                render_sheet(subject, HERE / f"fig{name}.jpg", **layout)
    finally:
        detail_deform.unregister()
    if not check and chosen == list(FIGURES):
        (HERE / "numbers.md").write_text('\n'.join(texts), encoding='utf-8')
    if check and failures:
        raise SystemExit('; '.join(failures))


if __name__ == '__main__':
    main(sys.argv[sys.argv.index('--') + 1:] if '--' in sys.argv else [])
