# SPDX-License-Identifier: GPL-3.0-or-later
"""Long use: repeats an action many times, and compares memory and counts after a tenth of the repetitions with those at
the end.

    blender --background --factory-startup --python tests/blender/soak.py -- ZIP [--short] [NAME...]
    python tests/blender/soak.py -- ZIP [--short] [NAME...]          (bpy as a module)

Set BLENDER_USER_RESOURCES to an empty folder. NAMEs choose loops. Loops of Blender's own actions are then repeated in
another process without the add-on: what grows there too is Blender's own leak. Linux only: memory is read from /proc,
and the C library is asked how much of it is in use and how much only hasn't been given back to the system.
"""
import argparse
import ctypes
import gc
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import bpy
import numpy as np

HERE = Path(__file__).resolve().parent
if str(HERE) not in sys.path:
    sys.path.insert(0, str(HERE))

import conftest as c  # noqa: E402
import run  # noqa: E402

# A loop grows if both its resident memory and its memory in use grow by more than this fraction of the resident memory.
MAY_GROW = 0.02


class _Mallinfo2(ctypes.Structure):
    _fields_ = [(name, ctypes.c_size_t) for name in (
        'arena', 'ordblks', 'smblks', 'hblks', 'hblkhd', 'usmblks', 'fsmblks', 'uordblks', 'fordblks', 'keepcost')]


_process = ctypes.CDLL(None)
_process.mallinfo2.restype = _Mallinfo2


def given_back():
    """Gives all free memory back to the system; returns the bytes in use. Debian's Blender allocates by jemalloc, the
    others by the C library's malloc."""
    gc.collect()
    if not hasattr(_process, 'mallctl'):
        _process.malloc_trim(0)
        used = _process.mallinfo2()
        return used.uordblks + used.hblkhd
    _process.mallctl(b'arena.4096.purge', None, None, None, 0)  # all arenas
    epoch, used, size = ctypes.c_uint64(1), ctypes.c_size_t(), ctypes.c_size_t(ctypes.sizeof(ctypes.c_size_t))
    _process.mallctl(b'epoch', None, None, ctypes.byref(epoch), ctypes.sizeof(epoch))
    _process.mallctl(b'stats.allocated', ctypes.byref(used), ctypes.byref(size), None, 0)
    return used.value


def add_on_parts():
    """{name: module} of the installed add-on; empty in a Blender without it."""
    name = os.environ.get('DD_TEST_MODULE')
    return {key[len(name) + 1:]: value for key, value in list(sys.modules.items())
            if key.startswith(f'{name}.') and value} if name else {}


def measured():
    """(resident bytes, bytes in use, counts) after free memory was given back."""
    time.sleep(0.1)  # for threads that have done their work to end
    in_use = given_back()
    with open('/proc/self/statm') as file:
        resident = int(file.read().split()[1]) * os.sysconf('SC_PAGE_SIZE')
    return resident, in_use, counts()


def counts():
    """{name: number} of everything whose number must not grow."""
    handlers = [f for name in dir(bpy.app.handlers) if isinstance(f := getattr(bpy.app.handlers, name), list)]
    found = {'threads': len(os.listdir('/proc/self/task')), 'files': len(os.listdir('/proc/self/fd')),
             'handlers': sum(map(len, handlers)), 'Python modules': len(sys.modules), 'types': len(dir(bpy.types))}
    for prop in bpy.data.bl_rna.properties:
        if prop.type == 'COLLECTION':
            found[prop.identifier] = len(getattr(bpy.data, prop.identifier))
    found['attributes'] = sum(len(mesh.attributes) for mesh in bpy.data.meshes)
    found['modifiers'] = sum(len(ob.modifiers) for ob in bpy.data.objects)
    found['vertex groups'] = sum(len(ob.vertex_groups) for ob in bpy.data.objects)
    parts = add_on_parts()
    if 'library.loading' in parts:
        owned = parts['library.loading'].Owned
        found['objects of the library'] = sum(isinstance(o, owned) and bool(o._handle) for o in gc.get_objects())
        found['timers'] = sum(timer.is_running() for timer in parts['timers'].ALL)
        found['records'] = len(parts['follow.frame_results']._shown)
    return found


LOOPS = {}


def loop(count, short, blenders_own=False):
    """Registers a function that makes a scene and returns step(number). blenders_own: the steps don't need the add-on
    and are repeated without it; the function then opens a scene that was saved with the add-on."""
    def register(make):
        LOOPS[make.__name__] = (make, count, short, blenders_own)
        return make
    return register


def animated_strip(name="Strip", n=21):
    """A bound strip whose handle is keyed over the frames 1 to 100."""
    ob = c.bind(c.make_strip(n, name))
    target = ob.detail_deform.handles[0].target
    for frame in (1, 50, 100):
        target.location = (1, 0.5, 0.3 * (frame == 50))
        target.keyframe_insert('location', frame=frame)
    bpy.context.scene.frame_set(40)
    return ob


def scene_file(folder, name, make):
    """Opens the file of this name. Where there is none yet, make() makes its scene first, which needs the add-on."""
    path = str(Path(folder) / f'{name}.blend')
    if not os.path.exists(path):
        c.new_scene()
        make()
        bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path, load_ui=False)


@loop(100_000, 2_000)
def updates(folder):
    """Updates by all methods, in steps, and with free turns."""
    ob = c.make_strip(21)
    c.add_handle(ob, 'middle', c.add_empty("Middle", (0.5, 0.5, 0)))
    c.group(ob, 'middle', np.flatnonzero(np.abs(c.own(ob)[:, 0] - 0.5) < 0.03))
    key = ob.shape_key_add(name="Basis") and ob.shape_key_add(name="Up")
    lifted = c.own(ob) + np.outer(c.own(ob)[:, 0], (0, 0, 0.4))
    key.data.foreach_set('co', lifted.astype(np.float32).ravel())
    key.value = 0
    c.activate(ob)
    bpy.ops.object.detail_deform_examples_from_keys()
    c.bind(ob)
    settings, target = ob.detail_deform, ob.detail_deform.handles[0].target
    ways = [{'refine': 4}, {'refine': 0}, {'rotation_only': False}, {'base_deformer': 'MOTIONS'}, {'steps': 2},
            {'turns': 'FREE'}, {'soft_border': 0.3}, {'output': 'BASE'},
            *({'method': method} for method in ('VARIATIONAL', 'NORMAL', 'GRADIENT', 'VOLUMES', 'EXAMPLES'))]
    usual = {name: getattr(settings, name) for way in ways for name in way if name != 'turns'}

    def choose(way):
        for name, value in {**usual, **way}.items():
            if name != 'turns' and getattr(settings, name) != value:
                setattr(settings, name, value)
        settings.handles[1].turns = way.get('turns', 'TARGET')

    def step(number):
        if number % 25 == 0:
            choose(ways[number // 25 % len(ways)])
        target.location.z = 0.2 * np.sin(0.1 * number) + 1e-7 * number
        c.update()
        if number % 500 == 0:
            assert settings.is_bound and not settings.problem, settings.status
            assert np.abs(c.evaluated(ob)[:, 2]).max() > 0.01
    return step


@loop(1_000, 60)
def binds(folder):
    """Binds with other settings each time; sometimes after a refused bind, or after one that is ended before it is
    done."""
    ob = c.make_strip(31)

    def step(number):
        bpy.ops.object.detail_deform_unbind()
        if number % 10 == 3:
            ob.detail_deform.region = "none of that name"
            assert "none of that name" in c.refusal(bpy.ops.object.detail_deform_bind, wait=True)
            ob.detail_deform.region = 'region'
        ob.detail_deform.metric_smoothing = 0.1 * (number % 7)
        if number % 10 == 6:
            bpy.ops.object.detail_deform_bind()
            bpy.ops.object.detail_deform_unbind()
        c.bind(ob)
    c.bind(ob)
    return step


@loop(200, 40, blenders_own=True)
def undo_and_redo(folder):
    scene_file(folder, 'undo', animated_strip)
    bpy.ops.ed.undo_push(message="loaded")

    def step(number):
        bpy.data.objects["Strip"].location.x = 0.1 * (number % 7)
        bpy.data.objects["Strip"].data.vertices[0].co.z += 1e-3
        bpy.data.objects["Strip"].data.vertices[0].co.z -= 1e-3
        c.update()
        bpy.ops.ed.undo_push(message="moved")
        bpy.ops.ed.undo()
        bpy.context.scene.frame_set(20 + number % 50)
        bpy.ops.ed.redo()
        bpy.context.scene.frame_set(20 + number % 60)
        assert c.moved(bpy.data.objects["Strip"]) > 0.02
    return step


def _two_strips():
    first, second = animated_strip(), animated_strip("Other", 25)
    return first, second


def _followed():
    from test_transfer import add_key, bent, raw_strip
    source, target = raw_strip("Source"), raw_strip("Strip")
    add_key(source, "Bend", bent(c.own(source)))
    target.detail_deform.transfer.source = source
    c.activate(target)
    assert bpy.ops.object.detail_deform_transfer_live() == {'FINISHED'}
    source.data.shape_keys.key_blocks["Bend"].value = 1
    c.update()


@loop(100, 16, blenders_own=True)
def files(folder):
    """Opens one file after the other, changes and saves each."""
    kinds = {'one': animated_strip, 'two': _two_strips, 'followed': _followed}
    for name, make in kinds.items():
        scene_file(folder, name, make)

    def step(number):
        name = list(kinds)[number % len(kinds)]
        bpy.ops.wm.open_mainfile(filepath=str(Path(folder) / f'{name}.blend'), load_ui=False)
        bpy.context.scene.frame_set(40)
        assert c.moved(bpy.data.objects["Strip"]) > 0.02
        bpy.ops.wm.save_as_mainfile(filepath=str(Path(folder) / f'{name}{os.getpid()}.blend'), copy=True)
    # The counts differ from file to file, so ran() makes both measurements with the same one open.
    return step


@loop(10_000, 300, blenders_own=True)
def playback(folder):
    scene_file(folder, 'two', _two_strips)

    def step(number):
        bpy.context.scene.frame_set(1 + number % 100)
        if number % 100 == 49:
            assert c.moved(bpy.data.objects["Strip"]) > 0.02
    return step


@loop(400, 30, blenders_own=True)
def copies(folder):
    """Copies a bound object, evaluates the copy and deletes it, by operators and by bpy.data in turn."""
    scene_file(folder, 'undo', animated_strip)

    def step(number):
        ob = bpy.data.objects["Strip"]
        c.activate(ob)
        if number % 2:
            bpy.ops.object.duplicate()
            copy = bpy.context.active_object
        else:
            copy = ob.copy()
            copy.data = ob.data.copy()
            bpy.context.scene.collection.objects.link(copy)
        bpy.context.scene.frame_set(20 + number % 60)
        assert copy != ob and c.moved(copy) > 0.01
        mesh = copy.data
        if number % 2:
            c.activate(copy)
            bpy.ops.object.delete()
        else:
            bpy.data.objects.remove(copy)
        bpy.data.meshes.remove(mesh)
        for action in [action for action in bpy.data.actions if not action.users]:
            bpy.data.actions.remove(action)
        c.update()
    return step


@loop(50, 5)
def enable_and_disable(folder):
    """Disables and enables the add-on while an object is bound."""
    animated_strip()
    name = os.environ['DD_TEST_MODULE']

    def step(number):
        bpy.ops.preferences.addon_disable(module=name)
        bpy.context.scene.frame_set(1 + number % 2)
        bpy.ops.preferences.addon_enable(module=name)
        bpy.context.scene.frame_set(30 + number % 20)
        ob = bpy.data.objects["Strip"]
        assert ob.detail_deform.is_bound and c.moved(ob) > 0.02
    return step


@loop(10_000, 300)
def following(folder):
    """Follows a source by live transfer, which is stopped and started again now and then."""
    _followed()
    source, target = bpy.data.objects["Source"], bpy.data.objects["Strip"]

    def step(number):
        if number % 50 == 0:
            c.activate(target)
            bpy.ops.object.detail_deform_transfer_live(on=False)
            assert c.moved(target) == 0
            bpy.ops.object.detail_deform_transfer_live()
        source.data.shape_keys.key_blocks["Bend"].value = 0.5 + 0.01 * (number % 50)
        c.update()
    return step


@loop(200, 15)
def pulls(folder):
    """Pulls two selections, saves the result as a shape key, and removes everything again."""
    ob = c.make_strip(21)
    bpy.ops.object.detail_deform_remove()
    ob.vertex_groups.clear()
    bpy.data.objects.remove(bpy.data.objects["Right"])
    c.update()
    at = c.own(ob)

    def step(number):
        for side in (at[:, 0] > 0.9, at[:, 0] < 0.1):
            empty = c.pull(ob, side, radius=0.3)
            empty.location.z += 0.2
            c.update()
        assert c.moved(ob) > 0.15
        c.activate(ob)
        bpy.ops.object.detail_deform_save_key()
        bpy.ops.object.detail_deform_remove()
        ob.shape_key_clear()
        bpy.data.orphans_purge(do_recursive=True)
        c.update()
        assert len(bpy.data.objects) == 1
    return step


@loop(100, 8)
def bakes(folder):
    """Bakes a cache that is played and dropped, shape keys and Alembic; applies another object's deformation."""
    ob = animated_strip()
    path = str(Path(folder) / 'bake.pc2')

    def step(number):
        c.activate(ob)
        bpy.ops.object.detail_deform_bake(filepath=path, frame_start=40, frame_end=44)
        bpy.context.scene.frame_set(44)
        assert c.moved(ob) > 0.02
        bpy.ops.object.detail_deform_bake_drop()
        if number % 4 == 0:
            bpy.ops.object.detail_deform_bake(mode='SHAPE_KEYS', frame_start=40, frame_end=42)
            ob.shape_key_clear()
            ob.modifiers["Detail Deform"].show_viewport = ob.modifiers["Detail Deform"].show_render = True
        if number % 4 == 2 and bpy.app.build_options.alembic:
            bpy.ops.object.detail_deform_bake(mode='ALEMBIC', filepath=path[:-4] + '.abc', frame_start=40,
                                              frame_end=42)
        bpy.context.scene.frame_set(1 + number % 2)
        other = c.bind(c.make_strip(15, "Applied"))
        other.detail_deform.handles[0].target.location.z += 0.3
        c.update()
        bpy.ops.object.detail_deform_apply(mode='MESH' if number % 2 else 'SHAPE_KEY')
        target = other.detail_deform.handles[0].target if other.detail_deform.handles else None
        mesh = other.data
        bpy.data.objects.remove(other)
        bpy.data.meshes.remove(mesh)
        bpy.data.objects.remove(target or bpy.data.objects["Right.001"])
        bpy.data.orphans_purge(do_recursive=True)
        c.update()
    return step


class Row:
    """The growth of memory and counts in a loop."""

    def __init__(self, name, steps, before, after, seconds):
        self.name, self.steps, self.seconds = name, steps, seconds
        self.resident, self.grown, self.in_use = before[0], after[0] - before[0], after[1] - before[1]
        self.more = {what: (before[2].get(what, 0), count) for what, count in after[2].items()
                     if count != before[2].get(what, 0)}

    @property
    def is_flat(self):
        # A leak raises both numbers. Resident memory alone grows where pages aren't given back, memory in use alone
        # where Blender fills a cache once.
        return min(self.grown, self.in_use) <= MAY_GROW * self.resident and not self.more

    def __str__(self):
        more = ''.join(f", {what} {before} -> {after}" for what, (before, after) in self.more.items())
        return (f"{self.name:<28} {self.steps:>7,} {self.seconds:>7.0f} {self.resident / 1e6:>8.1f} "
                f"{self.grown / 1e6:>+8.2f} {100 * self.grown / self.resident:>+6.2f} {self.in_use / 1e6:>+8.2f}  "
                f"{'flat' if self.is_flat else 'GROWS'}{more}")


HEAD = (f"{'loop':<28} {'steps':>7} {'s':>7} {'MB':>8} {'grown':>8} {'%':>6} {'in use':>8}\n"
        "(MB in memory at a tenth of the steps; from there to the end: MB more in memory, in %, MB more in use)")


def ran(name, folder, short=False, own=False):
    """Runs a loop; returns its Row. own: the add-on isn't there."""
    make, count, short_count, _ = LOOPS[name]
    c.new_scene()
    step, steps = make(folder), short_count if short else count
    tenth = max(steps // 10, 3)
    tenth -= (tenth - steps) % 3  # the loop "files" then has the same one of its three files open at both measurements
    start = time.monotonic()
    for number in range(steps):
        if number == tenth:
            before = measured()
        step(number)
    return Row(f"{name} without it" if own else name, steps, before, measured(), time.monotonic() - start)


def without_the_add_on(names, folder, short):
    """Runs these loops in a Blender without the add-on; prints their rows."""
    command = [sys.executable, __file__]
    if bpy.app.binary_path:
        command = [bpy.app.binary_path, '--background', '--factory-startup', '--python', __file__]
    with tempfile.TemporaryDirectory() as resources:
        subprocess.run([*command, '--', '--own', folder, *['--short'] * short, *names], check=True,
                       env={**os.environ, 'BLENDER_USER_RESOURCES': resources, 'DD_TEST_MODULE': ''})


def main(arguments):
    parser = argparse.ArgumentParser()
    parser.add_argument('zip', nargs='?')
    parser.add_argument('names', nargs='*')
    parser.add_argument('--short', action='store_true')
    parser.add_argument('--own', metavar='FOLDER', help=argparse.SUPPRESS)
    asked = parser.parse_args(arguments)
    if asked.own:
        for name in [*filter(None, [asked.zip]), *asked.names]:
            print(ran(name, asked.own, asked.short, own=True), flush=True)
        os._exit(0)
    if not asked.zip or 'BLENDER_USER_RESOURCES' not in os.environ:
        sys.exit(__doc__)
    os.environ['DD_TEST_MODULE'] = run.install(Path(asked.zip).resolve())
    names = asked.names or list(LOOPS)
    print(f"Blender {bpy.app.version_string}\n{HEAD}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        rows = []
        for name in names:
            rows.append(ran(name, folder, asked.short))
            print(rows[-1], flush=True)
        own = [name for name in names if LOOPS[name][3]]
        if own:
            without_the_add_on(own, folder, asked.short)
    bpy.ops.preferences.addon_disable(module=os.environ['DD_TEST_MODULE'])
    sys.stdout.flush()
    os._exit(0 if all(row.is_flat for row in rows) else 1)


if __name__ == '__main__':
    main(sys.argv[sys.argv.index('--') + 1:])
