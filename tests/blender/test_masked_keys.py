# SPDX-License-Identifier: GPL-3.0-or-later
"""Shape keys masked by vertex groups, such as the left and right halves of one expression: transfer, examples and Bind
use the shape that Blender displays, also with weights between 0 and 1."""

import bpy
import numpy as np
import pytest

from conftest import activate, add_empty, add_handle, bind, evaluated, own, update
from test_transfer import add_key, copy_of_rest, coordinates, raw_strip, transfer


def shown_alone(ob, name):
    """(n, 3): positions displayed by Blender with the key at 1 and all others at 0."""
    for key in ob.data.shape_keys.key_blocks:
        key.value = float(key.name == name)
    update()
    result = evaluated(ob)
    ob.data.shape_keys.key_blocks[name].value = 0
    update()
    return result


@pytest.fixture
def halves():
    """A strip with a lift in two halves, which fade into one another, and a third key relative to the first."""
    ob = raw_strip("Source")
    lifted = own(ob) + np.outer(own(ob)[:, 0] ** 2, (0, 0, 0.5))
    share = np.clip(2 * own(ob)[:, 1] - 0.5, 0, 1)
    for side, weights in (('L', share), ('R', 1 - share)):
        made = ob.vertex_groups.new(name=side)
        for vertex, weight in enumerate(weights):
            if weight:
                made.add([vertex], float(weight), 'REPLACE')
        add_key(ob, f"lift {side}", lifted, vertex_group=side)
    further = lifted + np.outer(own(ob)[:, 0] ** 2, (0, 0.2, 0))
    key = add_key(ob, "more", further, vertex_group='L')
    key.relative_key = ob.data.shape_keys.key_blocks["lift L"]
    update()
    return activate(ob)


NAMES = ["lift L", "lift R", "more"]


def test_transferred_to_a_mesh_without_the_groups(halves):
    target = copy_of_rest(halves)
    assert transfer(source="Source", what='ALL_KEYS', correspondence='TOPOLOGY') == {'FINISHED'}
    for name in NAMES:
        shape = shown_alone(halves, name)
        assert np.abs(shape - own(halves)).max() > 0.05
        assert np.abs(shown_alone(target, name) - shape).max() < 1e-5, name
        assert np.abs(coordinates(target.data.shape_keys.key_blocks[name]) - shape).max() < 1e-5, name


def test_transferred_to_a_mesh_with_the_groups(halves):
    """There the key is masked by the group like the source's, and its shape is not masked once more."""
    target = copy_of_rest(halves)
    for side in 'LR':
        made = target.vertex_groups.new(name=side)
        for vertex in halves.data.vertices:
            for element in vertex.groups:
                if element.group == halves.vertex_groups[side].index:
                    made.add([vertex.index], element.weight, 'REPLACE')
    assert transfer(source="Source", what='ALL_KEYS', correspondence='TOPOLOGY') == {'FINISHED'}
    for name in NAMES:
        assert target.data.shape_keys.key_blocks[name].vertex_group == ('R' if name == "lift R" else 'L')
        assert np.abs(shown_alone(target, name) - shown_alone(halves, name)).max() < 1e-5, name


def test_masked_keys_as_examples(halves):
    vertices = np.flatnonzero((own(halves)[:, 0] > 0.95) & (own(halves)[:, 1] > 0.8))
    halves.vertex_groups.new(name='corner').add(vertices.tolist(), 1, 'REPLACE')
    halves.vertex_groups.new(name='region').add(np.flatnonzero(own(halves)[:, 0] > 0.08).tolist(), 1, 'REPLACE')
    settings = halves.detail_deform
    settings.region, settings.method = 'region', 'EXAMPLES'
    empty = add_empty("Corner", own(halves)[vertices].mean(0))
    add_handle(halves, 'corner', empty)
    update()
    shapes = {name: shown_alone(halves, name) for name in NAMES}
    assert bpy.ops.object.detail_deform_examples_from_keys() == {'FINISHED'}
    bind(halves)
    settings.weights_by = 'SLIDERS'
    moving = own(halves)[:, 0] > 0.12
    for number, name in enumerate(NAMES):
        for example in settings.examples:
            example.weight = 0
        settings.examples[number].weight = 1
        update()
        assert np.abs(evaluated(halves) - shapes[name])[moving].max() < 2e-3, name


def test_a_pinned_key_is_where_a_bind_starts(halves):
    """With Show Only the active key, its mask counts as well."""
    halves.active_shape_key_index = 1
    halves.show_only_shape_key = True
    update()
    seen = evaluated(halves)
    vertices = np.flatnonzero(own(halves)[:, 0] > 0.95)
    halves.vertex_groups.new(name='right').add(vertices.tolist(), 1, 'REPLACE')
    halves.vertex_groups.new(name='region').add(np.flatnonzero(own(halves)[:, 0] > 0.08).tolist(), 1, 'REPLACE')
    halves.detail_deform.region = 'region'
    empty = add_empty("Right", seen[vertices].mean(0))
    add_handle(halves, 'right', empty)
    update()
    bind(halves)
    assert np.abs(evaluated(halves) - seen).max() < 1e-6
    # The handle turns the displayed shape.
    empty.rotation_euler.y = -0.5
    update()
    turned = evaluated(halves)[vertices] - empty.location
    before = seen[vertices] - empty.location
    assert np.abs(np.linalg.norm(turned, axis=1) - np.linalg.norm(before, axis=1)).max() < 1e-4
