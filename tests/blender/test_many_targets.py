# SPDX-License-Identifier: GPL-3.0-or-later
"""Transfer from one source to many targets: a failure leaves its target as it was, and a second run replaces the shape
keys of the first."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from conftest import activate, curves, evaluated, group, own, refusal, update
from test_transfer import add_key, bent, coordinates, mark, raw_strip

many = bpy.ops.object.detail_deform_transfer_many


def shaped(ob, positions):
    ob.data.vertices.foreach_set('co', np.asarray(positions, np.float32).ravel())
    return ob


def choose(source, *targets):
    activate(source)
    for target in targets:
        target.select_set(True)


def keys_of(ob):
    return ob.data.shape_keys.key_blocks if ob.data.shape_keys else {}


def table():
    return bpy.data.texts["Detail Deform Transfer"].as_string()


def row(name):
    return next(line for line in table().split('\n') if line.startswith(name + " "))


def failures(source):
    return {entry.name: entry.reason for entry in source.detail_deform.transfer.failed}


def make_source():
    ob = raw_strip("Source")
    add_key(ob, "Bend", bent(own(ob)), slider_min=-1.0, slider_max=2.0, value=0.25)
    add_key(ob, "Lift", own(ob) + own(ob)[:, :1] ** 2 * (0, 0, 0.3))
    return ob


def make_targets():
    return [raw_strip(name) for name in ("Ann", "Bob", "Cid")]


@pytest.fixture
def source():
    return make_source()


@pytest.fixture
def targets(source):
    return make_targets()


def test_all_selected_meshes_get_the_keys(source, targets):
    moved = own(source) + (3, 0, 0)
    shaped(targets[1], moved)
    choose(source, *targets, bpy.data.objects["Right"])  # the last is an empty, which is no target
    assert many(what='ALL_KEYS') == {'FINISHED'}
    for target, shift in zip(targets, (0, 3, 0)):
        assert [key.name for key in keys_of(target)] == ["Basis", "Bend", "Lift"]
        for name in ("Bend", "Lift"):
            expected = coordinates(keys_of(source)[name]) + (shift, 0, 0)
            assert np.abs(coordinates(keys_of(target)[name]) - expected).max() < 1e-4
        bend = keys_of(target)["Bend"]
        assert (bend.slider_min, bend.slider_max, bend.value) == (-1, 2, 0.25)
        assert "Same Topology" in row(target.name) and "2 keys" in row(target.name)
    assert "3 of 3 targets done." in table() and not failures(source)
    assert bpy.context.active_object == source


def test_failed_targets_are_untouched_and_named_and_the_others_are_done(source, targets):
    ann, bob, cid = targets
    shared, absolute, other, following = (raw_strip(name) for name in ("Dan", "Eve", "Fay", "Gil"))
    twin = bpy.data.objects.new("Twin", shared.data)
    bpy.context.scene.collection.objects.link(twin)
    add_key(absolute, "Mine", own(absolute))
    absolute.data.shape_keys.use_relative = False
    shaped_mesh = raw_strip("Other Mesh", 20)
    other.data = shaped_mesh.data
    bpy.data.objects.remove(shaped_mesh)
    following.detail_deform.transfer.source = source
    activate(following)
    bpy.ops.object.detail_deform_transfer_live(source="Source")
    bob.detail_deform.transfer.anchor, bob.detail_deform.transfer.anchor_group = 'PINNED', "feet"
    names = [*(ob.name for ob in (*targets, shared, absolute, other, following)), "Nobody", "Right"]
    activate(source)
    many(what='ALL_KEYS', targets=[{'name': name} for name in names])
    failed = failures(source)
    for name, sentence in (("Bob", "no vertex group 'feet'"), ("Dan", "is used by 2 objects"),
                           ("Eve", "has absolute shape keys"), ("Fay", "has other vertices or faces than 'Source'"),
                           ("Gil", "follows 'Source' already"), ("Nobody", "no mesh object 'Nobody'"),
                           ("Right", "no mesh object 'Right'")):
        assert sentence in failed.pop(name)
        assert sentence in row(name)
    assert not failed and "2 of 9 targets done, 7 failed" in table()
    for ob in (ann, cid):
        assert len(keys_of(ob)) == 3
    for ob in (bob, shared, other, following):
        assert not keys_of(ob)
    assert len(keys_of(absolute)) == 2
    # A target that succeeds later, by either of the two operators, is taken off the list; the others stay on it.
    bob.detail_deform.transfer.anchor = 'SOURCE'
    choose(source, bob)
    many(what='ALL_KEYS')
    assert "Bob" not in failures(source) and len(failures(source)) == 6
    bpy.data.objects.remove(twin)
    activate(shared)
    bpy.ops.object.detail_deform_transfer(source="Source", what='ALL_KEYS')
    assert "Dan" not in failures(source)
    activate(source)
    assert bpy.ops.object.detail_deform_target_activate(target="Fay") == {'FINISHED'}
    assert bpy.context.active_object == other
    activate(source)
    bpy.ops.object.detail_deform_transfer_dismiss()
    assert not failures(source)


def test_a_target_in_edit_mode_or_linked_is_left(source, targets, tmp_path):
    ann, bob, cid = targets
    path = str(tmp_path / "library.blend")
    bpy.data.libraries.write(path, {cid})
    cid.name = "Local"
    with bpy.data.libraries.load(path, link=True) as (_, into):
        into.objects = ["Cid"]
    linked = into.objects[0]
    bpy.context.scene.collection.objects.link(linked)
    activate(bob)
    bpy.ops.object.mode_set(mode='EDIT')
    bpy.context.view_layer.objects.active = source
    linked.select_set(True)
    ann.select_set(True)
    many(what='ALL_KEYS')
    assert "is in Edit Mode" in failures(source)["Bob"] and "is linked from another file" in failures(source)["Cid"]
    assert len(keys_of(ann)) == 3 and not keys_of(linked)


def test_wrong_arguments_are_refused_once_and_not_for_each_target(source, targets, tmp_path):
    activate(source)
    assert "No other mesh is selected" in refusal(many, what='ALL_KEYS')
    choose(source, *targets)
    assert "whose name fits 'x*'" in refusal(many, what='ALL_KEYS', pattern="x*")
    assert "is before the first" in refusal(many, what='ANIMATION', frame_start=5, frame_end=1)
    assert "can't be read" in refusal(many, what='ALL_KEYS', names_file=str(tmp_path / "none.txt"))
    assert "never saved" in refusal(many, what='ANIMATION')
    assert not bpy.data.texts and not failures(source)
    for target in targets:
        target.detail_deform.transfer.anchor = 'PINNED'
    assert "0 of 3 targets done, 3 failed" in refusal(many, what='ALL_KEYS')
    bpy.ops.object.mode_set(mode='EDIT')
    assert "is in Edit Mode" in refusal(many, what='ALL_KEYS')


def test_each_target_has_its_own_settings(source, targets):
    _, bob, cid = targets
    for ob in (bob, cid):
        group(ob, 'left', range(25))
    bob.detail_deform.transfer.anchor, bob.detail_deform.transfer.anchor_group = 'PINNED', 'left'
    source_key = add_key(source, "Twice", 2 * own(source))
    cid.detail_deform.transfer.rotation_only = True
    choose(source, *targets)
    many(what='ALL_KEYS')
    twice = [coordinates(keys_of(ob)["Twice"]) for ob in targets]
    assert np.abs(twice[0] - coordinates(source_key)).max() < 1e-4
    assert np.abs(twice[1][:25] - own(bob)[:25]).max() < 1e-6
    assert np.abs(np.ptp(twice[2], axis=0) - np.ptp(own(cid), axis=0)).max() < 1e-4


def test_each_target_is_matched_by_its_own_topology_markers_match_or_list(source, targets, tmp_path):
    by_markers, matched, listed, other = (raw_strip(name, 33) for name in ("Marked", "Matched", "Li/sted", "Foreign"))
    mark(source, 25, False)
    for ob in (by_markers, matched, other):
        mark(ob, 33, False)
    foreign = raw_strip("Foreign Source", 21)
    mark(foreign, 21, False)
    for ob, of in ((matched, source), (other, foreign)):
        activate(ob)
        ob.detail_deform.transfer.source = of
        assert bpy.ops.object.detail_deform_transfer_match() == {'FINISHED'}
    other.vertex_groups.clear()
    activate(matched)
    bpy.ops.object.detail_deform_transfer_save(filepath=str(tmp_path / "Li_sted.txt"))
    matched.vertex_groups.clear()
    obs = (targets[0], by_markers, matched, listed, other)
    choose(source, *obs)
    many(what='ALL_KEYS', lists=str(tmp_path))
    for ob, by in zip(obs, ("Same Topology", "Shape and Markers", "Saved Match", "List")):
        assert f"  {by}  " in row(ob.name), row(ob.name)
    assert "a Saved Match for 'Foreign Source'" in failures(source)["Foreign"]
    for ob in obs[1:4]:
        found = coordinates(keys_of(ob)["Bend"])
        assert np.abs(found - bent(own(ob))).max() < 0.05
    # The match that was found is stored, and the second run uses it.
    choose(source, by_markers)
    many(what='ALL_KEYS')
    assert "Saved Match" in row("Marked") and len(keys_of(by_markers)) == 3
    many(what='ALL_KEYS', correspondence='MARKERS')
    assert "Markers" in row("Marked")


def test_the_current_pose_and_an_animation(source, targets, tmp_path):
    key = keys_of(source)["Bend"]
    choose(source, *targets)
    key.value = 0.5
    update()
    assert many() == {'FINISHED'}
    for target in targets:
        assert np.abs(evaluated(target) - evaluated(source)).max() < 1e-4
        target.data.shape_keys.key_blocks["Source Pose"].value = 0
    for frame, value in ((1, 0.0), (3, 1.0)):
        key.value = value
        key.keyframe_insert('value', frame=frame)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    many(what='ANIMATION', frame_start=1, frame_end=3)
    assert len({ob.modifiers[0].filepath for ob in targets}) == 3 and "3 frames" in row("Bob")
    for frame in (3, 2):
        bpy.context.scene.frame_set(frame)
        for target in targets:
            assert np.abs(evaluated(target) - evaluated(source)).max() < 1e-4


# ---- a second run

def test_a_second_run_updates_in_place_and_loses_nothing(source, targets):
    ann, bob, _ = targets
    mine = own(ann) + (0, 0, 1)
    add_key(ann, "Lift", mine)
    driver = keys_of(source)["Lift"].driver_add('value').driver
    driver.expression = "0.5"
    choose(source, *targets)
    many(what='ALL_KEYS', drivers=True)
    assert [key.name for key in keys_of(ann)] == ["Basis", "Lift", "Bend", "Lift.001"]
    assert "'Lift.001' beside 'Lift'" in row("Ann")
    # The user works on with the transferred keys.
    bend = keys_of(bob)["Bend"]
    bend.slider_max, bend.value = 1.5, 0.75
    bend.keyframe_insert('value', frame=1)
    bob.data.shape_keys.animation_data.drivers[0].driver.expression = "0.125"
    group(bob, 'left', range(25))
    keys_of(bob)["Lift"].vertex_group = 'left'
    group(source, 'left', range(25))
    before = {ob.name: [key.name for key in keys_of(ob)] for ob in targets}
    # The source's keys are changed.
    new = own(source) + own(source)[:, :1] * (0, 0.2, 0)
    for key in ("Bend", "Lift"):
        keys_of(source)[key].data.foreach_set('co', new.astype(np.float32).ravel())
    keys_of(source)["Bend"].slider_min, keys_of(source)["Bend"].value = -0.5, 1.0
    keys_of(source)["Lift"].slider_max = 3.0
    many(what='ALL_KEYS', drivers=True)
    assert {ob.name: [key.name for key in keys_of(ob)] for ob in targets} == before
    assert np.abs(coordinates(keys_of(ann)["Lift"]) - mine).max() < 1e-6
    for ob, name in ((ann, "Bend"), (ann, "Lift.001"), (bob, "Bend"), (bob, "Lift")):
        assert np.abs(coordinates(keys_of(ob)[name]) - new).max() < 1e-4
    # Settings of a key that the user hasn't changed on the target follow the source; changed ones stay, and are named.
    assert (keys_of(ann)["Bend"].slider_min, keys_of(ann)["Bend"].slider_max) == (-0.5, 2)
    assert keys_of(ann)["Bend"].value == 0.25
    assert (bend.slider_min, bend.slider_max, bend.value) == (-1, 1.5, 0.75)
    assert keys_of(bob)["Lift"].slider_max == 3 and keys_of(bob)["Lift"].vertex_group == 'left'
    assert "range of 'Bend'" in row("Bob") and "vertex group of 'Lift'" in row("Bob")
    assert "range" not in row("Cid")
    assert [curve.driver.expression for curve in bob.data.shape_keys.animation_data.drivers] == ["0.125"]
    assert [curve.data_path for curve in curves(bob.data.shape_keys)] == ['key_blocks["Bend"].value']
    # The same in a third run.
    keys_of(source)["Bend"].slider_max = 1.0
    many(what='ALL_KEYS')
    assert bend.slider_max == 1.5 and keys_of(ann)["Bend"].slider_max == 1.0


def test_keys_that_the_source_has_no_more_are_left_and_named(source, targets):
    choose(source, *targets)
    many(what='ALL_KEYS')
    source.shape_key_remove(keys_of(source)["Lift"])
    many(what='ALL_KEYS')
    for target in targets:
        assert [key.name for key in keys_of(target)] == ["Basis", "Bend", "Lift"]
        assert "'Source' has them no more: 'Lift'" in row(target.name)


def test_replace_takes_keys_of_the_user_s_own_and_leaves_their_range(source, targets):
    ann = targets[0]
    add_key(ann, "Bend", own(ann), slider_max=0.5)
    choose(source, ann)
    many(what='ALL_KEYS', replace=True)
    key = keys_of(ann)["Bend"]
    assert len(keys_of(ann)) == 3 and key.slider_max == 0.5
    assert np.abs(coordinates(key) - bent(own(source))).max() < 1e-4


def test_damaged_records_of_transferred_keys_are_passed_over(source, targets):
    ann = targets[0]
    add_key(ann, "Bend", own(ann), slider_max=0.5)
    ann.data['detail_deform_transferred_keys'] = '{"Bend": {}, "Gone": {}}'
    choose(source, ann)
    many(what='ALL_KEYS')
    assert [key.name for key in keys_of(ann)] == ["Basis", "Bend", "Lift"]
    for nonsense in (7, "[1, 2]", '{"Bend": 3}', '{"Bend": {"source": "Source", "key": [3], "range": "x"}}', '"',
                     "[" * 9999):
        ann.data['detail_deform_transferred_keys'] = nonsense
        many(what='ALL_KEYS', replace=True)
        assert len(keys_of(ann)) == 3


def test_one_key_that_is_no_shape_leaves_the_others(source, targets):
    broken = add_key(source, "Broken", np.full((625, 3), np.nan))
    choose(source, *targets)
    many(what='ALL_KEYS')
    for target in targets:
        assert [key.name for key in keys_of(target)] == ["Basis", "Bend", "Lift"]
        assert "Left out: 'Broken': " in row(target.name)
    source.shape_key_remove(broken)


def test_a_mesh_without_faces_is_named(source, targets):
    bare = bpy.data.objects.new("Bare", bpy.data.meshes.new("Bare"))
    bpy.context.scene.collection.objects.link(bare)
    choose(source, bare, targets[0])
    many()
    assert "'Bare' has no faces" in failures(source)["Bare"]


def test_factors_are_kept_and_shared_and_memory_is_bounded(source, targets, part, monkeypatch):
    factored, prepared = part('follow.transfer_cache'), part('follow.prepared_transfer')
    made = []

    class Counted(prepared.Preparation):
        def __init__(self, source, target, *others, **options):
            made.append(target.name)
            super().__init__(source, target, *others, **options)

    monkeypatch.setattr(prepared, 'Preparation', Counted)
    factored._kept.clear()
    shaped(targets[2], 2 * own(source))
    choose(source, *targets)
    many(what='ALL_KEYS')
    assert len(made) == 2 and "Cid" in made  # two of them are alike
    keys_of(source)["Bend"].data[7].co.z += 0.1
    many(what='ALL_KEYS')
    assert len(made) == 2
    assert np.abs(coordinates(keys_of(targets[0])["Bend"]) - coordinates(keys_of(source)["Bend"])).max() < 1e-4
    shaped_basis = coordinates(targets[2].data.shape_keys.reference_key) * (1, 1, 2)
    targets[2].data.shape_keys.reference_key.data.foreach_set('co', shaped_basis.astype(np.float32).ravel())
    many(what='ALL_KEYS')
    assert made[2:] == ["Cid"]
    # With room for one factor only, the one that this run used last stays.
    monkeypatch.setattr(factored, '_MOST_BYTES', 1.5 * max(size for _, size in factored._kept.values()))
    factored._kept.clear()
    for _ in range(2):
        many(what='ALL_KEYS')
        assert len(factored._kept) == 1
    assert len(made) == 3 + 2 + 1
    choose(source, targets[2])
    many(what='ALL_KEYS')
    many(what='ALL_KEYS')
    assert len(made) <= 7 and len(factored._kept) == 1
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    assert not factored._kept


# ---- cancelling, undo and the table

@pytest.fixture
def work(part, source, targets):
    """work(*targets): the rows of the table, and the generator that the operator runs over these targets."""
    transfer, table_of = part('results.transfer'), part('results.transfer_table')

    def begin(*obs, what='ALL_KEYS'):
        wanted = transfer.TransferRequest(
            what=what, settings=SimpleNamespace(
                correspondence='AUTOMATIC', filepath="", pairs_of='TRIANGLES', rotation_only=False,
                placing='VERTICES', keep_outside=True, gap=0.0, anchor='SOURCE', anchor_group="",
                formulation='SURFACE'),
            pattern="*", replace=False, drivers=False, names={}, alike_names=False, bake_as='CACHE', start=1, end=5,
            cache_path="")
        rows = [table_of.Row(ob.name, ob) for ob in obs]
        return rows, part('results.transfer_many').begin(bpy.context, source, rows, lambda ob: wanted, "A heading",
                                                         lambda text: None)

    return begin


def test_a_cancel_keeps_the_finished_targets_and_leaves_the_others_untouched(source, targets, work):
    rows, generator = work(*targets)
    while not rows[0].outcome:
        assert 0 <= next(generator) <= 1
    generator.close()
    assert [len(keys_of(target)) for target in targets] == [3, 0, 0]
    assert "1 of 3 targets done, 2 cancelled and left as they were." in table()
    assert "Cancelled" in row("Bob") and "Cancelled" in row("Cid") and not failures(source)
    # Cancelled in the midst of the second target.
    for ob in targets:
        ob.shape_key_clear()
    rows, generator = work(*targets)
    seen = [done for done in generator if done >= 0.5 and not rows[1].outcome and generator.close() is None]
    assert len(seen) == 1 and [len(keys_of(target)) for target in targets] == [3, 0, 0]


def test_the_fraction_done_only_grows(targets, work):
    _, generator = work(*targets)
    done = list(generator)
    assert done == sorted(done) and min(done) >= 0 and 0.99 < done[-1] <= 1


def test_a_cancel_before_anything_is_done_leaves_nothing(source, targets, work):
    _, generator = work(*targets)
    next(generator)
    generator.close()
    assert not bpy.data.texts and not failures(source) and not keys_of(targets[0])


def test_esc_is_a_step_of_undo_where_something_stays(part, source, targets, work, monkeypatch):
    """By the operator's modal(), as the window calls it."""
    base = part('operators.operator_base')
    monkeypatch.setattr(base.Progress, '__init__', lambda self, context: None)
    monkeypatch.setattr(base.Progress, 'show', lambda *told: "")
    monkeypatch.setattr(base.Progress, 'end', lambda self, context: None)
    operator_class = part('operators.transfer_many_operators').OBJECT_OT_detail_deform_transfer_many

    class Event:
        type = 'ESC'

    class Operator:
        said, task, keeps_partial_work, interactive = [], "", False, True
        modal, _end, reported = base.LongOperator.modal, base.LongOperator._end, operator_class._reported

        def report(self, kind, text):
            self.said.append((kind, text))

    for steps, ends in ((0, {'CANCELLED'}), (1, {'FINISHED'})):
        rows, generator = work(*targets)
        operator = Operator()
        operator._progress, operator._work = base.Progress(None), operator.reported(generator, rows)
        next(operator._work)
        while sum(bool(each.outcome) for each in rows) < steps:
            next(operator._work)
        assert operator.modal(bpy.context, Event()) == ends
    assert operator.said[-1][0] == {'INFO'} and operator.said[-1][1].startswith("1 of 3 targets done, 2 cancelled")


def test_one_step_of_undo_takes_all_back(source, targets):
    choose(source, *targets, raw_strip("Odd", 20))
    activate(source)
    for ob in bpy.context.view_layer.objects:
        ob.select_set(ob.type == 'MESH')
    bpy.ops.ed.undo_push(message="Before")
    many(what='ALL_KEYS')
    bpy.ops.ed.undo_push(message="Transferred")
    bpy.ops.ed.undo()
    assert not any(keys_of(bpy.data.objects[name]) for name in ("Ann", "Bob", "Cid"))
    assert not failures(bpy.data.objects["Source"]) and "Detail Deform Transfer" not in bpy.data.texts
    bpy.ops.ed.redo()
    assert all(len(keys_of(bpy.data.objects[name])) == 3 for name in ("Ann", "Bob", "Cid"))
    assert "Odd" in failures(bpy.data.objects["Source"])


def test_a_text_of_the_user_s_own_is_no_table(source, targets):
    mine = bpy.data.texts.new("Detail Deform Transfer")
    mine.write("mine")
    choose(source, *targets)
    for _ in range(2):
        many(what='ALL_KEYS')
        assert mine.as_string().strip() == "mine" and len(bpy.data.texts) == 2


def test_a_table_that_was_renamed_or_copied_is_the_user_s(source, targets):
    choose(source, *targets)
    many(what='ALL_KEYS')
    copy, mine = bpy.data.texts["Detail Deform Transfer"].copy(), bpy.data.texts["Detail Deform Transfer"]
    mine.name = "Notes"
    for text in (mine, copy):
        text.write("what I think of it\n")
    for _ in range(2):
        many(what='ALL_KEYS')
        assert all("what I think of it" in text.as_string() for text in (mine, copy)) and len(bpy.data.texts) == 3
        assert "3 of 3 targets done" in table()


def test_a_linked_source(source, targets, tmp_path):
    path = str(tmp_path / "library.blend")
    bpy.data.libraries.write(path, {source})
    bpy.data.objects.remove(source)
    with bpy.data.libraries.load(path, link=True) as (_, into):
        into.objects = ["Source"]
    linked = into.objects[0]
    bpy.context.scene.collection.objects.link(linked)
    choose(linked, *targets, raw_strip("Odd", 20))
    activate(linked)
    for ob in targets:
        ob.select_set(True)
    many(what='ALL_KEYS')
    assert all(len(keys_of(ob)) == 3 for ob in targets)


def test_the_panel_of_the_source(part, source, targets):
    panel = part('ui.transfer_panel').OBJECT_PT_detail_deform_source
    activate(source)
    assert not panel.poll(bpy.context)
    choose(source, raw_strip("Odd", 20))
    activate(source)
    bpy.data.objects["Odd"].select_set(True)
    assert panel.poll(bpy.context)
    refusal(many, what='ALL_KEYS')
    activate(source)
    assert panel.poll(bpy.context)  # because of the failed target


class Layout:
    """Stands in for a panel's layout and records the labels and buttons that are drawn."""

    def __init__(self):
        self.labels, self.buttons = [], []

    def row(self, **_):
        return self

    column = row

    def label(self, text="", icon='NONE'):
        self.labels.append(text)

    def operator(self, name, **_):
        self.buttons.append(SimpleNamespace(name=name, target=None))
        return self.buttons[-1]


def test_a_failed_target_is_known_by_whatever_name(part, source, targets):
    panel = part('ui.transfer_panel').OBJECT_PT_detail_deform_source
    context = SimpleNamespace(preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1)),
                              region=SimpleNamespace(type='WINDOW', width=4000))

    def drawn():
        layout = Layout()
        panel._draw_failed(context, layout, bpy.data.objects["Source"].detail_deform.transfer.failed)
        return layout.labels, [button.target for button in layout.buttons if button.target]

    for name in ("Odd", "Even"):
        raw_strip(name, 20)
    activate(source)
    refusal(many, what='ALL_KEYS', targets=[{'name': name} for name in ("Odd", "Even", "Nobody")])
    odd, even = bpy.data.objects["Odd"], bpy.data.objects["Even"]
    odd.name, targets[0].name = "Renamed", "Odd"  # another object has the old name now
    labels, buttons = drawn()
    assert buttons == ["Renamed", "Even"] and "Renamed" in labels and "'Nobody' is in no scene." in labels
    activate(source)
    assert bpy.ops.object.detail_deform_target_activate(target=buttons[0]) == {'FINISHED'}
    assert bpy.context.active_object == odd
    # Deleted by the operator, then removed from the file.
    activate(even)
    bpy.ops.object.delete()
    assert drawn()[1] == ["Renamed"] and "'Even' is in no scene." in drawn()[0]
    bpy.data.objects.remove(even)
    assert drawn()[1] == ["Renamed"] and "'Even' is in no scene." in drawn()[0]
    # A failed target that succeeds is taken off the list by its present name; another object with its old name isn't
    # taken for it.
    choose(source, targets[0])
    many(what='ALL_KEYS')
    assert "Odd" in failures(source)
    odd.data = targets[1].data.copy()
    choose(source, odd)
    many(what='ALL_KEYS')
    assert set(failures(source)) == {"Even", "Nobody"}
    targets[2].name = "Nobody"
    choose(source, targets[2])
    many(what='ALL_KEYS')
    assert set(failures(source)) == {"Even"}
