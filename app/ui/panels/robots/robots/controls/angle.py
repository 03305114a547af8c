"""Dial for entering an angle."""

from __future__ import annotations

import math

from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPen, QPolygonF, QWheelEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.ui.text import plain
from app.ui.theme.theme import Theme
from nep.i18n import _, number

DIAL_SIZE = 44
PAGE_STEPS = 10
WHEEL_NOTCH = 120


class AngleDial(QWidget):
    """Dial for entering an angle in degrees.

    The dial is operated by dragging, the wheel (with focus), the arrow keys, Page Up, Page Down, Home and
    End. A double click sets the default.

    Args:
        minimum: Smallest angle in degrees.
        maximum: Largest angle in degrees.
        step: Step of the arrow keys in degrees.
        value: Initial angle in degrees.
        default: Angle after a double click; by default the initial angle.
        name: Accessible name.
        upright: False to show the robot from above: up is forward, and positive angles turn left. True to
            show the robot from its left side: left is forward, and positive angles point down.
    """

    changed = Signal(float)

    def __init__(
        self,
        theme: Theme,
        minimum: float,
        maximum: float,
        *,
        step: float = 1.0,
        value: float = 0.0,
        default: float | None = None,
        name: str = "",
        upright: bool = False,
    ) -> None:
        super().__init__()
        self._theme, self._minimum, self._maximum, self._step = theme, minimum, maximum, step
        self._default = default if default is not None else value
        self._value, self._is_upright = value, upright
        self._drag_angle: float | None = None
        self.setAccessibleName(name)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.setProperty("focusRadius", DIAL_SIZE // 2)
        self.setToolTip(plain.tip(_("Drag to turn; double-click to reset")))
        self.setCursor(Qt.CursorShape.PointingHandCursor)

    @property
    def value(self) -> float:
        """Angle in degrees."""
        return self._value

    def set_value(self, value: float) -> None:
        """Set the angle in degrees without emitting `changed`."""
        self._value = value
        self.setAccessibleDescription(f"{number(value)}°")
        self.update()

    def sizeHint(self) -> QSize:
        side = round(self._theme.scaled(DIAL_SIZE))
        return QSize(side, side)

    def direction(self, angle_deg: float) -> QPointF:
        """Return the direction of an angle as a unit vector in screen coordinates."""
        angle_rad = math.radians(angle_deg)
        if self._is_upright:
            return QPointF(-math.cos(angle_rad), math.sin(angle_rad))
        return QPointF(-math.sin(angle_rad), -math.cos(angle_rad))

    def _angle_at(self, point: QPointF) -> float:
        offset = point - QPointF(self.rect().center())
        if self._is_upright:
            return math.degrees(math.atan2(offset.y(), -offset.x()))
        return math.degrees(math.atan2(-offset.x(), -offset.y()))

    def _change_value(self, value: float) -> None:
        steps = round((value - self._minimum) / self._step)
        stepped = round(self._minimum + steps * self._step, 6)
        clamped = min(max(stepped, self._minimum), self._maximum)
        if clamped != self._value:
            self.set_value(clamped)
            self.changed.emit(clamped)

    # -- input --------------------------------------------------------------------------------------------

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self._drag_angle = self._value
            self._drag_to(self._angle_at(event.position()))

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self._drag_angle is not None:
            self._drag_to(self._angle_at(event.position()))

    def _drag_to(self, angle: float) -> None:
        # Of the equivalent angles, takes the one nearest to the last, so that full turns accumulate.
        last = self._drag_angle if self._drag_angle is not None else self._value
        self._drag_angle = angle + 360.0 * round((last - angle) / 360.0)
        self._drag_angle = min(max(self._drag_angle, self._minimum - 90.0), self._maximum + 90.0)
        self._change_value(self._drag_angle)

    def mouseReleaseEvent(self, _event: QMouseEvent) -> None:
        self._drag_angle = None

    def mouseDoubleClickEvent(self, _event: QMouseEvent) -> None:
        self._drag_angle = None
        self._change_value(self._default)

    def wheelEvent(self, event: QWheelEvent) -> None:
        if self.hasFocus():
            self._change_value(self._value + self._step * event.angleDelta().y() / WHEEL_NOTCH)
            event.accept()
        else:
            event.ignore()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        left, right = Qt.Key.Key_Left, Qt.Key.Key_Right
        by = {
            (right if self._is_upright else left): self._step,
            (left if self._is_upright else right): -self._step,
            Qt.Key.Key_Up: -self._step if self._is_upright else self._step,
            Qt.Key.Key_Down: self._step if self._is_upright else -self._step,
            Qt.Key.Key_PageUp: PAGE_STEPS * self._step,
            Qt.Key.Key_PageDown: -PAGE_STEPS * self._step,
            Qt.Key.Key_Home: self._minimum - self._value,
            Qt.Key.Key_End: self._maximum - self._value,
        }.get(Qt.Key(event.key()))
        if by is None:
            super().keyPressEvent(event)
        else:
            self._change_value(self._value + by)

    # -- painting -----------------------------------------------------------------------------------------

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme, painter = self._theme, QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        half = min(self.width(), self.height()) / 2 - 1.5
        middle = QRectF(self.rect()).center()
        disc = QRectF(middle.x() - half, middle.y() - half, 2 * half, 2 * half)
        painter.setPen(QPen(theme.colour("controlBorder"), 1))
        painter.setBrush(theme.colour("sunken" if theme.is_dark else "panel"))
        painter.drawEllipse(disc)
        self._paint_sector(painter, disc)
        painter.setPen(QPen(theme.colour("borderStrong"), 1, Qt.PenStyle.DashLine))
        painter.drawLine(middle, middle + self.direction(0.0) * (half - 3))
        colour = theme.colour("accent" if self.isEnabled() else "textDisabled")
        hand = self.direction(self._value)
        tip = middle + hand * (half - 4)
        painter.setPen(QPen(colour, 2.2, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
        painter.drawLine(middle, tip)
        side = QPointF(-hand.y(), hand.x())
        back = tip - hand * 6.5
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(colour)
        painter.drawPolygon(QPolygonF([tip + hand * 1.5, back + side * 4, back - side * 4]))
        painter.drawEllipse(middle, 3.2, 3.2)
        painter.end()

    def _paint_sector(self, painter: QPainter, disc: QRectF) -> None:
        # Sector from forward to the angle; a full disc from 360°.
        tint = self._theme.colour("selected")
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(tint)
        inner = disc.adjusted(2, 2, -2, -2)
        angle = min(360.0, abs(self._value))
        if angle >= 360.0:
            painter.drawEllipse(inner)
            return
        # Qt: 1/16 degree, counterclockwise from three o'clock
        start = 180.0 if self._is_upright else 90.0
        sweep = math.copysign(angle, self._value)
        painter.drawPie(inner, round(start * 16), round(sweep * 16))
