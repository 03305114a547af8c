"""State in one or two words: never a button."""

from __future__ import annotations

from PySide6.QtCore import QRectF, QSize
from PySide6.QtGui import QFont, QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint

HEIGHT = 22
PADDING = 8
GAP = 5


class Chip(QWidget):
    """An icon and a word on the tint of a status; `set` changes it, empty words hide it."""

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
        """``icon`` "" shows none, None the status' own; ``large`` is the chip of the app bar (26 high)."""
        super().__init__(parent)
        self._theme = theme
        self._large = large
        self._text, self._status, self._icon = "", "", icon
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        theme.changed.connect(self.updateGeometry)
        self.set(text, status, icon)

    @property
    def text(self) -> str:
        """The words shown now."""
        return self._text

    @property
    def status(self) -> str:
        """The status shown now."""
        return self._status

    def set(self, text: str, status: str = "ok", icon: str | None = None) -> None:
        """Show another state; the chip is hidden while it has no words."""
        if (text, status, icon) == (self._text, self._status, self._icon):
            if not text:
                self.hide()
            return
        self._theme.status(status)
        self._text, self._status, self._icon = text, status, icon
        self.setAccessibleName(text)
        paint.show_when(self, bool(text))
        self.updateGeometry()
        self.update()

    def _icon_name(self) -> str:
        return self._theme.status(self._status).icon if self._icon is None else self._icon

    def _side(self) -> float:
        return self._theme.scaled(self._theme.size("icon", "small") + (1 if self._large else 0))

    def _font(self) -> QFont:
        font = self._theme.font("body" if self._large else "small")
        font.setWeight(font.Weight.Medium)
        return font

    def sizeHint(self) -> QSize:
        width = paint.width_of(self._font(), self._text) + 2 * PADDING + (2 if self._large else 0)
        if self._icon_name():
            width += self._side() + GAP
        least = HEIGHT + (4 if self._large else 0)
        return QSize(round(width) + 1, max(least, round(paint.height_of(self._font())) + 6))

    def minimumSizeHint(self) -> QSize:
        return self.sizeHint()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        paint.tell_whole(self, self._text)

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme = self._theme
        status = theme.status(self._status)
        painter = QPainter(self)
        rect = QRectF(self.rect())
        edge = theme.colour("controlBorder") if theme.high_contrast else None
        tint = status.tint or "sunken"
        paint.box(painter, rect, rect.height() / 2, theme.colour(tint), edge)
        plain = {"off": "textSecondary", "running": "text"}
        ink = theme.colour(plain.get(self._status, status.colour))
        left = float(PADDING + (1 if self._large else 0))
        name = self._icon_name()
        if name:
            side = self._side()
            square = QRectF(left, (rect.height() - side) / 2, side, side)
            paint_icon(painter, square, name, theme.colour(status.colour) if name == "dot" else ink)
            left += side + GAP
        paint.words(painter, rect.adjusted(left, 0, -3, 0), self._text, self._font(), ink)
        painter.end()
