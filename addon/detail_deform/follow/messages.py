# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors and progress in the user's words: sentences are made of what the C library tells of an error (what it is
about, by number, and what can be done), with the names of handles and examples and the labels of buttons."""

from ..library.native import NativeError
from ..scene import examples
from ..scene.pieces import Pieces
from ..scene.subject import enabled_handles
from ..scene.mesh_data import MeshProblem

TOLD = (MeshProblem, NativeError, MemoryError)  # exceptions that are shown to the user as a sentence
_NO_MEMORY = "There is not enough memory for a mesh of this size."
STEPS = 3
# The step that a stage of a bind belongs to: the mesh's equations, the base surface, the handles.
STEP_OF_STAGE = {'STARTING': 1, 'OPERATORS': 1, 'POISSON': 1, 'ENERGY': 2, 'BASE': 2, 'HANDLES': 3,
                 'ENERGY_ON_BASE': 3, 'DONE': 3}
# What the subject of an error is called where it has no name in Blender. {}: its number.
_SUBJECTS = {'VERTEX': "Vertex {}", 'TRIANGLE': "Triangle {}", 'HANDLE': "Handle {}", 'EXAMPLE': "Example {}",
             'PAIR': "Pair {}",
             'SOURCE_VERTEX': "Vertex {} of the source", 'SOURCE_TRIANGLE': "Triangle {} of the source",
             'TARGET_VERTEX': "Vertex {} of the target", 'TARGET_TRIANGLE': "Triangle {} of the target",
             'BASE_VERTEX': "Vertex {} of the base object", 'BASE_TRIANGLE': "Triangle {} of the base object"}
# What the user can do about it.
_REMEDIES = {
    'FREE_RESOURCES': "close other programs, or give Blender more memory and threads",
    'VALIDATE_MESH': "validate the mesh",
    'MOVE_VERTEX': "delete or move that vertex",
    'ADD_FACES': "the method works on surfaces, add faces",
    'DISSOLVE_FACES': "merge doubled vertices and dissolve degenerate faces there, add a handle, or leave that part "
                      "out of the region",
    'ADD_HANDLE': "add at least one that moves some vertices",
    'ASSIGN_VERTICES': "give it at least one",
    'HANDLE_ON_PART': "put a handle on the part that should deform",
    'FREE_VERTICES': "make the region larger, or give the handles fewer vertices",
    'FIX_VERTICES': "leave some vertices out of the region",
    'MOVE_LESS': "put it back",
    'SMOOTH_METRIC_LESS': "lower Smoothing",
    'SURFACE_METRIC': "set Measure On to Surface, or hold that part by one more handle",
    'PIN_FEWER': "pin fewer vertices",
    'WHOLE_GRADIENTS': "switch Keep Proportions off, or choose other Places",
    'MATCH_MESHES': "choose another Match By",
    'MOVE_TARGET': "bring this mesh nearer to the source",
    'CORRECT_MARKERS': "take one of these markers away",
    'SAME_VERTICES': "choose a copy of this mesh with the same vertices"}


def step(stage):
    return f"({STEP_OF_STAGE.get(stage, STEPS)} of {STEPS})"  # the first update of a BindJob comes last


def said(ob, error):
    """The sentence of one of TOLD about an object, with the names of its handles and examples."""
    return _composed(error, _names(ob)) if isinstance(error, NativeError) else sentence(error)


def sentence(error):
    """The same without those names."""
    if isinstance(error, MemoryError):
        return _NO_MEMORY
    return _composed(error, {}) if isinstance(error, NativeError) else str(error)


def _names(ob):
    settings = ob.detail_deform
    handles = enabled_handles(settings)
    return {'HANDLE': [f"Handle '{handles[number].name}'" for number in Pieces(handles).owner],
            'EXAMPLE': [f"Example '{examples.title(example)}'" for example in examples.enabled(settings)]}


def _composed(error, names):
    """names: {subject: [name of each]}"""
    if not error.message:  # the add-on's own
        return str(error)
    known = names.get(error.subject, ())
    if 0 <= error.index < len(known):
        subject = known[error.index]
    else:
        subject = _SUBJECTS.get(error.subject, "").format(error.index)
    text = f"{subject} {error.message}".lstrip()
    remedy = _REMEDIES.get(error.remedy)
    return f"{text}: {remedy}." if remedy else f"{text}."
