# SPDX-License-Identifier: GPL-3.0-or-later
"""The manual comes with the add-on and opens in the browser, and all of its links and pictures exist."""

import ast
import importlib
import re
import subprocess
import sys
import urllib.parse
import urllib.request
import webbrowser
import zipfile
from html.parser import HTMLParser

import bpy
import pytest

from conftest import REPOSITORY, bind, can_start_programs, make_strip

EMPTY = {'img', 'meta'}  # elements without an end tag


class Page(HTMLParser):
    """A page's anchors, links and pictures. Fails where start and end tags don't match."""

    def __init__(self, text):
        super().__init__()
        self.ids, self.links, self.pictures, self.open, self.text = set(), [], [], [], ""
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.ids.update({found['id']} if 'id' in found else ())
        self.links += [found['href']] if tag == 'a' else []
        self.pictures += [found['src']] if tag == 'img' else []
        if tag not in EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


@pytest.fixture
def opened(monkeypatch):
    """The addresses that the add-on gives to the browser."""
    found = []
    monkeypatch.setattr(webbrowser, 'open', found.append)
    return found


def test_the_manual_opens_whole(opened):
    assert bpy.ops.wm.detail_deform_manual() == {'FINISHED'}
    page = Page(urllib.request.urlopen(opened[0]).read().decode())
    assert {link for link in page.links if link.startswith('#')} > {'#what-a-message-means'}
    assert [link for link in page.links if link.startswith('#') and link[1:] not in page.ids] == []
    assert len(page.pictures) > 10
    for picture in page.pictures:
        address = urllib.parse.urljoin(opened[0], picture)
        assert urllib.request.urlopen(address).read(3) in {b'\x89PN', b'\xff\xd8\xff'}, picture
    assert '**' not in page.text and '](' not in page.text and '| ' not in page.text.replace(" | Detail", "")


def test_the_installed_manual_is_opened(part, module):
    found = part('ui.preferences').manual()
    assert module.__file__.startswith(str(found.parent))


def test_markdown_becomes_html(monkeypatch):
    monkeypatch.syspath_prepend(str(REPOSITORY / 'addon'))
    page = importlib.import_module('manual_page').page
    text = page("# A & B: c\n\nOne *two* **three > `<f>`**,\nand [four](#a--b-c), [five](../FIVE.md).\n\n"
                "1. first\n   goes on\n2. second\n\n| a | b |\n|---|---|\n| ![x](y.png) | `*` |\n\n"
                "```python\nx\n\ny\n```\n    indented\n")
    for expected in ('<h1 id="a--b-c">A &amp; B: c</h1>',
                     '<p>One <i>two</i> <b>three &gt; <code>&lt;f&gt;</code></b>, and <a href="#a--b-c">four</a>, five',
                     '<ol><li>first goes on</li><li>second</li></ol>',
                     '<td><img src="y.png" alt="x"></td><td><code>*</code></td>',
                     '<pre>x\n\ny</pre>', '<pre>indented</pre>'):
        assert expected in text


def test_a_report_names_versions_mesh_modifiers_and_status(part, opened, monkeypatch):
    ob = bind(make_strip(9))
    preferences = part('ui.preferences')
    text = preferences.report(ob)
    for expected in (bpy.app.version_string, part('library.native').version(), "81 vertices, 64 faces",
                     "modifiers: NODES", ob.detail_deform.status):
        assert expected in text
    assert "Mesh:" not in preferences.report(None)
    assert bpy.ops.wm.detail_deform_report() == {'FINISHED'} and not opened
    monkeypatch.setattr(preferences, 'WEBSITE', "https://example.org/deform")
    assert bpy.ops.wm.detail_deform_report() == {'FINISHED'} and opened == ["https://example.org/deform/issues"]


def test_a_zip_made_for_a_website_links_to_it(part, tmp_path):
    if not can_start_programs():
        pytest.skip("no programs like this one can be started here")
    made, website = tmp_path / 'made.zip', "https://example.org/deform"
    subprocess.run([sys.executable, REPOSITORY / 'addon' / 'make_zip.py', part('library.native').library_path(),
                    'linux-x64', made, website], check=True)
    with zipfile.ZipFile(made) as made:
        texts = {name: made.read(f'detail_deform/{name}').decode() for name in (
            'blender_manifest.toml', '__init__.py', 'website.py')}
    assert texts['blender_manifest.toml'].count('website = "https://example.org/deform"\n') == 1
    found = ast.literal_eval(re.search(r"bl_info = (\{.*?\n\})", texts['__init__.py'], re.DOTALL)[1])
    assert (found['doc_url'], found['tracker_url']) == (website, website + '/issues')
    assert 'WEBSITE = "https://example.org/deform"' in texts['website.py']


def test_the_preferences_have_an_entry(module):
    assert module.__name__ in bpy.context.preferences.addons
    assert bpy.context.preferences.addons[module.__name__].preferences.bl_rna.identifier == 'DetailDeformPreferences'
