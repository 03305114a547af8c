"""Painting of shapes and texts: boxes, lines, single-line text, key caps.

The module also contains helpers for tooltips, screen readers, visibility and the style of widgets.
"""

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
    """Paint a box with rounded corners.

    Args:
        painter: Painter.
        rect: Rectangle that includes the border.
        radius: Corner radius in px.
        fill: Colour of the inside, or None.
        border: Colour of the border, or None.
        width: Width of the border in px.
    """
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setBrush(fill if fill is not None else Qt.BrushStyle.NoBrush)
    if border is None:
        painter.setPen(Qt.PenStyle.NoPen)
        painter.drawRoundedRect(rect, radius, radius)
        return
    painter.setPen(QPen(border, width))
    inner = rect.adjusted(width / 2, width / 2, -width / 2, -width / 2)
    inner_radius = max(0.0, radius - width / 2)
    painter.drawRoundedRect(inner, inner_radius, inner_radius)


def hairline(painter: QPainter, rect: QRectF, edge: Qt.Edge, colour: QColor) -> None:
    """Paint a line along the inside of an edge, 1 logical pixel wide but aligned to device pixels.

    The width is the same at every position, even with a fractional device pixel ratio.
    """
    ratio = painter.device().devicePixelRatioF()
    line_width = max(1, int(ratio)) / ratio
    line = QRectF(rect)
    if edge == Qt.Edge.TopEdge:
        line.setHeight(line_width)
    elif edge == Qt.Edge.BottomEdge:
        line.setTop(rect.bottom() - line_width)
    elif edge == Qt.Edge.LeftEdge:
        line.setWidth(line_width)
    else:
        line.setLeft(rect.right() - line_width)
    is_antialiased = painter.testRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)
    painter.fillRect(line, colour)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing, is_antialiased)


def text_line(
    painter: QPainter,
    rect: QRectF,
    text: str,
    font: QFont,
    colour: QColor,
    align: Qt.AlignmentFlag = LEFT,
) -> None:
    """Paint one line of text, elided at its end if it doesn't fit."""
    painter.setFont(font)
    painter.setPen(colour)
    elided = QFontMetricsF(font).elidedText(text, Qt.TextElideMode.ElideRight, rect.width() + 1)
    painter.drawText(rect, int(align), elided)


def two_lines(font: QFont, text: str, width: float) -> list[str]:
    """Break a text into at most two lines, of which only the first is limited to the width.

    Args:
        font: Font.
        text: Text.
        width: Width of the first line in px.
    """
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
    """Return the width in px of the key cap for a key."""
    return max(MIN_KEY_SIZE, width_of(theme.font("caption"), key) + 2 * KEY_PADDING)


def key_cap(painter: QPainter, theme: Theme, right: float, middle: float, key: str) -> QRectF:
    """Paint a key cap and return its rectangle.

    Args:
        painter: Painter.
        theme: Theme.
        right: Right edge in px.
        middle: Vertical centre in px.
        key: Formatted name of the key.
    """
    height = max(MIN_KEY_SIZE, theme.scaled(MIN_KEY_SIZE))
    width = key_width(theme, key)
    rect = QRectF(right - width, middle - height / 2, width, height)
    box(painter, rect, theme.radius("key"), theme.colour("sunken"), theme.colour("borderStrong"))
    text_line(painter, rect, key, theme.font("caption"), theme.colour("textSecondary"), CENTRE)
    return rect


def set_elision_tooltip(widget: QWidget, text: str) -> None:
    """Show the full text as tooltip if the widget elides it, unless the widget has its own tooltip."""
    has_own_tooltip = widget.property("tip") or (widget.toolTip() and not widget.property("shortened"))
    if has_own_tooltip:
        return
    is_elided = widget.width() < widget.sizeHint().width() - 1
    widget.setProperty("shortened", is_elided)
    widget.setToolTip(plain.tip(text if is_elided else ""))


def announce(widget: QWidget, text: str) -> None:
    """Announce a text to screen readers, for events such as alerts; not for values that change often."""
    if QAccessible.isActive():
        QAccessible.updateAccessibility(QAccessibleAnnouncementEvent(widget, text))


def show_when(widget: QWidget, visible: bool) -> None:
    """Show a widget if `visible`, else hide it.

    Unlike `setVisible`, this doesn't show a widget without a parent as a window.
    """
    if not visible:
        widget.hide()
    elif widget.parentWidget() is not None:
        widget.show()
    else:
        widget.setAttribute(Qt.WidgetAttribute.WA_WState_ExplicitShowHide, False)


def set_style_property(widget: QWidget, name: str, value: object) -> None:
    """Set a dynamic property that the style sheet uses, and apply the style sheet again if it changed.

    Widgets that were never shown get the style later.
    """
    if widget.property(name) != value:
        widget.setProperty(name, value)
        if widget.testAttribute(Qt.WidgetAttribute.WA_WState_Polished):
            widget.style().unpolish(widget)
            widget.style().polish(widget)
            widget.update()
