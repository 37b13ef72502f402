# SPDX-License-Identifier: GPL-3.0-or-later
"""A modifier before Detail Deform that discards the mesh leaves nothing to deform: the status names it."""

import bpy
import numpy as np
import pytest

from conftest import activate, bind, evaluated, has_voxels, make_strip, own, update


def node_group(kind):
    """A node group that passes the mesh on ('pass'), or replaces it by a cube ('cube') or by nothing ('empty')."""
    made = bpy.data.node_groups.new(kind, 'GeometryNodeTree')
    if hasattr(made, 'interface'):
        for way in ('INPUT', 'OUTPUT'):
            made.interface.new_socket('Geometry', in_out=way, socket_type='NodeSocketGeometry')
    else:
        made.inputs.new('NodeSocketGeometry', 'Geometry')
        made.outputs.new('NodeSocketGeometry', 'Geometry')
    source, target = made.nodes.new('NodeGroupInput'), made.nodes.new('NodeGroupOutput')
    if kind == 'pass':
        made.links.new(source.outputs[0], target.inputs[0])
    elif kind == 'cube':
        made.links.new(made.nodes.new('GeometryNodeMeshCube').outputs['Mesh'], target.inputs[0])
    return made


def add_nodes(ob, kind, index):
    modifier = ob.modifiers.new(kind.title(), 'NODES')
    modifier.node_group = node_group(kind)
    activate(ob)
    bpy.ops.object.modifier_move_to_index(modifier=modifier.name, index=index)
    return modifier


def lift(ob, height=0.1):
    ob.detail_deform.handles[0].target.location.z += height
    update()


@pytest.mark.parametrize('kind', ['cube', 'empty'])
@pytest.mark.parametrize('early', [False, True])
def test_a_mesh_that_is_discarded_is_noticed(kind, early):
    ob = make_strip()
    if early:  # the modifier is there before Bind, and is moved before Detail Deform afterwards
        add_nodes(ob, kind, 0)
        bind(ob)
        bpy.ops.object.modifier_move_to_index(modifier=kind.title(), index=0)
    else:
        bind(ob)
        add_nodes(ob, kind, 0)
    update()
    lift(ob)
    assert f"'{kind.title()}' before Detail Deform" in ob.detail_deform.status
    ob.modifiers[kind.title()].show_viewport = False
    update()
    lift(ob)
    assert ob.detail_deform.status.startswith("Bound")
    assert np.allclose((evaluated(ob) - own(ob))[-1], (0, 0, 0.2), atol=1e-5)


def test_a_discarded_mesh_is_noticed_in_a_frame_in_which_no_handle_moves():
    ob = bind(make_strip())
    lift(ob)
    add_nodes(ob, 'cube', 0)
    update()
    bpy.context.scene.frame_set(2)
    assert "'Cube' before Detail Deform" in ob.detail_deform.status
    ob.modifiers.remove(ob.modifiers["Cube"])
    update()
    bpy.context.scene.frame_set(3)
    assert ob.detail_deform.status.startswith("Bound")


@pytest.mark.parametrize('kind, index', [('pass', 0), ('pass', 1), ('cube', 1)])
def test_modifiers_that_pass_the_mesh_on_or_come_later_are_not_reported(kind, index):
    ob = bind(make_strip())
    add_nodes(ob, kind, index)
    update()
    lift(ob)
    bpy.context.scene.frame_set(2)
    assert ob.detail_deform.status.startswith("Bound")


@has_voxels
def test_a_voxel_remesh_before_detail_deform_is_named():
    ob = bind(make_strip())
    ob.modifiers.new("Remesh", 'REMESH').voxel_size = 0.2
    bpy.ops.object.modifier_move_to_index(modifier="Remesh", index=0)
    update()
    lift(ob)
    assert "'Remesh' before Detail Deform" in ob.detail_deform.status


def test_a_modifier_that_discards_a_followers_mesh_is_named():
    source = make_strip(name="Source")
    target = make_strip(name="Target")
    target.detail_deform.handles.clear()
    bpy.ops.object.detail_deform_transfer_live(source="Source")
    add_nodes(target, 'cube', 0)
    update()
    source.data.vertices[0].co.z += 0
    bpy.context.scene.frame_set(2)
    assert "'Cube' before Detail Deform" in target.detail_deform.status


def test_a_bake_of_nothing_is_refused(tmp_path):
    ob = bind(make_strip())
    add_nodes(ob, 'cube', 0)
    update()
    lift(ob)
    with pytest.raises(RuntimeError, match="'Cube' before Detail Deform"):
        bpy.ops.object.detail_deform_bake(filepath=str(tmp_path / "x.pc2"), frame_start=1, frame_end=2)
