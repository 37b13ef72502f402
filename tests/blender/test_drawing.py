# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on draws in the viewport only by functions that all of Blender's graphics back ends support. In the
background nothing can be drawn, so its sources are searched for the others."""

import re
from pathlib import Path

import pytest

# Patterns of names that Vulkan or Metal don't support, each with the reason.
NOT_EVERYWHERE = {
    r'\bbgl\b': "is OpenGL itself",
    r'line_width_set': "leaves lines a pixel wide: scene/shaders.py has wide ones",
    r'GPUShader\(': "refuses sources that nothing describes: create_from_info() takes them",
    r'LINE_LOOP|TRI_FAN': "has to be emulated: strips and triangles don't",
}


def lines_of(module):
    for path in sorted(Path(module.__file__).parent.rglob('*.py')):
        for number, line in enumerate(path.read_text(encoding='utf-8').splitlines(), 1):
            yield f"{path.name}:{number}", line


@pytest.mark.parametrize('name', NOT_EVERYWHERE)
def test_nothing_is_drawn_by_what_only_opengl_has(module, name):
    found = [where for where, line in lines_of(module) if re.search(name, line)]
    assert not found, f"{name} {NOT_EVERYWHERE[name]}"


def test_points_and_lines_have_shaders_that_make_them_wide(module):
    """Blender's shaders without a width draw them one pixel wide, except on OpenGL. So only scene/shaders.py chooses
    shaders."""
    built_in = {where.partition(':')[0] for where, line in lines_of(module) if 'from_builtin' in line}
    assert built_in == {'shaders.py'}
