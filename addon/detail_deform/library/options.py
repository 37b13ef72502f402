# SPDX-License-Identifier: GPL-3.0-or-later
"""All that can be set, as one table. Blender's properties, the panels' rows and why one is greyed, Copy Settings, what
a bind and an update get as arguments, and the option structs' fields are made of it. It needs no Blender.

A new setting of a method is a row here and its field's name in structs.py, beside the C library's own."""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

BIND, UPDATE, TRANSFER, APPLY = 'dd_bind_options', 'dd_update_options', 'dd_transfer_options', 'dd_apply_options'
# Of an update: settings of single methods.
REFINEMENT, NORMAL = 'dd_refinement_options', 'dd_normal_options'
VOLUMES, EXAMPLES = 'dd_volumes_options', 'dd_examples_options'
OF_UPDATE = (UPDATE, REFINEMENT, NORMAL, VOLUMES, EXAMPLES)


class Need(NamedTuple):
    """A condition of an option: it has an effect only while the setting `name` has one of `values`."""
    name: str
    values: tuple
    why_not: str = ""  # shown where the condition fails, the option greyed; '': it is hidden
    methods: tuple = ()  # the methods for which the condition applies; (): all


class Field(NamedTuple):
    """What a setting fills of the C library's structs."""
    struct: str
    name: str
    kind: Any  # int, float, or the name of an enum
    value: Callable = lambda value: value  # function from the setting's value to the field's


@dataclasses.dataclass(frozen=True)
class Option:
    name: str  # in Blender's properties
    kind: Any  # bool, int, float, str, or (name, title, tooltip) of each value of an enum
    title: str
    tooltip: str
    default: Any = None  # None: false, nothing, or the enum's first
    limits: dict = dataclasses.field(default_factory=dict)  # min, max and so on, as bpy.props has them
    fills: Field | None = None
    needs: tuple = ()
    off: Any = None  # passed while a need is unmet; None: the field isn't passed then
    section: str = ""  # of the panels; '': no row, or one of its own
    compared: tuple = ()  # values that the enum's menu lists last, under the heading For Comparison (declared.py)
    expand: bool = False  # as buttons side by side
    search: str = ""  # of the object: collection that a name is chosen from
    copied: bool = True  # by Copy Settings
    argument_tooltip: str = ""  # tooltip of the operator's argument, if it differs

    @property
    def struct(self):
        return self.fills.struct if self.fills else ""

    @property
    def keyword(self):
        """The keyword of native.Bind or of an update: the field's name, or for a method's struct the option's own."""
        return self.fills.name if self.fills.struct in (BIND, UPDATE) else self.name

    @property
    def as_argument(self):
        """As the operator has it."""
        return dataclasses.replace(self, tooltip=self.argument_tooltip or self.tooltip)


# Values of enums. The order is that of the C library's numbers where it knows them.

METHODS = (
    ('TRANSFER', "Detail Transfer",
     "A smooth base surface bends, and details turn with it. The best choice nearly always"),
    ('VARIATIONAL', "Smooth Displacement",
     "The smoothest way to follow the handles: details are moved but not turned, so they shear"),
    ('NORMAL', "Normal Displacement",
     "A smooth base surface bends, and details stand on it along its normals: fails where they overhang, "
     "and self-intersects in tight bends"),
    ('GRADIENT', "Gradient Editing",
     "The handles' rotation and scale spread over the surface; a handle that is only moved turns nothing"),
    ('VOLUMES', "Displacement Volumes",
     "The space between the smooth base and the surface keeps its volume: bulges where it is pressed "
     "together. Slow: while you drag, Detail Transfer is shown, and the result comes when you pause"),
    ('EXAMPLES', "Examples",
     "Poses by example: the handles pull the mesh between shape keys or posed copies of it, and what turns "
     "there turns along an arc. It bends as the examples do, not as a base surface"))
# Methods that are here beside Detail Transfer because the paper compares it with them.
COMPARED_METHODS = ('VARIATIONAL', 'NORMAL', 'GRADIENT', 'VOLUMES')
OUTPUTS = (
    ('RESULT', "Result", "The deformed surface"),
    ('BASE', "Smooth Preview", "The smooth base surface in its place, to see where it bulges"))
METRICS = (
    ('SURFACE', "Surface",
     "Stiffness is measured on the surface itself: exact when all handles move together, fast to bind"),
    ('BASE', "Base Surface",
     "Stiffness is measured on the smooth base surface, as in the paper: better under thorns that overhang, "
     "worse where the base has tiny triangles"))
FORMULATIONS = (
    ('SURFACE', "Surface", "The paper's: fast, and its large bends can be improved"),
    ('FOURTH_POINTS', "Fourth Points",
     "As in the original deformation transfer, with a point beside each face, but weighted by volumes: slower"),
    ('FOURTH_POINTS_UNWEIGHTED', "Fourth Points, Unweighted",
     "The original deformation transfer as it was: small faces count as much as large ones"))
PAIRS_OF = (
    ('TRIANGLES', "Triangles", "Numbers of triangles; those of faces where all of them are triangles"),
    ('VERTICES', "Vertices", "Numbers of vertices"))
NEAREST = 'NEAREST'  # also a value of the library's dd_pairs_of, which then finds the pairs itself
ANCHORS = (
    ('SOURCE', "With Source", "Every loose part moves along with what it corresponds to"),
    ('CENTROID', "Centre", "The centre of the mesh stays in place"),
    ('VERTICES', "Group's Mean", "The vertices of the anchor group stay in place on average"),
    ('PINNED', "Pinned Group", "Each vertex of the anchor group stays in place"))
PLACINGS = (
    ('VERTICES', "As the Source",
     "What has a shape like the source's goes where the source goes, and lids and lips that close there close here. "
     "By Nearest, what lies close keeps its place there"),
    ('COMPONENTS', "By Turns Alone",
     "Each loose part goes along as a whole; within it turns and stretches alone decide. Two to four times as fast"),
    ('PARTS', "Rigid Parts", "Each loose part keeps its shape, as buttons, armour and glasses do"),
    ('DISPLACEMENTS', "Displacements",
     "Each vertex goes as far as the source does there and the same way: for shape keys of heads that belong to one "
     "family. Poses that turn limbs are better carried over by As the Source"))
LOOSE_PARTS = (
    ('AUTO', "Ride Along", "Small ones keep their shape, as plates, horns and eyes do; large ones, as clothes, bend"),
    ('RIGID', "Ride Rigidly", "All keep their shape"),
    ('BEND', "Bend Along", "All bend with what is beneath them"),
    ('STAY', "Stay", "Nothing moves but what is connected with a handle"))
SHOWN_AS = (
    ('AUTO', "Automatic",
     "By a shape key where a modifier such as Multires wants the mesh itself, or else by the modifier"),
    ('MODIFIER', "Modifier", "By Detail Deform's modifier, where it stands in the stack"),
    ('SHAPE_KEY', "Shape Key",
     "By a shape key, before all modifiers, whose value is the factor: for exporters that know shape keys alone"))
BASE_DEFORMERS = (
    ('AUTOMATIC', "Automatic",
     "Linear where no handle turns by more than 135 degrees against another one or what is fixed, Motions from 180 "
     "degrees on, and a mean of both in between"),
    ('LINEAR', "Linear",
     "The smoothest way to follow the handles: stretches least, but gathers a twist in the middle, collapses "
     "towards half a turn and knows no more"),
    ('MOTIONS', "Motions",
     "The handles' rotations are blended: even twists and arcs of any number of turns, those of an empty's Euler "
     "rotation"))
HANDLE_TURNS = (
    ('TARGET', "As Empty", "The vertices turn and scale as the empty does"),
    ('FREE', "Freely",
     "The empty only places the vertices: they keep their shape and turn as the surface around them asks, about the "
     "place where the empty was bound. Pull a limb by its hand, and it follows with no twist of the wrist"))
# The index of each but the first is the order of the base energy, dd_smoothness, that it sets for a reach.
FALLOFFS = (
    ('MESH', "As the Mesh", "As the mesh's own Smoothness has it (Base Surface)"),
    ('SHARP', "Sharp", "To a point at the handle, and to a crease at the border: Smoothness 1"),
    ('SMOOTH', "Smooth", "Level at the handle and at the border: Smoothness 2"),
    ('SMOOTHER', "Smoother", "Farther level at both, and steeper between: Smoothness 3"))
FALLOFF_ORDERS = {name: order for order, (name, _, _) in enumerate(FALLOFFS)}
_BASES = (
    ('COMPUTED', "Computed",
     "The smooth base surface is computed from the region's border, and the handles move it"),
    ('OBJECT', "Object",
     "Another object is the base, a copy of this mesh or a cage or coarser mesh near it: whatever deforms it "
     "(armature, lattice, curve, shape keys, simulation) moves the details. Handles are not needed"))
_WEIGHTS_BY = (
    ('HANDLES', "Handles", "The weights are those that fit the handles best"),
    ('SLIDERS', "Sliders", "The weights are set by hand, and the handles let go"))
CORRESPONDENCES = (
    ('TOPOLOGY', "Same Topology", "Both meshes have the same vertices and faces in the same order"),
    ('MARKERS', "Shape and Markers",
     "Found by fitting the source to this mesh. Poses, remeshed copies and akin shapes need no markers; places that "
     "are marked on both meshes, by vertex groups or empties named Marker 1, Marker 2 and so on, fall on one another"),
    ('LIST', "List", "Pairs of triangles or vertices from a text file"),
    ('STORED', "Saved Match", "What was found or read before and is saved with this mesh"),
    (NEAREST, "Nearest",
     "Clothes, armour and other props: each face goes with what it lies over on the source, as both stand in the scene "
     "when Follow or Transfer is pressed, in their rest shapes"))


def enum_numbers(values):
    """{name: number} of an enum's values."""
    return {value[0]: number for number, value in enumerate(values)}


def _by(*methods, why_not=""):
    return Need('method', methods, why_not)


def _gradients(rotation_only):
    return 'ROTATIONS' if rotation_only else 'WHOLE'


def library_method(name):
    """The library's name of a method; scripts and files call the paper's TRANSFER."""
    return 'DETAIL' if name == 'TRANSFER' else name


_COMPUTED = Need('base', ('COMPUTED',))
_NO_SLIDERS = Need('weights_by', ('HANDLES',), methods=('EXAMPLES',))
_WITHOUT_REFINE = "It has no effect while Quality of large bends is 0."

# Of Object.detail_deform, by the panels' sections and in the order of their rows.
SETTINGS = (
    Option('method', METHODS, "Method",
           "How the surface follows its handles. Switching needs no new Bind",
           fills=Field(UPDATE, 'method', 'dd_method', library_method), section='METHOD', compared=COMPARED_METHODS),
    Option('rotation_only', bool, "Keep Detail Size",
           "Details only turn with the surface and keep their size. Off: they are stretched and sheared with it too",
           default=True, fills=Field(UPDATE, 'gradients', 'dd_gradients', _gradients), section='METHOD',
           needs=(_by('TRANSFER', 'GRADIENT'),)),
    Option('refine', int, "Quality of large bends",
           "Passes that take out stretch and shrinking where the surface bends far, by Examples where it goes beyond "
           "them. Each takes about as long as an update without. 0: none, the paper's result",
           default=4, limits=dict(min=0, soft_max=16, max=1000), fills=Field(REFINEMENT, 'iterations', int),
           section='METHOD',
           needs=(_by('TRANSFER', 'EXAMPLES'), _NO_SLIDERS,
                  Need('base', ('COMPUTED',), "A base object is followed as it is, so no bend of it is improved."),
                  Need('rotation_only', (True,), "Large bends are improved only with Keep Detail Size: switch it on.",
                       methods=('TRANSFER',)),
                  Need('formulation', ('SURFACE',),
                       "Large bends are improved only by Formulation > Surface (For Comparison).",
                       methods=('TRANSFER',))),
           off=0),
    Option('rotation_smoothing', float, "Bend Length",
           "Length over which a bend is spread out, as a share of the size of the region (the square root of its "
           "area), so that the mesh's density doesn't matter. Short bends sharply, and a thick shape may fold; long is "
           "stiff",
           default=0.009, limits=dict(min=0.009, soft_max=0.05, max=1.0, precision=3, step=0.1),
           fills=Field(REFINEMENT, 'rotation_smoothing', float), section='METHOD',
           needs=(_by('TRANSFER', 'EXAMPLES'), _NO_SLIDERS, Need('base', ('COMPUTED',)),
                  Need('rotation_only', (True,), methods=('TRANSFER',)),
                  Need('formulation', ('SURFACE',), methods=('TRANSFER',)),
                  Need('refine', range(1, 1001), _WITHOUT_REFINE))),
    Option('solidity', float, "Solidity",
           "How far limbs keep their cross-sections, as if they were solid, where they are bent, led aside or twisted. "
           "0: the surface bends as a hollow skin. Sheets have no inside, so it changes nothing there",
           default=1.0, limits=dict(min=0.0, max=1.0, precision=2, step=5),
           fills=Field(REFINEMENT, 'solidity', float), section='METHOD',
           needs=(_by('TRANSFER', 'EXAMPLES'), _NO_SLIDERS,
                  Need('rotation_only', (True,), methods=('TRANSFER',)),
                  Need('formulation', ('SURFACE',), methods=('TRANSFER',)),
                  Need('steps', (1,), "In steps a surface bends as a hollow skin: set Steps to 1."),
                  Need('refine', range(1, 1001), _WITHOUT_REFINE)),
           off=0.0),
    Option('stiff_parts', str, "Stiff Parts",
           "Vertex group by whose weights parts bend less than the rest: with 1 they are rigid, as bone or armour, "
           "with 0.5 a hundred times as stiff as with 0. To make a joint that bends more, paint all but the joint. "
           "Takes effect at the next Bind",
           section='METHOD', search='vertex_groups', copied=False, needs=(_COMPUTED,)),
    Option('rim_smoothing', float, "Rim Smoothing",
           "Width of the band around handles and fixed parts in which the surface leaves them smoothly, without a "
           "crease or spike, as a share of the size of the region (the square root of its area). 0: the paper's result",
           default=0.05, limits=dict(min=0.0, soft_max=0.2, max=1.0, precision=3, step=1),
           fills=Field(REFINEMENT, 'rim_smoothing', float), section='METHOD',
           needs=(_by('TRANSFER', 'EXAMPLES'), _NO_SLIDERS,
                  Need('rotation_only', (True,), "Without Keep Detail Size there is no crease to smooth.",
                       methods=('TRANSFER',)),
                  Need('formulation', ('SURFACE',),
                       "Rims are smoothed only by Formulation > Surface (For Comparison).", methods=('TRANSFER',)),
                  Need('refine', range(1, 1001), _WITHOUT_REFINE, methods=('EXAMPLES',))),
           off=0.0),
    Option('levels', int, "Levels",
           "Surfaces between the detailed and the smooth one, each displaced from the next smoother one: shorter "
           "displacements, which intersect later",
           default=1, limits=dict(min=1, max=20, soft_max=5), fills=Field(NORMAL, 'levels', int), section='COMPARISON',
           needs=(_by('NORMAL'),)),
    Option('volume_tolerance', float, "Tolerance",
           "The search for the volumes ends when no vertex moves by more than this from one pass to the next, as a "
           "share of the details' mean height",
           default=0.01, limits=dict(min=1e-6, max=1.0, precision=4), fills=Field(VOLUMES, 'tolerance', float),
           section='COMPARISON', needs=(_by('VOLUMES'),)),
    Option('volume_iterations', int, "Iterations",
           "Passes after which the search for the volumes stops anyway",
           default=50, limits=dict(min=1, max=10000, soft_max=500), fills=Field(VOLUMES, 'iterations', int),
           section='COMPARISON', needs=(_by('VOLUMES'),)),
    Option('output', OUTPUTS, "Show", "What is seen of the deformation",
           fills=Field(UPDATE, 'output', 'dd_output'), section='METHOD'),

    Option('weights_by', _WEIGHTS_BY, "Weights by", "Where the weights of the examples come from",
           section='EXAMPLES', expand=True, copied=False, needs=(_by('EXAMPLES'),)),
    Option('example_stiffness', float, "Stiffness",
           "How much the mesh keeps to single examples and between rest and example, rather than to what fits the "
           "handles most closely by mixing and exaggerating them",
           default=1.0, limits=dict(min=0.0, soft_max=10.0, max=1e4),
           fills=Field(EXAMPLES, 'stiffness', float), section='EXAMPLES',
           needs=(_by('EXAMPLES'), Need('weights_by', ('HANDLES',)))),

    Option('base', _BASES, "Base", "Where the smooth base surface comes from. Takes effect at the next Bind",
           section='BASE', copied=False),
    Option('smoothness', int, "Smoothness",
           "What the smooth base surface keeps small. 1: its area; it meets its border with a crease and bulges least. "
           "2: its curvature; it continues the slope of its border. 3: the change of its curvature; it continues that "
           "too and bulges most. Takes effect at the next Bind",
           default=2, limits=dict(min=1, max=3), fills=Field(BIND, 'smoothness', 'dd_smoothness'), section='BASE',
           needs=(_COMPUTED,)),
    Option('base_metric', METRICS, "Measure On",
           "Where the stiffness of the base surface is measured. Takes effect at the next Bind",
           fills=Field(BIND, 'base_metric', 'dd_base_metric'), section='BASE', needs=(_COMPUTED,)),
    Option('metric_smoothing', float, "Smoothing",
           "Measure the stiffness on a slightly smoothed copy of the surface, in mean edge lengths: evens out the pull "
           "where the relief is strong. Takes effect at the next Bind",
           default=0.0, limits=dict(min=0.0, soft_max=4.0, max=6.0), fills=Field(BIND, 'metric_smoothing', float),
           section='BASE',
           needs=(_COMPUTED, Need('base_metric', ('SURFACE',), "It has no effect unless Measure On is Surface.")),
           off=0.0),
    Option('base_deformer', BASE_DEFORMERS, "Deformer", "How the handles move the computed base surface",
           fills=Field(UPDATE, 'base_deformer', 'dd_base_deformer'), section='BASE',
           needs=(_COMPUTED, _by('TRANSFER', 'NORMAL', 'VOLUMES'))),

    Option('steps', int, "Steps",
           "Split a large motion of the handles into so many steps, each on the surface that the last one left, as the "
           "paper does. Large turns need none: see Base Surface > Deformer. While you drag, one step is shown; the "
           "result in steps comes when you pause. Each step takes as long as a Bind",
           default=1, limits=dict(min=1, soft_max=24, max=1000), fills=Field(UPDATE, 'steps', int),
           section='COMPARISON',
           needs=(_by('TRANSFER', 'VARIATIONAL', 'NORMAL', 'GRADIENT', 'VOLUMES',
                      why_not="Examples are not approached in steps: add examples of the larger motion."),
                  Need('base', ('COMPUTED',), "The motion of a base object can't be split.")),
           off=1),
    Option('formulation', FORMULATIONS, "Formulation",
           "How the turn of the base is carried over to the details",
           fills=Field(UPDATE, 'formulation', 'dd_formulation'), section='COMPARISON',
           needs=(_by('TRANSFER', why_not="Only Detail Transfer has a Formulation."),)),

    Option('soft_border', float, "Soft Border",
           "Let the deformation fade towards the region's border, over this share of the way from there to the "
           "handles. 0: as the method leaves it, without a crease but close to the border. Needs no new Bind",
           default=0.0, limits=dict(min=0.0, max=1.0, precision=2, subtype='FACTOR')),
    Option('loose_parts', LOOSE_PARTS, "Loose Parts",
           "How parts without a handle go with the surface on which they lie or in which they stick. What is far from "
           "it, or larger, stays. Needs no new Bind"),
    Option('show_as', SHOWN_AS, "Show As",
           "What shows the deformation. Sculpted details of a Multires modifier turn with the surface by a shape key "
           "alone"),
    Option('auto_bind', bool, "Re-bind by Itself",
           "After an edit of the mesh, of handles or of settings, bind again with the present pose, where that takes "
           "less than half a second. In the window, while Live is on",
           default=True),
    Option('preview', bool, "Show Vertices",
           "Colour the vertices of the region and of the handles in the viewport, outside Edit Mode"),
    Option('live', bool, "Live", "Follow every move of the handles. Off: only when Update is pressed", default=True),
)

_WORN = (Need('correspondence', (NEAREST, 'STORED')), Need('rotation_only', (False,)), Need('placing', ('VERTICES',)))

# Of Object.detail_deform.transfer, and arguments of the operator that transfers.
TRANSFER_SETTINGS = (
    Option('correspondence', CORRESPONDENCES, "Match By",
           "How it is known which part of the source belongs to which of this mesh", section='CORRESPONDENCE',
           argument_tooltip="How it is known which part of the source belongs to which of this mesh; as in the panel "
                            "unless given"),
    Option('filepath', str, "List",
           "Text file with a pair of numbers a line, source then target, counted from 0",
           limits=dict(subtype='FILE_PATH'), section='CORRESPONDENCE', needs=(Need('correspondence', ('LIST',)),)),
    Option('pairs_of', PAIRS_OF, "Pairs of", "What the list's numbers count",
           fills=Field(TRANSFER, 'pairs_of', 'dd_pairs_of'), section='CORRESPONDENCE',
           needs=(Need('correspondence', ('LIST',)),)),
    Option('rotation_only', bool, "Keep Proportions",
           "This mesh only turns as the source does and keeps its proportions. Off: it is stretched with the source "
           "too",
           fills=Field(APPLY, 'gradients', 'dd_gradients', _gradients), section='TRANSFER',
           argument_tooltip="Only turn with the source, without its stretch; as in the panel unless given"),
    Option('placing', PLACINGS, "Places",
           "What decides where this mesh goes, beside how the source turns and stretches",
           fills=Field(TRANSFER, 'placing', 'dd_placing'), section='TRANSFER',
           needs=(Need('rotation_only', (False,)),), off='COMPONENTS',
           argument_tooltip="What decides where the mesh goes; as in the panel unless given"),
    Option('keep_outside', bool, "Keep Outside",
           "What is matched by Nearest doesn't go through the source, or not farther than it does at rest. What is "
           "mostly inside of it at rest stays inside",
           default=True, section='TRANSFER', needs=_WORN,
           argument_tooltip="What is matched by Nearest stays outside of the source; as in the panel unless given"),
    Option('gap', float, "Gap",
           "How far outside at least, as a share of this mesh's size, or three quarters as far as at rest where that "
           "is less",
           default=0.005, limits=dict(min=0.0, soft_max=0.1, max=10.0, precision=4, step=0.1),
           fills=Field(TRANSFER, 'gap', float), section='TRANSFER',
           needs=(*_WORN, Need('keep_outside', (True,))), off=-1.0,
           argument_tooltip="How far outside of the source it is kept at least, as a share of the mesh's size; as in "
                            "the panel unless given"),
    Option('anchor', ANCHORS, "Anchor", "What stays in place: how a mesh bends says nothing of where it is",
           fills=Field(TRANSFER, 'anchor', 'dd_anchor'), section='TRANSFER',
           argument_tooltip="What stays in place; as in the panel unless given"),
    Option('anchor_group', str, "Anchor Group", "Vertex group of this mesh that stays in place", section='TRANSFER',
           search='vertex_groups', needs=(Need('anchor', ('VERTICES', 'PINNED')),)),
    Option('formulation', FORMULATIONS, "Formulation",
           "How the deformation of the faces becomes that of the mesh",
           fills=Field(TRANSFER, 'formulation', 'dd_formulation'), section='COMPARISON',
           argument_tooltip="How the deformation of the faces becomes that of the mesh; as in the panel unless given"),
)


# The rows applied to an object's settings

def _unmet(option, settings):
    return [need for need in option.needs if getattr(settings, need.name) not in need.values
            and (not need.methods or settings.method in need.methods)]


def is_shown(option, settings):
    return all(need.why_not for need in _unmet(option, settings))


def why_not(option, settings):
    """Why a setting that is shown has no effect now: a sentence, or ''."""
    return next((need.why_not for need in _unmet(option, settings) if need.why_not), "")


def library_value(option, settings):
    """The value of the option's field in the library's struct. Where the setting has no effect now, it is option.off,
    so that a change of the setting makes no difference to the library; None: the field keeps its default."""
    return option.off if _unmet(option, settings) else option.fills.value(getattr(settings, option.name))


_OPTIONS_OF_CALL = {BIND: [option for option in SETTINGS if option.struct == BIND],
                    UPDATE: [option for option in SETTINGS if option.struct in OF_UPDATE],
                    TRANSFER: [option for option in TRANSFER_SETTINGS if option.struct == TRANSFER]}


def arguments_of(call, settings):
    """{keyword: value}: the arguments of a bind, an update or the preparation of a transfer, of the settings that have
    an effect now. call: BIND, UPDATE or TRANSFER. settings: an object with attributes of the settings' names."""
    values = {option.keyword: library_value(option, settings) for option in _OPTIONS_OF_CALL[call]}
    return {name: value for name, value in values.items() if value is not None}


def kind_of(struct, field):
    """int, float, or the name of an enum."""
    return next(option.fills.kind for option in SETTINGS + TRANSFER_SETTINGS
                if option.fills and option.fills[:2] == (struct, field))
