"""Shapes of painted widgets: crisp boxes, single-line text, key caps."""

from __future__ import annotations

from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import (
    QAccessible,
    QAccessibleAnnouncementEvent,
    QColor,
    QFont,
    QFontMetricsF,
    QPainter,
    QPen,
)
from PySide6.QtWidgets import QWidget

from app.ui.text import plain
from app.ui.theme.theme import Theme

LEFT = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
CENTRE = Qt.AlignmentFlag.AlignCenter
KEY_PADDING = 6.0
MIN_KEY_SIZE = 18.0


def box(
    painter: QPainter,
    rect: QRectF,
    radius: float,
    fill: QColor | None,
    border: QColor | None = None,
    width: float = 1.0,
) -> None:
    """Paint a rounded box, with its border inside ``rect`` and on whole pixels."""
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setBrush(fill if fill is not None else Qt.BrushStyle.NoBrush)
    if border is None:
        painter.setPen(Qt.PenStyle.NoPen)
        painter.drawRoundedRect(rect, radius, radius)
        return
    painter.setPen(QPen(border, width))
    inner = rect.adjusted(width / 2, width / 2, -width / 2, -width / 2)
    inside = max(0.0, radius - width / 2)
    painter.drawRoundedRect(inner, inside, inside)


def hairline(painter: QPainter, rect: QRectF, edge: Qt.Edge, colour: QColor) -> None:
    """Paint a line inside one edge of ``rect`` with the same thickness everywhere: 1 px, even at 125 %."""
    ratio = painter.device().devicePixelRatioF()
    thin = max(1, int(ratio)) / ratio
    line = QRectF(rect)
    if edge == Qt.Edge.TopEdge:
        line.setHeight(thin)
    elif edge == Qt.Edge.BottomEdge:
        line.setTop(rect.bottom() - thin)
    elif edge == Qt.Edge.LeftEdge:
        line.setWidth(thin)
    else:
        line.setLeft(rect.right() - thin)
    smooth = painter.testRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)
    painter.fillRect(line, colour)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing, smooth)


def text_line(
    painter: QPainter,
    rect: QRectF,
    text: str,
    font: QFont,
    colour: QColor,
    align: Qt.AlignmentFlag = LEFT,
) -> None:
    """Paint one line of text, elided at its end if it does not fit."""
    painter.setFont(font)
    painter.setPen(colour)
    fitting = QFontMetricsF(font).elidedText(text, Qt.TextElideMode.ElideRight, rect.width() + 1)
    painter.drawText(rect, int(align), fitting)


def two_lines(font: QFont, text: str, width: float) -> list[str]:
    """Break a text into one or two lines. The second line may be too long."""
    line, *rest = text.split(" ")
    while rest and width_of(font, f"{line} {rest[0]}") <= width:
        line = f"{line} {rest.pop(0)}"
    return [line, " ".join(rest)] if rest else [line]


def width_of(font: QFont, text: str) -> float:
    """Return the width in px of a line of text."""
    return QFontMetricsF(font).horizontalAdvance(text)


def height_of(font: QFont) -> float:
    """Return the height in px of a line of text."""
    return QFontMetricsF(font).height()


def key_width(theme: Theme, key: str) -> float:
    """Return the width in px of a key cap."""
    return max(MIN_KEY_SIZE, width_of(theme.font("caption"), key) + 2 * KEY_PADDING)


def key_cap(painter: QPainter, theme: Theme, right: float, middle: float, key: str) -> QRectF:
    """Paint a key cap whose right edge is at ``right``. Return its rectangle."""
    height = max(MIN_KEY_SIZE, theme.scaled(MIN_KEY_SIZE))
    width = key_width(theme, key)
    rect = QRectF(right - width, middle - height / 2, width, height)
    box(painter, rect, theme.radius("key"), theme.colour("sunken"), theme.colour("borderStrong"))
    text_line(painter, rect, key, theme.font("caption"), theme.colour("textSecondary"), CENTRE)
    return rect


def set_elision_tooltip(widget: QWidget, words: str) -> None:
    """Set a tooltip with the full text if it is elided. An explicit tooltip is kept."""
    own = widget.property("tip") or (widget.toolTip() and not widget.property("shortened"))
    if own:
        return
    short = widget.width() < widget.sizeHint().width() - 1
    widget.setProperty("shortened", short)
    widget.setToolTip(plain.tip(words if short else ""))


def announce(widget: QWidget, words: str) -> None:
    """Announce a text to screen readers. Used for alerts and stopped robots, never for changing values."""
    if QAccessible.isActive():
        QAccessible.updateAccessibility(QAccessibleAnnouncementEvent(widget, words))


def show_when(widget: QWidget, shown: bool) -> None:
    """Show or hide a widget. Unlike with `setVisible`, a widget without a parent doesn't become a window."""
    if not shown:
        widget.hide()
    elif widget.parentWidget() is not None:
        widget.show()
    else:
        widget.setAttribute(Qt.WidgetAttribute.WA_WState_ExplicitShowHide, False)
