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
        name_font, second_font = (
            theme.font("code" if self.mono else "body"),
            theme.font("small" if self.mono else "mono"),
        )
        if not self.mono:
            name_font.setWeight(QFont.Weight.DemiBold)
        second_font.setPixelSize(theme.font("small").pixelSize())
        first_height, second_height = paint.height_of(name_font), paint.height_of(second_font)
        top = box.center().y() - (first_height + second_height + 2) / 2
        name_rect = QRectF(box.left(), top, box.width(), first_height)
        paint.text_line(painter, name_rect, self.name, name_font, theme.colour("text"))
        second_rect = QRectF(box.left(), top + first_height + 2, box.width(), second_height)
        paint.text_line(painter, second_rect, self.second_line, second_font, theme.colour("textSecondary"))
