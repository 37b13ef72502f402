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
    """The healthy sheet, and each kind alone; with all methods, ending with Apply."""
    yield HEALTHY
    for kind in ALL:
        yield Case((kind,))


def pairs(share=1):
    """All pairs of kinds that combine, or one in `share` of them. Each is driven with the default method and another
    one, which depends on the pair's names."""
    for one, other in itertools.combinations(ALL, 2):
        if one.whole and other.whole or one.about and one.about == other.about:
            continue
        number = zlib.crc32(f"{one.name} {other.name}".encode())
        if number // 10 % share == 0:
            kinds = tuple(sorted((one, other), key=lambda kind: (_STAGES.index(kind.stage), not kind.whole)))
            yield Case(kinds, (METHODS[0], METHODS[1 + number % 5]), bool(number // 5 % 2))
