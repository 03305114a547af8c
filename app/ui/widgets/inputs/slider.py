"""Slider combined with a number field."""

from __future__ import annotations

import math

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtGui import QMouseEvent, QWheelEvent
from PySide6.QtWidgets import QGridLayout, QSizePolicy, QSlider, QStyle, QWidget

from app.ui.theme.theme import Theme
from app.ui.widgets.inputs.fields import NumberEdit
from app.ui.widgets.labels import label

MAX_STEPS = 100_000
FIELD_WIDTH = 104
PAGE_STEPS = 10


class SliderTrack(QSlider):
    """Slider with a 4 px track and a 20 px handle; its values are numbers of steps.

    `reset` is emitted on a double click. Ignores the mouse wheel without focus.
    """

    reset = Signal()

    def __init__(self, theme: Theme, steps: int) -> None:
        super().__init__(Qt.Orientation.Horizontal)
        self._theme = theme
        # Qt fills the wrong side of a mirrored slider
        self.setLayoutDirection(Qt.LayoutDirection.LeftToRight)
        self.setRange(0, steps)
        self.setSingleStep(1)
        self.setPageStep(PAGE_STEPS)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setMinimumWidth(80)
        self.setProperty("focusRadius", theme.radius("control"))

    def sizeHint(self) -> QSize:
        return QSize(200, self._theme.size("sliderHandle") + 4)

    def minimumSizeHint(self) -> QSize:
        return QSize(80, self._theme.size("sliderHandle") + 4)

    def _step_at(self, x: float) -> int:
        handle = self._theme.size("sliderHandle")
        position, span = round(x - handle / 2), self.width() - handle
        return QStyle.sliderValueFromPosition(self.minimum(), self.maximum(), position, span)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self.setSliderDown(True)
            self.setSliderPosition(self._step_at(event.position().x()))
            event.accept()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self.isSliderDown():
            self.setSliderPosition(self._step_at(event.position().x()))
            event.accept()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        self.setSliderDown(False)
        event.accept()

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        self.reset.emit()
        event.accept()

    def wheelEvent(self, event: QWheelEvent) -> None:
        if self.hasFocus():
            super().wheelEvent(event)
        else:
            event.ignore()


def decimals_of(step: float) -> int:
    """Return the number of decimals, at most 6, that are needed for multiples of a step."""
    return next((digits for digits in range(7) if math.isclose(round(step, digits), step, rel_tol=1e-9)), 6)


class SliderWithUnit(QWidget):
    """Input for a number between two limits, with a slider and a number field.

    `changed` is emitted when the user sets a value.
    """

    changed = Signal(float)

    def __init__(
        self,
        theme: Theme,
        minimum: float,
        maximum: float,
        *,
        step: float = 1,
        value: float | None = None,
        default: float | None = None,
        unit: str = "",
        name: str = "",
    ) -> None:
        # Raises ValueError if the limits or the step are invalid.
        super().__init__()
        if not (maximum > minimum and step > 0):
            raise ValueError(f"no range from {minimum} to {maximum} by {step}")
        steps = min(MAX_STEPS, max(1, round((maximum - minimum) / step)))
        self._minimum, self._step = minimum, (maximum - minimum) / steps
        self._default = default if default is not None else value if value is not None else minimum
        self._value = minimum
        digits = decimals_of(step)
        self.track = SliderTrack(theme, steps)
        self.field = NumberEdit(theme, minimum, maximum, unit, digits)
        self.field.setFixedWidth(FIELD_WIDTH)
        self._digits = digits
        self._error_label = label("", "small", role="error", wrap=True)
        self._error_label.hide()
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setHorizontalSpacing(12)
        grid.setVerticalSpacing(4)
        grid.addWidget(self.track, 0, 0)
        grid.addWidget(self.field, 0, 1)
        grid.addWidget(self._error_label, 1, 0, 1, 2)
        self._set_name(name)
        self.set_value(value if value is not None else self._default)
        self.track.valueChanged.connect(self._on_track_changed)
        self.track.reset.connect(lambda: self._change_value(self._default))
        self.field.number_entered.connect(self._change_value)
        self.field.problem_changed.connect(self._show_problem)

    def _set_name(self, name: str) -> None:
        self.setAccessibleName(name)
        self.track.setAccessibleName(name)
        self.field.setAccessibleName(name)

    @property
    def value(self) -> float:
        """Current value."""
        return self._value

    def set_value(self, value: float) -> None:
        """Set the value without emitting `changed`."""
        self._value = value
        self.track.blockSignals(True)
        self.track.setValue(round((value - self._minimum) / self._step))
        self.track.blockSignals(False)
        self.track.update()
        self.field.show_number(value)

    def _on_track_changed(self, steps: int) -> None:
        self._change_value(round(self._minimum + steps * self._step, max(self._digits, 6)))

    def _change_value(self, value: float) -> None:
        if value != self._value:
            self.set_value(value)
            self.changed.emit(value)

    def _show_problem(self, message: str) -> None:
        self._error_label.setText(message)
        self._error_label.setVisible(bool(message))
