# SPDX-License-Identifier: GPL-3.0-or-later
"""The user's own data has the name under which the add-on stores the offsets: it is reported, and never lost."""

import bpy
import numpy as np
import pytest

from conftest import activate, bind, evaluated, group, make_strip, own, refusal, update

NAME = 'detail_deform_offset'


def vertex_group(ob):
    group(ob, NAME, [0, 1])
    return "vertex group"


def uv_map(ob):
    ob.data.uv_layers.new(name=NAME)
    return "UV map"


def face_attribute(ob):
    ob.data.attributes.new(NAME, 'FLOAT', 'FACE').data[3].value = 7
    return "attribute"


def colours(ob):
    ob.data.color_attributes.new(NAME, 'FLOAT_COLOR', 'POINT')
    return "attribute"


def is_there(ob, take):
    mesh = ob.data
    return {vertex_group: lambda: NAME in ob.vertex_groups, uv_map: lambda: NAME in mesh.uv_layers,
            face_attribute: lambda: mesh.attributes[NAME].domain == 'FACE' and mesh.attributes[NAME].data[3].value == 7,
            colours: lambda: NAME in mesh.color_attributes}[take]()


def rename(ob, take):
    owner = {vertex_group: ob.vertex_groups, uv_map: ob.data.uv_layers}.get(take, ob.data.attributes)
    owner[NAME].name = "mine"


TAKES = pytest.mark.parametrize('take', [vertex_group, uv_map, face_attribute, colours])


@TAKES
def test_a_bind_is_refused_and_nothing_is_lost(take):
    ob = make_strip()
    what = take(ob)
    attributes = sorted(ob.data.attributes.keys())
    assert f"{what} '{NAME}'" in refusal(bpy.ops.object.detail_deform_bind, wait=True)
    assert sorted(ob.data.attributes.keys()) == attributes and is_there(ob, take)
    assert not ob.detail_deform.signature and not ob.modifiers
    rename(ob, take)
    bind(ob)
    assert is_named_mine(ob, take)


def is_named_mine(ob, take):
    return "mine" in {vertex_group: ob.vertex_groups, uv_map: ob.data.uv_layers}.get(take, ob.data.attributes)


@TAKES
def test_removing_and_unbinding_leave_the_users_data(take):
    ob = bind(make_strip())
    ob.data.attributes.remove(ob.data.attributes[NAME])
    take(ob)
    bpy.ops.object.detail_deform_unbind()
    assert is_there(ob, take)
    bpy.ops.object.detail_deform_remove()
    assert is_there(ob, take)


@TAKES
def test_a_name_taken_after_the_bind_is_reported_until_it_is_free(take):
    ob = bind(make_strip())
    if take in (face_attribute, colours):  # Blender makes the names of attributes unique
        ob.data.attributes.remove(ob.data.attributes[NAME])
    what = take(ob)
    if not is_there(ob, take):
        pytest.skip("this version gives another name")
    ob.detail_deform.handles[0].target.location.z += 0.4
    update()
    assert f"{what} '{NAME}'" in ob.detail_deform.status and is_there(ob, take)
    rename(ob, take)
    ob.detail_deform.handles[0].target.location.z += 0.1
    update()
    assert ob.detail_deform.status.startswith("Bound") and is_named_mine(ob, take)
    assert np.allclose((evaluated(ob) - own(ob))[-1], (0, 0, 0.5), atol=1e-5)


def test_following_a_source_is_refused_too():
    make_strip(name="Source")
    target = make_strip(name="Target")
    target.detail_deform.handles.clear()
    vertex_group(activate(target))
    assert "vertex group" in refusal(bpy.ops.object.detail_deform_transfer_live, source="Source")
    assert not target.detail_deform.transfer.live and not target.modifiers
