# SPDX-License-Identifier: GPL-3.0-or-later
"""A horse and a camel of our own, x forward, z up; the horse's armature and its gallop."""
import math

import bpy
import numpy as np
from mathutils import Matrix

from implicit import Body
from studio import activate, add_object

HORSE_COLOURS = {None: (0.21, 0.068, 0.024), 'dark': (0.022, 0.013, 0.010), 'hoof': (0.05, 0.04, 0.035),
                 'eye': (0.008, 0.006, 0.006), 'muzzle': (0.055, 0.030, 0.022)}
CAMEL_COLOURS = {None: (0.44, 0.245, 0.098), 'dark': (0.17, 0.082, 0.034), 'hoof': (0.30, 0.19, 0.10),
                 'eye': (0.010, 0.007, 0.006), 'muzzle': (0.46, 0.30, 0.16)}


def horse():
    body = Body()
    body.limb([(-0.66, 0, 1.27, .23), (-0.45, 0, 1.29, .265), (-0.15, 0, 1.22, .265), (0.12, 0, 1.17, .300),
               (0.36, 0, 1.15, .300), (0.60, 0, 1.17, .235)], 0.10, wide=0.86)
    body.limb([(-0.40, 0, 1.44, .10), (0.05, 0, 1.38, .09), (0.30, 0, 1.52, .075), (0.55, 0, 1.52, .10)], 0.14)
    body.limb([(0.52, 0, 1.30, .250), (0.80, 0, 1.55, .185), (1.02, 0, 1.80, .130), (1.12, 0, 1.90, .105)], 0.12,
              wide=0.56)
    # The head: skull, cheeks, the nose's bridge, a muzzle with lips.
    body.limb([(1.12, 0, 1.90, .100), (1.26, 0, 1.76, .100), (1.44, 0, 1.56, .068), (1.53, 0, 1.45, .062)], 0.05,
              wide=0.66)
    body.limb([(1.14, 0, 1.76, .115), (1.24, 0, 1.67, .090), (1.40, 0, 1.52, .060)], 0.05, wide=0.50)
    body.both(body.limb, [(1.20, .055, 1.83, .040), (1.34, .048, 1.68, .024)], 0.04)
    body.limb([(1.500, 0, 1.485, .058), (1.545, 0, 1.430, .054)], 0.05, 'muzzle', wide=0.86)
    body.limb([(1.465, 0, 1.430, .040), (1.505, 0, 1.388, .034)], 0.03, 'muzzle')
    body.both(body.limb, [(1.560, .046, 1.392, .007), (1.500, .056, 1.428, .007), (1.450, .058, 1.462, .004)], 0.010,
              carve=True)
    body.both(body.limb, [(1.570, .045, 1.478, .012), (1.556, .055, 1.502, .012)], 0.016, carve=True)
    body.both(body.ball, (1.215, .080, 1.800), .040, 0.03, carve=True)
    body.both(body.ball, (1.213, .066, 1.800), .034, 0.006, 'eye')
    body.both(body.limb, [(1.180, .068, 1.842, .020), (1.222, .082, 1.838, .019), (1.252, .070, 1.806, .012)], 0.02)
    body.both(body.limb, [(1.085, .050, 1.960, .034), (1.082, .066, 2.045, .038), (1.108, .076, 2.150, .008)], 0.03)
    body.both(body.limb, [(1.122, .060, 2.010, .018), (1.125, .072, 2.060, .018), (1.128, .080, 2.105, .004)], 0.015,
              carve=True)
    # Mane, forelock and tail.
    body.limb([(0.50, 0, 1.54, .035), (0.70, 0, 1.69, .052), (0.90, 0, 1.86, .056), (1.04, 0, 1.985, .050)], 0.03,
              'dark', wide=0.75)
    body.limb([(1.07, 0, 1.985, .036), (1.16, 0, 1.965, .036), (1.255, 0, 1.86, .010)], 0.02, 'dark')
    body.limb([(-0.84, 0, 1.39, .050), (-0.95, 0, 1.34, .066), (-1.04, 0, 1.14, .090), (-1.06, 0, 0.88, .095),
               (-1.04, 0, 0.66, .066), (-1.01, 0, 0.50, .012)], 0.04, 'dark', wide=0.85)
    # Forelegs: shoulder, forearm with its muscle, knee, cannon, fetlock, pastern, hoof.
    body.both(body.limb, [(0.40, .13, 1.34, .12), (0.58, .15, 1.10, .125), (0.42, .165, 0.95, .105)], 0.08)
    body.both(body.limb, [(0.42, .165, 0.95, .105), (0.435, .17, 0.78, .083), (0.455, .17, 0.62, .056),
                          (0.46, .17, 0.53, .056), (0.452, .17, 0.44, .043), (0.45, .17, 0.27, .040)], 0.05)
    body.both(body.ball, (0.470, .17, 0.535), (.056, .054, .072), 0.03)
    body.both(body.limb, [(0.432, .17, 0.49, .030), (0.428, .17, 0.25, .028)], 0.03)
    body.both(body.limb, [(0.45, .17, 0.30, .040), (0.452, .17, 0.20, .051), (0.492, .17, 0.115, .042)], 0.03, 'dark')
    body.both(body.limb, [(0.490, .17, 0.095, .046), (0.525, .17, 0.030, .066)], 0.012, 'hoof')
    # Hind legs: croup, thigh, gaskin, hock with its point, cannon, fetlock, pastern, hoof.
    body.both(body.limb, [(-0.56, .10, 1.20, .200), (-0.46, .145, 1.06, .165), (-0.385, .165, 0.93, .130)], 0.08,
              wide=0.85)
    body.both(body.limb, [(-0.74, .11, 1.20, .130), (-0.70, .13, 1.00, .125), (-0.60, .155, 0.82, .085)], 0.08)
    body.both(body.limb, [(-0.40, .170, 0.92, .125), (-0.56, .170, 0.76, .088), (-0.70, .17, 0.64, .062),
                          (-0.765, .17, 0.57, .062), (-0.755, .17, 0.45, .049), (-0.745, .17, 0.28, .043)], 0.05)
    body.both(body.limb, [(-0.70, .17, 0.76, .026), (-0.815, .17, 0.645, .036), (-0.80, .17, 0.53, .034)], 0.035)
    body.both(body.limb, [(-0.790, .17, 0.50, .030), (-0.780, .17, 0.25, .030)], 0.03)
    body.both(body.limb, [(-0.745, .17, 0.30, .043), (-0.745, .17, 0.20, .053), (-0.700, .17, 0.115, .043)], 0.03,
              'dark')
    body.both(body.limb, [(-0.700, .17, 0.095, .046), (-0.668, .17, 0.030, .065)], 0.012, 'hoof')
    sole(body)
    return body


def camel():
    body = Body()
    body.limb([(-0.60, 0, 1.46, .185), (-0.40, 0, 1.47, .225), (-0.10, 0, 1.43, .260), (0.18, 0, 1.38, .300),
               (0.42, 0, 1.36, .290), (0.62, 0, 1.40, .190)], 0.10, wide=0.82)
    body.limb([(-0.10, 0, 1.66, .26), (-0.03, 0, 1.80, .215), (-0.04, 0, 1.93, .160), (-0.07, 0, 2.00, .115)], 0.12,
              wide=0.72)
    body.limb([(-0.05, 0, 2.02, .075), (-0.13, 0, 2.04, .070)], 0.07, 'dark')
    body.limb([(0.52, 0, 1.46, .195), (0.74, 0, 1.39, .135), (0.93, 0, 1.37, .108), (1.11, 0, 1.47, .100),
               (1.24, 0, 1.70, .092), (1.32, 0, 1.96, .086), (1.38, 0, 2.12, .088)], 0.10, wide=0.80)
    body.limb([(0.72, 0, 1.28, .040), (0.92, 0, 1.275, .045), (1.12, 0, 1.38, .040), (1.26, 0, 1.62, .020)], 0.05,
              'dark', wide=0.6)
    # The head: flat skull, brows over the eyes, a long split lip that overhangs.
    body.limb([(1.38, 0, 2.15, .100), (1.52, 0, 2.165, .092), (1.70, 0, 2.100, .066), (1.82, 0, 2.055, .060)], 0.05,
              wide=0.76)
    body.limb([(1.44, 0, 2.07, .080), (1.62, 0, 2.03, .056), (1.78, 0, 1.985, .042)], 0.04, wide=0.68)
    body.ball((1.845, 0, 2.055), (.058, .055, .052), 0.03, 'muzzle')
    body.ball((1.808, 0, 1.978), (.055, .044, .030), 0.02, 'muzzle')
    body.both(body.limb, [(1.885, .038, 2.010, .007), (1.730, .056, 2.020, .006)], 0.012, carve=True)
    body.limb([(1.915, 0, 2.085, .006), (1.905, 0, 2.020, .006)], 0.012, carve=True)
    body.both(body.limb, [(1.885, .030, 2.082, .008), (1.862, .044, 2.098, .008)], 0.010, carve=True)
    body.both(body.ball, (1.548, .082, 2.172), .036, 0.03, carve=True)
    body.both(body.ball, (1.546, .070, 2.168), .031, 0.006, 'eye')
    body.both(body.limb, [(1.505, .066, 2.208, .020), (1.555, .082, 2.212, .020), (1.592, .068, 2.186, .012)], 0.02)
    body.both(body.limb, [(1.375, .070, 2.220, .026), (1.345, .105, 2.260, .032), (1.325, .130, 2.305, .008)], 0.025)
    body.both(body.limb, [(1.375, .105, 2.262, .014), (1.352, .124, 2.288, .006)], 0.012, carve=True)
    body.limb([(1.30, 0, 2.20, .030), (1.40, 0, 2.245, .038), (1.48, 0, 2.24, .024)], 0.03, 'dark')
    body.limb([(-0.74, 0, 1.50, .036), (-0.83, 0, 1.42, .030), (-0.86, 0, 1.18, .026), (-0.85, 0, 1.02, .036),
               (-0.84, 0, 0.90, .040), (-0.84, 0, 0.80, .010)], 0.03)
    # Long legs with large knees and broad pads.
    body.both(body.limb, [(0.42, .125, 1.50, .115), (0.54, .150, 1.32, .115), (0.43, .165, 1.14, .100)], 0.08)
    body.both(body.limb, [(0.43, .165, 1.14, .100), (0.440, .17, 0.96, .074), (0.455, .17, 0.76, .054),
                          (0.46, .17, 0.66, .060), (0.452, .17, 0.54, .044), (0.450, .17, 0.30, .040),
                          (0.452, .17, 0.18, .050), (0.480, .17, 0.10, .048)], 0.05)
    body.both(body.ball, (0.472, .17, 0.665), (.064, .062, .082), 0.03)
    body.both(body.ball, (0.510, .17, 0.040), (.108, .084, .056), 0.03, 'hoof')
    body.both(body.limb, [(-0.52, .09, 1.40, .165), (-0.44, .14, 1.26, .140), (-0.385, .16, 1.12, .110)], 0.08,
              wide=0.85)
    body.both(body.limb, [(-0.66, .09, 1.42, .100), (-0.64, .12, 1.20, .090), (-0.54, .15, 1.00, .062)], 0.07)
    body.both(body.limb, [(-0.39, .165, 1.11, .105), (-0.49, .17, 0.94, .072), (-0.59, .17, 0.79, .054),
                          (-0.64, .17, 0.71, .058), (-0.625, .17, 0.58, .045), (-0.600, .17, 0.32, .040),
                          (-0.598, .17, 0.19, .049), (-0.570, .17, 0.10, .046)], 0.05)
    body.both(body.limb, [(-0.60, .17, 0.86, .022), (-0.690, .17, 0.765, .034), (-0.67, .17, 0.66, .034)], 0.035)
    body.both(body.ball, (-0.535, .17, 0.040), (.104, .082, .055), 0.03, 'hoof')
    sole(body)
    return body


def sole(body):
    """Cuts the body off flat at the ground."""
    body.parts.append((lambda p: p[..., 2], np.array([-1, -0.3, -0.12]), np.array([1, 0.3, 0.06]), 0.006, None, -1))


def add_horse(cell=0.016):
    body = horse()
    points, quads = body.mesh(cell)
    return add_object("Horse", points, quads, body.paint(points, HORSE_COLOURS, 0.006))


def add_camel(cell=0.017, ratio=0.6):
    """Triangles in all directions, where the horse has quads along the axes."""
    body = camel()
    turn = Matrix.Rotation(0.5, 3, 'Z') @ Matrix.Rotation(0.4, 3, 'X')
    points, quads = body.mesh(cell, turn)
    ob = add_object("Camel", points, quads)
    decimate = ob.modifiers.new("Decimate", 'DECIMATE')
    decimate.ratio, decimate.use_collapse_triangulate = ratio, True
    bpy.ops.object.modifier_apply(modifier="Decimate")
    points = np.array([vertex.co for vertex in ob.data.vertices])
    faces = [list(face.vertices) for face in ob.data.polygons]
    bpy.data.objects.remove(ob)
    return add_object("Camel", points, faces, body.paint(points, CAMEL_COLOURS, 0.006))


# ---------------------------------------------------------------- the gallop

FORE, HIND = ("arm", "forearm", "cannon", "pastern"), ("thigh", "gaskin", "shank", "heel")
# Bone: head, tail, parent; leg bones, given for the left side, are on both.
BONES = {
    "pelvis": ((-0.12, 0, 1.27), (-0.70, 0, 1.28), None), "chest": ((-0.12, 0, 1.27), (0.46, 0, 1.26), None),
    "neck": ((0.46, 0, 1.30), (0.82, 0, 1.58), "chest"), "nape": ((0.82, 0, 1.58), (1.10, 0, 1.87), "neck"),
    "head": ((1.10, 0, 1.87), (1.54, 0, 1.43), "nape"), "dock": ((-0.82, 0, 1.38), (-1.03, 0, 1.16), "pelvis"),
    "tail": ((-1.03, 0, 1.16), (-1.03, 0, 0.55), "dock"),
    "scapula": ((0.36, .13, 1.42), (0.56, .15, 1.12), "chest"),
    "arm": ((0.56, .15, 1.12), (0.42, .165, 0.95), "scapula"),
    "forearm": ((0.42, .165, 0.95), (0.46, .17, 0.53), "arm"),
    "cannon": ((0.46, .17, 0.53), (0.45, .17, 0.20), "forearm"),
    "pastern": ((0.45, .17, 0.20), (0.53, .17, 0.03), "cannon"),
    "thigh": ((-0.56, .13, 1.18), (-0.40, .17, 0.92), "pelvis"),
    "gaskin": ((-0.40, .17, 0.92), (-0.77, .17, 0.58), "thigh"),
    "shank": ((-0.77, .17, 0.58), (-0.75, .17, 0.20), "gaskin"),
    "heel": ((-0.75, .17, 0.20), (-0.67, .17, 0.03), "shank"),
}
# Degrees by which each bone is swung forward from rest (one that points forward: up), at fractions of a leg's stride,
# which begins where the hoof comes down.
FORE_STRIDE = ((0.00, (16, 30, 30, 32)), (0.12, (0, 2, 2, 34)), (0.25, (-16, -32, -34, -20)),
               (0.38, (-12, -20, -100, -130)), (0.55, (6, 30, -85, -125)), (0.70, (18, 60, -25, -65)),
               (0.86, (24, 60, 48, 30)))
HIND_STRIDE = ((0.00, (28, 22, 34, 36)), (0.12, (6, 0, 4, 26)), (0.25, (-24, -36, -36, -46)),
               (0.36, (-20, -44, -58, -92)), (0.50, (4, -30, -72, -112)), (0.65, (26, -10, -50, -88)),
               (0.80, (40, 20, 8, -16)), (0.91, (38, 32, 38, 28)))
LEGS = (("L", FORE, FORE_STRIDE, 0.40), ("R", FORE, FORE_STRIDE, 0.54),
        ("L", HIND, HIND_STRIDE, 0.00), ("R", HIND, HIND_STRIDE, 0.13))  # last: when in the gallop it comes down
# Degrees of the bones that are no legs, over the gallop, and the height over the ground.
TRUNK = ("pelvis", "chest", "neck", "nape", "head", "dock", "tail")
GALLOP = ((0.00, (14, 7, 4, 2, 2, -40, -58), 0.05), (0.20, (6, 5, -6, -8, 0, -34, -52), 0.0),
          (0.40, (-7, 0, -16, -18, 4, -30, -46), 0.0), (0.60, (-7, -6, -14, -16, 6, -36, -60), 0.0),
          (0.78, (2, -3, -4, -6, 2, -42, -66), 0.07), (0.90, (11, 3, 2, 0, 0, -44, -66), 0.10))
PHASES = 6


def swings(phase):
    """{bone: degrees}, and the height over the ground."""
    def at(table, share):
        values = np.array([np.ravel(row[1]) for row in table])
        return [np.interp(share % 1, [row[0] for row in table], column, period=1) for column in values.T]

    found = dict(zip(TRUNK, at(GALLOP, phase)))
    for side, names, stride, begin in LEGS:
        found.update(zip((f"{name}.{side}" for name in names), at(stride, phase - begin)))
        if names is FORE:
            found[f"scapula.{side}"] = 0.45 * found[f"arm.{side}"] + found["chest"]
    return found, np.interp(phase, [row[0] for row in GALLOP], [row[2] for row in GALLOP], period=1)


def add_gallop(ob):
    """An armature with automatic weights, keyed at the frames 1 to PHASES; frame 0 is the rest."""
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(rig)
    activate(rig)
    bpy.ops.object.mode_set(mode='EDIT')
    for name, (head, tail, parent) in BONES.items():
        for side, sign in (("L", 1), ("R", -1)) if head[1] else (("", 0),):
            bone = rig.data.edit_bones.new(f"{name}.{side}" if side else name)
            bone.head, bone.tail = (head[0], sign * head[1], head[2]), (tail[0], sign * tail[1], tail[2])
            bone.parent = rig.data.edit_bones.get(f"{parent}.{side}" if side else parent or "") or \
                rig.data.edit_bones.get(parent or "")
    bpy.ops.object.mode_set(mode='OBJECT')
    activate(ob)
    rig.select_set(True)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.parent_set(type='ARMATURE_AUTO')
    ob.modifiers[0].use_deform_preserve_volume = True
    soften = ob.modifiers.new("Corrective Smooth", 'CORRECTIVE_SMOOTH')
    soften.iterations, soften.smooth_type = 12, 'LENGTH_WEIGHTED'
    for bone in rig.pose.bones:
        bone.rotation_mode = 'QUATERNION'
    for frame in range(PHASES + 1):
        turned = swings((frame - 1) / PHASES)[0] if frame else {}
        for bone in rig.pose.bones:
            turn = turned.get(bone.name, 0) - (turned.get(bone.parent.name, 0) if bone.parent else 0)
            rest = bone.bone.matrix_local.to_3x3()
            about = Matrix.Rotation(-math.radians(turn), 3, 'Y')
            bone.rotation_quaternion = (rest.inverted() @ about @ rest).to_quaternion()
            bone.keyframe_insert('rotation_quaternion', frame=frame)
    rig.hide_render = True
    return rig
