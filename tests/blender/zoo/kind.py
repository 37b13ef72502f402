# SPDX-License-Identifier: GPL-3.0-or-later
"""A kind of defect, and the decorator that collects kinds in a list."""

from collections.abc import Callable
from typing import NamedTuple


class Kind(NamedTuple):
    name: str
    stage: str  # 'mesh': make(Sheet); 'object': make(Specimen) before Bind; 'pose': make(Specimen) after Bind
    make: Callable
    whole: bool  # it replaces the sheet by another mesh
    about: str  # two kinds about the same thing don't combine


class Kinds(list):
    """A list of kinds, and a decorator that adds a function as `make` of a new one."""

    def __init__(self, stage):
        self._stage = stage

    def __call__(self, name, whole=False, about=""):
        def taken(make):
            self.append(Kind(name, self._stage, make, whole, about))
            return make
        return taken

    def each(self, about, made):
        """Adds several kinds about the same thing. made: {name: make}."""
        for name, make in made.items():
            self.append(Kind(name, self._stage, make, False, about))
