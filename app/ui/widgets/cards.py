"""Surfaces that hold other widgets, and the tile of an action or a block."""

from __future__ import annotations

from PySide6.QtCore import QRectF
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QFrame, QWidget

from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint

TILE = 28


class Card(QFrame):
    """A surface with a border and large corners."""

    def __init__(self, theme: Theme, *, radius: str = "card", fill: str = "panel") -> None:
        super().__init__()
        self._theme, self._radius, self.fill = theme, radius, fill
        self.border = "border"

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter, theme = QPainter(self), self._theme
        fill, edge = theme.colour(self.fill), theme.colour(self.border)
        paint.box(painter, QRectF(self.rect()), theme.radius(self._radius), fill, edge)
        painter.end()


class Tile(QWidget):
    """A white icon on the colour of a block category."""

    def __init__(self, theme: Theme, icon: str, category: str = "robot", side: int = TILE) -> None:
        super().__init__()
        self._theme, self._icon, self._category = theme, icon, category
        self.setFixedSize(side, side)

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        rect = QRectF(self.rect())
        paint.box(painter, rect, self._theme.radius("small"), self._theme.block_colour(self._category))
        inset = rect.width() * 0.22
        ink = self._theme.block_text(self._category)
        paint_icon(painter, rect.adjusted(inset, inset, -inset, -inset), self._icon, ink)
        painter.end()
