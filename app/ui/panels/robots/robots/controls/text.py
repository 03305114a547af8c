"""Input controls for texts, lists and objects."""

from __future__ import annotations

from collections.abc import Mapping

from app.robots.description.description import Parameter
from app.robots.description.inputs import format_for_editing, parse_value
from app.ui.panels.robots.robots.controls.base import Control, connect, line_field
from app.ui.theme.theme import Theme
from app.ui.widgets.inputs.fields import LongTextField
from nep.i18n import _

MIN_MULTILINE_LENGTH = 200
"""Maximum length of a parameter from which its field has several lines."""


def text_control(theme: Theme, parameter: Parameter) -> Control:
    """Create the input control for a text, list or object.

    The items of a list are separated by commas. Objects, and lists of lists or objects, are typed as JSON.
    """
    if parameter.kind in ("list", "object"):
        return _list_control(theme, parameter)
    if (parameter.max_length or 0) >= MIN_MULTILINE_LENGTH or parameter.widget == "multiline":
        return _multiline_control(theme, parameter)
    field = line_field(theme, parameter)
    control = Control(
        field,
        lambda: _text_or_none(parameter, field.text()),
        lambda given: field.setText(_field_text(given)),
        lambda callback: connect(field.textChanged, callback),
        finished=lambda callback: connect(field.editingFinished, callback),
    )
    control.show_value(parameter.default)
    return control


def _multiline_control(theme: Theme, parameter: Parameter) -> Control:
    field = LongTextField(theme, parameter.title)
    control = Control(
        field,
        lambda: _text_or_none(parameter, field.text()),
        lambda given: field.set_text(_field_text(given)),
        lambda callback: connect(field.changed, callback),
        finished=lambda callback: connect(field.finished, callback),
    )
    control.show_value(parameter.default)
    return control


def _list_control(theme: Theme, parameter: Parameter) -> Control:
    field = line_field(theme, parameter)
    field.setPlaceholderText(_placeholder(parameter))

    def value() -> object:
        text = field.text().strip()
        if not text and not parameter.is_required and (parameter.is_nullable or parameter.kind == "object"):
            return None
        return parse_value(parameter, text)

    control = Control(
        field,
        value,
        lambda given: field.setText(_field_text(given)),
        lambda callback: connect(field.textChanged, callback),
        finished=lambda callback: connect(field.editingFinished, callback),
    )
    control.show_value(parameter.default)
    return control


def _text_or_none(parameter: Parameter, text: str) -> str | None:
    # Empty text omits an optional parameter; validation reports a missing required one.
    return text if text or parameter.is_required else None


def _placeholder(parameter: Parameter) -> str:
    if parameter.kind == "object":
        names = ", ".join(f'"{field.name}": …' for field in parameter.fields) or '"name": …'
        return f"{{{names}}}"
    items = [parameter.item] if parameter.item is not None else list(parameter.prefix_items)
    if any(each.kind in ("list", "object") for each in items):
        return "[…, …]"
    if parameter.prefix_items:
        return ", ".join(each.kind for each in parameter.prefix_items)
    is_number = parameter.item is not None and parameter.item.kind in ("number", "integer", "angle")
    return _("Numbers separated by commas") if is_number else _("Words separated by commas")


def _field_text(value: object) -> str:
    if isinstance(value, (list, tuple, Mapping)):
        return format_for_editing(value)
    return "" if value is None else str(value)
