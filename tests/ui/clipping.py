"""Detection of clipped text: labels, buttons and chips that are smaller than their text or cut off.

Text that is elided on purpose has a tooltip with the complete text.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtGui import QFontMetricsF
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractScrollArea,
    QComboBox,
    QDockWidget,
    QLabel,
    QLineEdit,
    QWidget,
)

from app.ui.widgets import Button, Chip, ElidedLabel, StatusItem
from app.ui.widgets.table.cells import PADDING, TableHeader, header_font

SLACK = 1.5
LONGER = 0.35
ASKED = (QAbstractButton, Chip, StatusItem)


def shown(root: QWidget) -> Iterator[QWidget]:
    """Yield every visible widget below `root`, including those outside of a scroll area's viewport."""
    docks = root.findChildren(QDockWidget)
    behind = [dock for dock in docks if dock.x() < -dock.width() / 2]  # Qt moves docks with hidden tabs away
    hidden = {each for dock in behind for each in dock.findChildren(QWidget)}
    for widget in [root, *root.findChildren(QWidget)]:
        if widget.isVisibleTo(root) and widget.width() > 0 and widget not in hidden:
            yield widget


def lengthen(root: QWidget) -> None:
    """Make every label and button text about a third longer, as translations do."""
    for widget in shown(root):
        if isinstance(widget, QLabel | QAbstractButton) and widget.text() and not widget.property("long"):
            widget.setProperty("long", True)
            widget.setText(longer(widget.text()))


def longer(text: str) -> str:
    """Return a longer text: a single word gets more letters, a sentence more words."""
    more = math.ceil(len(text) * LONGER)
    if " " not in text:
        return text + "n" * more
    return text + " nnnn" * (more // 5) + "n" * (more % 5)


def clipped(root: QWidget) -> list[str]:
    """Return a sentence for each widget that is too small for its text."""
    widgets = list(shown(root))
    heads = [widget for widget in widgets if isinstance(widget, TableHeader)]
    return [
        *(fault for widget in widgets for fault in _faults(widget, root)),
        *(fault for head in heads for fault in _heads(head)),
    ]


def sideways(root: QWidget) -> list[str]:
    """Return a sentence for each scroll area that can be scrolled horizontally."""
    areas = [area for area in shown(root) if isinstance(area, QAbstractScrollArea) and area.accessibleName()]
    never = Qt.ScrollBarPolicy.ScrollBarAlwaysOff
    return [
        f"{area.accessibleName()} is {area.horizontalScrollBar().maximum()} too wide"
        for area in areas
        if area.horizontalScrollBar().maximum() > 0 and area.horizontalScrollBarPolicy() != never
    ]


def _faults(widget: QWidget, root: QWidget) -> Iterator[str]:
    said = _name(widget)
    if isinstance(widget, ElidedLabel) or not said:
        return
    if isinstance(widget, QLabel):
        yield from _label(widget, said)
    elif isinstance(widget, ASKED):
        wanted = widget.sizeHint()
        if widget.width() < wanted.width() - SLACK and not _tip(widget):
            yield f"{said} is {widget.width()} wide and needs {wanted.width()}"
        yield from _below_minimum(widget, said)
        if widget.height() < wanted.height() - SLACK:
            yield f"{said} is {widget.height()} high and needs {wanted.height()}"
    elif isinstance(widget, QLineEdit | QComboBox):
        high = QFontMetricsF(widget.font()).height()
        if widget.height() < high:
            yield f"{said} is {widget.height()} high and its letters are {high:.0f}"
    if isinstance(widget, (QLabel, *ASKED)):
        cut = _cut(widget, root)
        if cut:
            yield f"{said} is cut by {cut}"


def _below_minimum(widget: QWidget, said: str) -> Iterator[str]:
    least = widget.minimumSizeHint().width()
    if isinstance(widget, Button) and widget.width() < least - SLACK:
        yield f"{said} is {widget.width()} wide and can be shortened only to {least}"


def _heads(head: TableHeader) -> Iterator[str]:
    """Yield a sentence for each column header that is too narrow and has no tooltip with its text."""
    model, across = head.model(), Qt.Orientation.Horizontal
    for place in range(head.count()):
        words = str(model.headerData(place, across, Qt.ItemDataRole.DisplayRole))
        tip = str(model.headerData(place, across, Qt.ItemDataRole.ToolTipRole))
        wide, needed = head.sectionSize(place), head_needs(head, words)
        if not head.isSectionHidden(place) and wide < needed and words not in tip:
            yield f"the head “{words}” is {wide} wide and needs {needed:.0f}"


def head_needs(head: TableHeader, words: str) -> float:
    """Return the width in pixels of a column whose header is not elided."""
    return QFontMetricsF(header_font(head._theme)).horizontalAdvance(words) + 2 * PADDING


def _label(label: QLabel, said: str) -> Iterator[str]:
    if label.pixmap() is not None and not label.pixmap().isNull():
        return
    if label.wordWrap():
        wanted = label.heightForWidth(label.width())
        if label.height() < wanted - SLACK:
            yield f"{said} is {label.height()} high and needs {wanted}"
        return
    wide = label.sizeHint().width()
    if label.width() < wide - SLACK and not _tip(label):
        yield f"{said} is {label.width()} wide and needs {wide}"
    high = QFontMetricsF(label.font()).height()
    if label.height() < high - SLACK:
        yield f"{said} is {label.height()} high and its letters are {high:.0f}"


def _cut(widget: QWidget, root: QWidget) -> str:
    """Return the ancestor that clips a widget, or "" if there is none or the widget can be scrolled to."""
    rect = widget.rect()
    step = widget
    while step is not root:
        parent = step.parentWidget()
        if parent is None:
            return ""
        rect.translate(step.pos())
        if _scrolls(parent, rect):
            return ""
        room = parent.rect()
        out = QRect(rect).united(room)
        slack = 2
        if out.width() > room.width() + slack or out.height() > room.height() + slack:
            return f"{type(parent).__name__} ({parent.accessibleName()}) by {out.size() - room.size()}"
        step = parent
    return ""


def _scrolls(viewport: QWidget, rect: QRect) -> bool:
    """Return whether an area can scroll to `rect`: always vertically, horizontally only with a scroll bar."""
    area = viewport.parentWidget()
    if not isinstance(area, QAbstractScrollArea) or area.viewport() is not viewport:
        return False
    sideways = area.horizontalScrollBarPolicy() != Qt.ScrollBarPolicy.ScrollBarAlwaysOff
    return sideways or (rect.left() >= -2 and rect.right() <= viewport.width() + 2)


def _tip(widget: QWidget) -> bool:
    return bool(widget.toolTip())


def _name(widget: QWidget) -> str:
    text = getattr(widget, "text", None)
    words = text() if callable(text) else text
    words = words if isinstance(words, str) else widget.accessibleName()
    where = widget.mapTo(widget.window(), QPoint(0, 0))
    return f"{type(widget).__name__} “{words[:50]}” at {where.x()},{where.y()}" if words else ""
