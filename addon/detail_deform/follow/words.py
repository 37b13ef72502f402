# SPDX-License-Identifier: GPL-3.0-or-later
"""What goes wrong, as it is told; what the C library says, in the words of those who use it: the stages of a bind as
steps, and handles and examples, which it knows by their numbers, by their names."""

import re

from ..library.native import NativeError
from ..scene import examples, handle_matrices
from ..scene.mesh_data import MeshProblem

TOLD = (MeshProblem, NativeError, MemoryError)  # to the user, as a sentence
_NO_MEMORY = "There is not enough memory for a mesh of this size."  # as the C library says it
STEPS = 3
# The step that a stage belongs to: the mesh's equations, the base surface, the handles.
STEP_OF_STAGE = {
    "Starting": 1, "Building operators": 1, "Factoring the Poisson system": 1,
    "Factoring the base surface's energy": 2, "Computing the base surface": 2,
    "Computing the handles' basis functions": 3, "Factoring the energy on the base": 3, "Done": 3}


def step(stage):
    return f"({STEP_OF_STAGE.get(stage, 1)} of {STEPS})"


def said(ob, error):
    """The sentence of one of TOLD about an object."""
    return named(ob, str(error)) if isinstance(error, NativeError) else sentence(error)


def sentence(error):
    """The same without the names of handles and examples."""
    return _NO_MEMORY if isinstance(error, MemoryError) else str(error)


def named(ob, sentence):
    settings = ob.detail_deform
    names = {'handle': [handle.name for handle in handle_matrices.enabled_handles(settings)],
             'example': [examples.title(example) for example in examples.enabled(settings)]}

    def by_name(found):
        kind, number = found[1], int(found[2])
        known = names[kind.lower()]
        return f"{kind} '{known[number]}'" if number < len(known) else found[0]

    return re.sub(r"\b(handle|example) (\d+)\b", by_name, sentence, flags=re.IGNORECASE)
