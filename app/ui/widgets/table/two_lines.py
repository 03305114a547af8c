"""Cell with two lines, for a name and its origin."""

from __future__ import annotations

from dataclasses import dataclass

from PySide6.QtCore import QRectF
from PySide6.QtGui import QFont, QPainter

from app.ui.theme.theme import Theme
from app.ui.widgets import paint

ROW_PX = 50


@dataclass(frozen=True, slots=True)
class TwoLines:
    """Cell contents with two lines, usable as a mark.

    Attributes:
        name: First line.
        second_line: Second line, in a small font.
        mono: True if the name is monospaced, as for topics and services.
    """

    name: str
    second_line: str
    mono: bool = False

    def paint(self, painter: QPainter, box: QRectF, theme: Theme) -> None:
        """Paint both lines into the rectangle ``box``."""
        name, below = (
            theme.font("code" if self.mono else "body"),
            theme.font("small" if self.mono else "mono"),
        )
        if not self.mono:
            name.setWeight(QFont.Weight.DemiBold)
        below.setPixelSize(theme.font("small").pixelSize())
        first, second = paint.height_of(name), paint.height_of(below)
        top = box.center().y() - (first + second + 2) / 2
        row = QRectF(box.left(), top, box.width(), first)
        paint.text_line(painter, row, self.name, name, theme.colour("text"))
        row = QRectF(box.left(), top + first + 2, box.width(), second)
        paint.text_line(painter, row, self.second_line, below, theme.colour("textSecondary"))
