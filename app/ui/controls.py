"""The control for one typed parameter of an action: slider, segments, switch, swatches, field."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol

from PySide6.QtGui import QDoubleValidator
from PySide6.QtWidgets import QFileDialog, QHBoxLayout, QLineEdit, QWidget

from app.robots.description import Parameter
from app.ui.theme import Theme
from app.ui.widgets import Button, Choice, ColourSwatches, Segments, SliderWithUnit, Switch, label
from app.ui.widgets.menus import EditMenu

VALUE_WIDTH, ROW_HEIGHT = 104, 36
SEGMENTS_AT_MOST = 4
NUMBERS = frozenset({"number", "integer", "angle"})
PICTURES = "Pictures (*.png *.jpg *.jpeg *.gif *.bmp *.webp)"


class Control(Protocol):
    """What a form needs of one parameter's control."""

    widget: QWidget
    changed: Callable[[Callable[[], None]], None]

    def value(self) -> object:
        """The value as the robot wants it; None leaves it out."""

    def show_value(self, value: object) -> None:
        """Show a value; one that does not fit changes nothing."""


class _Made:
    """A control from functions."""

    def __init__(
        self,
        widget: QWidget,
        value: Callable[[], object],
        show: Callable[[object], None],
        changed: Callable[[Callable[[], None]], None],
    ) -> None:
        self.widget, self._value, self._show, self.changed = widget, value, show, changed

    def value(self) -> object:
        return self._value()

    def show_value(self, value: object) -> None:
        self._show(value)


def control_for(theme: Theme, parameter: Parameter, options: Sequence[str] = ()) -> Control:
    """The control of a parameter; ``options`` are the words that the robot offers for it now."""
    if parameter.choices or options:
        return _choice(theme, parameter, options)
    if parameter.kind in NUMBERS:
        return _number(theme, parameter)
    if parameter.kind == "boolean":
        return _switch(theme, parameter)
    if parameter.kind == "colour":
        return _colour(theme, parameter)
    if parameter.kind == "image":
        return _picture(theme, parameter)
    return _text(theme, parameter)


def _choice(theme: Theme, parameter: Parameter, options: Sequence[str]) -> Control:
    pairs = [(str(choice.value), choice.title) for choice in parameter.choices] or [(o, o) for o in options]
    values: dict[str, object] = {str(choice.value): choice.value for choice in parameter.choices}
    if len(pairs) <= SEGMENTS_AT_MOST:
        segments = Segments(
            theme,
            [(value, sentence_case(title), None) for value, title in pairs],
            check=True,
            size="form",
            name=parameter.title,
        )
        return _Made(
            segments,
            lambda: values.get(segments.value, segments.value) or None,
            lambda value: segments.set_value(str(value)),
            lambda tell: _connect(segments.changed, tell),
        )
    combo = Choice(theme, pairs, name=parameter.title)
    return _Made(
        combo,
        lambda: values.get(combo.value, combo.value) or None,
        lambda value: combo.set_value(str(value)),
        lambda tell: _connect(combo.currentIndexChanged, tell),
    )


def _number(theme: Theme, parameter: Parameter) -> Control:
    whole = parameter.kind == "integer"
    low, high = parameter.minimum, parameter.maximum
    if low is None or high is None or high <= low:
        return _open_number(theme, parameter, whole=whole)
    default = parameter.default if isinstance(parameter.default, (int, float)) else None
    slider = SliderWithUnit(
        theme,
        low,
        high,
        step=parameter.step or (1 if whole or high - low > 20 else _fine_step(high - low)),
        value=default,
        default=default,
        unit=parameter.unit or "",
        name=parameter.title,
    )

    def value() -> object:
        return round(slider.value) if whole else float(slider.value)

    def show(given: object) -> None:
        if isinstance(given, (int, float)) and not isinstance(given, bool) and low <= given <= high:
            slider.set_value(float(given))

    return _Made(slider, value, show, lambda tell: _connect(slider.changed, tell))


def _open_number(theme: Theme, parameter: Parameter, *, whole: bool) -> Control:
    """A number without limits: a field of its own; what can't be read is left as it was typed."""
    field = _field(theme, parameter)
    field.setFixedWidth(VALUE_WIDTH)
    if not whole:
        field.setValidator(QDoubleValidator(field))

    def value() -> object:
        text = field.text().strip().replace(",", ".")
        if not text:
            return None
        try:
            return int(text) if whole else float(text)
        except ValueError:
            return text  # the check of the action says what is wrong with it

    row = QWidget()
    inner = QHBoxLayout(row)
    inner.setContentsMargins(0, 0, 0, 0)
    inner.addWidget(field)
    if parameter.unit:
        inner.addWidget(label(parameter.unit, "bodyLarge", role="textTertiary"))
    inner.addStretch(1)
    shown = _Made(
        row,
        value,
        lambda given: field.setText("" if given is None else f"{given}"),
        lambda tell: _connect(field.textChanged, tell),
    )
    shown.show_value(parameter.default)
    return shown


def _switch(theme: Theme, parameter: Parameter) -> Control:
    switch = Switch(theme, "yes" if parameter.default is True else "no", parameter.default is True)
    switch.setAccessibleName(parameter.title)
    switch.toggled.connect(lambda on: switch.setText("yes" if on else "no"))
    return _Made(
        switch,
        switch.isChecked,
        lambda value: switch.setChecked(value is True),
        lambda tell: _connect(switch.toggled, tell),
    )


def _colour(theme: Theme, parameter: Parameter) -> Control:
    start = parameter.default if isinstance(parameter.default, str) else "#ffffff"
    swatches = ColourSwatches(theme, start, name=parameter.title)
    return _Made(
        swatches,
        lambda: swatches.value,
        lambda value: swatches.set_value(str(value)),
        lambda tell: _connect(swatches.changed, tell),
    )


def _picture(theme: Theme, parameter: Parameter) -> Control:
    field = _field(theme, parameter)
    field.setPlaceholderText("A file or an address")
    choose = Button(theme, "Choose", "folder-open", size="form")
    choose.setAccessibleName(f"Choose a file for {parameter.title}")
    row = QWidget()
    inner = QHBoxLayout(row)
    inner.setContentsMargins(0, 0, 0, 0)
    inner.addWidget(field, 1)
    inner.addWidget(choose)

    def ask() -> None:
        path, _ = QFileDialog.getOpenFileName(row, "Choose a picture", "", PICTURES)
        if path:
            field.setText(Path(path).as_uri())

    choose.clicked.connect(ask)
    return _Made(
        row,
        lambda: field.text().strip() or None,
        lambda value: field.setText("" if value is None else str(value)),
        lambda tell: _connect(field.textChanged, tell),
    )


def _text(theme: Theme, parameter: Parameter) -> Control:
    field = _field(theme, parameter)
    many = parameter.kind == "list"
    if many:
        field.setPlaceholderText("Words with commas between them")

    def value() -> object:
        if many:
            return [part.strip() for part in field.text().split(",") if part.strip()]
        return field.text() if field.text() or parameter.required else None

    def show(given: object) -> None:
        if isinstance(given, (list, tuple)):
            field.setText(", ".join(str(part) for part in given))
        else:
            field.setText("" if given is None else str(given))

    made = _Made(field, value, show, lambda tell: _connect(field.textChanged, tell))
    made.show_value(parameter.default)
    return made


def _field(theme: Theme, parameter: Parameter) -> QLineEdit:
    field = QLineEdit()
    EditMenu(theme, field)
    field.setAccessibleName(parameter.title)
    field.setMinimumHeight(ROW_HEIGHT - 2)
    if parameter.max_length is not None:
        field.setMaxLength(parameter.max_length)
    return field


def _connect(signal: object, tell: Callable[[], None]) -> None:
    signal.connect(lambda *_values: tell())  # type: ignore[attr-defined]  # any Qt signal


def _fine_step(span: float) -> float:
    return 0.01 if span <= 2 else 0.1


def sentence_case(words: str) -> str:
    """The words with a capital at their beginning."""
    return words[:1].upper() + words[1:]
