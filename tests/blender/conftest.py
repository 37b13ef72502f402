# SPDX-License-Identifier: GPL-3.0-or-later
import functools
import importlib
import os
import platform
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Matrix

REPOSITORY = Path(__file__).resolve().parents[2]
FIXTURES = REPOSITORY / 'blend_fixtures'


def pytest_configure(config):
    config.addinivalue_line('markers', "large: takes seconds, and says no more in another Blender; one runs it")
    config.addinivalue_line('markers', "thorough: takes long for what it tells; for tests/run.sh --all")


# Debian builds Blender for 64-bit ARM without OpenVDB.
has_voxels = pytest.mark.skipif(not bpy.app.build_options.openvdb, reason="this Blender remeshes no voxels")


def make_zip(library, path, *options, sources=REPOSITORY):
    """Packs the add-on with this library into a zip for this system, by the build's script."""
    system = {'win32': 'windows', 'darwin': 'macos'}.get(sys.platform, 'linux')
    processor = 'arm64' if platform.machine() in {'aarch64', 'arm64'} else 'x64'
    script = sources / 'addon' / 'make_zip.py'
    subprocess.run([sys.executable, script, library, f'{system}-{processor}', path, *options], check=True)


@functools.lru_cache
def can_start_programs():
    """False in an emulator where the system doesn't know how to start programs for the emulated processor."""
    try:
        return subprocess.run([sys.executable, '-c', ''], check=False).returncode == 0
    except OSError:
        return False


starts_blender = pytest.mark.skipif(sys.platform not in {'linux', 'win32'} or not can_start_programs(),
                                    reason="starts Blender as on these systems")


@pytest.fixture
def module():
    """The add-on's package, as installed."""
    return sys.modules[os.environ['DD_TEST_MODULE']]


@pytest.fixture
def part(module):
    """part('follow.binding'): a module of the installed add-on."""
    return lambda name: importlib.import_module(f'{module.__name__}.{name}')


@pytest.fixture
def as_in_a_window(part, monkeypatch):
    """as_in_a_window('follow.lifecycle'): this module takes Blender for one with a window, and so do timers, which are
    then called by hand."""
    class Window:
        def __getattr__(self, name):
            return False if name == 'background' else getattr(bpy.app, name)

    class Bpy:
        app = Window()

        def __getattr__(self, name):
            return getattr(bpy, name)

    return lambda *names: [monkeypatch.setattr(part(name), 'bpy', Bpy()) for name in (*names, 'timers')]


class Probe(bpy.types.RenderEngine):
    """A render engine that records an object's evaluated positions in each rendered frame."""
    bl_idname, bl_label = 'DD_PROBE', "Probe"
    name, seen = "", {}

    def render(self, depsgraph):
        vertices = depsgraph.objects[Probe.name].data.vertices
        values = np.empty(3 * len(vertices), np.float32)
        vertices.foreach_get('co', values)
        Probe.seen[depsgraph.scene.frame_current] = values.reshape(-1, 3).astype(float)
        self.end_result(self.begin_result(0, 0, 8, 8))


@pytest.fixture
def rendered(tmp_path):
    """rendered(name): {frame: (n, 3)}, the positions of an object in renders of the frames 1 to 5."""
    bpy.utils.register_class(Probe)

    def run(name="Strip"):
        scene = bpy.context.scene
        if not scene.camera:
            scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
            scene.collection.objects.link(scene.camera)
        scene.render.engine, scene.render.filepath = 'DD_PROBE', str(tmp_path / 'f')
        scene.render.resolution_x = scene.render.resolution_y = 8
        scene.frame_start, scene.frame_end = 1, 5
        Probe.name = name
        Probe.seen.clear()
        bpy.ops.render.render(animation=True)
        return dict(Probe.seen)

    yield run
    bpy.utils.unregister_class(Probe)


def new_scene():
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)


@pytest.fixture(autouse=True)
def empty_scene():
    new_scene()


@pytest.fixture(autouse=True)
def nothing_printed_to_the_console(capfd):
    """No Python exception may reach the console, whatever a test does."""
    yield
    out, err = capfd.readouterr()
    assert 'Traceback' not in out + err, out + err


@pytest.fixture(autouse=True)
def context_has_no_owner(request):
    """Until 4.3, reading `context.tool_settings` makes the scene the owner of `bpy.context`: see
    scene/selection.py. Later tests would read the owner after it was freed, so the run ends here."""
    yield
    if bpy.context.id_data is not None:
        pytest.exit(f"{request.node.nodeid} leaves {bpy.context.id_data} as the owner of bpy.context", 1)


def update():
    bpy.context.view_layer.update()


def rigid_motion(rest, now):
    """(rotation, (n, 3) differences): the rigid motion that fits points best, and how far they are off it."""
    a, b = rest - rest.mean(axis=0), now - now.mean(axis=0)
    left, _, right = np.linalg.svd(b.T @ a)
    left[:, -1] *= np.linalg.det(left @ right)
    rotation = left @ right
    return rotation, b - a @ rotation.T


def evaluated(ob):
    """(n, 3) positions of the object after its modifiers, in its own space."""
    mesh = ob.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    values = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get('co', values)
    return values.reshape(-1, 3).astype(float)


def own(ob):
    """(n, 3) positions stored in the object's mesh."""
    values = np.empty(3 * len(ob.data.vertices), np.float32)
    ob.data.vertices.foreach_get('co', values)
    return values.reshape(-1, 3).astype(float)


def moved(ob):
    """The largest coordinate of any vertex's offset, evaluated minus stored."""
    return np.abs(evaluated(ob) - own(ob)).max()


def activate(ob):
    for other in bpy.context.view_layer.objects:
        other.select_set(other == ob)
    bpy.context.view_layer.objects.active = ob
    return ob


def script_copy(ob):
    """A copy with a mesh of its own, made as scripts do it."""
    copy = ob.copy()
    copy.data = ob.data.copy()
    bpy.context.scene.collection.objects.link(copy)
    return copy


def in_a_collection(*objects, name="Hidden"):
    """Moves objects from the scene's collection into a new child collection, which is returned."""
    scene, made = bpy.context.scene.collection, bpy.data.collections.new(name)
    scene.children.link(made)
    for ob in objects:
        made.objects.link(ob)
        scene.objects.unlink(ob)
    return made


def group(ob, name, members):
    made = ob.vertex_groups.new(name=name)
    made.add([int(v) for v in members], 1.0, 'REPLACE')
    return made


def add_empty(name, location, parent=None):
    empty = bpy.data.objects.new(name, None)
    bpy.context.scene.collection.objects.link(empty)
    empty.location = location
    empty.parent = parent
    return empty


def add_handle(ob, vertex_group, target):
    handle = ob.detail_deform.handles.add()
    handle.name = vertex_group
    handle.vertex_group = vertex_group
    handle.target = target
    return handle


def wavy(n=25):
    """Positions of a wavy n × n grid over the unit square."""
    x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n), indexing='ij')
    return np.stack([x, y, 0.03 * np.sin(40 * x) * np.cos(31 * y)], -1).reshape(-1, 3)


def make_strip(n=25, name="Strip", scale=1.0, world=None):
    """A wavy quad grid: fixed on the left, group and empty "right" on the right side."""
    columns = np.repeat(np.arange(n), n)
    faces = [(i * n + j, (i + 1) * n + j, (i + 1) * n + j + 1, i * n + j + 1)
             for i in range(n - 1) for j in range(n - 1)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata((scale * wavy(n)).tolist(), [], faces)
    ob = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(ob)
    world = world or Matrix()
    ob.matrix_world = world
    group(ob, 'region', np.flatnonzero(columns >= 3))
    group(ob, 'right', np.flatnonzero(columns >= n - 3))
    empty = add_empty("Right", (world @ Matrix.Translation((scale, 0.5 * scale, 0))).translation)
    ob.detail_deform.region = 'region'
    add_handle(ob, 'right', empty)
    update()
    return activate(ob)


def choose(ob, **settings):
    """Sets settings of the object. Blender takes an assignment to a property that isn't there without an error."""
    for name, value in settings.items():
        assert name in ob.detail_deform.bl_rna.properties, name
        setattr(ob.detail_deform, name, value)


def bind(ob, **options):
    activate(ob)
    assert bpy.ops.object.detail_deform_bind(wait=True, **options) == {'FINISHED'}
    assert ob.detail_deform.is_bound, ob.detail_deform.status
    return ob


def members(ob, name):
    index = ob.vertex_groups[name].index
    return np.array([any(g.group == index and g.weight > 0.5 for g in v.groups)
                     for v in ob.data.vertices])


def refusal(operator, **arguments):
    """The sentence with which an operator refuses."""
    with pytest.raises(RuntimeError) as caught:
        operator(**arguments)
    return str(caught.value)


def open_fixture(name):
    bpy.ops.wm.open_mainfile(filepath=str(FIXTURES / f'{name}.blend'), load_ui=False)
    return activate(next(ob for ob in bpy.data.objects if ob.type == 'MESH'))


def select(ob, chosen):
    activate(ob)
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.ops.mesh.select_all(action='DESELECT')
    bpy.ops.object.mode_set(mode='OBJECT')
    ob.data.vertices.foreach_set('select', np.asarray(chosen, bool))
    bpy.ops.object.mode_set(mode='EDIT')


def add_from(ob, chosen, **options):
    select(ob, chosen)
    assert bpy.ops.object.detail_deform_handle_add(**options) == {'FINISHED'}
    bpy.ops.object.mode_set(mode='OBJECT')
    return ob.detail_deform.handles[-1]


def pull(ob, chosen, **options):
    """Presses Pull with these vertices selected; returns the new handle's empty."""
    select(ob, chosen)
    assert bpy.ops.object.detail_deform_pull(**options) == {'FINISHED'}, ob.detail_deform.status
    update()
    assert ob.detail_deform.is_bound, ob.detail_deform.status
    return bpy.context.active_object


def set_factor(part, ob, factor):
    deform_modifier = part('scene.deform_modifier')
    owner, name = deform_modifier.factor_property(ob, deform_modifier.find(ob))
    if name == 'value':  # 5.2 on
        owner.value = factor
    else:
        owner[name[2:-2]] = factor
    ob.update_tag()


def curves(owner):
    """The curves of the action of an object, shape keys or another data-block."""
    action = owner.animation_data.action
    if hasattr(action, 'fcurves'):
        return list(action.fcurves)
    return [curve for layer in action.layers for strip in layer.strips for bag in strip.channelbags
            for curve in bag.fcurves]


def data_blocks():
    return {(kind, block.name) for kind in ('objects', 'collections', 'node_groups', 'meshes', 'actions')
            for block in getattr(bpy.data, kind)}


def symmetric(n=25):
    """A wavy square about the origin, which is its own mirror image across x = 0, in its triangles too."""
    p = wavy(n)
    p[:, :2] -= 0.5
    p[:, 2] = 0.03 * np.cos(40 * p[:, 0]) * np.cos(31 * p[:, 1])
    faces = []
    for i in range(n - 1):
        for j in range(n - 1):
            a, b, c, d = i * n + j, (i + 1) * n + j, (i + 1) * n + j + 1, i * n + j + 1
            faces += [(a, b, c), (a, c, d)] if i < n // 2 else [(a, b, d), (b, c, d)]
    mesh = bpy.data.meshes.new("Square")
    mesh.from_pydata(p.tolist(), [], faces)
    ob = bpy.data.objects.new("Square", mesh)
    bpy.context.scene.collection.objects.link(ob)
    return activate(ob)


@pytest.fixture
def rigged():
    from rigs import make_rigged  # here, because rigs imports this module
    return make_rigged()
