# SPDX-License-Identifier: GPL-3.0-or-later
"""The C ABI through the add-on's own ctypes layer, without Blender."""

import importlib
import sys
import types
from pathlib import Path

import numpy as np
import pytest

ADDON = Path(__file__).resolve().parents[2] / 'addon' / 'detail_deform'
IDENTITY = np.eye(4)[None, :3]


def rotation(angle, shift):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[[c, 0, s, shift[0]], [0, 1, 0, shift[1]], [-s, 0, c, shift[2]]]])


def part(name):
    """A module of the add-on that needs no Blender, without the package's own __init__."""
    package = sys.modules.setdefault('detail_deform_parts', types.ModuleType('detail_deform_parts'))
    package.__path__ = [str(ADDON)]
    return importlib.import_module(f'detail_deform_parts.{name}')


def is_sanitized():
    """Whether a sanitizer's runtime is loaded in this process."""
    if not sys.platform.startswith('linux'):
        return False
    with open('/proc/self/maps', encoding='utf-8') as maps:
        return any(name in line for line in maps for name in ('libasan', 'libtsan'))


@pytest.fixture(scope='session')
def native():
    return part('library.native')


@pytest.fixture(scope='session')
def structs():
    return part('library.structs')


class Strip:
    """A wavy strip of n × 8 vertices: fixed on the left, handle 0 on the right."""

    def __init__(self, n=24):
        i, j = np.meshgrid(np.arange(n), np.arange(8), indexing='ij')
        self.positions = np.stack([i, j, 0.5 * np.sin(2.1 * i) * np.cos(1.7 * j)], -1).reshape(-1, 3)
        self.positions = self.positions.astype(np.float32)
        corner = (i * 8 + j)[:-1, :-1].ravel()
        self.triangles = np.stack([corner, corner + 8, corner + 9, corner, corner + 9, corner + 1],
                                  -1).reshape(-1, 3).astype(np.int32)
        self.roles = np.full(n * 8, -1, np.int32)
        self.roles[i.ravel() < 2] = -2
        self.roles[i.ravel() >= n - 2] = 0


def sheet(n):
    """A wavy sheet of n × n vertices, fixed on the left, handle 0 on the right: positions, triangles, roles."""
    i, j = np.divmod(np.arange(n * n), n)
    positions = np.stack([i / n, j / n, 0.02 * np.sin(34 * i / n)], axis=1).astype(np.float32)
    a = (n * np.arange(n - 1)[:, None] + np.arange(n - 1)).ravel()
    triangles = np.concatenate([np.stack([a, a + n, a + n + 1], axis=1), np.stack([a, a + n + 1, a + 1], axis=1)])
    return positions, triangles.astype(np.int32), np.where(i < 5, -2, np.where(i >= n - 5, 0, -1)).astype(np.int32)


@pytest.fixture
def strip():
    return Strip()
