# SPDX-License-Identifier: GPL-3.0-or-later
"""Memory, data-blocks and threads don't grow in long use, by short forms of the loops of soak.py."""
import sys

import pytest

if sys.platform != 'linux':
    pytest.skip("reads /proc", allow_module_level=True)

import soak


@pytest.mark.thorough
@pytest.mark.parametrize('name', soak.LOOPS)
def test_nothing_grows(tmp_path, name):
    row = soak.ran(name, str(tmp_path), short=True)
    assert row.is_flat, f'{soak.HEAD}\n{row}'
