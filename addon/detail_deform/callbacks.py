# SPDX-License-Identifier: GPL-3.0-or-later
"""What follows from a change of a property of Object.detail_deform: its update callbacks, called by Blender with the
struct that has the property and the context."""

from .follow import binding, lifecycle, status
from .scene import handle_curves, outside_base
from .ui import preview


def content_changed(self, context):
    lifecycle.compare(self.id_data)


def region_changed(self, context):
    self.pulled_region = False
    lifecycle.compare(self.id_data)


def name_changed(self, context):
    """Makes the name unique, and renames the handle in those that mirror it."""
    others = [h for h in self.id_data.detail_deform.handles if h != self]
    taken = {h.name for h in others}
    if self.name in taken:
        self.name = next(name for name in (f"{self.name}.{k:03d}" for k in range(1, 10000)) if name not in taken)
        return  # the assignment has called this function again
    earlier, self.earlier_name = self.earlier_name, self.name
    for handle in others:
        if earlier and handle.mirrors == earlier:
            handle.mirrors = self.name


def target_changed(self, context):
    if self.id_data.detail_deform.signature and (handle_curves.is_new(self) or self.rest_curve):
        lifecycle.compare(self.id_data)  # what it moves in pieces may be another
    binding.targets_changed(self.id_data)


def base_object_changed(self, context):
    if self.base_object != self.base_rest_of:
        outside_base.forget_rest(self)  # it belongs to the former base object
    self.base_rest_of = self.base_object
    base_changed(self, context)


def base_changed(self, context):
    lifecycle.compare(self.id_data)
    binding.targets_changed(self.id_data)


def preview_changed(self, context):
    preview.forget()


def influence_changed(self, context):
    binding.influence_changed(self.id_data)
    display_changed(self, context)


def display_changed(self, context):
    lifecycle.settle_channel(self.id_data, context.evaluated_depsgraph_get())


def method_changed(self, context):
    lifecycle.compare(self.id_data)  # examples are content of one method only
    result_changed(self, context)


def result_changed(self, context):
    lifecycle.refresh(self.id_data, context.evaluated_depsgraph_get())


def example_changed(self, context):
    lifecycle.compare(self.id_data)
    result_changed(self, context)


def weights_by_changed(self, context):
    """Sets the sliders to the weights that the handles asked for, so that the pose is kept."""
    if self.weights_by == 'SLIDERS' and status.weights_are_found(self.id_data):
        found = [(example, example.found_weight) for example in self.examples if example.enabled]
        for example, weight in found:
            example.weight = weight
    result_changed(self, context)
