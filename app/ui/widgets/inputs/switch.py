"""Switch with two states."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, QSize
from PySide6.QtGui import QPainter

from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.buttons import PaintedButton


class Switch(PaintedButton):
    """Switch with two states and a label."""

    TRACK = QSize(36, 20)

    def __init__(self, theme: Theme, text: str, on: bool = False) -> None:
        super().__init__(theme, text, checkable=True)
        self.setChecked(on)
        self.setProperty("focusRadius", 10)

    def sizeHint(self) -> QSize:
        font = self._theme.font("bodyLarge")
        gap = 10 if self.text() else 0
        width = self.TRACK.width() + gap + paint.width_of(font, self.text())
        return QSize(round(width) + 2, max(24, round(paint.height_of(font))))

    def paint_button(self, painter: QPainter, rect: QRectF) -> None:
        theme = self._theme
        track = QRectF(0, rect.center().y() - 10, self.TRACK.width(), self.TRACK.height())
        on = self.isChecked()
        if on and self.isEnabled():
            paint.box(painter, track, 10, theme.colour("accent"))
        else:
            paint.box(painter, track, 10, theme.colour("sunken"), theme.colour("controlBorder"))
        knob = QRectF(0, 0, 14, 14)
        knob.moveCenter(QPointF(track.right() - 10 if on else track.left() + 10, track.center().y()))
        paint.box(painter, knob, 7, theme.colour("onAccent" if on else "controlBorder"))
        colour = theme.colour("text" if self.isEnabled() else "textDisabled")
        paint.text_line(painter, rect.adjusted(46, 0, 0, 0), self.text(), theme.font("bodyLarge"), colour)
