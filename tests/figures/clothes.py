# SPDX-License-Identifier: GPL-3.0-or-later
"""A body of our own with an armature and one pose, and a shirt over it, of other vertices; x forward, y to its left."""
import math

import bpy
import numpy as np
from mathutils import Matrix, Vector

from implicit import Body
from studio import activate, add_object

BODY_COLOURS = {None: (0.36, 0.30, 0.27)}
SHIRT_COLOURS = {None: (0.035, 0.13, 0.22), 'hem': (0.026, 0.10, 0.17)}
LOOSE = 0.020  # how far the shirt is from the skin, about
# The shirt's borders: a height; a point of a plane and the direction that is cut off; an ellipsoid around the neck.
HEM, CUFF = 0.93, ((0, 0.39, 1.29), (0, 0.80, -0.60))
COLLAR = ((0.030, 0, 1.60), (0.128, 0.120, 0.188))
BONES = {
    "hips": ((0, 0, 0.92), (0, 0, 1.06), None, 1), "waist": ((0, 0, 1.06), (0, 0, 1.20), "hips", 1),
    "chest": ((0, 0, 1.20), (0, 0, 1.46), "waist", 1), "neck": ((0, 0, 1.46), (0.02, 0, 1.60), "chest", 1),
    "head": ((0.02, 0, 1.60), (0.04, 0, 1.84), "neck", 1), "collar": ((0, .03, 1.43), (0, .17, 1.435), "chest", 2),
    "arm": ((0, .175, 1.43), (-0.01, .395, 1.265), "collar", 2),
    "forearm": ((-0.01, .395, 1.265), (0.03, .59, 1.12), "arm", 2),
    "hand": ((0.03, .59, 1.12), (0.05, .71, 1.03), "forearm", 2),
    "thigh": ((0, .095, 0.90), (0.01, .11, 0.48), "hips", 2),
}
# Turns about the scene's axes, in degrees, one after the other.
POSE = {"hips": (0, 0, 0), "waist": (0, 4, 17), "chest": (-5, 6, 20), "neck": (4, -4, -12), "head": (3, -6, -12),
        "collar.L": (22, 0, 0), "arm.L": (68, 0, 8), "forearm.L": (48, 0, 22), "collar.R": (4, 0, 6),
        "arm.R": (22, -16, 22), "forearm.R": (0, -34, 42)}


def figure(more=0.0):
    """A mannequin down to its thighs. more: how much wider everything is."""
    body = Body()

    def wider(points):
        return np.array(points) + (0, 0, 0, more)

    body.limb(wider([(-0.01, 0, 0.86, .125), (-0.01, 0, 0.96, .128), (0.0, 0, 1.08, .112), (0.005, 0, 1.20, .122),
                     (0.0, 0, 1.32, .132), (-0.01, 0, 1.41, .085)]), 0.06, wide=1.30)
    body.both(body.ball, (0.065, .085, 1.335), np.array((.060, .085, .065)) + more, 0.05)
    body.both(body.ball, (-0.075, .095, 1.330), np.array((.050, .080, .095)) + more, 0.05)
    body.both(body.ball, (-0.065, .070, 0.900), np.array((.080, .080, .085)) + more, 0.05)
    body.both(body.limb, wider([(-0.02, .04, 1.475, .045), (-0.01, .12, 1.435, .050), (0, .165, 1.415, .066)]), 0.06)
    body.both(body.limb, wider([(0, .165, 1.415, .070), (0.0, .24, 1.375, .060), (-0.005, .32, 1.32, .052),
                                (-0.01, .395, 1.265, .043), (0.0, .46, 1.215, .046), (0.03, .59, 1.12, .029)]), 0.04)
    body.limb(wider([(-0.02, 0, 1.42, .070), (0.0, 0, 1.50, .056), (0.015, 0, 1.58, .055)]), 0.04)
    return body


def mannequin():
    body = figure()
    body.ball((0.015, 0, 1.72), (.102, .080, .112), 0.03)
    body.limb([(0.03, 0, 1.66, .070), (0.075, 0, 1.625, .036)], 0.05)
    body.limb([(0.104, 0, 1.745, .010), (0.120, 0, 1.695, .014)], 0.035)
    body.both(body.limb, [(0.03, .59, 1.12, .030), (0.045, .65, 1.075, .034), (0.055, .70, 1.035, .022)], 0.02,
              wide=0.9)
    for k, place in enumerate(((0.085, .735, 1.012), (0.062, .748, 0.995), (0.038, .742, 0.998), (0.018, .725, 1.010))):
        body.both(body.limb, [(0.072 - 0.014 * k, .685, 1.045, .012), (*place, .010)], 0.008)
    body.both(body.limb, [(0.06, .645, 1.085, .013), (0.098, .675, 1.045, .011)], 0.012)
    body.both(body.limb, [(0, .095, 0.88, .095), (0.01, .105, 0.70, .080), (0.01, .11, 0.40, .062)], 0.04)
    return body


def add_body(cell=0.0105):
    body = mannequin()
    points, quads = body.mesh(cell)
    return add_object("Body", points, quads, body.paint(points, BODY_COLOURS, 0.01))


def add_shirt(cell=0.0085, ratio=0.6):
    """The figure a little wider, cut off at hem, sleeves and collar, with folds; triangles of all directions."""
    points, quads = figure(LOOSE).mesh(cell, Matrix.Rotation(0.5, 3, 'X') @ Matrix.Rotation(0.4, 3, 'Z'))
    ob = add_object("Shirt", points, quads)
    decimate = ob.modifiers.new("Decimate", 'DECIMATE')
    decimate.ratio, decimate.use_collapse_triangulate = ratio, True
    bpy.ops.object.modifier_apply(modifier=decimate.name)
    ob.data.calc_loop_triangles()
    points = np.array([vertex.co for vertex in ob.data.vertices])
    points += np.array([folds(v.co) * v.normal for v in ob.data.vertices])
    faces = np.array([face.vertices for face in ob.data.loop_triangles])
    bpy.data.objects.remove(ob)
    points, faces = clipped(points, faces, HEM - points[:, 2])
    beside = np.stack([points[:, 0], np.abs(points[:, 1]), points[:, 2]], -1)
    points, faces = clipped(points, faces, np.minimum((beside - CUFF[0]) @ np.array(CUFF[1]), beside[:, 1] - 0.25))
    points, faces = clipped(points, faces, 0.11 * (1 - np.linalg.norm((points - COLLAR[0]) / COLLAR[1], axis=1)))
    colours = np.tile(SHIRT_COLOURS[None], (len(points), 1))
    colours[border_distance(points, faces) < 0.013] = SHIRT_COLOURS['hem']
    return add_object("Shirt", points, faces.tolist(), colours)


def clipped(points, faces, beyond):
    """Triangles without where `beyond`, about a length at each point, is positive; cut along its zeros."""
    beyond = np.where(np.abs(beyond) < 0.0015, 0, beyond)  # no slivers
    points, made, found = list(points), {}, []

    def between(a, b):
        if (b, a) not in made:
            made[a, b] = len(points)
            points.append(points[a] + (points[b] - points[a]) * (beyond[a] / (beyond[a] - beyond[b])))
        return made.get((a, b), made.get((b, a)))

    for face in faces:
        outline = []
        for a, b in zip(face, np.roll(face, -1)):
            outline += [a] if beyond[a] <= 0 else []
            outline += [between(a, b)] if beyond[a] * beyond[b] < 0 else []
        found += [(outline[0], *pair) for pair in zip(outline[1:], outline[2:])] if (beyond[face] < 0).any() else []
    used, faces = np.unique(np.array(found), return_inverse=True)
    return np.array(points)[used], faces.reshape(-1, 3)


def border_distance(points, faces):
    edges, times = np.unique(np.sort(np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1), axis=0,
                             return_counts=True)
    border = points[np.unique(edges[times == 1])]
    return np.array([np.linalg.norm(border - point, axis=1).min() for point in points])


def folds(p):
    """Offset from the even cloth: slack around the waist, creases that run from the armpits, a loose hem."""
    side, waist = math.atan2(p.y, p.x), math.exp(-((p.z - 1.07) / 0.10) ** 2)
    found = 0.007 * waist + 0.010 * waist * math.sin(7 * side + 32 * p.z) * math.sin(24 * p.z)
    pit = Vector((0, math.copysign(0.17, p.y), 1.30))
    away = p - pit
    found += 0.011 * math.exp(-away.length / 0.10) * math.sin(9 * math.atan2(away.z, math.hypot(away.x, away.y)) + 2)
    hem = smooth(1.04, 0.93, p.z)
    sleeve = smooth(0.27, 0.38, abs(p.y))
    return found + hem * (0.010 + 0.010 * math.sin(7 * side)) + sleeve * (0.010 + 0.003 * math.sin(60 * p.x))


def smooth(low, high, value):
    t = min(1.0, max(0.0, (value - low) / (high - low)))
    return t * t * (3 - 2 * t)


def add_rig(ob):
    """An armature with automatic weights; frame 1 is the rest, frame 2 the pose."""
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(rig)
    activate(rig)
    bpy.ops.object.mode_set(mode='EDIT')
    for name, (head, tail, parent, sides) in BONES.items():
        for side, sign in (("L", 1), ("R", -1)) if sides == 2 else (("", 0),):
            bone = rig.data.edit_bones.new(f"{name}.{side}" if side else name)
            bone.head, bone.tail = (head[0], sign * head[1], head[2]), (tail[0], sign * tail[1], tail[2])
            bone.parent = rig.data.edit_bones.get(f"{parent}.{side}") or rig.data.edit_bones.get(parent or "")
    bpy.ops.object.mode_set(mode='OBJECT')
    activate(ob)
    rig.select_set(True)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.parent_set(type='ARMATURE_AUTO')
    ob.modifiers[0].use_deform_preserve_volume = True
    for name, turns in POSE.items():
        bone = rig.pose.bones[name]
        bone.rotation_mode = 'QUATERNION'
        rest, turned = bone.bone.matrix_local.to_3x3(), Matrix.Identity(3)
        for axis, turn in zip('XYZ', turns):
            turned = Matrix.Rotation(math.radians(turn), 3, axis) @ turned
        for frame, now in ((1, Matrix.Identity(3)), (2, turned)):
            bone.rotation_quaternion = (rest.inverted() @ now @ rest).to_quaternion()
            bone.keyframe_insert('rotation_quaternion', frame=frame)
    rig.hide_render = True
    return rig
