# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of extreme settings, base objects and examples."""

import bpy
import numpy as np

from .checks import own
from .kind import Kinds
from .specimen import DoesNotCombine

KINDS = kind = Kinds('object')


def _setting(name, value):
    def make(of):
        setattr(of.ob.detail_deform, name, value)
    return make


KINDS.each('settings', {f"{name} {value}": _setting(name, value) for name, value in (
    ('smoothness', 1), ('smoothness', 3), ('base_metric', 'BASE'), ('metric_smoothing', 6), ('refine', 0),
    ('refine', 40), ('rotation_only', False), ('rotation_smoothing', 1), ('rim_smoothing', 0), ('rim_smoothing', 1),
    ('levels', 5), ('solidity', 0), ('soft_border', 1), ('formulation', 'FOURTH_POINTS'),
    ('formulation', 'FOURTH_POINTS_UNWEIGHTED'), ('base_deformer', 'MOTIONS'), ('base_deformer', 'LINEAR'),
    ('steps', 3), ('live', False), ('preview', True))})


@kind("output BASE", about='output')
def _output(of):
    of.ob.detail_deform.output = 'BASE'
    of.shows_base = True


@kind("influence right", about='influence')
def _influence(of):
    of.ob.detail_deform.influence = 'right'
    of.shows_a_share = True


@kind("a handle that turns freely", about='turns')
def _free(of):
    of.handle.turns = 'FREE'
    of.is_free_to_turn = True


@kind("a handle that mirrors the other", about='handles')
def _mirrors(of):
    ob = of.ob
    if not len(ob.data.vertices) or ob.mode == 'EDIT':  # vertex groups can't be written in Edit Mode
        raise DoesNotCombine
    of.add_handle("Mirrored", [0])
    ob.detail_deform.handles[-1].mirrors = of.handle.name


@kind("a handle that mirrors itself", about='handles')
def _mirrors_itself(of):
    of.handle.mirrors = of.handle.name


# ---- base objects

def _based(of, base):
    of.ob.detail_deform.base = 'OBJECT'
    of.ob.detail_deform.base_object = base


@kind("a base object that is not chosen", about='base')
def _no_base(of):
    _based(of, None)


@kind("a base object without vertices", about='base')
def _empty_base(of):
    _based(of, of.other("Base", [], []))


@kind("a base object of one triangle", about='base')
def _triangle(of):
    _based(of, of.other("Base", of.size * np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)]), [(0, 1, 2)]))


@kind("a base object of zero area", about='base')
def _flat(of):
    _based(of, of.other("Base", of.size * np.array([(0, 0, 0), (1, 0, 0), (0.5, 0, 0)]), [(0, 1, 2)]))


@kind("a base object of NaN", about='base')
def _nan(of):
    _based(of, of.other("Base", np.array([(0, 0, 0), (1, 0, 0), (np.nan, 1, 0)]), [(0, 1, 2)]))


@kind("a base object far away", about='base')
def _far(of):
    _based(of, of.other("Base", of.size * np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)]) + [1e6, 0, 0], [(0, 1, 2)]))


@kind("a base object that is a copy", about='base')
def _copy(of):
    base = bpy.data.objects.new("Base", of.ob.data.copy())
    bpy.context.scene.collection.objects.link(base)
    _based(of, base)


@kind("a base object that follows the mesh", about='base')
def _cyclic(of):
    base = of.other("Base", of.size * np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)]), [(0, 1, 2)])
    base.modifiers.new("Shrinkwrap", 'SHRINKWRAP').target = of.ob
    _based(of, base)


@kind("the mesh as its own base object", about='base')
def _own(of):
    _based(of, of.ob)


@kind("a base object of scale 0", about='base')
def _no_scale(of):
    _copy(of)
    of.ob.detail_deform.base_object.scale = (0, 0, 0)


@kind("a base object whose modifier leaves nothing", about='base')
def _masked(of):
    _copy(of)
    of.ob.detail_deform.base_object.modifiers.new("Mask", 'MASK').vertex_group = "none such"
    of.ob.detail_deform.base_object.modifiers.new("Build", 'BUILD').frame_start = 1000


# ---- examples

@kind("an example of the mesh at rest", about='examples')
def _example(of):
    _add_example(of, lambda values: values)


@kind("an example of NaN", about='examples')
def _example_nan(of):
    _add_example(of, lambda values: values * np.nan)


@kind("an example without size", about='examples')
def _example_point(of):
    _add_example(of, lambda values: values * 0)


@kind("an example turned inside out", about='examples')
def _example_mirrored(of):
    _add_example(of, lambda values: values * [1, 1, -1])


def _add_example(of, change):
    if not len(of.ob.data.vertices):
        raise DoesNotCombine
    posed = bpy.data.objects.new("Posed", of.ob.data.copy())
    bpy.context.scene.collection.objects.link(posed)
    with np.errstate(all='ignore'):
        posed.data.vertices.foreach_set('co', change(own(of.ob)).astype(np.float32).ravel())
    example = of.ob.detail_deform.examples.add()
    example.name, example.object = "Posed", posed
    example.is_object = True


@kind("an example of another mesh", about='examples')
def _example_other(of):
    example = of.ob.detail_deform.examples.add()
    example.name, example.object = "Other", of.other("Other", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    example.is_object = True
