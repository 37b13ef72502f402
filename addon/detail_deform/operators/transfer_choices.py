# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties that the operators for transfer to one mesh and to many have in common."""

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty

from ..results import key_names, transfer
from .operator_base import PATH_OPTIONS, LongOperator

WHAT = (('POSE', "Current Pose", "What its modifiers and shape keys make of it now, as a shape key"),
        ('ACTIVE_KEY', "Active Shape Key", "Its active shape key, as one of the same name"),
        ('ALL_KEYS', "All Shape Keys", "Each of its shape keys, as one of the same name and range"),
        ('ANIMATION', "Animation",
         "A range of frames, as a cache that a Mesh Cache modifier plays, or as keyed shape keys"))


class TransferChoices(LongOperator):
    what: EnumProperty(
        name="What", default='POSE', description="What of the source's deformation is transferred", items=WHAT)
    pattern: StringProperty(
        name="Keys", default="*", options={'SKIP_SAVE'},
        description="Of all shape keys those whose names fit, such as mouth* (* stands for any letters)")
    replace: BoolProperty(
        name="Replace", default=False,
        description="Give shape keys of the same names that were not transferred before the new shape, too, instead of "
                    "adding others beside them")
    drivers: BoolProperty(
        name="Copy Drivers", default=False,
        description="Copy the drivers of the source's shape keys to the new ones. Where a key that was transferred "
                    "before has one, that stays")
    alike_names: BoolProperty(
        name="Alike Names", default=False,
        description="A key goes to one whose name differs in case, separators and the spelling of left and right "
                    "alone, as jawLeft, jaw_L and left.jaw do, if there is one. One that was not transferred before "
                    "gets another one beside it, unless Replace is on")
    names_file: StringProperty(
        name="Key Names", subtype='FILE_PATH', options=PATH_OPTIONS,
        description="Text file that says which key goes to a key of another name, one pair a line: the source's name, "
                    "a tab, a comma or ->, and the target's name")
    bake_as: EnumProperty(
        name="As", description="What an animation is kept as",
        items=[('CACHE', "Mesh Cache", "A point cache (PC2), played by a Mesh Cache modifier"),
               ('SHAPE_KEYS', "Shape Keys", "A keyed shape key for each frame: for few frames")])
    frame_start: IntProperty(name="First Frame", options={'SKIP_SAVE'}, description="That of the scene unless given")
    frame_end: IntProperty(name="Last Frame", options={'SKIP_SAVE'}, description="That of the scene unless given")

    def draw_choices(self, column):
        column.prop(self, 'what')
        if self.what == 'ALL_KEYS':
            column.prop(self, 'pattern')
        if self.what == 'ANIMATION':
            column.prop(self, 'bake_as')
            column.prop(self, 'frame_start')
            column.prop(self, 'frame_end')
        else:
            column.prop(self, 'replace')
        if self.what in {'ACTIVE_KEY', 'ALL_KEYS'}:
            column.prop(self, 'drivers')
            column.prop(self, 'alike_names')
            column.prop(self, 'names_file')

    def request(self, context, source, settings, **others):
        """The transfer.TransferRequest of these properties and the given other fields. Raises MeshProblem."""
        names = {}
        if self.names_file and self.what in {'ACTIVE_KEY', 'ALL_KEYS'}:
            names = key_names.read(bpy.path.abspath(self.names_file))
            self._tell_unknown(source, names)
        start, end = self.frame_range(context)
        return transfer.TransferRequest(
            what=self.what, settings=settings, pattern=self.pattern, replace=self.replace, drivers=self.drivers,
            names=names, alike_names=self.alike_names, bake_as=self.bake_as, start=start, end=end, **others)

    def _tell_unknown(self, source, names):
        keys = source.data.shape_keys
        unknown = [name for name in names if keys is None or name not in keys.key_blocks]
        if unknown:
            self.report({'INFO'}, f"Key Names has {len(unknown):,} names that '{source.name}' has no keys of, as "
                                  f"'{unknown[0]}'.")
