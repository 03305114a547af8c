"""Status indicators: chips, items of the status bar, sparklines and bars."""

from __future__ import annotations

import re
from collections.abc import Sequence
from math import isfinite

from PySide6.QtCore import QRectF, QSize, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QFont,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPainterPath,
    QPaintEvent,
    QPen,
    QResizeEvent,
)
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.ui.text import plain
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.labels import IconLabel
from nep.i18n import _, lazy

CHIP_HEIGHT, CHIP_PADDING, CHIP_GAP = 22, 8, 5
ICON_SIZE = 18
# minimum width in px at 100 % of an item if space is scarce; its tooltip has the full text
MIN_ITEM_WIDTH = 64
SPARKLINE_SIZE = QSize(56, 16)
SPARKLINE_STROKE = 1.25
BAR_HEIGHT = 6
STATUS_NAMES = {
    "ok": lazy("ok"),
    "info": lazy("info"),
    "warn": lazy("warning"),
    "error": lazy("error"),
    "running": lazy("running"),
    "off": lazy("off"),
}
# status of the chip by `RobotLink.state`
STATUS_BY_ROBOT_STATE = {
    "ready": "ok", "busy": "running", "stopping": "running", "silent": "warn", "not stopped": "error",
    "away": "off", "connecting": "off",
}  # fmt: skip


def status_name(status: str) -> str:
    """Return the name of a status for screen readers."""
    return _(STATUS_NAMES.get(status, status))


class Chip(QWidget):
    """Chip with icon and text in the colours of a status; hidden if the text is empty."""

    def __init__(
        self,
        theme: Theme,
        text: str = "",
        status: str = "ok",
        icon: str | None = None,
        *,
        large: bool = False,
        parent: QWidget | None = None,
    ) -> None:
        # An `icon` of "" shows none, None that of the status; `large` is the chip of the app bar (26 px
        # high).
        super().__init__(parent)
        self._theme = theme
        self._is_large = large
        self._text, self._status, self._icon = "", "", icon
        self._is_icon_only = False
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        theme.changed.connect(self.updateGeometry)
        self.set(text, status, icon)

    @property
    def text(self) -> str:
        """Current text."""
        return self._text

    @property
    def status(self) -> str:
        """Current status."""
        return self._status

    def set(self, text: str, status: str = "ok", icon: str | None = None) -> None:
        """Set the contents of the chip.

        Args:
            text: Text; "" hides the chip.
            status: Status that determines the colours.
            icon: Name of the icon; None for that of the status, "" for no icon.
        """
        if (text, status, icon) == (self._text, self._status, self._icon):
            if not text:
                self.hide()
            return
        self._theme.status(status)
        self._text, self._status, self._icon = text, status, icon
        self.setAccessibleName(text)
        paint.show_when(self, bool(text))
        if self._is_icon_only:
            self._update_tooltip()
        self.updateGeometry()
        self.update()

    def set_icon_only(self, is_icon_only: bool) -> None:
        """Show only the icon if `is_icon_only`, with the text as tooltip, else the icon and the text."""
        if is_icon_only != self._is_icon_only:
            self._is_icon_only = is_icon_only
            self.updateGeometry()
            self.update()

    def full_width(self) -> int:
        """Return the width in px with icon and text."""
        width = paint.width_of(self._font(), self._text) + 2 * CHIP_PADDING + (2 if self._is_large else 0)
        return round(width + (self._icon_side() + CHIP_GAP if self._icon_name() else 0)) + 1

    def _icon_name(self) -> str:
        return self._theme.status(self._status).icon if self._icon is None else self._icon

    def _icon_side(self) -> float:
        return self._theme.scaled(self._theme.size("icon", "small") + (1 if self._is_large else 0))

    def _font(self) -> QFont:
        font = self._theme.font("body" if self._is_large else "small")
        font.setWeight(font.Weight.Medium)
        return font

    def icon_only_width(self) -> int:
        """Return the width in px with the icon only."""
        return max(self._preferred_height(), round(self._icon_side()) + CHIP_PADDING)

    def _preferred_height(self) -> int:
        min_height = CHIP_HEIGHT + (4 if self._is_large else 0)
        return max(min_height, round(paint.height_of(self._font())) + 6)

    def sizeHint(self) -> QSize:
        return QSize(
            self.icon_only_width() if self._is_icon_only else self.full_width(), self._preferred_height()
        )

    def minimumSizeHint(self) -> QSize:
        return self.sizeHint()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._update_tooltip()

    def _update_tooltip(self) -> None:
        paint.set_elision_tooltip(self, self._text)
        if self._is_icon_only:
            self.setProperty("shortened", True)
            self.setToolTip(plain.tip(self._text))

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme = self._theme
        status = theme.status(self._status)
        painter = QPainter(self)
        rect = QRectF(self.rect())
        edge = theme.colour("controlBorder") if theme.is_high_contrast else None
        tint = status.tint or "sunken"
        paint.box(painter, rect, rect.height() / 2, theme.colour(tint), edge)
        text_roles = {"off": "textSecondary", "running": "text"}
        text_colour = theme.colour(text_roles.get(self._status, status.colour))
        left = float(CHIP_PADDING + (1 if self._is_large else 0))
        name = self._icon_name()
        if name:
            side = self._icon_side()
            left = (rect.width() - side) / 2 if self._is_icon_only else left
            icon_rect = QRectF(left, (rect.height() - side) / 2, side, side)
            paint_icon(
                painter, icon_rect, name, theme.colour(status.colour) if name == "dot" else text_colour
            )
            left += side + CHIP_GAP
        if not self._is_icon_only:
            paint.text_line(painter, rect.adjusted(left, 0, -3, 0), self._text, self._font(), text_colour)
        painter.end()


class StatusIcon(IconLabel):
    """Icon of a status, next to a text with the same meaning."""

    def __init__(self, theme: Theme, status: str = "off", *, height: int = 0, colour: str = "") -> None:
        # `height` is that of the adjacent line of text (0: the icon's own); `colour` overrides the default.
        self._colour = colour
        super().__init__(theme, theme.status(status).icon, colour or theme.status(status).colour, ICON_SIZE)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        if height:
            self.setFixedHeight(height)
        self.setAccessibleName(status_name(status))

    def set(self, status: str) -> None:
        """Set the status, which determines icon, colour and accessible name."""
        values = self._theme.status(status)
        self.set_icon(values.icon, self._colour or values.colour)
        self.setAccessibleName(status_name(status))


class StatusItem(QWidget):
    """Item of the status bar with an optional icon and a short text, clickable if it has a command."""

    ICON_SIZE = 14
    pressed = Signal(str)
    """Emitted with the item's command on a click, Enter or Space."""

    def __init__(self, theme: Theme, icon: str = "", text: str = "", status: str | None = None) -> None:
        super().__init__()
        self._theme = theme
        self._icon, self._text, self._status = "", "", status
        self.command = ""
        self.setSizePolicy(QSizePolicy.Policy.Maximum, QSizePolicy.Policy.Preferred)
        self.setProperty("focusRadius", theme.radius("small"))
        theme.changed.connect(self.updateGeometry)
        self.set(icon, text, status)

    @property
    def text(self) -> str:
        """Current text."""
        return self._text

    def set(self, icon: str, text: str, status: str | None = None) -> None:
        """Set the contents of the item.

        Args:
            icon: Name of the icon, or "" for none.
            text: Text; "" hides the item.
            status: Status that determines the colour, or None for normal text.
        """
        if (icon, text, status) == (self._icon, self._text, self._status):
            return
        before = self.sizeHint()
        self._icon, self._text, self._status = icon, text, status
        self.setAccessibleName(text)
        paint.show_when(self, bool(text))
        if self.sizeHint() != before:
            self.updateGeometry()
        self.update()

    def set_command(self, command: str) -> None:
        """Set the command to emit on activation; "" makes the item passive."""
        if command != self.command:
            self.command = command
            self.setFocusPolicy(Qt.FocusPolicy.TabFocus if command else Qt.FocusPolicy.NoFocus)
            self.setCursor(Qt.CursorShape.PointingHandCursor if command else Qt.CursorShape.ArrowCursor)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if self.command and self.rect().contains(event.position().toPoint()):
            self.pressed.emit(self.command)
        else:
            super().mouseReleaseEvent(event)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        keys = {Qt.Key.Key_Return, Qt.Key.Key_Enter, Qt.Key.Key_Space}
        if self.command and event.key() in keys and not event.isAutoRepeat():
            self.pressed.emit(self.command)
        else:
            super().keyPressEvent(event)

    def _icon_side(self) -> float:
        return self._theme.scaled(self.ICON_SIZE)

    def sizeHint(self) -> QSize:
        font = self._theme.font("small")
        # All digits count with the same width: values change many times a second, and each new width would
        # cause a relayout.
        text = re.sub(r"\d", "0", self._text)
        width = paint.width_of(font, text) + (self._icon_side() + 6 if self._icon else 0)
        return QSize(round(width) + 1, round(paint.height_of(font)))

    def minimumSizeHint(self) -> QSize:
        preferred = self.sizeHint()
        return QSize(min(preferred.width(), round(self._theme.scaled(MIN_ITEM_WIDTH))), preferred.height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        paint.set_elision_tooltip(self, self._text)

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        theme = self._theme
        rect = QRectF(self.rect())
        is_prominent = self._status in {"warn", "error"}
        status_colour = (
            theme.colour(theme.status(self._status).colour) if self._status and is_prominent else None
        )
        if self._icon:
            colour = status_colour or theme.colour(
                theme.status(self._status).colour if self._status else "textSecondary"
            )
            side = self._icon_side()
            paint_icon(painter, QRectF(0, rect.center().y() - side / 2, side, side), self._icon, colour)
            rect.setLeft(side + 6)
        paint.text_line(
            painter, rect, self._text, theme.font("small"), status_colour or theme.colour("textSecondary")
        )
        painter.end()


class Sparkline(QWidget):
    """Small chart of recent values, 56 x 16 px."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._values: tuple[float, ...] = ()
        self.setFixedSize(SPARKLINE_SIZE)

    def set_values(self, values: Sequence[float]) -> None:
        """Set the values, oldest first."""
        if tuple(values) != self._values:
            self._values = tuple(values)
            self.update()

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        paint_sparkline(painter, QRectF(self.rect()), self._values, self._theme.colour("textSecondary"))
        painter.end()


def paint_sparkline(painter: QPainter, rect: QRectF, values: Sequence[float], colour: QColor) -> None:
    """Paint a line chart without axes, with the oldest value on the left.

    The vertical range is from 0, or the minimum if that is negative, to the maximum. A constant rate is
    therefore a horizontal line, and a rate that stops falls to the bottom. Nothing is painted for fewer
    than two values, or if one is NaN or infinite.
    """
    if len(values) < 2 or not isfinite(sum(values)):
        return
    lowest = min(0.0, *values)
    span = (max(0.0, *values) - lowest) or 1.0
    left, step = rect.left(), rect.width() / (len(values) - 1)
    bottom, rise = rect.bottom() - 1, (rect.height() - 2) / span
    curve = QPainterPath()
    curve.reserve(len(values))
    curve.moveTo(left, bottom - (values[0] - lowest) * rise)
    draw_to = curve.lineTo
    for index, value in enumerate(values):
        draw_to(left + step * index, bottom - (value - lowest) * rise)
    painter.save()
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setPen(QPen(colour, SPARKLINE_STROKE))
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.drawPath(curve)
    painter.restore()


class ValueBar(QWidget):
    """Bar that shows the position of a sensor's value within its range."""

    def __init__(self, theme: Theme, fraction: float | None = None) -> None:
        super().__init__()
        self._theme = theme
        self._fraction: float | None = None
        self.setFixedHeight(BAR_HEIGHT)
        self.setMinimumWidth(40)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.set_fraction(fraction)

    @property
    def fraction(self) -> float | None:
        """Displayed position, from 0 to 1, or None if it is unknown."""
        return self._fraction

    def set_fraction(self, fraction: float | None) -> None:
        """Set the position, clamped to 0 to 1; None shows an empty bar."""
        value = None if fraction is None or fraction != fraction else min(max(fraction, 0.0), 1.0)  # noqa: PLR0124
        if value != self._fraction:
            self._fraction = value
            self.update()

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        paint_bar(painter, self._theme, QRectF(self.rect()), self._fraction)
        painter.end()


def paint_bar(painter: QPainter, theme: Theme, rect: QRectF, fraction: float | None) -> None:
    """Paint a bar that is filled up to a fraction (0 to 1); None paints an empty bar."""
    round_end = rect.height() / 2
    paint.box(painter, rect, round_end, theme.colour("sunken"))
    if fraction:
        filled = QRectF(rect.left(), rect.top(), max(rect.height(), rect.width() * fraction), rect.height())
        paint.box(painter, filled, round_end, theme.colour("accent"))
