# SPDX-License-Identifier: GPL-3.0-or-later
"""Building blocks of the panels."""

import textwrap

from ..library import options


class ToggleListMixin:
    """Mixin of lists whose items have a check box for enabled."""

    def draw_item(self, context, layout, data, item, icon, active_data, active_propname, index=0):
        row = layout.row()
        row.use_property_split = False
        content = row.row()
        content.active = item.enabled
        self.draw_content(content, data, item)
        row.prop(item, 'enabled', text="", emboss=False,
                 icon='CHECKBOX_HLT' if item.enabled else 'CHECKBOX_DEHLT')


def draw_text(layout, context, text, icon):
    """Draws a text, wrapped to the panel's width, as labels don't wrap."""
    scale = context.preferences.system.ui_scale
    beside = 30 if context.region.type == 'UI' else 0  # width of the tabs
    width = max(20, int((context.region.width / scale - beside) / 7) - 6)
    column = layout.column(align=True)
    column.scale_y = 0.8
    for number, line in enumerate(textwrap.wrap(text, width)):
        column.label(text=line, icon=icon if number == 0 else 'BLANK1')


class ModifierPanel:
    bl_space_type = 'PROPERTIES'
    bl_region_type = 'WINDOW'
    bl_context = 'modifier'

    @classmethod
    def poll(cls, context):
        return context.object is not None and context.object.type == 'MESH'

    def draw(self, context):
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        self.draw_settings(context, self.layout, context.object, context.object.detail_deform)


def draw_options(layout, context, settings, section, table=options.SETTINGS):
    """Draws the rows of a section. A setting that has no effect now is greyed, and the reason stands below it."""
    for option in table:
        if option.section == section and options.is_shown(option, settings):
            _draw_option(layout, context, settings, option, options.why_not(option, settings))


def _draw_option(layout, context, settings, option, why_not):
    row = layout.row() if option.expand else layout.column()
    row.active = not why_not
    if option.search:
        row.prop_search(settings, option.name, settings.id_data, option.search)
    else:
        row.prop(settings, option.name, expand=option.expand)
    if why_not:
        draw_text(row, context, why_not, 'INFO')
