# SPDX-License-Identifier: GPL-3.0-or-later
"""Live transfer: the correspondence that it uses, and its preparation in the background."""

import re

import bpy
import numpy as np
import pytest

from conftest import activate, bind, evaluated, group, make_strip, own, refusal, update
from test_transfer import add_key, bent, raw_strip

live = bpy.ops.object.detail_deform_transfer_live


def marked(ob, n):
    """Adds markers at the corners and in the middle."""
    for number, vertex in enumerate((0, n - 1, n * n - n, n * n - 1, n * (n // 2) + n // 2), 1):
        group(ob, f"Marker {number}", [vertex])


@pytest.fixture
def pair():
    """A source with a key that bends it, and a target of other topology, active; both with markers."""
    source, target = raw_strip("Source", 21), raw_strip("Target", 31)
    add_key(source, "Bend", bent(own(source)))
    marked(source, 21)
    marked(target, 31)
    target.detail_deform.transfer.source = source
    activate(target)
    return source, target


@pytest.fixture
def alike():
    source, target = raw_strip("Source"), raw_strip("Target")
    add_key(source, "Bend", bent(own(source)))
    activate(target)
    return source, target


def bend(source, value=1.0):
    source.data.shape_keys.key_blocks["Bend"].value = value
    update()


def assert_bent(target, within):
    # Up to a translation, which the gradients leave open.
    difference = evaluated(target) - bent(own(target))
    assert np.abs(difference - difference.mean(0)).max() < within


def kept_pairs(target):
    return np.array(target.data['detail_deform_match']['arrays']['pairs']).reshape(-1, 2)


def test_markers_are_searched_when_following_starts(pair):
    """An earlier match that is stored isn't used in their place."""
    source, target = pair
    settings = target.detail_deform.transfer
    settings.correspondence = 'MARKERS'
    assert live() == {'FINISHED'}
    assert settings.correspondence == 'STORED' and len(kept_pairs(target)) > 500
    bend(source)
    assert_bent(target, 0.1)
    # With other markers a new start finds other pairs, although a match is stored.
    before = kept_pairs(target)
    live(on=False)
    for ob in (source, target):
        ob.vertex_groups.remove(ob.vertex_groups["Marker 5"])
    settings.correspondence = 'MARKERS'
    live()
    after = kept_pairs(target)
    assert before.shape != after.shape or (before != after).any()


def test_a_list_is_read_when_following_starts(alike, tmp_path):
    source, target = alike
    settings, path = target.detail_deform.transfer, tmp_path / "pairs.txt"
    settings.source = source
    settings.correspondence, settings.filepath = 'LIST', str(tmp_path / "none.txt")
    assert "can't be read" in refusal(live)
    assert not settings.live and settings.correspondence == 'LIST' and not target.modifiers
    path.write_text("0 0\n5 5\n")
    settings.filepath = str(path)
    assert live() == {'FINISHED'}
    assert kept_pairs(target).tolist() == [[0, 0], [5, 5]] and settings.correspondence == 'STORED'
    live(on=False)
    path.write_text(''.join(f"{k} {k}\n" for k in range(2 * 24 * 24)))
    settings.correspondence = 'LIST'
    live()
    assert len(kept_pairs(target)) == 2 * 24 * 24
    bend(source)
    assert_bent(target, 1e-3)


def test_pairs_of_triangles_and_of_vertices_are_told_apart(alike, tmp_path, factored):
    """Also where the numbers in both lists are the same."""
    _, target = alike
    path = tmp_path / "pairs.txt"
    path.write_text(''.join(f"{k} {k}\n" for k in range(600)))
    settings = target.detail_deform.transfer
    settings.filepath = str(path)
    for count, pairs_of in enumerate(('TRIANGLES', 'VERTICES'), 1):
        settings.correspondence, settings.pairs_of = 'LIST', pairs_of
        live(source="Source")
        live(on=False)
        assert factored.count == count


def test_a_choice_that_can_t_be_meant_while_following_is_said(alike):
    source, target = alike
    settings = target.detail_deform.transfer
    live(source="Source")
    bend(source, 0.5)
    before = evaluated(target)
    for how in ('MARKERS', 'LIST'):
        settings.correspondence = how
        bend(source, 1.0)
        assert "only when following starts" in settings.state
        assert np.abs(evaluated(target) - before).max() < 1e-6
    settings.correspondence = 'TOPOLOGY'
    bend(source, 0.9)
    assert "Follows 'Source'" in settings.state
    assert np.abs(evaluated(target) - evaluated(source)).max() < 1e-4


class Counted:
    """Job: a native.TransferJob whose finish() is counted, and raises `failure` if there is one."""

    def __init__(self, native, failure=None):
        counted = self
        self.count = 0

        class Job(native.TransferJob):
            def finish(self):
                counted.count += 1
                if failure:
                    raise failure
                return super().finish()

        self.Job = Job


def poll_until_ready(life):
    """Does the timer's work until it has none left."""
    while life._poll() is not None:
        pass


@pytest.fixture(autouse=True)
def nothing_prepared_yet(part):
    part('follow.source_follower').cache.clear()


@pytest.fixture
def factored(part, monkeypatch):
    native = part('library.native')
    counted = Counted(native)
    monkeypatch.setattr(native, 'TransferJob', counted.Job)
    return counted


def test_nothing_is_factored_within_an_update(alike, part, as_in_a_window, factored):
    """In the window a job prepares the transfer in the background and reports its progress; the target follows when it
    has ended."""
    source, target = alike
    life = part('follow.lifecycle')
    as_in_a_window('follow.lifecycle')
    assert live(source="Source") == {'FINISHED'}
    bend(source)
    assert factored.count == 0
    assert re.fullmatch(r"Preparing to follow 'Source', \d+%\.", target.detail_deform.transfer.state)
    assert np.abs(evaluated(target) - own(target)).max() == 0
    poll_until_ready(life)
    update()
    assert factored.count == 1 and target.detail_deform.transfer.state == "Follows 'Source'."
    assert np.abs(evaluated(target) - evaluated(source)).max() < 1e-4
    # So does an edit of the source; meanwhile the last result is shown.
    shown = evaluated(target)
    basis = source.data.shape_keys.key_blocks[0]
    basis.data[300].co.z += 0.01
    source.data.update_tag()
    update()
    assert factored.count == 1 and "Preparing" in target.detail_deform.transfer.state
    assert np.array_equal(evaluated(target), shown)
    poll_until_ready(life)
    assert factored.count == 2 and "Follows" in target.detail_deform.transfer.state


@pytest.fixture
def growing(part, monkeypatch):
    """growing(name): progress() of jobs of this class of the library returns more digits at each call."""
    def grow(name):
        fractions = iter([0.01, 0.1, 1.0, 10.0, 100.0, 1e3, 1e4])
        monkeypatch.setattr(getattr(part('library.native'), name), 'progress',
                            lambda job: (True, next(fractions), 'ENERGY'))
    return grow


def test_a_text_is_the_same_for_both_calls_of_its_getter(alike, part, as_in_a_window, growing):
    """Blender asks for the length first and writes past the end if the text has grown in the meantime."""
    target = alike[1]
    life = part('follow.lifecycle')
    as_in_a_window('follow.lifecycle')
    growing('TransferJob')
    assert live(source="Source") == {'FINISHED'}
    life._poll()
    assert target.detail_deform.transfer.state == "Preparing to follow 'Source', 10%."
    assert target.detail_deform.transfer.state == "Preparing to follow 'Source', 10%."
    life._poll()
    assert target.detail_deform.transfer.state == "Preparing to follow 'Source', 100%."


def test_preparing_can_be_cancelled(alike, part, as_in_a_window, factored):
    source, target = alike
    life = part('follow.lifecycle')
    as_in_a_window('follow.lifecycle')
    live(source="Source")
    assert part('follow.live_transfer').is_preparing(target)
    live(on=False)
    assert life._poll() is None and factored.count == 0
    assert not target.detail_deform.transfer.live and not target.modifiers
    bend(source)
    assert np.abs(evaluated(target) - own(target)).max() == 0


def test_a_failed_preparation_is_reported_and_not_tried_at_every_update(alike, part, as_in_a_window, monkeypatch):
    source, target = alike
    native = part('library.native')
    life = part('follow.lifecycle')
    as_in_a_window('follow.lifecycle')
    failing = Counted(native, native.NativeError("There is no memory left."))
    monkeypatch.setattr(native, 'TransferJob', failing.Job)
    live(source="Source")
    poll_until_ready(life)
    for value in (0.1, 0.2, 0.3):
        bend(source, value)
        poll_until_ready(life)
        assert target.detail_deform.transfer.state == "There is no memory left."
    assert failing.count == 1
    # Starting to follow tries again.
    monkeypatch.undo()
    live(on=False)
    assert live(source="Source") == {'FINISHED'}
    bend(source)
    assert np.abs(evaluated(target) - evaluated(source)).max() < 1e-4


def test_followers_of_equal_content_share_what_is_prepared(alike, factored):
    source, target = alike
    live(source="Source")
    copy = target.copy()
    copy.data = target.data.copy()
    bpy.context.scene.collection.objects.link(copy)
    bend(source)
    assert factored.count == 1
    for ob in (target, copy):
        assert np.abs(evaluated(ob) - evaluated(source)).max() < 1e-4


def test_undo_needs_no_new_preparation(alike, factored):
    live(source="Source")
    bpy.ops.ed.undo_push(message="following")
    bend(bpy.data.objects["Source"])
    bpy.ops.ed.undo_push(message="bent")
    bpy.ops.ed.undo()
    source, target = (bpy.data.objects[name] for name in ("Source", "Target"))
    update()
    assert np.abs(evaluated(target) - own(target)).max() < 1e-5
    bend(source, 0.7)
    assert np.abs(evaluated(target) - evaluated(source)).max() < 1e-4
    assert factored.count == 1


def without_attribute(ob):
    ob.data.attributes.remove(ob.data.attributes['detail_deform_offset'])
    ob.update_tag()


def with_another_mesh_of_equal_content(ob):
    mesh = ob.data.copy()
    mesh.attributes.remove(mesh.attributes['detail_deform_offset'])
    ob.data = mesh


@pytest.mark.parametrize('emptied', [without_attribute, with_another_mesh_of_equal_content])
def test_a_mesh_without_offsets_gets_them_again(alike, emptied):
    source, target = alike
    live(source="Source")
    bend(source)
    emptied(target)
    update()
    update()
    assert np.abs(evaluated(target) - evaluated(source)).max() < 1e-4


def test_a_bound_object_is_refused_before_anything_is_searched(pair, part, monkeypatch):
    _source, _ = pair
    strip = bind(make_strip(name="Strip"))
    strip.detail_deform.transfer.correspondence = 'MARKERS'

    def search(*_):
        raise AssertionError("searched")

    monkeypatch.setattr(part('setup.matching'), 'search', search)
    assert "bound to handles" in refusal(live, source="Source")
