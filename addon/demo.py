# SPDX-License-Identifier: GPL-3.0-or-later
"""Deforms the scenes of blend_fixtures/ and checks, times and renders the result.

Run by demo.sh, in background Blender or with Blender as a Python module:
    blender --background --factory-startup --python addon/demo.py -- [scene...]
    python addon/demo.py -- [scene...]
"""
import contextlib
import os
import statistics
import sys
from math import radians
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "build" / "demo"
# A handle is dragged in steps, as by a user's mouse: every step costs one update.
DRAG_STEPS = 12
# Fractions of the bounding box's diagonal. EXACT: Blender's float32 coordinates are exact to about 1e-7 of it, and the
# rest is for rounding in the solves. VISIBLE: a hundredth, less than the shortest motion below.
EXACT = 1e-5
VISIBLE = 1e-2


class DemoError(Exception):
    """The demo can't go on, or its result is wrong; the message is one sentence for the user."""


# ---------------------------------------------------------------- motions, one for each scene

def drag(motions):
    """Moves empties step by step; motions: name -> (shift, axis, degrees), in the empty's axes."""
    def run(subject):
        rest = {name: bpy.data.objects[name].matrix_world.copy() for name in motions}
        for step in range(1, DRAG_STEPS + 1):
            t = step / DRAG_STEPS
            for name, (shift, axis, degrees) in motions.items():
                place = (rest[name] @ Matrix.Translation([t * x for x in shift])
                         @ Matrix.Rotation(t * radians(degrees), 4, axis))
                bpy.data.objects[name].matrix_world = place
            bpy.context.view_layer.update()
            subject.note_update(f"step {step} of {DRAG_STEPS}")
        return [subject.render("after")]
    return run


def play(stills):
    """Plays the scene's own animation and renders some of its frames."""
    def run(subject):
        scene, pictures = bpy.context.scene, []
        for frame in range(scene.frame_start, scene.frame_end + 1):
            scene.frame_set(frame)
            subject.note_update(f"frame {frame} of {scene.frame_end}")
            if frame in stills:
                pictures.append(subject.render(f"frame_{frame:02d}"))
        return pictures
    return run


SCENES = {
    # Fig. 1: a pure translation, which gradient-based editing can't follow.
    "bumpy_plane": ("Bumpy Plane", drag({"Right": ((0, 0, 0.38), "Z", 0)})),
    "suzanne": ("Suzanne", drag({"Ear": ((0, 0.10, 0.38), "X", 35),
                                 "Brow": ((0, 0, 0.16), "X", 12)})),
    "animated": ("Tentacle", play((8, 16, 24))),
}


# ---------------------------------------------------------------- one scene

def connected(mesh, chosen):
    """(n,) bool: the vertices that edges connect with chosen ones, and these."""
    edges = np.array([edge.vertices[:] for edge in mesh.edges])
    count = 0
    while chosen.sum() > count:
        count, chosen = chosen.sum(), chosen.copy()
        chosen[edges[chosen[edges].any(axis=1)]] = True
    return chosen


class Subject:
    """The bound object of an opened scene, with its rest positions and vertex masks to check the deformation by."""

    def __init__(self, scene_name, object_name):
        self.scene_name = scene_name
        self.object = bpy.data.objects[object_name]
        self.settings = self.object.detail_deform
        self.updates = []
        mesh = self.object.data
        self.triangles = sum(len(p.vertices) - 2 for p in mesh.polygons)
        self.rest = self.evaluated()
        self.size = float(np.linalg.norm(np.ptp(self.rest, axis=0)))
        self.handles = [(mask_of(self.object, h.vertex_group), h.target,
                         h.target.matrix_world.copy()) for h in self.settings.handles]
        self.free = mask_of(self.object, self.settings.region)
        self.fixed = ~self.free
        for mask, _, _ in self.handles:
            self.free &= ~mask
            self.fixed &= ~mask
        # Loose parts without a handle, as Suzanne's eyes, ride along.
        self.fixed &= connected(mesh, np.any([mask for mask, _, _ in self.handles], axis=0))

    def evaluated(self):
        mesh = self.object.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        positions = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", positions)
        return positions.reshape(-1, 3).astype(float)

    def bind(self):
        view_layer = bpy.context.view_layer
        for other in view_layer.objects:
            other.select_set(other == self.object)
        view_layer.objects.active = self.object
        result = bpy.ops.object.detail_deform_bind(wait=True)
        if result != {"FINISHED"} or not self.settings.is_bound:
            raise DemoError(f"Bind did not finish: {self.settings.status or result}")
        say(f"  bound in {self.settings.bind_ms:.0f} ms")
        bpy.context.view_layer.update()
        self.expect("binding alone moved the mesh", self.evaluated() - self.rest, EXACT)

    def note_update(self, step):
        self.updates.append(self.settings.update_ms)
        if len(self.updates) % 6 == 0:
            say(f"  {step}: updated in {self.settings.update_ms:.1f} ms")

    def check(self):
        """The result follows the empties exactly where it must, and moves visibly in between."""
        now = self.evaluated()
        if now.shape != self.rest.shape:
            raise DemoError("The evaluated mesh has another number of vertices than before.")
        if not np.isfinite(now).all():
            raise DemoError("The deformed mesh has coordinates that are no numbers.")
        self.expect("fixed vertices moved", (now - self.rest)[self.fixed], EXACT)
        to_object, to_world = self.object.matrix_world.inverted(), self.object.matrix_world
        for mask, target, rest_place in self.handles:
            motion = np.array(to_object @ target.matrix_world @ rest_place.inverted() @ to_world)
            wanted = self.rest[mask] @ motion[:3, :3].T + motion[:3, 3]
            if np.abs(wanted - self.rest[mask]).max() < VISIBLE * self.size:
                raise DemoError(f"The empty {target.name} did not move.")
            self.expect(f"vertices of the handle {target.name} did not follow it",
                        now[mask] - wanted, EXACT)
        if np.abs((now - self.rest)[self.free]).max() < VISIBLE * self.size:
            raise DemoError("The surface between the handles did not follow them.")

    def expect(self, complaint, difference, tolerance):
        worst = np.abs(difference).max(initial=0) / self.size
        # Not "worst > tolerance": a NaN must fail too.
        if not worst <= tolerance:
            raise DemoError(f"{self.scene_name}: {complaint}, by {worst:.1e} of the mesh's size.")

    def render(self, label):
        path = OUT / f"{self.scene_name}_{label}.png"
        path.unlink(missing_ok=True)
        bpy.context.scene.render.filepath = str(path)
        with quiet():
            bpy.ops.render.render(write_still=True)
        if not path.is_file():
            raise DemoError(f"Blender did not render {path.name}; see {OUT / 'render.log'}.")
        say(f"  wrote {path.relative_to(ROOT)}")
        return path


def run_scene(scene_name):
    object_name, move = SCENES[scene_name]
    path = ROOT / "blend_fixtures" / f"{scene_name}.blend"
    if not path.is_file():
        raise DemoError(f"{path.relative_to(ROOT)} is missing; blend_fixtures/README.md says how "
                        "to make it.")
    say(f"{path.relative_to(ROOT)}")
    with quiet():
        bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)
    bpy.context.view_layer.update()
    subject = Subject(scene_name, object_name)
    pictures = [subject.render("before")]
    say(f"  binding {subject.triangles} triangles ...")
    subject.bind()
    pictures += move(subject)
    subject.check()
    return (scene_name, subject.triangles, subject.settings.bind_ms,
            statistics.median(subject.updates), pictures)


# ---------------------------------------------------------------- helpers

def say(line):
    print(line, flush=True)


def mask_of(ob, group_name):
    if not group_name or group_name not in ob.vertex_groups:
        raise DemoError(f"{ob.name} has no vertex group named {group_name!r}.")
    index = ob.vertex_groups[group_name].index
    return np.array([any(g.group == index and g.weight > 0.5 for g in v.groups)
                     for v in ob.data.vertices])


@contextlib.contextmanager
def quiet():
    """Sends Blender's own messages about files, renders and EGL to a log, so that only the demo's lines are shown."""
    sys.stdout.flush()
    saved = [os.dup(1), os.dup(2)]
    with open(OUT / "render.log", "ab") as log:
        os.dup2(log.fileno(), 1)
        os.dup2(log.fileno(), 2)
        try:
            yield
        finally:
            sys.stdout.flush()
            for number, copy in zip((1, 2), saved):
                os.dup2(copy, number)
                os.close(copy)


def table(rows):
    say(f"\n{'scene':<14}{'triangles':>10}{'bind ms':>10}{'update ms':>11}  pictures in "
        f"{OUT.relative_to(ROOT)}/")
    for name, triangles, bind_ms, update_ms, pictures in rows:
        say(f"{name:<14}{triangles:>10}{bind_ms:>10.0f}{update_ms:>11.1f}  "
            + " ".join(path.name for path in pictures))


def main(names):
    unknown = [name for name in names if name not in SCENES]
    if unknown:
        raise DemoError(f"No scene named {unknown[0]}; there are {', '.join(SCENES)}.")
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / "render.log").unlink(missing_ok=True)
    sys.path.insert(0, str(ROOT / "addon"))
    import detail_deform

    say(f"Detail Deform in Blender {bpy.app.version_string}")
    detail_deform.register()
    try:
        table([run_scene(name) for name in names or SCENES])
    finally:
        # Some versions of the bpy module crash or hang at exit while a handler is still registered.
        detail_deform.unregister()


if __name__ == "__main__":
    arguments = sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else []
    try:
        main(arguments)
    # Operators report their errors as RuntimeError.
    except (DemoError, RuntimeError, ImportError) as error:
        print(f"The demo failed: {str(error).strip()}", file=sys.stderr, flush=True)
        sys.exit(1)
