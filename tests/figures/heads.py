# SPDX-License-Identifier: GPL-3.0-or-later
"""Two heads of our own, x forward, y to their left: lips that open, lids over eyeballs, and the first one's keys."""
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix

from implicit import Body, relaxed
from studio import add_markers, add_object


@dataclass
class Face:
    """Places of a head's features, in decimetres; of those on both sides the left one's."""
    skull: tuple = ((-0.24, 0, 0.42), (0.97, 0.77, 0.80))
    face: tuple = ((0.10, 0, -0.32), (0.66, 0.60, 0.86))
    jaw: tuple = ((-0.06, 0.43, -0.62, 0.16), (0.24, 0.33, -0.96, 0.16), (0.54, 0.10, -1.13, 0.16))
    chin: tuple = ((0.66, 0, -1.16), (0.17, 0.20, 0.15))
    cheek: tuple = ((0.43, 0.37, -0.30), 0.20)
    jowl: tuple = ((0.26, 0.30, -0.68), 0.27)
    brow: tuple = ((0.72, 0.10, 0.19, 0.075), (0.71, 0.34, 0.27, 0.080), (0.50, 0.58, 0.14, 0.060))
    bridge: tuple = ((0.72, 0, 0.14, 0.075), (0.84, 0, -0.12, 0.070), (0.97, 0, -0.36, 0.100))
    wing: tuple = ((0.84, 0.095, -0.41), (0.11, 0.070, 0.080))
    nostril: tuple = ((0.91, 0.060, -0.49), (0.050, 0.032, 0.040))
    ear: tuple = ((-0.10, 0.70, -0.18, 0.06), (-0.06, 0.76, 0.02, 0.09), (-0.16, 0.84, 0.16, 0.085),
                  (-0.27, 0.86, 0.10, 0.05), (-0.24, 0.82, -0.12, 0.05), (-0.13, 0.74, -0.32, 0.06))
    neck: tuple = ((-0.26, 0, -0.60, 0.50), (-0.46, 0, -2.25, 0.56))
    eye: tuple = (0.50, 0.315, 0.0)
    eyeball: float = 0.225
    opening: tuple = (0.165, 0.082)  # half the width and half the height between the lids
    lid: float = 0.05  # thickness
    slant: float = 0.06  # of the outer corners above the inner ones
    mouth: tuple = (0.745, -0.77)  # x and z
    lips: tuple = (0.29, 0.056, 0.070)  # half the width, thickness of the upper and of the lower
    hinge: tuple = (-0.05, -0.38)  # of the jaw, x and z


YOUNG = Face()
OLD = Face(
    skull=((-0.30, 0, 0.46), (1.00, 0.72, 0.72)), face=((0.14, 0, -0.40), (0.66, 0.56, 1.02)),
    jaw=((-0.08, 0.42, -0.74, 0.17), (0.24, 0.38, -1.18, 0.19), (0.60, 0.14, -1.46, 0.18)),
    chin=((0.78, 0, -1.52), (0.20, 0.22, 0.19)), cheek=((0.48, 0.40, -0.36), 0.20), jowl=((0.28, 0.28, -0.86), 0.27),
    brow=((0.78, 0.09, 0.17, 0.11), (0.74, 0.36, 0.24, 0.105), (0.46, 0.60, 0.10, 0.070)),
    bridge=((0.76, 0, 0.12, 0.09), (1.08, 0, -0.20, 0.115), (1.24, 0, -0.56, 0.150)),
    wing=((0.98, 0.13, -0.58), (0.16, 0.10, 0.110)), nostril=((1.06, 0.085, -0.69), (0.075, 0.045, 0.055)),
    ear=((-0.10, 0.66, -0.24, 0.06), (-0.04, 0.76, 0.02, 0.10), (-0.22, 1.02, 0.26, 0.085),
         (-0.44, 1.30, 0.44, 0.020), (-0.34, 0.96, 0.04, 0.06), (-0.16, 0.72, -0.34, 0.05)),
    neck=((-0.30, 0, -0.70, 0.48), (-0.52, 0, -2.55, 0.50)),
    eye=(0.53, 0.335, -0.02), eyeball=0.200, opening=(0.150, 0.070), lid=0.055, slant=0.10,
    mouth=(0.80, -1.00), lips=(0.36, 0.046, 0.074), hinge=(-0.06, -0.46))
COLOURS = {"Young": {None: (0.50, 0.235, 0.145), 'lips': (0.36, 0.10, 0.075), 'brow': (0.10, 0.045, 0.022)},
           "Old": {None: (0.23, 0.29, 0.135), 'lips': (0.16, 0.115, 0.070), 'brow': (0.055, 0.06, 0.045)}}
GAZE = 0.22  # to their left, in radians
INSIDE = (0.10, 0.018, 0.016)  # colour inside of the mouth
BROW_HAIR = ((0.055, 0.02, 0.035, -0.030), (0.050, 0, 0.045, -0.030), (0.035, -0.02, 0.050, -0.025))  # added to brow
OVERLAP = (0.06, 0.3)  # of closed lids, in the middle and added at the corners, as fractions of their opening
KEYS = ("Jaw Open", "Smile", "Blink Left", "Brow Up")


def head(f):
    body = Body()
    body.ball(*f.skull, 0.1)
    body.ball(*f.face, 0.25)
    body.limb(f.neck, 0.25)
    body.both(body.limb, f.jaw, 0.22)
    body.ball(*f.chin, 0.16)
    body.both(body.ball, *f.cheek, 0.24)
    body.both(body.ball, *f.jowl, 0.22)
    body.both(body.limb, f.brow, 0.14)
    body.both(body.limb, np.array(f.brow) + BROW_HAIR, 0.05, 'brow')
    body.limb(f.bridge, 0.12)
    body.both(body.ball, *f.wing, 0.09)
    # Lips, around a muscle that carries them.
    front, high = f.mouth
    half, upper, lower = f.lips
    body.ball((front - 0.16, 0, high), (0.20, half, 0.22), 0.16)
    for up, thick in ((1, upper), (-1, lower)):
        corner = (front - 0.17, 0.92 * half, high + 0.005, .024)
        left = [corner, (front - 0.02, 0.55 * half, high + up * 0.75 * thick, thick * 0.85)]
        right = [(x, -y, z, radius) for x, y, z, radius in left[::-1]]
        body.limb([*left, (front + 0.015, 0, high + up * 0.85 * thick, thick), *right], 0.045, 'lips')
    groove = (f.wing[0][0] + 0.06, 0, f.wing[0][2] - 0.06, .016)
    body.limb([(front + 0.07, 0, high + 2.0 * upper, .022), groove], 0.07, carve=True)
    body.both(body.ball, *f.nostril, 0.03, carve=True)
    body.ball((front - 0.36, 0, high), (0.24, 0.75 * half, 0.10), 0.03, carve=True)
    body.slab((front - 0.25, 0, high), (0.46, 0.95 * half), 0.022, 0.012, carve=True)
    # Lids: a ball's shell over each eyeball, with a slit like an almond.
    eye, along = np.array(f.eye), corner_axis(f)
    body.both(body.ball, eye, f.eyeball + f.lid, 0.07)
    width, height = f.opening
    across = np.array([-1, 1]) * width
    places = [eye + s * along + np.array([np.sqrt((f.eyeball + f.lid / 2) ** 2 - s ** 2), 0, 0]) @ turned(along)
              for s in (across[0], across[0] / 2, 0, across[1] / 2, across[1])]
    radii = height * np.array([0.26, 0.86, 1.0, 0.82, 0.26])
    body.both(body.limb, [(*place, radius) for place, radius in zip(places, radii)], 0.016, carve=True)
    body.both(body.ball, eye, f.eyeball + 0.004, 0.006, carve=True)
    # Ears.
    ear = np.array(f.ear)
    body.both(body.limb, ear, 0.06)
    middle, axes = ear[:, :3].mean(0), np.linalg.svd(ear[:, :3] - ear[:, :3].mean(0))[2].T
    radii = np.append(1.55 * ((ear[:, :3] - middle) @ axes[:, :2]).std(0), 0.050)
    for sign in (1, -1):
        mirror = np.array([1, sign, 1])
        body.ball(middle * mirror, radii, 0.04, turn=axes * mirror[:, None])
    return body


def corner_axis(f):
    """The direction from the left eye's inner corner to its outer one."""
    axis = np.array([-0.42, 1, f.slant])
    return axis / np.linalg.norm(axis)


def turned(along):
    """The left eye's axes as rows: forward, to the outer corner, up."""
    up = np.cross(np.cross(along, [0, 0, 1]), along) * -1
    up /= np.linalg.norm(up)
    up *= np.sign(up[2])
    return np.array([np.cross(along, up), along, up])


def add_head(name, f, cell, turn=None, ratio=1.0):
    """Skin and eyeballs in one mesh, the eyeballs last."""
    body = head(f)
    points, faces = body.mesh(cell, turn)
    kept = points[:, 2] > f.neck[-1][2] + 0.25  # open below, as busts are
    faces = faces[kept[faces].all(1)]
    used, faces = np.unique(faces, return_inverse=True)
    points, faces = points[used], faces.reshape(-1, 4).tolist()
    if ratio < 1:
        points, faces = decimated(points, faces, ratio)
    skin = len(points)
    colours = painted(body, f, name, points)
    for sign in (1, -1):
        ball, quads, tint = eyeball(f, sign)
        faces += (quads + len(points)).tolist()
        points, colours = np.vstack([points, ball]), np.vstack([colours, tint])
    ob = add_object(name, points, faces, colours)
    ob["skin"] = skin
    return ob


def decimated(points, faces, ratio):
    ob = add_object("Decimated", points, faces)
    decimate = ob.modifiers.new("Decimate", 'DECIMATE')
    decimate.ratio, decimate.use_collapse_triangulate = ratio, True
    bpy.ops.object.modifier_apply(modifier=decimate.name)
    found = np.array([v.co for v in ob.data.vertices]), [list(p.vertices) for p in ob.data.polygons]
    bpy.data.objects.remove(ob)
    return found


def painted(body, f, name, points):
    colours = COLOURS[name]
    found = body.paint(points, colours, 0.012)
    front, high = f.mouth
    across = np.abs(points[:, 1]) / f.lips[0]
    deep = np.clip((front - 0.02 - 0.10 * across ** 2 - points[:, 0]) / 0.05, 0, 1)
    deep = (deep * ((np.abs(points[:, 2] - high) < 0.12) & (across < 0.85) & (points[:, 0] > front - 0.9)))[:, None]
    return (1 - deep) * found + deep * np.array(INSIDE)


def eyeball(f, sign, rings=24, sides=32):
    """Points, quads and colours of one eyeball, whose pole is the pupil."""
    polar, around = np.meshgrid(np.pi * (np.arange(rings) + 0.5) / rings, 2 * np.pi * np.arange(sides) / sides,
                                indexing='ij')
    ball = np.stack([np.cos(polar), np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around)], -1)
    ball = ball @ np.array(Matrix.Rotation(-GAZE, 3, 'Z'))
    i, j = (a.ravel() for a in np.meshgrid(np.arange(rings - 1), np.arange(sides), indexing='ij'))
    a, b = i * sides + j, i * sides + (j + 1) % sides
    tint = np.where(polar[..., None] < 0.26, (0.006, 0.006, 0.008),
                    np.where(polar[..., None] < 0.56, (0.055, 0.075, 0.085), (0.72, 0.70, 0.66)))
    quads = np.stack([a, a + sides, b + sides, b], -1)
    caps = np.array([[k, k + 1, sides - 2 - k, sides - 1 - k] for k in range(sides // 2 - 1)])
    last = (rings - 1) * sides
    points = np.array(f.eye) * (1, sign, 1) + f.eyeball * ball.reshape(-1, 3)
    return points, np.vstack([quads, caps[:, ::-1], caps + last]), tint.reshape(-1, 3)


# ---------------------------------------------------------------- the first head's keys

def smoothstep(x):
    x = np.clip(x, 0, 1)
    return x * x * (3 - 2 * x)


def near(points, place, reach):
    """(n, 1): 1 at the place, falling to 0 at the reach."""
    return smoothstep(1 - np.linalg.norm((points - np.array(place)) / reach, axis=1))[:, None]


def jaw_open(points, f, degrees=17):
    """A turn about the hinge; the lower lip parts from the upper one at the slit, the cheeks are drawn along."""
    front, high = f.mouth
    drop, side = high - points[:, 2], np.clip(np.abs(points[:, 1]) / f.lips[0], 0, 1)
    # Little by little away from the lips; at once between the lips, so far that the mouth becomes an oval.
    weight = smoothstep(0.5 + drop / 0.42) - 0.5
    lips = 0.5 * np.clip(drop / 0.006, -1, 1) * np.sqrt(1 - side ** 2) * smoothstep((points[:, 0] - front + 0.6) / 0.14)
    weight = 0.5 + np.where(np.abs(weight) > np.abs(lips), weight, lips)
    # The throat and the head behind the jaw stay.
    weight *= smoothstep((points[:, 0] - f.hinge[0] + 0.15 + 0.25 * (points[:, 2] - high)) / 0.45)
    weight *= smoothstep((points[:, 2] - f.chin[0][2] + 0.75) / 0.5)
    angle = np.radians(degrees) * weight
    x, z = points[:, 0] - f.hinge[0], points[:, 2] - f.hinge[1]
    return np.stack([x * np.cos(angle) + z * np.sin(angle) - x, 0 * x, z * np.cos(angle) - x * np.sin(angle) - z], -1)


def smile(points, f):
    front, high = f.mouth
    found = np.zeros_like(points)
    for sign in (1, -1):
        corner = (front - 0.13, sign * f.lips[0], high)
        found += near(points, corner, 0.42) * np.array([-0.10, sign * 0.09, 0.14])
        cheek = np.array(f.cheek[0]) * (1, sign, 1) + (0.05, 0, -0.08)
        found += near(points, cheek, 0.36) * np.array([0.05, sign * 0.02, 0.06])
    return found


def blink_left(points, f):
    """Both lids turn about the line through the eye's corners until they meet, the upper one further."""
    rows = turned(corner_axis(f))
    q = (points - np.array(f.eye)) @ rows.T
    radius, theta, far = np.linalg.norm(q, axis=1), np.arctan2(q[:, 2], q[:, 0]), 1.35
    along = q[:, 1] / f.opening[0]
    low, high = lid_edges(along, theta, np.abs(radius - f.eyeball - 0.6 * f.lid) < 0.4 * f.lid)
    meet, is_upper = 0.75 * low + 0.25 * high, theta > (low + high) / 2
    overlap = (OVERLAP[0] + OVERLAP[1] * np.minimum(along ** 2, 1.5)) * (high - low)
    edge, meet = np.where(is_upper, high, low), meet + np.where(is_upper, -overlap, overlap)
    share = np.clip(np.where(is_upper, (far - theta) / (far - high), (far + theta) / (far + low)), 0, 1)
    # The lid's edge moves all the way; the motion fades out smoothly where the lid ends.
    turn = share ** 1.6 * (meet - edge) * smoothstep((f.eyeball + f.lid + 0.19 - radius) / 0.17) * (np.abs(theta) < far)
    new = np.stack([q[:, 0] * np.cos(turn) - q[:, 2] * np.sin(turn), q[:, 1],
                    q[:, 0] * np.sin(turn) + q[:, 2] * np.cos(turn)], -1)
    return (new - q) @ rows


def lid_edges(along, theta, is_lid, knots=19):
    """The lower and the upper lid's edge beside each point, as angles about the eye."""
    found = []
    for place in np.linspace(-1.25, 1.25, knots):
        there = theta[is_lid & (np.abs(along - place) < 1.6 / knots)]
        if (there < 0).any() and (there > 0).any():
            found.append((place, there[there < 0].max(), there[there > 0].min()))
    places, low, high = np.array(found).T
    return np.interp(along, places, low), np.interp(along, places, high)


def brow_up(points, f):
    found = np.zeros_like(points)
    brow = np.array(f.brow)
    for sign in (1, -1):
        for k in range(3):
            found += near(points, brow[k, :3] * (1, sign, 1) + (0, 0, 0.08), 0.42) * np.array([0.0, 0, 0.085])
    above = smoothstep((points[:, 2] - f.eye[2] - f.opening[1] - 0.02) / 0.2)[:, None]
    return found * above * (points[:, :1] > 0)


def add_keys(ob, f):
    points, faces = np.array([v.co for v in ob.data.vertices]), [list(p.vertices) for p in ob.data.polygons]
    faces = np.array([face for face in faces if max(face) < ob["skin"]])
    ob.shape_key_add(name="Basis")
    for name, make, evened in zip(KEYS, (jaw_open, smile, blink_left, brow_up), (6, 6, 1, 6)):
        moved = make(points, f)
        moved[ob["skin"]:] = 0  # eyeballs stay
        for _ in range(evened):  # smooths along the surface, not across the slit
            moved = relaxed(moved, faces)
        ob.shape_key_add(name=name, from_mix=False).data.foreach_set('co', np.float32(points + moved).ravel())


def mark(ob, f):
    """Three markers: the nose's tip, the left eye's outer corner, the left corner of the mouth."""
    corner = np.array(f.eye) + 1.1 * f.opening[0] * corner_axis(f) + (0.12, 0, 0)
    mouth = (f.mouth[0], 0.95 * f.lips[0], f.mouth[1])
    add_markers(ob, (np.array(f.bridge[-1][:3]) + (0.15, 0, 0), corner, mouth), ob["skin"])


def add_young(cell=0.022):
    ob = add_head("Young", YOUNG, cell)
    add_keys(ob, YOUNG)
    return ob


def add_old(cell=0.020, ratio=0.55):
    return add_head("Old", OLD, cell, Matrix.Rotation(0.6, 3, 'Z') @ Matrix.Rotation(0.5, 3, 'X'), ratio)
