"""Blender's properties and layout, made from the table of the panel's fields."""

from __future__ import annotations

from typing import Any

from boltpose.blender.api import bpy
from boltpose.blender.fields import PANEL_FIELDS, Kind, PanelField


def panel_properties() -> dict[str, Any]:
    """Annotations that give an operator one property per field."""
    return {field.name: _property(field) for field in PANEL_FIELDS}


def _property(field: PanelField) -> Any:
    """The property of one field."""
    words: dict[str, Any] = {
        "name": field.label,
        "description": field.description,
        "default": field.default(),
    }
    if field.limits is not None:
        words["min"], words["max"] = field.limits
    props = bpy.props
    if field.kind is Kind.FLOAT:
        return props.FloatProperty(**words, precision=2, step=50)
    if field.kind is Kind.INT:
        words |= {key: int(words[key]) for key in ("min", "max") if key in words}
        return props.IntProperty(**words)
    if field.kind is Kind.BOOL:
        return props.BoolProperty(**words)
    if field.kind is Kind.FILE:
        return props.StringProperty(**words, subtype="FILE_PATH")
    items = [(name, name.replace("_", " ").capitalize(), "") for name in field.choices]
    return props.EnumProperty(**words, items=items)


def draw_fields(layout: Any, operator: Any) -> None:
    """Lay out an operator's fields for the redo panel."""
    layout.use_property_split = True
    for field in PANEL_FIELDS:
        row = layout.row()
        if field.is_dimension:
            row.enabled = operator.by_hand
        if field.shown_if is not None:
            row.enabled = row.enabled and getattr(operator, field.shown_if)
        row.prop(operator, field.name)
