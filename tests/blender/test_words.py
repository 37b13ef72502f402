# SPDX-License-Identifier: GPL-3.0-or-later
"""Texts for users: every setting and operator has a tooltip, sentences and the manual call buttons and settings by
their labels, and the manual has a row for each message."""

import re
from pathlib import Path

import bpy
import pytest

from conftest import REPOSITORY, add_from, bind, group, make_strip, own, refusal, update
from sentences import labels, native_sentences, refusals, texts

MANUAL = REPOSITORY / 'addon' / 'MANUAL.md'
# Blender's labels and other names. Any other word with a capital in a sentence has to be a label of the add-on.
BLENDERS = {
    "Add Modifier", "Add-ons", "Alembic", "Alt+S", "Apply", "Armature", "Bevel", "Blender", "By Distance",
    "Clean Up", "Cloth", "Control", "Ctrl+F", "Ctrl+T", "Ctrl+V", "Data", "Deform", "Degenerate Dissolve", "Depth",
    "Detail Deform", "Dyntopo", "Edit Mode", "Edit", "EEVEE", "Enter", "Esc", "Euler", "Extrude", "F9",
    "Frame Range", "G", "Geometry Nodes", "Geometry", "Get Extensions", "Install from Disk", "Install", "Levels Render",
    "Levels Viewport", "Live", "Lock Interface", "Make Local", "Make Single User", "MB", "Merge", "Mesh Cache",
    "Mesh", "Mirror", "Modifiers", "Multires", "N", "New", "Object & Data", "Object Data", "Object", "Old",
    "Output", "P", "PC2", "Preferences", "Properties", "R", "Relations", "Relative", "Render", "Render U", "Resolution",
    "S", "Sculpt Mode", "Select More", "Selected Objects and Data", "Shape", "Shape Key", "Shape Keys", "Shift",
    "Soft Body",
    "Subdivision", "Tab",
    "Time Stretching", "Vertex", "Visual Geometry to Mesh", "X", "Y", "Z"}
# Names of data that the add-on makes, and other words with a capital.
OTHERS = {"UVs", "ID", "Middle", "Detail Deform Transfer", "DOCTYPE", "I", "Marker 1", "Marker 2", "{} Pose", "… Rest",
          "… Mirrored", "… Match",
          "Object Mode", "Poisson", "Press", "UTF-8", "Windows", "with an Empty of Its Own"}


@pytest.fixture
def folder(module):
    return Path(module.__file__).parent


def described():
    settings = bpy.types.Object.bl_rna.properties['detail_deform'].fixed_type
    groups = [settings, *(settings.properties[name].fixed_type for name in ('handles', 'examples', 'transfer'))]
    operators = [getattr(bpy.ops.object, name).get_rna_type() for name in dir(bpy.ops.object)
                 if name.startswith('detail_deform')]
    return groups, operators


def visible(rna):
    return [p for p in rna.properties if p.identifier not in {'rna_type', 'name'} and not p.is_hidden]


def test_every_setting_and_operator_has_a_tooltip():
    groups, operators = described()
    assert len(operators) >= 20
    for rna in (*groups, *operators):
        for prop in visible(rna):
            assert len(prop.description) > 10, f"{rna.identifier}.{prop.identifier}"
            if prop.type == 'ENUM':
                for item in prop.enum_items:
                    assert len(item.description) > 10, f"{prop.identifier} {item.identifier}"
    for rna in operators:
        assert len(rna.description) > 20, rna.identifier


def test_tooltips_end_without_a_full_stop():
    """Blender adds it."""
    groups, operators = described()
    for rna in (*groups, *operators):
        for text in (rna.description if rna in operators else "", *(p.description for p in visible(rna))):
            assert not text.endswith('.'), text


@pytest.mark.parametrize('name', ['Detail Deform', 'Handles', 'Examples', 'Base Surface', 'Advanced', 'For Comparison',
                                  'Detail Deform: Transfer'])
def test_panels_are_there(name):
    assert any(getattr(getattr(bpy.types, kind), 'bl_label', "") == name for kind in dir(bpy.types)
               if kind.startswith('OBJECT_PT_detail_deform'))


def test_labels_are_the_users_words():
    settings = bpy.types.Object.bl_rna.properties['detail_deform'].fixed_type.properties
    transfer = settings['transfer'].fixed_type.properties
    for prop, name in ((settings['rotation_only'], "Keep Detail Size"), (settings['refine'], "Quality of large bends"),
                       (settings['base_metric'], "Measure On"), (transfer['rotation_only'], "Keep Proportions")):
        assert prop.name == name
    assert settings['output'].enum_items['BASE'].name == "Smooth Preview"
    assert transfer['correspondence'].enum_items['STORED'].name == "Saved Match"
    assert bpy.ops.object.detail_deform_marker_add.get_rna_type().name == "Add Transfer Marker"


def test_no_two_settings_have_one_label():
    settings = bpy.types.Object.bl_rna.properties['detail_deform'].fixed_type
    names = [prop.name for prop in visible(settings)]
    assert sorted(set(names)) == sorted(names)


def test_numbers_of_methods_are_those_of_existing_files():
    """They don't depend on a method's place in the menu."""
    methods = bpy.types.Object.bl_rna.properties['detail_deform'].fixed_type.properties['method'].enum_items
    assert {item.identifier: item.value for item in methods} == {
        'TRANSFER': 0, 'VARIATIONAL': 1, 'NORMAL': 2, 'GRADIENT': 3, 'VOLUMES': 4, 'EXAMPLES': 5}


# ---- sentences

def unknown(text, known):
    """Words with a capital that are neither known labels nor at the beginning of a sentence."""
    for name in sorted(known, key=len, reverse=True):
        text = re.sub(rf"(?<![\w-]){re.escape(name)}(?![\w-])", '·', text)
    text = re.sub(r"'…'|…", '·', text)
    return re.findall(r"(?<![.?!] )(?<!^)(?<!\n)\b[A-Z][\w-]*", text)


def test_sentences_use_the_labels_of_buttons_and_settings(folder):
    known = labels(folder) | BLENDERS | OTHERS
    wrong = [(where, text, found) for where, text in texts(folder) if (found := unknown(text, known))]
    assert not wrong, '\n'.join(map(str, wrong))


def test_the_check_of_labels_finds_wrong_ones(folder):
    known = labels(folder) | BLENDERS
    assert unknown("Nothing follows: press Around Handles.", known) == ["Around"]
    assert unknown("Only rotations count (Rotation Only).", known) == ["Rotation", "Only"]
    assert unknown("Press Re-bind to go on. Then move it.", known) == []
    assert unknown("The last Bind, of 'X': choose Quality of large bends.", known) == []


def test_press_is_followed_by_a_label(folder):
    for where, text in texts(folder):
        for word in re.findall(r"\b[Pp]ress (\S+)", text):
            assert word[0].isupper(), (where, text)


# ---- the status

def test_progress_is_said_in_steps(part):
    ob = make_strip(n=60)
    assert bpy.ops.object.detail_deform_bind(wait=True) == {'FINISHED'}  # the library is loaded
    words, bound = part('follow.messages'), part('follow.handle_follower')
    said = [words.step(stage) for stage in words.STEP_OF_STAGE]
    assert said[0] == "(1 of 3)" and set(said) == {"(1 of 3)", "(2 of 3)", "(3 of 3)"}

    class Job:
        cancelled = False

        def progress(self):
            return True, 0.41, 'POISSON'

    content = ob.detail_deform.signature
    bound.cache._jobs[content] = Job()
    try:
        assert bound.cache.poll(content) and ob.detail_deform.status == "Preparing (1 of 3), 41%."
    finally:
        bound.cache._pop(content)


def test_every_stage_of_a_bind_has_its_step(part):
    sources, stages = REPOSITORY / 'native' / 'src', {'STARTING'}
    for path in ('deform/deformer.cpp', 'base/bound_surface.cpp', 'solver/sparse_cholesky.h'):
        source = (sources / path).read_text(encoding='utf-8')
        stages.update(word.upper() for word in re.findall(r'Stage::(\w+)', source))
    assert stages == set(part('follow.messages').STEP_OF_STAGE)


def test_each_subject_and_remedy_of_the_library_has_its_words(part):
    words, structs = part('follow.messages'), part('library.structs')
    assert set(words._SUBJECTS) == set(structs.SUBJECTS) - {'NONE'}
    assert set(words._REMEDIES) == set(structs.REMEDIES) - {'NONE', 'CALL', 'WAIT'}


def test_the_status_counts_in_plain_words():
    ob = bind(make_strip(n=36))
    assert ob.detail_deform.status == "Bound to 'right': 1,080 vertices follow it."
    group(ob, 'left', range(36 * 3, 36 * 4))
    bpy.ops.object.detail_deform_handle_add(vertex_group='left')
    update()
    assert bind(ob).detail_deform.status == "Bound to 2 handles: 1,044 vertices follow."


def test_handles_and_examples_are_called_by_name(part):
    """Also in the C library's sentences: the library knows only numbers, which the add-on replaces by names."""
    ob = make_strip()
    add_from(ob, own(ob)[:, 0] < 0.3)
    ob.detail_deform.examples.add().name = "Bent"
    words, error = part('follow.messages'), part('library.native').NativeError
    for message, subject, index, remedy, said in (
            ("flattens", 'HANDLE', 0, 'CALL', "Handle 'right' flattens."),
            ("has none", 'HANDLE', 1, 'ASSIGN_VERTICES', "Handle 'Handle' has none: give it at least one."),
            ("has 2 vertices", 'EXAMPLE', 0, 'NONE', "Example 'Bent' has 2 vertices."),
            ("collapses", 'VERTEX', 7, 'SMOOTH_METRIC_LESS', "Vertex 7 collapses: lower Smoothing."),
            ("has a turn that is not finite", 'HANDLE', 7, 'CALL', "Handle 7 has a turn that is not finite."),
            ("Nothing is there", 'NONE', -1, 'NONE', "Nothing is there.")):
        assert words.said(ob, error("", message=message, subject=subject, index=index, remedy=remedy)) == said
    assert words.said(ob, error("It was cancelled.")) == "It was cancelled."
    ob.detail_deform.steps = 3
    bind(ob)
    ob.detail_deform.handles[0].target.scale = (-1, 1, 1)
    update()
    assert ob.detail_deform.status.startswith("Handle 'right' flattens or mirrors")
    assert "'right'" in refusal(bpy.ops.object.detail_deform_update)


# ---- the manual

def pattern(words):
    """The regular expression of a row of the manual, in which … stands for any text."""
    return '.*'.join(re.escape(part.strip()) for part in words.strip().split('…'))


def is_of(row, text):
    """Whether a row is about a sentence. The row's text may be in the sentence; or the sentence, which may be a part of
    a longer message, at the beginning of the row."""
    begins = text.split('…')[0]
    return bool(re.search(pattern(row), text)) or len(begins.split()) > 3 and re.match(pattern(text.rstrip('.')), row)


def rows():
    """The sentences in the first column of the manual's tables of messages."""
    text = MANUAL.read_text(encoding='utf-8').split('## What a message means')[1].split('\n## ')[0]
    cells = re.findall(r'^\| (.*?) \|', text, re.MULTILINE)
    return [alternative for cell in cells if cell not in {'it says'} and set(cell) - set('-|')
            for alternative in cell.split(' / ')]


def test_each_message_has_a_row_in_the_manual(folder):
    found = rows()
    assert len(found) > 100
    missing = [(where, text) for where, text in refusals(folder) if not any(is_of(row, text) for row in found)]
    assert not missing, '\n'.join(map(str, missing))


def test_each_row_of_the_manual_is_a_message(folder):
    said = [text for _, text in texts(folder)] + [*native_sentences(REPOSITORY / 'native' / 'src')]
    stale = [row for row in rows() if not any(is_of(row, text) for text in said)]
    assert not stale, '\n'.join(stale)


def bold(text):
    """The words in bold in a Markdown text, split at commas and at > in menu paths."""
    text = re.sub(r'```.*?```', '', text, flags=re.DOTALL)
    for found in re.findall(r'\*\*(.+?)\*\*', text):
        yield from (part.strip() for part in re.split(r' > |, ', re.sub(r'\[(.*?)\]\(.*?\)', r'\1', found)))


@pytest.mark.parametrize('file', ['addon/MANUAL.md', 'README.md'])
def test_words_in_bold_are_labels(folder, file):
    known = labels(folder) | BLENDERS | {"+", "−", "▾", "⇄", "What a message means"}
    wrong = {name for name in bold((REPOSITORY / file).read_text(encoding='utf-8')) if name not in known}
    assert not wrong, wrong
