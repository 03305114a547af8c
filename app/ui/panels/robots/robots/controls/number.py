"""Input controls for numbers: a slider with a field, only a field, or a dial for angles."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QVBoxLayout, QWidget

from app.robots.description.description import Parameter
from app.robots.description.typed_number import parse_number
from app.ui.panels.robots.robots.controls.angle import AngleDial
from app.ui.panels.robots.robots.controls.base import VALUE_WIDTH, Callback, Control, connect
from app.ui.theme.theme import Theme
from app.ui.widgets import NumberEdit, SliderWithUnit, label
from app.ui.widgets.flow_layout import Flow
from app.ui.widgets.inputs.slider import decimals_of
from app.ui.widgets.keyboard import has_no_modifiers
from nep.i18n import number as number_text

MIN_COARSE_SPAN = 20
VERTICAL_KEYWORDS = ("pitch", "tilt", "down", "up", "nod")
PAGE_STEPS = 10


def number_control(theme: Theme, parameter: Parameter) -> Control:
    """Create the input control for a number, integer or angle."""
    low, high = parameter.minimum, parameter.maximum
    if low is None or high is None or high <= low:
        return _unbounded_number_control(theme, parameter)
    slider = SliderWithUnit(
        theme,
        low,
        high,
        step=step_of(parameter),
        value=_float_or_none(parameter.default),
        default=_float_or_none(parameter.default),
        unit=parameter.unit or "",
        name=parameter.title,
    )
    dial = _make_dial(theme, parameter, slider) if parameter.kind == "angle" else None

    def show(given: object) -> None:
        number = _float_or_none(given)
        if number is not None and low <= number <= high:
            slider.set_value(number)
            if dial is not None:
                dial.set_value(number)

    def changed(callback: Callback) -> None:
        connect(slider.changed, callback)
        connect(slider.field.textEdited, callback)

    return Control(
        slider if dial is None else _make_dial_row(dial, slider, parameter.title),
        lambda: _slider_value(slider, parameter),
        show,
        changed,
        finished=lambda callback: connect(slider.field.editingFinished, callback),
        error_text=lambda: slider.field.problem,
    )


def _slider_value(slider: SliderWithUnit, parameter: Parameter) -> object:
    # Returns the typed text if it differs from the slider's value, even if it is invalid.
    is_integer = parameter.kind == "integer"
    typed = slider.field.text()
    if typed != slider.field.format_number(slider.value):
        return parse_typed(typed, as_int=is_integer)
    return round(slider.value) if is_integer else float(slider.value)


def step_of(parameter: Parameter) -> float:
    """Return the step of a parameter: from its description, or derived from its range."""
    if parameter.step is not None and parameter.step > 0:
        return parameter.step
    span = (parameter.maximum or 0.0) - (parameter.minimum or 0.0)
    if parameter.kind == "integer" or span > MIN_COARSE_SPAN or span <= 0:
        return 1.0
    return 0.01 if span <= 2 else 0.1


def parse_typed(typed: str, *, as_int: bool) -> object:
    """Parse a typed number.

    Args:
        typed: Text of the field.
        as_int: True to return whole numbers as int.

    Returns:
        The number; None for empty text, and the text itself if it is not a number.
    """
    if not typed.strip():
        return None
    try:
        number = parse_number(typed)
    except ValueError:
        return typed  # the action's validation explains the error
    return int(number) if as_int and number.is_integer() else number


def _make_dial(theme: Theme, parameter: Parameter, slider: SliderWithUnit) -> AngleDial:
    tokens = f"{parameter.name} {parameter.title}".casefold().split()
    dial = AngleDial(
        theme,
        parameter.minimum or 0.0,
        parameter.maximum or 0.0,
        step=step_of(parameter),
        value=slider.value,
        default=_float_or_none(parameter.default),
        name=parameter.title,
        upright=any(keyword in tokens for keyword in VERTICAL_KEYWORDS),
    )

    def on_dial_changed(value: float) -> None:
        slider.set_value(value)
        slider.changed.emit(value)

    dial.changed.connect(on_dial_changed)
    slider.changed.connect(dial.set_value)
    return dial


def _make_dial_row(dial: AngleDial, slider: SliderWithUnit, name: str) -> QWidget:
    row = QWidget()
    row.setAccessibleName(name)
    inner = Flow(row)
    inner.addWidget(dial)
    inner.add_elastic(slider, is_greedy=True)
    return row


class UnboundedNumberEdit(NumberEdit):
    """Number field for a parameter that lacks a minimum or maximum; it may be empty.

    Arrow keys change the number by one step, Page Up and Page Down by ten steps. The
    result is clamped to the limit that exists.
    """

    def __init__(self, theme: Theme, parameter: Parameter) -> None:
        self._parameter = parameter
        self._by = step_of(parameter)
        super().__init__(
            theme, parameter.minimum, parameter.maximum, parameter.unit or "", decimals_of(self._by)
        )
        self.setAccessibleName(parameter.title)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        steps = {
            Qt.Key.Key_Up: 1,
            Qt.Key.Key_Down: -1,
            Qt.Key.Key_PageUp: PAGE_STEPS,
            Qt.Key.Key_PageDown: -PAGE_STEPS,
        }.get(Qt.Key(event.key()))
        current = parse_typed(self.text() or "0", as_int=False)
        if steps is None or not has_no_modifiers(event) or not isinstance(current, (int, float)):
            super().keyPressEvent(event)
            return
        low, high = self._parameter.minimum, self._parameter.maximum
        target = current + steps * self._by
        target = max(target, low) if low is not None else target
        self.show_number(min(target, high) if high is not None else target)
        self.textEdited.emit(self.text())

    def _parse_text(self) -> None:
        if self.text().strip():
            super()._parse_text()
        else:
            self._set_problem("")


def _unbounded_number_control(theme: Theme, parameter: Parameter) -> Control:
    field = UnboundedNumberEdit(theme, parameter)
    field.setMinimumWidth(VALUE_WIDTH)
    field.setMaximumWidth(2 * VALUE_WIDTH)
    error_label = label("", "small", role="error", wrap=True)
    error_label.hide()
    field.problem_changed.connect(error_label.setText)
    field.problem_changed.connect(lambda message: error_label.setVisible(bool(message)))
    column = QWidget()
    column.setAccessibleName(parameter.title)
    inner = QVBoxLayout(column)
    inner.setContentsMargins(0, 0, 0, 0)
    inner.setSpacing(4)
    inner.addWidget(field, 0, Qt.AlignmentFlag.AlignLeft)
    inner.addWidget(error_label)

    def show(given: object) -> None:
        number = _float_or_none(given)
        if number is None:
            field.setText("" if given is None else f"{given}")
        else:
            field.setText(number_text(number))

    show(parameter.default)
    return Control(
        column,
        lambda: parse_typed(field.text(), as_int=parameter.kind == "integer"),
        show,
        lambda callback: connect(field.textChanged, callback),
        finished=lambda callback: connect(field.editingFinished, callback),
        error_text=lambda: field.problem,
    )


def _float_or_none(value: object) -> float | None:
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return float(value) if is_number else None  # type: ignore[arg-type]
