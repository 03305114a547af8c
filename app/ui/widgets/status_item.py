"""One fact in the status bar."""

from __future__ import annotations

from PySide6.QtCore import QRectF, QSize
from PySide6.QtGui import QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint

LEAST = 64  # px at 100 % that a fact keeps where there is too little room for all; its tooltip has the whole


class StatusItem(QWidget):
    """One fact in the status bar: perhaps an icon, and a few words."""

    ICON = 14

    def __init__(self, theme: Theme, icon: str = "", text: str = "", status: str | None = None) -> None:
        super().__init__()
        self._theme = theme
        self._icon, self._text, self._status = "", "", status
        self.setSizePolicy(QSizePolicy.Policy.Maximum, QSizePolicy.Policy.Preferred)
        theme.changed.connect(self.updateGeometry)
        self.set(icon, text, status)

    @property
    def text(self) -> str:
        """What it says now."""
        return self._text

    def set(self, icon: str, text: str, status: str | None = None) -> None:
        """Show another fact; without words the item is hidden. A status colours it."""
        if (icon, text, status) == (self._icon, self._text, self._status):
            return
        self._icon, self._text, self._status = icon, text, status
        self.setAccessibleName(text)
        paint.show_when(self, bool(text))
        self.updateGeometry()
        self.update()

    def _side(self) -> float:
        return self._theme.scaled(self.ICON)

    def sizeHint(self) -> QSize:
        font = self._theme.font("small")
        width = paint.width_of(font, self._text) + (self._side() + 6 if self._icon else 0)
        return QSize(round(width) + 1, round(paint.height_of(font)))

    def minimumSizeHint(self) -> QSize:
        wanted = self.sizeHint()
        return QSize(min(wanted.width(), round(self._theme.scaled(LEAST))), wanted.height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        paint.tell_whole(self, self._text)

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        theme = self._theme
        rect = QRectF(self.rect())
        loud = self._status in {"warn", "error"}
        ink = theme.colour(theme.status(self._status).colour) if self._status and loud else None
        if self._icon:
            colour = ink or theme.colour(
                theme.status(self._status).colour if self._status else "textSecondary"
            )
            side = self._side()
            paint_icon(painter, QRectF(0, rect.center().y() - side / 2, side, side), self._icon, colour)
            rect.setLeft(side + 6)
        paint.words(painter, rect, self._text, theme.font("small"), ink or theme.colour("textSecondary"))
        painter.end()
