# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes from files: given a region and a handle by rule, and driven like the zoo's."""

from pathlib import Path

import addon_utils
import bpy
import numpy as np

from . import checks
from .driver import METHODS, Case, Outcome, drive
from .specimen import REGION, RIGHT, DoesNotCombine, Specimen, update

HOWS = ("by its ends", "by a pull")
_ORDER = ('result', 'sentence', 'failure')
_MOST = 3  # the number of a file's largest objects that are driven
_SMALL = 20000  # the number of vertices below which slow methods are tried


def drive_file(path, how, rows):
    """The worst Outcome of a file's largest objects; None where there is no mesh."""
    worst = None
    for name in _load(path):
        if worst is not None:
            _load(path)
        ob = bpy.data.objects[name]
        methods = METHODS[:-1] if len(ob.data.vertices) < _SMALL else METHODS[:1]
        outcome = drive(Case((), methods), rows, lambda drive, name=name: _prepare(drive, name, how))
        if outcome:
            outcome = Outcome(outcome.kind, f"{name}, {len(ob.data.vertices)} vertices: {outcome.text}")
            worst = max(filter(None, (outcome, worst)), key=lambda one: _ORDER.index(one.kind))
    return worst


def _load(path):
    """Loads a file; returns the names of its largest visible mesh objects."""
    try:
        if Path(path).suffix == '.blend':
            bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)
        else:
            bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
            _import(Path(path))
    except (RuntimeError, ValueError, StopIteration):  # not a file that this Blender reads
        return []
    update()
    found = [ob for ob in bpy.context.view_layer.objects if ob.type == 'MESH' and ob.visible_get()]
    found.sort(key=lambda ob: len(ob.data.vertices), reverse=True)
    return [ob.name for ob in found[:_MOST]]


def _import(path):
    kind, file = path.suffix.lower(), str(path)
    if kind == '.off':
        _import_off(path)
    elif kind == '.obj':
        bpy.ops.wm.obj_import(filepath=file)
    elif kind in {'.glb', '.gltf'}:
        addon_utils.enable('io_scene_gltf2')
        bpy.ops.import_scene.gltf(filepath=file)
    elif bpy.app.version >= (4, 1):
        getattr(bpy.ops.wm, f'{kind[1:]}_import')(filepath=file)
    else:
        addon_utils.enable(f'io_mesh_{kind[1:]}')
        getattr(bpy.ops.import_mesh, kind[1:])(filepath=file)


def _import_off(path):
    words = [line.split('#')[0].split() for line in path.read_text(errors='replace').splitlines()]
    words = [word for line in words for word in line]
    numbers = iter(words[1:] if words[0].endswith('OFF') else words)
    vertices, faces, _ = (int(next(numbers)) for _ in range(3))
    positions = [[float(next(numbers)) for _ in range(3)] for _ in range(vertices)]
    corners = [[int(next(numbers)) for _ in range(int(next(numbers)))] for _ in range(faces)]
    mesh = bpy.data.meshes.new(path.stem)
    mesh.from_pydata(positions, [], corners)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new(path.stem, mesh))


def _prepare(drive, name, how):
    """Makes the Specimen for _Drive.run(): an object of the scene with a region and a handle."""
    ob = bpy.data.objects[name]
    for other in bpy.context.view_layer.objects:
        other.select_set(other == ob)
    bpy.context.view_layer.objects.active = ob
    if ob.mode != 'OBJECT':
        bpy.ops.object.mode_set(mode='OBJECT')
    of = Specimen.of(ob)
    of.shows_own_faults = bool(ob.modifiers)
    of.is_carried = any(modifier.type in {'ARMATURE', 'MIRROR'} for modifier in ob.modifiers)
    positions = checks.own(ob)
    if not len(positions):
        raise DoesNotCombine
    axis = positions[:, np.ptp(positions, axis=0).argmax()]
    share = (axis - axis.min()) / max(np.ptp(axis), 1e-300)
    if how == "by a pull":
        _pull(drive, of, share)
    else:
        of.weights(REGION, np.flatnonzero(share > 0.1))
        of.weights(RIGHT, np.flatnonzero(share > 0.9))
        ob.detail_deform.region = REGION
        if not drive.operate('handle_add', vertex_group=RIGHT):
            of.add_handle(RIGHT, np.flatnonzero(share > 0.9))
    update()
    return of


def _pull(drive, of, share):
    """Pulls a vertex and its neighbours, at two thirds of the mesh's length."""
    mesh = of.ob.data
    used = np.zeros(len(share), bool)
    corners = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get('vertex_index', corners)
    used[corners] = True
    if not used.any():
        used[:] = True
    start = np.where(used, np.abs(share - 0.67), np.inf).argmin()
    chosen = np.zeros(len(share), bool)
    chosen[start] = True
    for edge in mesh.edges:
        if start in edge.vertices:
            chosen[list(edge.vertices)] = True
    mesh.polygons.foreach_set('select', np.zeros(len(mesh.polygons), bool))
    mesh.edges.foreach_set('select', np.zeros(len(mesh.edges), bool))
    mesh.vertices.foreach_set('select', chosen)
    bpy.ops.object.mode_set(mode='EDIT')
    drive.operate('pull')
    if bpy.context.mode != 'OBJECT':
        bpy.ops.object.mode_set(mode='OBJECT')
    bpy.context.view_layer.objects.active = of.ob
