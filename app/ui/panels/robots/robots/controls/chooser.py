"""Factory of the input control for a parameter of an action."""

from __future__ import annotations

from collections.abc import Sequence

from app.robots.description.description import Parameter
from app.ui.panels.robots.robots.controls.base import ROW_HEIGHT, Control, connect, sentence_case
from app.ui.panels.robots.robots.controls.colour import colour_control
from app.ui.panels.robots.robots.controls.number import number_control
from app.ui.panels.robots.robots.controls.picture import EmptyImageSource, ImageSource, picture_control
from app.ui.panels.robots.robots.controls.text import text_control
from app.ui.panels.robots.robots.input_text import NUMBER_KINDS
from app.ui.text.sensor_values import yes_no_text
from app.ui.theme.theme import Theme
from app.ui.widgets import ComboBox, Segments, Switch

__all__ = [
    "NUMBER_KINDS", "ROW_HEIGHT", "Control", "EmptyImageSource", "ImageSource", "control_for",
    "sentence_case",
]  # fmt: skip

MAX_SEGMENTS = 4
MAX_SEGMENT_CHARS = 44


def control_for(
    theme: Theme, parameter: Parameter, options: Sequence[str] = (), pictures: ImageSource | None = None
) -> Control:
    """Create the input control for a parameter.

    Args:
        theme: Theme of the window.
        parameter: Parameter of an action.
        options: Values that the robot currently offers for the parameter.
        pictures: Source of images for image parameters.
    """
    if parameter.choices or options:
        return _choice_control(theme, parameter, options)
    if parameter.kind in NUMBER_KINDS:
        return number_control(theme, parameter)
    if parameter.kind == "boolean":
        return _switch_control(theme, parameter)
    if parameter.kind == "colour":
        return colour_control(theme, parameter)
    if parameter.kind == "image":
        return picture_control(theme, parameter, pictures if pictures is not None else EmptyImageSource())
    return text_control(theme, parameter)


def _choice_control(theme: Theme, parameter: Parameter, options: Sequence[str]) -> Control:
    pairs = [(str(choice.value), choice.title) for choice in parameter.choices] or [(o, o) for o in options]
    values: dict[str, object] = {str(choice.value): choice.value for choice in parameter.choices}
    control: Control
    if (
        len(pairs) <= MAX_SEGMENTS
        and sum(len(option_title) for _value, option_title in pairs) <= MAX_SEGMENT_CHARS
    ):
        segments = Segments(
            theme,
            [(value, sentence_case(title), None) for value, title in pairs],
            check=True,
            size="form",
            name=parameter.title,
            wraps=True,
        )
        control = Control(
            segments,
            lambda: _value_for_key(values, segments.value),
            lambda value: segments.set_value(str(value)),
            lambda callback: connect(segments.changed, callback),
        )
    else:
        combo = ComboBox(theme, pairs, name=parameter.title)
        control = Control(
            combo,
            lambda: _value_for_key(values, combo.value),
            lambda value: combo.set_value(str(value)),
            lambda callback: connect(combo.currentIndexChanged, callback),
        )
    if parameter.default is not None:
        control.show_value(parameter.default)
    return control


def _value_for_key(values: dict[str, object], key: str) -> object:
    # 0 is a valid value; "" means that there is none.
    return values.get(key, key) if key else None


def _switch_control(theme: Theme, parameter: Parameter) -> Control:
    switch = Switch(theme, yes_no_text(parameter.default is True), parameter.default is True)
    switch.setAccessibleName(parameter.title)
    switch.toggled.connect(lambda on: switch.setText(yes_no_text(on)))
    return Control(
        switch,
        switch.isChecked,
        lambda value: switch.setChecked(value is True),
        lambda callback: connect(switch.toggled, callback),
    )
