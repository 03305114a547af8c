"""Painted check box with a label."""

from __future__ import annotations

from PySide6.QtCore import QRectF, QSize
from PySide6.QtGui import QPainter

from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.buttons import PaintedButton

SIDE, GAP, MIN_HEIGHT = 18, 8, 26


class CheckBox(PaintedButton):
    """Check box with a label."""

    elides_text = True

    def __init__(self, theme: Theme, text: str, is_checked: bool = False) -> None:
        super().__init__(theme, text, checkable=True)
        self.setChecked(is_checked)

    def sizeHint(self) -> QSize:
        font = self._theme.font("body")
        width = self._theme.scaled(SIDE) + GAP + paint.width_of(font, self.text()) + 4
        return QSize(round(width) + 1, max(MIN_HEIGHT, round(paint.height_of(font)) + 6))

    def minimumSizeHint(self) -> QSize:
        preferred = self.sizeHint()
        return QSize(min(round(self._theme.scaled(72)), preferred.width()), preferred.height())

    def paint_button(self, painter: QPainter, rect: QRectF) -> None:
        theme, side = self._theme, self._theme.scaled(SIDE)
        box_rect = QRectF(1, rect.center().y() - side / 2, side, side)
        if self.isChecked():
            paint.box(painter, box_rect, theme.radius("key"), theme.colour("accent"))
            paint_icon(painter, box_rect.adjusted(2, 2, -2, -2), "check", theme.colour("onAccent"))
        else:
            fill = theme.colour("hover" if self.is_highlighted else "sunken" if theme.is_dark else "panel")
            paint.box(painter, box_rect, theme.radius("key"), fill, theme.colour("controlBorder"))
        colour = theme.colour("text" if self.isEnabled() else "textDisabled")
        paint.text_line(
            painter, rect.adjusted(side + GAP + 1, 0, 0, 0), self.text(), theme.font("body"), colour
        )
