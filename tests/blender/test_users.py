# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertex groups and empties that the add-on has made stay when handles are removed, if something of the user's uses
them."""

import bpy
import numpy as np
import pytest

from conftest import activate, make_strip, own, pull, update
from test_transfer import add_key

REMOVALS = {
    'one': lambda: bpy.ops.object.detail_deform_handle_remove(),
    'all': lambda: bpy.ops.object.detail_deform_remove(),
}


@pytest.fixture
def pulled():
    ob = make_strip()
    ob.detail_deform.handles.clear()
    ob.vertex_groups.clear()
    ob.detail_deform.region = ''
    pull(ob, own(ob)[:, 0] > 0.9, radius=0.3)
    return activate(ob)


def other_object(ob):
    other = bpy.data.objects.new("Other", None)
    ob.users_collection[0].objects.link(other)
    return other


def named_in_nodes(ob, name):
    tree = bpy.data.node_groups.new("Nodes", 'GeometryNodeTree')
    node = tree.nodes.new('GeometryNodeInputNamedAttribute')
    node.inputs['Name'].default_value = name
    ob.modifiers.new("Nodes", 'NODES').node_group = tree


def constrained(ob, name):
    constraint = other_object(ob).constraints.new('COPY_LOCATION')
    constraint.target, constraint.subtarget = ob, name


GROUP_USERS = {
    'Mask': lambda ob, name: setattr(ob.modifiers.new("Mask", 'MASK'), 'vertex_group', name),
    'second of two groups': lambda ob, name: setattr(
        ob.modifiers.new("Mix", 'VERTEX_WEIGHT_MIX'), 'vertex_group_b', name),
    'pinned cloth': lambda ob, name: setattr(ob.modifiers.new("Cloth", 'CLOTH').settings, 'vertex_group_mass', name),
    'particles': lambda ob, name: setattr(
        ob.modifiers.new("Hair", 'PARTICLE_SYSTEM').particle_system, 'vertex_group_density', name),
    'shape key': lambda ob, name: add_key(ob, "Key", own(ob), vertex_group=name),
    'nodes': named_in_nodes,
    'constraint': constrained,
}


@pytest.mark.parametrize('removal', REMOVALS)
@pytest.mark.parametrize('kind', GROUP_USERS)
def test_a_group_that_is_used_stays(pulled, kind, removal):
    name = pulled.detail_deform.handles[0].vertex_group
    GROUP_USERS[kind](pulled, name)
    activate(pulled)
    assert REMOVALS[removal]() == {'FINISHED'}
    assert name in pulled.vertex_groups


@pytest.mark.parametrize('removal', REMOVALS)
def test_a_group_that_nobody_uses_goes(pulled, removal):
    """A modifier whose own name is the group's doesn't use it, and a nodes modifier without nodes does no harm."""
    name = pulled.detail_deform.handles[0].vertex_group
    pulled.modifiers.new(name, 'MASK')
    pulled.modifiers.new("Nodes", 'NODES')
    assert REMOVALS[removal]() == {'FINISHED'}
    assert name not in pulled.vertex_groups


@pytest.mark.parametrize('which', ['region', 'reach'])
def test_a_region_or_reach_that_a_mask_uses_stays(pulled, which):
    name = pulled.detail_deform.own_region
    if which == 'reach':
        pull(pulled, own(pulled)[:, 0] < 0.1, radius=0.2)
        activate(pulled)
        name = pulled.detail_deform.handles[1].reach
    assert name in pulled.vertex_groups
    pulled.modifiers.new("Mask", 'MASK').vertex_group = name
    shown = len(pulled.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.vertices)
    assert bpy.ops.object.detail_deform_remove() == {'FINISHED'}
    update()
    assert name in pulled.vertex_groups
    assert len(pulled.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.vertices) == shown


def driven(ob, empty):
    variable = other_object(ob).driver_add('location', 0).driver.variables.new()
    variable.type = 'TRANSFORMS'
    variable.targets[0].id = empty


EMPTY_USERS = {
    'constraint of another object': lambda ob, empty: setattr(
        other_object(ob).constraints.new('COPY_LOCATION'), 'target', empty),
    'driver of another object': driven,
    'Hook of the mesh itself': lambda ob, empty: setattr(ob.modifiers.new("Hook", 'HOOK'), 'object', empty),
}


@pytest.mark.parametrize('removal', REMOVALS)
@pytest.mark.parametrize('kind', EMPTY_USERS)
def test_an_empty_that_is_used_stays(pulled, kind, removal):
    empty = pulled.detail_deform.handles[0].target
    EMPTY_USERS[kind](pulled, empty)
    activate(pulled)
    assert REMOVALS[removal]() == {'FINISHED'}
    assert empty.name in bpy.context.scene.objects


@pytest.mark.parametrize('removal', REMOVALS)
def test_an_empty_that_nobody_uses_goes_and_leaves_its_children_in_place(pulled, removal):
    empty = pulled.detail_deform.handles[0].target
    child = other_object(pulled)
    child.parent, child.location = empty, (1, 2, 3)
    update()
    name, place = empty.name, np.array(child.matrix_world)
    assert REMOVALS[removal]() == {'FINISHED'}
    update()
    assert name not in bpy.data.objects and np.abs(np.array(child.matrix_world) - place).max() < 1e-6
