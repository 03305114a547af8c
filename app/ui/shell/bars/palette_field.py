"""The field in the app bar that opens the command palette."""

from __future__ import annotations

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QAbstractButton, QSizePolicy, QWidget

from app.ui.text.numbers import spoken_key
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint

WORDS = "Find a command or panel"
WIDE, HIGH, LEFT, ICON, GAP = 248, 28, 10, 14, 9
LEAST_ROOM = 44  # less than that for the words, and only icon and key are shown


class PaletteField(QAbstractButton):
    """Looks like a field, with its key at the right; in narrow windows only icon and key are left."""

    def __init__(self, theme: Theme, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._theme, self._key = theme, ""
        self.setText(WORDS)
        self.setAccessibleName(WORDS)
        self.setProperty("command", "palette.open")
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        self.setProperty("focusRadius", theme.radius("control"))
        self.setAttribute(Qt.WidgetAttribute.WA_Hover)
        theme.changed.connect(self.updateGeometry)

    def show_key(self, key: str) -> None:
        """The key that opens the palette now; "" for none."""
        self._key = spoken_key(key)
        self.updateGeometry()
        self.update()

    def _side(self) -> float:
        return self._theme.scaled(ICON)

    def _key_room(self) -> float:
        return paint.key_width(self._theme, self._key) + 7 if self._key else 0.0

    def sizeHint(self) -> QSize:
        font = self._theme.font("body")
        wide = LEFT + self._side() + GAP + paint.width_of(font, self.text()) + 16 + self._key_room()
        high = max(HIGH, round(paint.height_of(font)) + 8)
        return QSize(max(WIDE, round(wide)), high)

    def minimumSizeHint(self) -> QSize:
        least = LEFT + self._side() + GAP + (self._key_room() or LEFT)
        return QSize(round(least), self.sizeHint().height())

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme, painter = self._theme, QPainter(self)
        rect, middle = QRectF(self.rect()), self.height() / 2
        over = self.underMouse() or self.isDown()
        fill = theme.colour("hover" if over else "panel")
        paint.box(painter, rect, theme.radius("control"), fill, theme.colour("borderStrong"))
        side = self._side()
        square = QRectF(LEFT, middle - side / 2, side, side)
        paint_icon(painter, square, "search", theme.colour("textSecondary"))
        font = theme.font("body")
        left = LEFT + side + GAP
        room = rect.width() - left - self._key_room() - 4
        if room >= self._theme.scaled(LEAST_ROOM):
            area = QRectF(left, 0, room, rect.height())
            paint.words(painter, area, self.text(), font, theme.colour("textSecondary"))
        if self._key:
            paint.key_cap(painter, theme, rect.right() - 6, middle, self._key)
        painter.end()
