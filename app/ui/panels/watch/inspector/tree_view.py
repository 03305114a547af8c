"""Tree view of the inspector: keys, values, and fading highlights of changes."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

from PySide6.QtCore import (
    QModelIndex,
    QPersistentModelIndex,
    QPoint,
    QPointF,
    QRect,
    QRectF,
    QSize,
    Qt,
    Signal,
)
from PySide6.QtGui import QColor, QFocusEvent, QFontMetricsF, QMouseEvent, QPainter, QPen
from PySide6.QtWidgets import QApplication, QStyledItemDelegate, QStyleOptionViewItem, QTreeView

from app.core.messages.inspected import NO_BASE
from app.ui.panels.watch.inspector.tree_model import NODE_ROLE, TreeModel, TreeNode
from app.ui.panels.watch.inspector.values import is_container, size_of, value_text
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme

Index = QModelIndex | QPersistentModelIndex
INDENT, LEFT_EDGE, CHEVRON, VALUE_EDGE = 14, 8, 14, 10
BAR_WIDTH = 3
BAR_ROLES = {"": "changed", "changed": "changed", "added": "ok", "removed": "error"}
MARK_SIGNS = {"added": "+ ", "removed": "\u2212 "}
LEFT = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter


def blend(under: QColor, top: QColor, opacity: float) -> QColor:
    """Blend `top` onto `under` with an opacity of 0 to 1."""
    inverse = 1.0 - opacity
    return QColor.fromRgbF(
        under.redF() * inverse + top.redF() * opacity,
        under.greenF() * inverse + top.greenF() * opacity,
        under.blueF() * inverse + top.blueF() * opacity,
    )


class _RowHeightDelegate(QStyledItemDelegate):
    """Delegate that sets the row height; the view paints everything else."""

    def __init__(self, view: TreeView) -> None:
        super().__init__(view)
        self._view = view

    def sizeHint(self, _option: QStyleOptionViewItem, _index: Index) -> QSize:
        return QSize(80, self._view.row_height)


class TreeView(QTreeView):
    """Tree view of one message.

    Args:
        model: Model of the message.
        clock: Returns the monotonic time in s, as in `TreeNode.changed_s`.

    Signals:
        drag_started: Node that the user started to drag.
    """

    drag_started = Signal(object)

    def __init__(self, theme: Theme, model: TreeModel, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self.theme = theme
        self._clock = clock
        self._tree = model
        self.row_height = theme.size("row", "tree")
        self._is_keyboard_navigation = False
        self._pressed_at: tuple[QPoint, TreeNode] | None = None
        self.setModel(model)
        self.setItemDelegate(_RowHeightDelegate(self))
        self.setHeaderHidden(True)
        self.setUniformRowHeights(True)
        self.setIndentation(INDENT)
        self.setRootIsDecorated(True)
        self.setVerticalScrollMode(QTreeView.ScrollMode.ScrollPerPixel)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setEditTriggers(QTreeView.EditTrigger.NoEditTriggers)
        self.setExpandsOnDoubleClick(False)
        self.setMouseTracking(True)

    def highlight_opacity(self, node: TreeNode) -> float:
        """Return the opacity of a node's highlight: 1 at the time of a change, 0 after the fade.

        If there is a base message, the highlight doesn't fade: 1 for nodes that differ, 0 for all others.
        """
        if node.mark:
            return 1.0
        if node.changed_s is None or node.base is not NO_BASE:
            return 0.0
        fade_s = self.theme.duration("changedFade") / 1000
        age_s = self._clock() - node.changed_s
        if fade_s <= 0:  # reduced motion: highlighted for a second instead of fading
            return 1.0 if age_s < 1.0 else 0.0
        return max(0.0, 1.0 - age_s / fade_s)

    def is_fading(self) -> bool:
        """Return True if the view must be repainted because a highlight may still be fading."""
        changed_at_s = self._tree.changed_at_s
        return changed_at_s is not None and self._clock() - changed_at_s < 1.2

    def expand_small(self, rows: int) -> None:
        """Expand objects and lists with few children, upper levels first.

        Args:
            rows: Maximum number of visible rows.
        """
        waiting, visible_rows = [QModelIndex()], self._tree.rowCount()
        while waiting:
            above = waiting.pop(0)
            for row in range(self._tree.rowCount(above)):
                index = self._tree.index(row, 0, above)
                node = self._tree.node(index)
                size = size_of(node.value)
                is_small = 0 < size <= (8 if isinstance(node.value, Mapping) else 1)
                if is_small and node.depth < 3 and visible_rows + size <= rows:
                    visible_rows += size
                    self._tree.fetchMore(index)
                    self.expand(index)
                    waiting.append(index)

    def drawBranches(self, _painter: QPainter, _rect: QRect, _index: Index) -> None:
        return

    def drawRow(self, painter: QPainter, option: QStyleOptionViewItem, index: Index) -> None:
        node = index.data(NODE_ROLE)
        if not isinstance(node, TreeNode):
            return
        rect = QRect(option.rect)
        rect.setLeft(0)
        is_selected = index == self.currentIndex()
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        background = self.theme.colour("selected" if is_selected else "panel")
        if is_selected:
            painter.fillRect(rect, background)
        opacity = self.highlight_opacity(node)
        if opacity > 0:
            bar = blend(background, self.theme.colour(BAR_ROLES[node.mark]), opacity)
            painter.fillRect(QRect(0, rect.top() + 4, BAR_WIDTH, rect.height() - 8), bar)
        key_end = self._paint_key(painter, rect, node, is_selected=is_selected)
        if not node.is_container:
            self._paint_value(painter, rect, node, key_end, background, opacity)
        if is_selected and self._is_keyboard_navigation and self.hasFocus():
            painter.setPen(QPen(self.theme.colour("focus"), 2))
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.drawRoundedRect(QRectF(rect).adjusted(1, 1, -1, -1), 4, 4)
        painter.restore()

    def _paint_key(self, painter: QPainter, rect: QRect, node: TreeNode, *, is_selected: bool) -> float:
        theme = self.theme
        left = LEFT_EDGE + node.depth * INDENT
        if node.is_container and self._tree.hasChildren(self._tree.index_of(node)):
            name = "chevron-down" if self.isExpanded(self._tree.index_of(node)) else "chevron-right"
            box = QRectF(left, rect.center().y() - CHEVRON / 2 + 0.5, CHEVRON, CHEVRON)
            paint_icon(painter, box, name, theme.colour("textSecondary"))
        font = theme.font("code")
        font.setStrikeOut(node.mark == "removed")
        metrics = QFontMetricsF(font)
        x = float(left + CHEVRON + 4)
        room = rect.width() - x - VALUE_EDGE
        key_text = MARK_SIGNS.get(node.mark, "") + str(node.key)
        key = metrics.elidedText(key_text, Qt.TextElideMode.ElideRight, max(40.0, room * 0.6))
        painter.setFont(font)
        role = BAR_ROLES[node.mark] if node.mark in MARK_SIGNS else "selectedText" if is_selected else "text"
        painter.setPen(theme.colour(role))
        width = metrics.horizontalAdvance(key)
        painter.drawText(QRectF(x, rect.top(), width + 2, rect.height()), LEFT, key)
        x += width
        if node.is_container:
            count = value_text(node.value)
            painter.setPen(theme.colour("accentText" if is_selected else "textTertiary"))
            painter.drawText(QRectF(x + 7, rect.top(), 90, rect.height()), LEFT, count)
        return x

    def _paint_value(
        self,
        painter: QPainter,
        rect: QRect,
        node: TreeNode,
        key_end: float,
        background: QColor,
        opacity: float,
    ) -> None:
        theme = self.theme
        metrics = QFontMetricsF(theme.font("code"))
        right = rect.right() - VALUE_EDGE - 5
        room = max(30.0, right - key_end - 16)
        text = metrics.elidedText(value_text(node.value), Qt.TextElideMode.ElideRight, room)
        width = metrics.horizontalAdvance(text)
        colour = theme.colour(_role(node.value))
        if opacity > 0 and node.mark not in MARK_SIGNS:
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(blend(background, theme.colour("changedTint"), opacity))
            painter.drawRoundedRect(
                QRectF(right - width - 5, rect.top() + 3, width + 10, rect.height() - 6), 4, 4
            )
            colour = blend(colour, theme.colour("changed"), opacity)
        if node.mark in MARK_SIGNS:
            colour = theme.colour(BAR_ROLES[node.mark])
        painter.setFont(theme.font("code"))
        painter.setPen(colour)
        painter.drawText(QRectF(right - width, rect.top(), width + 2, rect.height()), LEFT, text)
        self._paint_old_value(painter, rect, node, right - width - 10, key_end + 12)

    def _paint_old_value(
        self, painter: QPainter, rect: QRect, node: TreeNode, right: float, left: float
    ) -> None:
        if node.mark != "changed" or is_container(node.base):
            return
        text = f"{value_text(node.base)} \u2192"
        width = QFontMetricsF(painter.font()).horizontalAdvance(text)
        if right - width >= left:
            painter.setPen(self.theme.colour("textTertiary"))
            painter.drawText(QRectF(right - width, rect.top(), width + 2, rect.height()), LEFT, text)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self._is_keyboard_navigation = False
        index = self.indexAt(event.position().toPoint())
        node = index.data(NODE_ROLE) if index.isValid() else None
        if isinstance(node, TreeNode) and event.button() == Qt.MouseButton.LeftButton:
            self.setCurrentIndex(index)
            self.setFocus(Qt.FocusReason.MouseFocusReason)
            self._pressed_at = (event.position().toPoint(), node)
            if node.is_container and _is_on_chevron(event.position(), node):
                self.setExpanded(index, not self.isExpanded(index))
            return
        super().mousePressEvent(event)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        # Starts a drag after the platform's drag distance.
        if self._pressed_at is not None and event.buttons() & Qt.MouseButton.LeftButton:
            press_position, node = self._pressed_at
            distance = (event.position().toPoint() - press_position).manhattanLength()
            if distance >= QApplication.startDragDistance():
                self._pressed_at = None
                self.drag_started.emit(node)
            return
        super().mouseMoveEvent(event)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        self._pressed_at = None
        super().mouseReleaseEvent(event)

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        index = self.indexAt(event.position().toPoint())
        node = index.data(NODE_ROLE) if index.isValid() else None
        if isinstance(node, TreeNode) and node.is_container and not _is_on_chevron(event.position(), node):
            self.setExpanded(index, not self.isExpanded(index))

    def focusInEvent(self, event: QFocusEvent) -> None:
        self._is_keyboard_navigation = event.reason() != Qt.FocusReason.MouseFocusReason
        super().focusInEvent(event)


def _is_on_chevron(position: QPointF, node: TreeNode) -> bool:
    left = LEFT_EDGE + node.depth * INDENT
    return left - 4 <= position.x() <= left + CHEVRON + 4


def _role(value: object) -> str:
    if isinstance(value, str):
        return "ok"
    return "textTertiary" if value is None else "text"
