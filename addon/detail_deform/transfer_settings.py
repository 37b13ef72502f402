# SPDX-License-Identifier: GPL-3.0-or-later
"""Object.detail_deform.transfer: from where and how deformations are carried over to this mesh."""

import bpy
from bpy.props import BoolProperty, EnumProperty, PointerProperty, StringProperty

from .follow import life, live_transfer
from .ui import preview

CORRESPONDENCES = [
    ('TOPOLOGY', "Same Topology", "Both meshes have the same vertices and faces in the same order"),
    ('MARKERS', "Markers", "A few places are marked on both meshes, by vertex groups or empties named Marker 1, Marker "
                           "2 and so on; the rest is found by fitting the source to this mesh"),
    ('LIST', "List", "Pairs of triangles or vertices from a text file"),
    ('STORED', "Kept", "What was found or read before and is kept with this mesh")]
PAIRS_OF = [
    ('TRIANGLES', "Triangles", "Numbers of triangles; those of faces where all of them are triangles"),
    ('VERTICES', "Vertices", "Numbers of vertices")]
FORMULATIONS = [
    ('SURFACE', "Surface", "One unknown a vertex: the paper's, fast, and refined"),
    ('FOURTH_POINTS', "Fourth Points",
     "One unknown a vertex and a face, as in the original deformation transfer, weighted by volumes: to compare with"),
    ('FOURTH_POINTS_UNWEIGHTED', "Fourth Points, Unweighted",
     "The original deformation transfer as it was: small faces count as much as large ones")]
ANCHORS = [
    ('SOURCE', "With Source", "Every loose part moves along with what it corresponds to"),
    ('CENTROID', "Centre", "The centre of the mesh stays in place"),
    ('VERTICES', "Group's Mean", "The vertices of the anchor group stay in place on average"),
    ('PINNED', "Pinned Group", "Each vertex of the anchor group stays in place")]


def _source_changed(self, context):
    live_transfer.source_changed(self.id_data)
    _changed(self, context)


def _changed(self, context):
    life.check(self.id_data)
    life.refresh(self.id_data, context.evaluated_depsgraph_get())


def _preview_changed(self, context):
    preview.forget()


class DetailDeformTransfer(bpy.types.PropertyGroup):
    source: PointerProperty(
        name="Source", type=bpy.types.Object, update=_source_changed,
        poll=lambda self, ob: ob.type == 'MESH' and ob != self.id_data,
        description="Mesh object whose deformation is carried over to this one. "
                    "Its mesh without shape keys and modifiers is the rest")
    correspondence: EnumProperty(
        name="Correspondence", items=CORRESPONDENCES, update=_changed,
        description="How it is known which part of the source belongs to which of this mesh")
    filepath: StringProperty(
        name="List", subtype='FILE_PATH',
        description="Text file with a pair of numbers a line, source then target, counted from 0")
    pairs_of: EnumProperty(name="Pairs of", items=PAIRS_OF, description="What the list's numbers count")
    rotation_only: BoolProperty(
        name="Rotation Only", update=_changed,
        description="This mesh only turns as the source does and keeps its proportions. Off: "
                    "it is stretched with the source too")
    anchor: EnumProperty(
        name="Anchor", items=ANCHORS, update=_changed,
        description="What stays in place: how a mesh bends says nothing of where it is")
    anchor_group: StringProperty(
        name="Anchor Group", update=_changed, description="Vertex group of this mesh that stays in place")
    formulation: EnumProperty(
        name="Formulation", items=FORMULATIONS, update=_changed,
        description="Which system turns the deformation of faces into that of the mesh")
    show_markers: BoolProperty(
        name="Show Markers", default=True,
        description="Number the markers of this mesh and of the source in the viewport while this mesh is active: "
                    "yellow where both have the number, red where one has")
    show_match: BoolProperty(
        name="Show Match", update=_preview_changed,
        description="Colour the vertices by how well they are matched: green where the fitted source lies on this "
                    "mesh, red where it doesn't")
    state: StringProperty(
        name="State", get=lambda self: live_transfer.state(self.id_data),
        description="Whom this mesh follows, or what is wrong and what to do")
    live: BoolProperty(options={'HIDDEN'})
    prepared_for: StringProperty(options={'HIDDEN'})
    problem: StringProperty(options={'HIDDEN'})


register, unregister = bpy.utils.register_classes_factory((DetailDeformTransfer,))
