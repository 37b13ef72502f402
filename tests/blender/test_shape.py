# SPDX-License-Identifier: GPL-3.0-or-later
"""The shape by the default settings: no crease at a rim, no spike at a single vertex, even twists of any size in one
step, and the same shape at any density. With the settings PAPERS, the shape by the paper's system (14) alone."""

import math
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from conftest import activate, add_empty, add_handle, bind, evaluated, group, members, own, update

PAPERS = {'rim_smoothing': 0, 'refine': 0, 'base_deformer': 'LINEAR'}


def make(name, positions, triangles, region, held, place):
    """An unbound object. region, held: (n,) masks of its region and of its only handle, whose empty is at `place`."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(np.asarray(positions).tolist(), [], np.asarray(triangles).tolist())
    ob = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(ob)
    group(ob, 'region', np.flatnonzero(region))
    group(ob, 'held', np.flatnonzero(held))
    ob.detail_deform.region = 'region'
    add_handle(ob, 'held', add_empty(f"{name} Handle", place))
    update()
    return activate(ob)


def target_of(ob):
    return ob.detail_deform.handles[0].target


def set_all(ob, settings):
    for name, value in settings.items():
        setattr(ob.detail_deform, name, value)


# ---- a flat sheet

def pulled_sheet(n, radius):
    """(object, triangles, mask of the disc): a unit sheet of n × n squares with a fixed border, out of which a disc is
    moved by 0.3."""
    side = n + 1
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, side), np.linspace(0, 1, side), indexing='ij'))
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n), indexing='ij'))
    a, b, c, d = i * side + j, (i + 1) * side + j, (i + 1) * side + j + 1, i * side + j + 1
    triangles = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    inside = (np.minimum(x, y) > 0.5 / n) & (np.maximum(x, y) < 1 - 0.5 / n)
    disc = np.hypot(x - 0.5, y - 0.5) <= radius
    ob = bind(make("Sheet", np.stack([x, y, 0 * x], -1), triangles, inside, disc, (0.5, 0.5, 0)))
    target_of(ob).location.z = 0.3
    update()
    return ob, triangles, disc


def normals(positions, triangles):
    a, b, c = (positions[corner] for corner in triangles.T)
    across = np.cross(b - a, c - a)
    return across / np.linalg.norm(across, axis=1, keepdims=True)


def crease(ob, triangles, disc):
    """Mean angle in degrees between the two triangles at an edge of the disc's rim, of which one is in the disc; 0 at
    rest."""
    sides = {}
    for number, corners in enumerate(triangles.tolist()):
        for k in range(3):
            sides.setdefault(frozenset((corners[k], corners[k - 1])), []).append(number)
    whole = disc[triangles].all(1)
    rim = np.array([pair for pair in sides.values() if len(pair) == 2 and whole[pair[0]] != whole[pair[1]]])
    assert len(rim) > 20
    normal = normals(evaluated(ob), triangles)
    one, other = normal[rim[:, 0]], normal[rim[:, 1]]
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), (one * other).sum(1))).mean()


def creases(n):
    """The creases by default and with Rim Smoothing 0."""
    sheet = pulled_sheet(n, 0.13)
    by_default = crease(*sheet)
    sheet[0].detail_deform.rim_smoothing = 0
    update()
    return by_default, crease(*sheet)


def test_the_crease_at_a_handle_vanishes_with_the_edge_length():
    (coarse, coarse_without), (fine, fine_without) = creases(60), creases(120)
    assert fine <= 7 and fine <= 0.75 * coarse, (coarse, fine)
    assert min(coarse_without, fine_without) > 12, (coarse_without, fine_without)


def slope(n):
    """Mean slope in degrees of the triangles at a handle of a single vertex."""
    ob, triangles, vertex = pulled_sheet(n, 0.1 / n)
    assert vertex.sum() == 1
    around = triangles[vertex[triangles].any(1)]
    return np.degrees(np.arccos(np.abs(normals(evaluated(ob), around)[:, 2]))).mean()


def test_a_single_vertex_stands_on_no_spike():
    coarse, fine = slope(60), slope(120)
    assert coarse <= 20 and fine < coarse, (coarse, fine)


# ---- a twisted bar

RINGS, SIDES, HEIGHT = 61, 96, 1.2
FREE = (0.1 * HEIGHT, 0.9 * HEIGHT)  # between the fixed and the held end


def bar_mesh():
    """(positions, triangles) of a closed square tube along z, with vertices on its edges."""
    s = 8 * np.arange(SIDES) / SIDES
    side = np.floor(s / 2)
    along, angle = s - 2 * side - 1, side * math.pi / 2
    ring = 0.07 * np.stack([np.cos(angle) - along * np.sin(angle), np.sin(angle) + along * np.cos(angle)], -1)
    heights = HEIGHT * np.linspace(0, 1, RINGS)
    positions = np.concatenate([np.tile(ring, (RINGS, 1)), np.repeat(heights, SIDES)[:, None]], 1)
    positions = np.concatenate([positions, [(0, 0, 0), (0, 0, HEIGHT)]])
    bottom, top, last = RINGS * SIDES, RINGS * SIDES + 1, (RINGS - 1) * SIDES
    triangles = []
    for j in range(SIDES):
        k = (j + 1) % SIDES
        for a in range(0, last, SIDES):
            b = a + SIDES
            triangles += [(a + j, a + k, b + k), (a + j, b + k, b + j)]
        triangles += [(bottom, k, j), (top, last + j, last + k)]
    return positions, np.array(triangles)


def subdivided(positions, triangles):
    """Cuts each triangle into four at the middles of its edges; the old vertices come first."""
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    edges, of = np.unique(edges, axis=0, return_inverse=True)
    ab, bc, ca = len(positions) + of.reshape(3, -1)
    a, b, c = triangles.T
    cut = [np.stack(corners, -1) for corners in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    return np.concatenate([positions, positions[edges].mean(1)]), np.concatenate(cut)


def make_bar(positions, triangles):
    z = positions[:, 2]
    return bind(make("Bar", positions, triangles, z > FREE[0] + 1e-6, z > FREE[1] - 1e-6, (0, 0, HEIGHT)))


@pytest.fixture
def bar():
    return make_bar(*bar_mesh())


def turn(ob, degrees):
    """Twists the bar by its empty's Euler angle; returns the deformed positions."""
    target_of(ob).rotation_euler.z = math.radians(degrees)
    update()
    return evaluated(ob)


def largest_rate(positions):
    """(the largest rate of twist in any of 20 slabs of the free part, as a fraction of the mean rate; the twist in
    degrees)."""
    rings = [p[:RINGS * SIDES, 0].reshape(RINGS, SIDES) + 1j * p[:RINGS * SIDES, 1].reshape(RINGS, SIDES)
             for p in (bar_mesh()[0], positions)]
    angles = np.unwrap(np.angle((rings[1] * rings[0].conj()).sum(1)))
    at = np.interp(np.linspace(*FREE, 21), HEIGHT * np.linspace(0, 1, RINGS), angles)
    return np.abs(np.diff(at)).max() * 20 / abs(at[-1] - at[0]), math.degrees(at[-1] - at[0])


def intersecting(ob, part):
    """Number of triangles with a free vertex that intersect another one."""
    native = part('library.native')
    rest, triangles = own(ob), part('scene.mesh_data').triangles(ob.data)
    roles = np.where(rest[:, 2] > FREE[1] - 1e-6, 0,
                     np.where(rest[:, 2] > FREE[0] + 1e-6, native.ROLE_FREE, native.ROLE_FIXED))
    return native.measure(rest, evaluated(ob), triangles, roles).intersecting_triangles


def test_a_whole_turn_at_once_is_even_and_folds_nothing(bar, part):
    rate, turned = largest_rate(turn(bar, 360))
    assert turned == pytest.approx(360, abs=1) and rate <= 1.3, (turned, rate)
    assert intersecting(bar, part) == 0


def test_two_turns_at_once_are_even(bar):
    rate, turned = largest_rate(turn(bar, 720))
    assert turned == pytest.approx(720, abs=1) and rate <= 1.3, (turned, rate)


def test_the_surface_is_a_continuous_function_of_the_turn(bar):
    """Through 135 and 180 degrees too, where Automatic goes over from one kind of base to the other; and the way back
    gives the same shapes."""
    held = members(bar, 'held')
    angles = np.linspace(0, 360, 201)
    seen = []
    for angle in [*angles, *angles[::-1]]:
        seen.append(turn(bar, angle))
        if len(seen) > 1:
            step = np.linalg.norm(seen[-1] - seen[-2], axis=1)
            assert step.max() <= 3 * max(step[held].max(), 1e-6), angle
    assert max(np.abs(there - back).max() for there, back in zip(seen, seen[::-1])) < 1e-5
    for angle in (135, 180):
        assert np.abs(turn(bar, angle + 0.01) - turn(bar, angle - 0.01)).max() < 1e-4, angle


def test_a_turn_is_the_same_after_saving_and_in_a_jump_to_any_frame(bar, tmp_path):
    scene, target = bpy.context.scene, target_of(bar)
    frames = range(1, 38, 4)
    typed = {frame: turn(bar, 10 * (frame - 1)) for frame in frames}
    for frame in frames:
        target.rotation_euler.z = math.radians(10 * (frame - 1))
        target.keyframe_insert('rotation_euler', frame=frame)

    def jumps(ob):
        for frame in (37, 1, 21, 5, 33, 17, 29, 9, 25, 13):
            scene.frame_set(frame)
            assert np.abs(evaluated(ob) - typed[frame]).max() < 1e-5, frame

    jumps(bar)
    for frame in (25, 37):
        scene.frame_set(frame)
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / 'turned.blend'))
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / 'turned.blend'))
        scene, bar = bpy.context.scene, bpy.data.objects['Bar']
        assert np.abs(evaluated(bar) - typed[frame]).max() < 1e-5, frame
        # Computed anew, and not only read from the file.
        assert bpy.ops.object.detail_deform_update() == {'FINISHED'}
        assert np.abs(evaluated(bar) - typed[frame]).max() < 1e-5, frame
    jumps(bar)


def test_twice_the_density_is_the_same_shape():
    coarse = bar_mesh()
    shapes = [turn(make_bar(*mesh), 135) for mesh in (coarse, subdivided(*coarse))]
    apart = np.linalg.norm(shapes[1][:len(shapes[0])] - shapes[0], axis=1).max()
    assert apart <= 0.01 * np.linalg.norm(np.ptp(coarse[0], axis=0)), apart


# ---- the paper's shape

@pytest.mark.parametrize('degrees', [50, 135, 200])
def test_with_the_papers_settings_the_addon_shows_the_librarys_result_to_the_bit(bar, part, degrees):
    set_all(bar, PAPERS)
    turn(bar, degrees)
    native, subject = part('library.native'), part('scene.subject').Subject(
        bar, bpy.context.evaluated_depsgraph_get())
    rest = own(bar).astype(np.float32)
    roles = np.where(members(bar, 'held'), 0, np.where(members(bar, 'region'), native.ROLE_FREE, native.ROLE_FIXED))
    bound = native.Bind(rest, part('scene.mesh_data').triangles(bar.data), roles, 1).finish()
    motions = part('scene.handle_motions').motions(subject, part('scene.handle_transforms').local_transforms(subject))
    offsets = bound.offsets(motions, refine=0, rim_smoothing=0, base_deformer='LINEAR')
    assert np.array_equal(part('scene.offset_attribute').read(bar.data), offsets.reshape(-1, 3))
    assert np.array_equal(evaluated(bar).astype(np.float32), rest + offsets.reshape(-1, 3))


class Layout:
    """Stands in for a panel's layout and records the properties that are drawn."""

    def __init__(self, drawn):
        self.drawn = drawn

    def prop(self, of, name, **_):
        if name in of.bl_rna.properties:  # not so for the inputs of a modifier
            self.drawn.append(of.bl_rna.properties[name].name)

    def prop_search(self, of, name, *_, **__):
        self.prop(of, name)

    def __getattr__(self, name):
        return lambda *_, **__: self


def drawn(ob, part, *panels):
    """The labels of the properties that these panels draw."""
    context, names = SimpleNamespace(preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1)),
                                     region=SimpleNamespace(width=300, type='WINDOW'), object=ob), []
    for name in panels:
        panel = getattr(part('ui.panels'), name)
        panel.draw_settings(SimpleNamespace(draw_state=lambda *_: None), context, Layout(names), ob, ob.detail_deform)
    return names


def test_the_panel_has_the_settings_of_the_shape_and_no_steps(bar, part):
    main, base, others = 'OBJECT_PT_detail_deform', 'OBJECT_PT_detail_deform_base', 'OBJECT_PT_detail_deform_advanced'
    assert bar.detail_deform.method == 'TRANSFER'
    assert {"Method", "Quality of large bends", "Bend Length", "Rim Smoothing"} <= set(drawn(bar, part, main))
    assert "Deformer" in drawn(bar, part, base)
    assert "Steps" not in drawn(bar, part, main, base, others)
    assert bar.detail_deform.steps == 1
