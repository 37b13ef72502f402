# SPDX-License-Identifier: GPL-3.0-or-later
"""Shape keys that mean the same under different names, in a transfer."""

import bpy
import numpy as np
import pytest

from conftest import activate, own, refusal
from test_many_targets import choose, keys_of, make_source, make_targets, many, row
from test_transfer import add_key, bent, coordinates


@pytest.fixture
def source():
    return make_source()


@pytest.fixture
def targets(source):
    return make_targets()


@pytest.mark.parametrize('same', [
    ("eyeBlinkLeft", "EyeBlink_L", "eye_blink_left", "Left Eye Blink", "eye.blink.L", "L_eyeBlink", "EYEBLINKLEFT",
     "eyeblinkleft", "eyeBlinkL"),
    ("jawOpen", "Jaw Open", "jaw-open", "JAW_OPEN", "jaw.open"), ("browDownRight", "brow_down.R", "rightBrowDown"),
    ("Key 1", "key_1", "Key1"), ("L", "l")])
def test_spellings_of_one_name(part, same):
    form = part('results.key_names').form
    assert len({form(name) for name in same}) == 1 and form(same[0]) is not None


def test_spellings_of_different_names(part):
    form = part('results.key_names').form
    names = ("eyeBlinkLeft", "eyeBlinkRight", "eyeBlink", "Smile.001", "Smile", "left", "l", "mouthUpperUp", "...",
             "lookLeftEyeRight", "lookRightEyeLeft", "Key 1", "Key 11")
    assert len({form(name) for name in names}) == len(names)


def test_which_key_goes_where(part):
    places = part('results.key_names').places
    names = ["eyeBlinkLeft", "eyeBlink_L", "jawOpen", "smile"]
    assert places(names, ["EyeBlinkL", "Jaw Open", "jaw_open"], {}, False) == {name: name for name in names}
    assert places(names, ["EyeBlinkL", "Jaw Open", "jaw_open", "smile", "Smile"], {}, True) == {
        "eyeBlinkLeft": "EyeBlinkL", "eyeBlink_L": "eyeBlink_L",  # which is taken
        "jawOpen": "jawOpen",  # it could be either
        "smile": "smile"}
    assert places(names, [], {"jawOpen": "smile", "other": "x"}, True) == {
        "jawOpen": "smile", "eyeBlinkLeft": "eyeBlinkLeft", "eyeBlink_L": "eyeBlink_L", "smile": None}


def test_keys_go_to_those_of_alike_names(source, targets):
    ann, bob, cid = targets
    keys_of(source)["Bend"].name = "eyeBlinkLeft"
    add_key(ann, "EyeBlink_L", own(ann))
    choose(source, ann)
    many(what='ALL_KEYS', alike_names=True)  # it is the user's own
    assert [key.name for key in keys_of(ann)] == ["Basis", "EyeBlink_L", "EyeBlink_L.001", "Lift"]
    assert np.abs(coordinates(keys_of(ann)["EyeBlink_L"]) - own(ann)).max() < 1e-6
    add_key(bob, "EyeBlink_L", own(bob))
    choose(source, bob, cid)
    many(what='ALL_KEYS', alike_names=True, replace=True)
    assert [key.name for key in keys_of(bob)] == ["Basis", "EyeBlink_L", "Lift"]
    assert [key.name for key in keys_of(cid)] == ["Basis", "eyeBlinkLeft", "Lift"]
    # From now on it is one that was transferred.
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


@pytest.mark.parametrize('text, sentence', [
    ("# nothing\n", "has no names"), ("Bend Lift\n", "line 1: 'Bend Lift' is not a pair"), ("a,b\nBend,\n", "line 2"),
    ("a,b\na,c\n", "line 2: 'a' is there twice"), ("a,b\nc,b\n", "line 2: 'b' is there twice")])
def test_files_of_names_that_are_wrong(source, targets, tmp_path, text, sentence):
    path = tmp_path / "names.txt"
    path.write_text(text)
    choose(source, *targets)
    assert sentence in refusal(many, what='ALL_KEYS', names_file=str(path))
    path.write_bytes(b'\xff\xfe\x00')
    assert "it is no text" in refusal(many, what='ALL_KEYS', names_file=str(path))
    assert not keys_of(targets[0])
