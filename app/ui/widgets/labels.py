"""The smallest widgets: labels, lines, switch, sparkline, sensor bar, card, search field."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPainterPath, QPaintEvent, QPen
from PySide6.QtWidgets import QAbstractButton, QFrame, QLabel, QLineEdit, QSizePolicy, QWidget

from app.ui.text import plain
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.menus import EditMenu

SPARK = QSize(56, 16)
SPARK_STROKE = 1.25
BAR_HEIGHT = 6


def label(text: str = "", kind: str = "body", *, role: str = "text", wrap: bool = False) -> QLabel:
    """A line of text of one kind ("body", "small", "title", ...) in the colour of one role."""
    made = QLabel(text)
    made.setTextFormat(Qt.TextFormat.PlainText)
    made.setProperty("kind", kind)
    made.setProperty("role", role)
    made.setWordWrap(wrap)
    return made


def set_role(shown: QLabel, role: str) -> None:
    """Give a label's words the colour of another role."""
    if shown.property("role") != role:
        shown.setProperty("role", role)
        shown.style().unpolish(shown)
        shown.style().polish(shown)


class Elided(QLabel):
    """A line that is shortened in its middle where there is too little room; the tooltip has the whole."""

    def __init__(self, kind: str, role: str, least: int = 0) -> None:
        """Ask for ``least`` pixels always."""
        super().__init__()
        self._least = least
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setProperty("kind", kind)
        self.setProperty("role", role)

    def minimumSizeHint(self) -> QSize:
        return QSize(min(self._least, super().sizeHint().width()), super().minimumSizeHint().height())

    def paintEvent(self, _event: QPaintEvent) -> None:
        room = self.contentsRect()
        fits = self.fontMetrics().elidedText(self.text(), Qt.TextElideMode.ElideMiddle, room.width() + 1)
        whole = self.text() if fits != self.text() else ""
        if plain.tip(whole) != self.toolTip():
            self.setToolTip(plain.tip(whole))
        painter = QPainter(self)
        painter.setPen(self.palette().color(self.foregroundRole()))
        painter.drawText(room, int(paint.LEFT), fits)
        painter.end()


class Changing(Elided):
    """Words that change many times a second, in room that does not depend on them.

    A label asks for its room anew with every word, and the whole window is then laid out again.
    """

    def __init__(self, kind: str, role: str) -> None:
        self._words = ""
        super().__init__(kind, role)
        super().setText("0")  # the room of one line

    def text(self) -> str:
        return self._words

    def setText(self, text: str) -> None:
        if text != self._words:
            self._words = text
            self.setAccessibleName(text)
            self.update()


class Line(QWidget):
    """A line of 1 px: between groups of buttons (upright) or between parts of a panel."""

    def __init__(self, theme: Theme, *, upright: bool = False, length: int = 0) -> None:
        super().__init__()
        self._theme = theme
        if upright:
            self.setFixedWidth(1)
        else:
            self.setFixedHeight(1)
        if length:
            (self.setFixedHeight if upright else self.setFixedWidth)(length)

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        edge = Qt.Edge.LeftEdge if self.width() == 1 else Qt.Edge.TopEdge
        paint.hairline(painter, QRectF(self.rect()), edge, self._theme.colour("border"))
        painter.end()


class Switch(QAbstractButton):
    """Yes or no: a switch with the word beside it."""

    TRACK = QSize(36, 20)

    def __init__(self, theme: Theme, text: str, on: bool = False) -> None:
        super().__init__()
        self._theme = theme
        self.setCheckable(True)
        self.setChecked(on)
        self.setText(text)
        self.setAccessibleName(text)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.setAttribute(Qt.WidgetAttribute.WA_Hover)
        self.setProperty("focusRadius", 10)
        theme.changed.connect(self.updateGeometry)

    def sizeHint(self) -> QSize:
        font = self._theme.font("bodyLarge")
        gap = 10 if self.text() else 0
        width = self.TRACK.width() + gap + paint.width_of(font, self.text())
        return QSize(round(width) + 2, max(24, round(paint.height_of(font))))

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme = self._theme
        painter = QPainter(self)
        rect = QRectF(self.rect())
        track = QRectF(0, rect.center().y() - 10, self.TRACK.width(), self.TRACK.height())
        on = self.isChecked()
        if on and self.isEnabled():
            paint.box(painter, track, 10, theme.colour("accent"))
        else:
            paint.box(painter, track, 10, theme.colour("sunken"), theme.colour("controlBorder"))
        knob = QRectF(0, 0, 14, 14)
        knob.moveCenter(QPointF(track.right() - 10 if on else track.left() + 10, track.center().y()))
        paint.box(painter, knob, 7, theme.colour("onAccent" if on else "controlBorder"))
        ink = theme.colour("text" if self.isEnabled() else "textDisabled")
        paint.words(painter, rect.adjusted(46, 0, 0, 0), self.text(), theme.font("bodyLarge"), ink)
        painter.end()


def paint_sparkline(painter: QPainter, rect: QRectF, values: Sequence[float], colour: QColor) -> None:
    """One stroke through the values, oldest left, no axes; fewer than two values paint nothing.

    The lower edge is 0 (or the least, where that is below), the upper one the largest: a rate that changes
    little is a level line, and one that stops falls to the ground. Values that are no numbers paint nothing.
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
    painter.setPen(QPen(colour, SPARK_STROKE))
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.drawPath(curve)
    painter.restore()


class Sparkline(QWidget):
    """A small curve of 56 x 16."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._values: tuple[float, ...] = ()
        self.setFixedSize(SPARK)

    def set_values(self, values: Sequence[float]) -> None:
        """What to draw, oldest first."""
        if tuple(values) != self._values:
            self._values = tuple(values)
            self.update()

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        paint_sparkline(painter, QRectF(self.rect()), self._values, self._theme.colour("textSecondary"))
        painter.end()


class Bar(QWidget):
    """A sensor's value between its limits; None shows only the track."""

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
        """What is shown: 0 to 1, or None."""
        return self._fraction

    def set_fraction(self, fraction: float | None) -> None:
        """Show a share from 0 to 1 (outside values are cut), or None for "not known"."""
        value = None if fraction is None or fraction != fraction else min(max(fraction, 0.0), 1.0)  # noqa: PLR0124
        if value != self._fraction:
            self._fraction = value
            self.update()

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        rect = QRectF(self.rect())
        paint.box(painter, rect, rect.height() / 2, self._theme.colour("sunken"))
        if self._fraction:
            rect.setWidth(max(rect.height(), rect.width() * self._fraction))
            paint.box(painter, rect, rect.height() / 2, self._theme.colour("accent"))
        painter.end()


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


class SearchField(QLineEdit):
    """A field to filter or find, with its icon inside and the key that leads to it at the right."""

    def __init__(self, theme: Theme, placeholder: str, key: str = "") -> None:
        super().__init__()
        self._theme, self._key = theme, key
        self.setPlaceholderText(placeholder)
        self.setAccessibleName(placeholder)
        self.setProperty("quiet", "true")
        self.setProperty("focusRadius", theme.radius("control"))
        self.setMinimumHeight(26)
        EditMenu(theme, self)
        self._arrange()
        theme.changed.connect(self._arrange)

    def _arrange(self) -> None:
        right = round(paint.key_width(self._theme, self._key)) + 2 if self._key else 0
        self.setTextMargins(20, 0, right, 0)

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        painter = QPainter(self)
        middle = self.height() / 2
        paint_icon(painter, QRectF(9, middle - 7, 14, 14), "search", self._theme.colour("textTertiary"))
        if self._key and not self.text():
            paint.key_cap(painter, self._theme, self.width() - 5, middle, self._key)
        painter.end()


TILE = 28


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
