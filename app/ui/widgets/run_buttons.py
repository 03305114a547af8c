"""Run, Pause, Step and Stop: they keep their place and their width in every state."""

from __future__ import annotations

from typing import Literal

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QPainter, QPaintEvent
from PySide6.QtWidgets import QAbstractButton, QSizePolicy, QWidget

from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.buttons import Button, name_command

Place = Literal["runBar", "toolBar", "appBar"]
RUN_WIDTH = 112
BARE_WIDTH = 56
RING = 4


class RunButton(Button):
    """A button of the run bar: 112 x 44, wider only when the text is larger."""

    def __init__(
        self, theme: Theme, text: str, icon: str, *, widest: str = "", parent: QWidget | None = None
    ) -> None:
        """``widest`` is the longest word it will ever show, so that it never changes its width."""
        super().__init__(theme, text, icon, size="large", parent=parent)
        self._widest = widest or text
        self._bare = False
        self.fill_icon = False

    def set_filled(self, filled: bool) -> None:
        """Filled green (Run, Go on) or outlined."""
        self.fill_icon = filled
        self.set_kind("run" if filled else "plain")

    def set_bare(self, bare: bool) -> None:
        """Show only the icon, where large text leaves no room for the word; its accessible name stays."""
        if bare != self._bare:
            self._bare = bare
            self.updateGeometry()
            self.update()

    def icon_side(self) -> int:
        return self.measure.icon  # the words need the room

    def shown_word(self) -> str:
        return "" if self._bare else self.text()

    def sizeHint(self) -> QSize:
        font = self._theme.font("button")
        if self._bare:
            return QSize(
                max(BARE_WIDTH, self.icon_side() + 28),
                max(self.measure.height, round(paint.height_of(font)) + 12),
            )
        inner = self.icon_side() + self.measure.gap + paint.width_of(font, self._widest)
        height = max(self.measure.height, round(paint.height_of(font)) + 12)
        return QSize(max(RUN_WIDTH, round(inner) + 28), height)


class StopButton(QAbstractButton):
    """Stop: always enabled; its ring says that answers are awaited.

    A margin of 4 px around it is for that ring.
    """

    def __init__(self, theme: Theme, place: Place = "runBar", parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._theme = theme
        self._place: Place = place
        self._ring = False
        self.filled = True
        self.setText("Stop")
        self.setAccessibleName("Stop")
        name_command(self, "run.stop", "Stops the program and every robot", "F12")
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.setAttribute(Qt.WidgetAttribute.WA_Hover)
        self.setProperty("focusRadius", self._radius())
        self.setProperty("focusInset", RING)
        theme.changed.connect(self.updateGeometry)

    def show_state(self, word: str, *, ring: bool = False, filled: bool = True) -> None:
        """Show "Stop", "Stopping" (with the ring) or "Stop again"; outlined only while nothing can move."""
        if (word, ring, filled) == (self.text(), self._ring, self.filled):
            return
        self.setText(word)
        self.setAccessibleName(word)
        self._ring = ring
        self.filled = filled
        self.update()

    def _radius(self) -> int:
        return self._theme.radius("large" if self._place == "runBar" else "control")

    def sizeHint(self) -> QSize:
        wanted = self._theme.pair("stop", self._place)
        word, key = self._fonts()
        least = self._side() + 26 + paint.width_of(word, "Stop again")  # one place and size in every state
        if self._place != "runBar":
            least += paint.width_of(key, "F12") + 8
        height = max(wanted.height(), round(paint.height_of(word)) + 10)
        return QSize(max(wanted.width(), round(least)) + 2 * RING, height + 2 * RING)

    def minimumSizeHint(self) -> QSize:
        return self.sizeHint()

    def _fonts(self) -> tuple[QFont, QFont]:
        large = self._place == "runBar"
        word = self._theme.font("heading" if large else "title")
        word.setWeight(word.Weight.Bold)
        if large:
            word.setPixelSize(round(self._theme.scaled(17)))
        return word, self._theme.font("small" if large else "caption")

    def _side(self) -> int:
        return 16 if self._place == "runBar" else 12

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme = self._theme
        painter = QPainter(self)
        frame = QRectF(self.rect()).adjusted(RING, RING, -RING, -RING)
        if self._ring:
            ring = frame.adjusted(-RING, -RING, RING, RING)
            paint.box(painter, ring, self._radius() + RING, None, theme.colour("stop"), 2)
        if self.filled:
            role = "stopHover" if self.isDown() or self.underMouse() else "stop"
            paint.box(painter, frame, self._radius(), theme.colour(role))
            ink = theme.colour("onStop")
        else:
            fill = theme.colour("errorTint" if self.underMouse() or self.isDown() else "panel")
            paint.box(painter, frame, self._radius(), fill, theme.colour("stop"))
            ink = theme.colour("error")
        self._paint_words(painter, frame, ink)
        painter.end()

    def _paint_words(self, painter: QPainter, frame: QRectF, ink: QColor) -> None:
        font, key_font = self._fonts()
        key = "F12" if self.text() == "Stop" or self._place != "runBar" else ""
        side = self._side()
        gap = 10 if self._place == "runBar" else 8
        key_gap = gap + 3 if self._place == "runBar" else gap - 1
        word_width = paint.width_of(font, self.text())
        key_width = paint.width_of(key_font, key) + key_gap if key else 0
        left = frame.center().x() - (side + gap + word_width + key_width) / 2
        square = QRectF(left, frame.center().y() - side / 2, side, side)
        paint.box(painter, square, side / 6, ink)
        area = QRectF(QPointF(square.right() + gap, frame.top()), frame.bottomRight())
        paint.words(painter, area, self.text(), font, ink)
        if key:
            area.setLeft(area.left() + word_width + key_gap)
            paint.words(painter, area, key, key_font, ink)
