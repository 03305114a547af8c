"""Input controls for a colour: named swatches, a hue strip, and a field for a hex code."""

from __future__ import annotations

import re
from collections.abc import Sequence

from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QKeyEvent, QLinearGradient, QMouseEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QVBoxLayout, QWidget

from app.robots.description.description import Parameter
from app.ui.panels.robots.robots.controls.base import Control, connect, line_field
from app.ui.text import plain
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, label, paint
from app.ui.widgets.buttons import PaintedButton
from app.ui.widgets.flow_layout import Flow
from app.ui.widgets.inputs.frame import set_invalid
from nep.i18n import _, lazy

_HEX_PATTERN = re.compile(r"#?([0-9a-fA-F]{6})")
# Colours of robots' LEDs, therefore not theme tokens.
LAMP_COLOURS: tuple[tuple[str, str], ...] = (
    ("#ffffff", lazy("white")),
    ("#3ab7ff", lazy("sky blue")),
    ("#35c26b", lazy("green")),
    ("#ffc53d", lazy("amber")),
    ("#ff6b5e", lazy("coral")),
    ("#b06bff", lazy("violet")),
)
SWATCH_SIZE = 32
STRIP_SIZE = QSize(168, 34)
HUE_COUNT = 360
HUE_STEP, LIGHT_STEP = 5, 0.05
MAX_LIGHTNESS, MIN_LIGHTNESS = 0.95, 0.15


class _Swatch(PaintedButton):
    def __init__(self, theme: Theme, colour: str, name: str) -> None:
        super().__init__(theme, radius="control", checkable=True)
        self.colour = colour
        self.setAutoExclusive(True)
        self.setAccessibleName(name)
        self.setToolTip(plain.tip(name))
        self.setFixedSize(SWATCH_SIZE + 8, SWATCH_SIZE + 8)
        self.setProperty("focusInset", 4)

    def paint_button(self, painter: QPainter, rect: QRectF) -> None:
        theme = self._theme
        rect = rect.adjusted(4, 4, -4, -4)
        radius = theme.radius("control")
        if self.isChecked():
            paint.box(painter, rect.adjusted(-4, -4, 4, 4), radius + 4, None, theme.colour("accent"), 2)
        paint.box(painter, rect, radius, QColor(self.colour), theme.colour("controlBorder"))


class ColourSwatches(QWidget):
    """Row of colour swatches with the name of the selected colour."""

    changed = Signal(str)

    def __init__(
        self,
        theme: Theme,
        value: str = LAMP_COLOURS[0][0],
        colours: Sequence[tuple[str, str]] = LAMP_COLOURS,
        *,
        name: str = "",
    ) -> None:
        super().__init__()
        self._names = {colour.lower(): _(colour_name) for colour, colour_name in colours}
        self._value = ""
        name = name or _("Colour")
        self.setAccessibleName(name)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Preferred)
        row = Flow(self, gap=2)
        self._swatches: dict[str, _Swatch] = {}
        for colour, colour_name in self._names.items():
            swatch = _Swatch(theme, colour, colour_name)
            swatch.clicked.connect(lambda _on=False, colour=colour: self._change_value(colour))
            self._swatches[colour] = swatch
            row.addWidget(swatch)
        self._name = label("", "bodyLarge", role="textSecondary")
        self._name.setContentsMargins(6, 0, 0, 0)
        row.addWidget(self._name)
        self.set_value(value)

    @property
    def value(self) -> str:
        """Selected colour as ``#rrggbb``."""
        return self._value

    def set_value(self, value: str) -> None:
        """Select a colour without emitting `changed`; invalid text is ignored."""
        colour = QColor(value)
        if not colour.isValid():
            return
        self._value = colour.name()
        for key, swatch in self._swatches.items():
            swatch.setAutoExclusive(False)
            swatch.setChecked(key == self._value)
            swatch.setAutoExclusive(True)
        self._name.setText(self._names.get(self._value, self._value))

    def _change_value(self, value: str) -> None:
        if value != self._value:
            self.set_value(value)
            self.changed.emit(self._value)


class HueStrip(QWidget):
    """Strip of all hues, which get darker towards the bottom. A colour is selected by mouse or arrow keys."""

    changed = Signal(str)

    def __init__(self, theme: Theme, name: str) -> None:
        super().__init__()
        self._theme = theme
        self._hue, self._light = 0.55, 0.6
        self.setAccessibleName(name)
        self.setToolTip(plain.tip(_("Choose a colour; use the arrow keys to move between colours")))
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.setProperty("focusRadius", theme.radius("control"))
        self.setCursor(Qt.CursorShape.CrossCursor)

    def sizeHint(self) -> QSize:
        return STRIP_SIZE

    def show_colour(self, colour: QColor) -> None:
        """Move the marker to the colour of the strip that is most similar to `colour`."""
        if colour.hslHueF() >= 0:
            self._hue = colour.hslHueF()
        self._light = min(MAX_LIGHTNESS, max(MIN_LIGHTNESS, colour.lightnessF()))
        self.update()

    def _change_colour(self, hue: float, light: float) -> None:
        self._hue, self._light = min(max(hue, 0.0), 0.999), min(max(light, MIN_LIGHTNESS), MAX_LIGHTNESS)
        self.update()
        self.changed.emit(QColor.fromHslF(self._hue, 0.9, self._light).name())

    def _press(self, position: QPointF) -> None:
        light = MAX_LIGHTNESS - position.y() / self.height() * (MAX_LIGHTNESS - MIN_LIGHTNESS)
        self._change_colour(position.x() / self.width(), light)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self._press(event.position())

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if event.buttons() & Qt.MouseButton.LeftButton:
            self._press(event.position())

    def keyPressEvent(self, event: QKeyEvent) -> None:
        by = {
            Qt.Key.Key_Left: (-HUE_STEP, 0.0),
            Qt.Key.Key_Right: (HUE_STEP, 0.0),
            Qt.Key.Key_Up: (0, LIGHT_STEP),
            Qt.Key.Key_Down: (0, -LIGHT_STEP),
        }.get(Qt.Key(event.key()))
        if by is None:
            super().keyPressEvent(event)
        else:
            self._change_colour(self._hue + by[0] / HUE_COUNT, self._light + by[1])

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        rect = QRectF(self.rect()).adjusted(0.5, 0.5, -0.5, -0.5)
        radius = self._theme.radius("control")
        hues = QLinearGradient(rect.topLeft(), rect.topRight())
        for part in range(13):
            hues.setColorAt(part / 12, QColor.fromHslF(min(part / 12, 0.999), 0.9, 0.55))
        shade = QLinearGradient(rect.topLeft(), rect.bottomLeft())
        shade.setColorAt(0.0, QColor(255, 255, 255, 220))
        shade.setColorAt(0.5, QColor(128, 128, 128, 0))
        shade.setColorAt(1.0, QColor(0, 0, 0, 170))
        painter.setPen(Qt.PenStyle.NoPen)
        for brush in (hues, shade):
            painter.setBrush(brush)
            painter.drawRoundedRect(rect, radius, radius)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.setPen(QPen(self._theme.colour("controlBorder"), 1))
        painter.drawRoundedRect(rect, radius, radius)
        y = (MAX_LIGHTNESS - self._light) / (MAX_LIGHTNESS - MIN_LIGHTNESS) * self.height()
        mark = QPointF(self._hue * self.width(), min(max(y, 5.0), self.height() - 5.0))
        painter.setPen(QPen(self._theme.colour("text"), 3))
        painter.drawEllipse(mark, 5, 5)
        painter.setPen(QPen(self._theme.colour("panel"), 1.4))
        painter.drawEllipse(mark, 5, 5)
        painter.end()


class ColourChoice(QWidget):
    """Control with named swatches and, under "Other", a hue strip and a field for a hex code.

    Invalid text stays in the field.
    """

    changed = Signal()
    finished = Signal()

    def __init__(self, theme: Theme, parameter: Parameter) -> None:
        super().__init__()
        start = parameter.default if isinstance(parameter.default, str) else "#ffffff"
        self.setAccessibleName(parameter.title)
        self.swatches = ColourSwatches(theme, start, name=parameter.title)
        self.other = Button(theme, _("Other"), "palette", kind="ghost", size="small")
        self.other.setAccessibleName(_("Another colour for {value}").format(value=parameter.title))
        self.other.setCheckable(True)
        self.strip = HueStrip(theme, _("{value}, all colours").format(value=parameter.title))
        self.field = line_field(theme, parameter)
        self.field.setAccessibleName(_("{value}, hex code such as #33aaff").format(value=parameter.title))
        self.field.setPlaceholderText("#33aaff")
        self.field.setFixedWidth(round(theme.scaled(96)))
        self.error_text = ""
        self._error_label = label("", "small", role="error", wrap=True)
        self._lay_out()
        self.other.toggled.connect(self._set_expanded)
        self.swatches.changed.connect(self._swatch_selected)
        self.strip.changed.connect(self._hue_picked)
        self.field.textEdited.connect(lambda _text: self._hex_edited(is_final=False))
        self.field.editingFinished.connect(lambda: self._hex_edited(is_final=True))

    def _lay_out(self) -> None:
        first = Flow(gap=6)
        first.addWidget(self.swatches)
        first.addWidget(self.other)
        self._more = QWidget()
        second = Flow(self._more)
        second.setContentsMargins(4, 0, 0, 0)
        second.addWidget(self.strip)
        second.addWidget(self.field)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(4)
        column.addLayout(first)
        column.addWidget(self._more)
        column.addWidget(self._error_label)
        self._more.hide()
        self._error_label.hide()

    def value(self) -> str:
        """Return the colour as ``#rrggbb``, or the typed text if it is invalid."""
        return self.field.text() if self.error_text else self.swatches.value

    def set_value(self, value: object) -> None:
        """Show a colour without emitting `changed`; invalid values are ignored."""
        if isinstance(value, str) and _HEX_PATTERN.fullmatch(value):
            self.swatches.set_value(value)
            self._show_value()

    def _set_expanded(self, on: bool) -> None:
        self._more.setVisible(on)
        if on:
            self._show_value()
            self.strip.setFocus(Qt.FocusReason.OtherFocusReason)

    def _show_value(self) -> None:
        self.field.setText(self.swatches.value)
        self.strip.show_colour(QColor(self.swatches.value))
        self._show_error("")

    def _swatch_selected(self, _value: str) -> None:
        self._show_value()
        self.changed.emit()

    def _hue_picked(self, value: str) -> None:
        self.swatches.set_value(value)
        self.field.setText(value)
        self._show_error("")
        self.changed.emit()

    def _hex_edited(self, *, is_final: bool) -> None:
        match = _HEX_PATTERN.fullmatch(self.field.text().strip())
        if match is not None:
            self.swatches.set_value(f"#{match[1].lower()}")
            self.strip.show_colour(QColor(self.swatches.value))
        self._show_error(
            "" if match is not None else _("Enter a colour such as #33aaff."), is_quiet=not is_final
        )
        self.changed.emit()
        if is_final:
            self.finished.emit()

    def _show_error(self, message: str, *, is_quiet: bool = False) -> None:
        self.error_text = message
        is_visible = bool(message) and not is_quiet
        self._error_label.setText(message if is_visible else "")
        self._error_label.setVisible(is_visible)
        set_invalid(self.field, is_invalid=is_visible)


def colour_control(theme: Theme, parameter: Parameter) -> Control:
    """Create the input control for a colour parameter."""
    choice = ColourChoice(theme, parameter)
    return Control(
        choice,
        choice.value,
        choice.set_value,
        lambda callback: connect(choice.changed, callback),
        finished=lambda callback: connect(choice.finished, callback),
        error_text=lambda: choice.error_text,
    )
