# SPDX-License-Identifier: GPL-3.0-or-later
"""A kind of defect, and how a list of them is written."""

from collections.abc import Callable
from typing import NamedTuple


class Kind(NamedTuple):
    name: str
    stage: str  # 'mesh': make(Sheet); 'object': make(Specimen) before Bind; 'pose': make(Specimen) after
    make: Callable
    whole: bool  # it puts another mesh in the sheet's place
    about: str  # two about the same thing don't combine


class Kinds(list):
    """As a decorator of functions that make a kind."""

    def __init__(self, stage):
        self._stage = stage

    def __call__(self, name, whole=False, about=""):
        def taken(make):
            self.append(Kind(name, self._stage, make, whole, about))
            return make
        return taken

    def each(self, about, made):
        """Many that differ in a value: {name: a function}."""
        for name, make in made.items():
            self.append(Kind(name, self._stage, make, False, about))
