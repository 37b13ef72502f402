# SPDX-License-Identifier: GPL-3.0-or-later
"""All kinds, and their pairs."""

import itertools
import zlib

from . import groups, meshes, objects, poses, settings
from .driver import METHODS, Case

_STAGES = ('mesh', 'object', 'pose')
HEALTHY = Case(())
PARTS = (meshes, groups, objects, settings, poses)
ALL = [kind for part in PARTS for kind in part.KINDS]


def alone():
    """Each kind with all methods, once to be applied and once to be removed."""
    yield HEALTHY
    for kind in ALL:
        yield Case((kind,))


def pairs(share=1):
    """Each two that can be made on one mesh, with the default method and one other, which the pair's name chooses; of
    them one in so many as share says."""
    for one, other in itertools.combinations(ALL, 2):
        if one.whole and other.whole or one.about and one.about == other.about:
            continue
        number = zlib.crc32(f"{one.name} {other.name}".encode())
        if number // 10 % share == 0:
            kinds = tuple(sorted((one, other), key=lambda kind: (_STAGES.index(kind.stage), not kind.whole)))
            yield Case(kinds, (METHODS[0], METHODS[1 + number % 5]), bool(number // 5 % 2))
