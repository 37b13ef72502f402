# SPDX-License-Identifier: GPL-3.0-or-later
"""Transferring shape keys to keys with other names: other spellings of a name, and names from a file."""

import bpy
import numpy as np
import pytest

from conftest import activate, own, refusal
from test_many_targets import choose, keys_of, make_source, make_targets, many, row
from test_transfer import add_key, bent, coordinates, raw_strip


@pytest.fixture
def source():
    return make_source()


@pytest.fixture
def targets(source):
    return make_targets()


@pytest.mark.parametrize('same', [
    ("eyeBlinkLeft", "EyeBlink_L", "eye_blink_left", "Left Eye Blink", "eye.blink.L", "L_eyeBlink", "eyeBlinkL",
     "EYE_BLINK_LEFT", "LEFT eye blink", "EYEBlinkLeft"),
    ("jawOpen", "Jaw Open", "jaw-open", "JAW_OPEN", "jaw.open"), ("browDownRight", "brow_down.R", "rightBrowDown"),
    ("Key 1", "key_1", "Key1"), ("L", "l"), ("blink1left", "Blink 1 L", "blink_l1", "Left blink 1")])
def test_spellings_of_one_name(part, same):
    form = part('results.key_names').form
    assert len({form(name) for name in same}) == 1 and form(same[0]) is not None


def test_spellings_of_different_names(part):
    form = part('results.key_names').form
    names = ("eyeBlinkLeft", "eyeBlinkRight", "eyeBlink", "Smile.001", "Smile", "left", "l", "mouthUpperUp", "...",
             "lookLeftEyeRight", "lookRightEyeLeft", "Key 1", "Key 11", "Upright", "Up_R", "Bright", "B_R", "Cleft",
             "C_L", "cleft_l", "Leftover", "over.L", "Righteous", "eous_R")
    assert len({form(name) for name in names}) == len(names)


def test_which_key_goes_where(part):
    places = part('results.key_names').target_names
    names = ["eyeBlinkLeft", "eyeBlink_L", "jawOpen", "smile"]
    assert places(names, ["EyeBlinkL", "Jaw Open", "jaw_open"], {}, False) == {name: name for name in names}
    assert places(names, ["EyeBlinkL", "Jaw Open", "jaw_open", "smile", "Smile"], {}, True) == {
        "eyeBlinkLeft": "EyeBlinkL", "eyeBlink_L": "eyeBlink_L",  # "EyeBlinkL" is taken already
        "jawOpen": "jawOpen",  # two names of the target are spellings of it
        "smile": "smile"}
    assert places(names, [], {"jawOpen": "smile", "other": "x"}, True) == {
        "jawOpen": "smile", "eyeBlinkLeft": "eyeBlinkLeft", "eyeBlink_L": "eyeBlink_L", "smile": None}


def test_keys_go_to_those_of_alike_names(source, targets):
    ann, bob, cid = targets
    keys_of(source)["Bend"].name = "eyeBlinkLeft"
    add_key(ann, "EyeBlink_L", own(ann))
    choose(source, ann)
    many(what='ALL_KEYS', alike_names=True)  # "EyeBlink_L" is the user's own key and stays
    assert [key.name for key in keys_of(ann)] == ["Basis", "EyeBlink_L", "EyeBlink_L.001", "Lift"]
    assert np.abs(coordinates(keys_of(ann)["EyeBlink_L"]) - own(ann)).max() < 1e-6
    add_key(bob, "EyeBlink_L", own(bob))
    choose(source, bob, cid)
    many(what='ALL_KEYS', alike_names=True, replace=True)
    assert [key.name for key in keys_of(bob)] == ["Basis", "EyeBlink_L", "Lift"]
    assert [key.name for key in keys_of(cid)] == ["Basis", "eyeBlinkLeft", "Lift"]
    # From now on the key counts as a transferred one, and is written without `replace`.
    keys_of(source)["eyeBlinkLeft"].data[3].co.z += 0.1
    many(what='ALL_KEYS', alike_names=True)
    assert [key.name for key in keys_of(bob)] == ["Basis", "EyeBlink_L", "Lift"]
    assert np.abs(coordinates(keys_of(bob)["EyeBlink_L"]) - coordinates(keys_of(source)["eyeBlinkLeft"])).max() < 1e-4


@pytest.mark.parametrize('line', ["Bend\tJaw, open", "Bend -> Jaw, open", "Bend, Jaw"])
def test_keys_go_to_the_names_of_a_file(source, targets, tmp_path, line):
    path = tmp_path / "names.txt"
    path.write_text(f"# source, target\n\n{line}\nNothing -> There\n")
    choose(source, *targets)
    many(what='ALL_KEYS', names_file=str(path))
    name = "Jaw" if line.endswith("Jaw") else "Jaw, open"
    for _ in range(2):
        for target in targets:
            assert [key.name for key in keys_of(target)] == ["Basis", name, "Lift"]
        many(what='ALL_KEYS', names_file=str(path))
    activate(targets[0])
    bpy.ops.object.detail_deform_transfer(source="Source", what='ALL_KEYS', names_file=str(path))
    assert len(keys_of(targets[0])) == 3


def test_two_keys_don_t_go_to_one(source, targets, tmp_path):
    path = tmp_path / "names.txt"
    path.write_text("Bend,Lift\n")
    choose(source, *targets)
    many(what='ALL_KEYS', names_file=str(path))
    assert [key.name for key in keys_of(targets[0])] == ["Basis", "Lift"]
    assert np.abs(coordinates(keys_of(targets[0])["Lift"]) - bent(own(source))).max() < 1e-4
    assert "Left out: 'Lift': another key" in row("Ann")


# ---- no key is written over another one

def is_shape(key, of):
    return np.abs(coordinates(key) - coordinates(of)).max() < 1e-4


def test_a_file_of_names_applies_to_keys_that_were_transferred_before(source, targets, tmp_path):
    path = tmp_path / "names.txt"
    path.write_text("Bend -> Jaw Open\n")
    ann = targets[0]
    choose(source, ann)
    many(what='ALL_KEYS')
    old = coordinates(keys_of(ann)["Bend"])
    keys_of(source)["Bend"].data.foreach_set('co', (own(source) + (0, 0, 1)).astype(np.float32).ravel())
    for _ in range(2):
        many(what='ALL_KEYS', names_file=str(path))
        assert [key.name for key in keys_of(ann)] == ["Basis", "Bend", "Lift", "Jaw Open"]
        assert is_shape(keys_of(ann)["Jaw Open"], keys_of(source)["Bend"])
        assert np.abs(coordinates(keys_of(ann)["Bend"]) - old).max() < 1e-6
        assert "another name here now: 'Bend'." in row("Ann")
    ann.shape_key_remove(keys_of(ann)["Bend"])
    many(what='ALL_KEYS', names_file=str(path))
    assert "another name" not in row("Ann") and len(keys_of(ann)) == 3


def test_a_key_whose_name_another_key_was_transferred_to(source, targets, tmp_path):
    path = tmp_path / "names.txt"
    path.write_text("Bend -> Smile\n")
    ann = targets[0]
    choose(source, ann)
    many(what='ALL_KEYS', names_file=str(path))
    add_key(source, "Smile", own(source) * (1, 1, 2) + (0, 0, 1))
    many(what='ALL_KEYS')
    assert "3 keys" in row("Ann") and "of another key or source: 'Smile'." in row("Ann")
    assert [key.name for key in keys_of(ann)] == ["Basis", "Smile", "Lift", "Bend"]
    for name in ("Smile", "Lift", "Bend"):
        assert is_shape(keys_of(ann)[name], keys_of(source)[name])
    many(what='ALL_KEYS')
    assert "another" not in row("Ann") and len(keys_of(ann)) == 4


def test_one_source_leaves_the_keys_of_another(source, targets, tmp_path):
    path = tmp_path / "names.txt"
    path.write_text("Bend -> Smile\n")
    ann, other = targets[0], raw_strip("Other")
    add_key(other, "Bend", own(other) + (0, 0, 1))
    choose(source, ann)
    many(what='ALL_KEYS', names_file=str(path))
    choose(other, ann)
    many(what='ALL_KEYS')
    assert [key.name for key in keys_of(ann)] == ["Basis", "Smile", "Lift", "Bend"]
    assert is_shape(keys_of(ann)["Smile"], keys_of(source)["Bend"])
    assert is_shape(keys_of(ann)["Bend"], keys_of(other)["Bend"])
    # Two sources that write to the same key of the target: the change is reported.
    choose(source, ann)
    many(what='ALL_KEYS')
    assert is_shape(keys_of(ann)["Bend"], keys_of(source)["Bend"]) and "or source: 'Bend'." in row("Ann")


def test_sources_beside_one_key_of_the_user_s_own_have_one_each(source, targets):
    ann, other = targets[0], raw_strip("Other")
    mine = add_key(ann, "Bend", own(ann))
    add_key(other, "Bend", own(other) + (0, 0, 1))
    for _ in range(2):
        for each in (source, other):
            choose(each, ann)
            many(what='ALL_KEYS', pattern="Bend")
        assert [key.name for key in keys_of(ann)] == ["Basis", "Bend", "Bend.001", "Bend.002"]
        assert is_shape(keys_of(ann)["Bend.001"], keys_of(source)["Bend"])
        assert is_shape(keys_of(ann)["Bend.002"], keys_of(other)["Bend"])
    # When the user's own key is gone, the transferred keys keep their names.
    ann.shape_key_remove(mine)
    many(what='ALL_KEYS')
    assert [key.name for key in keys_of(ann)] == ["Basis", "Bend.001", "Bend.002"]


def test_a_key_made_beside_a_users_key_takes_no_other_keys_name(source, targets):
    ann = targets[0]
    add_key(ann, "Bend", own(ann))
    add_key(source, "Bend.001", own(source) + (0, 0, 1))
    choose(source, ann)
    for _ in range(2):
        many(what='ALL_KEYS')
        assert [key.name for key in keys_of(ann)] == ["Basis", "Bend", "Bend.001", "Lift", "Bend.002"]
        assert is_shape(keys_of(ann)["Bend.001"], keys_of(source)["Bend"])
        assert is_shape(keys_of(ann)["Bend.002"], keys_of(source)["Bend.001"])
        assert "take: 'Bend.001' beside 'Bend'." in row("Ann")


def test_a_pose_beside_a_key_of_the_user_s_own_is_replaced(source, targets):
    ann = targets[0]
    add_key(ann, "Source Pose", own(ann))
    choose(source, ann)
    for _ in range(2):
        many()
        assert [key.name for key in keys_of(ann)] == ["Basis", "Source Pose", "Source Pose.001"]


@pytest.mark.parametrize('text, sentence', [
    ("# nothing\n", "has no names"), ("Bend Lift\n", "line 1: 'Bend Lift' is not a pair"), ("a,b\nBend,\n", "line 2"),
    ("a,b\na,c\n", "line 2: 'a' is there twice"), ("a,b\nc,b\n", "line 2: 'b' is there twice")])
def test_files_of_names_that_are_wrong(source, targets, tmp_path, text, sentence):
    path = tmp_path / "names.txt"
    path.write_text(text, encoding='utf-8')
    choose(source, *targets)
    assert sentence in refusal(many, what='ALL_KEYS', names_file=str(path))
    for encoding in ('cp1252', 'utf-16', 'utf-16-le'):
        path.write_bytes("Bend, Öffnen\n".encode(encoding))
        assert "it is no text in UTF-8: save it" in refusal(many, what='ALL_KEYS', names_file=str(path))
    assert not keys_of(targets[0])
