"""Tree view of connected pages: a row with a disconnect button for each page, and a row for each topic."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

from PySide6.QtCore import (
    QEvent,
    QModelIndex,
    QPersistentModelIndex,
    QPoint,
    QRect,
    QRectF,
    QSize,
    Qt,
    Signal,
)
from PySide6.QtGui import (
    QFocusEvent,
    QFont,
    QKeyEvent,
    QKeySequence,
    QMouseEvent,
    QPainter,
    QPen,
    QResizeEvent,
)
from PySide6.QtWidgets import (
    QFrame,
    QHeaderView,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTreeView,
    QWidget,
)

from app.core.network.web_page_list import ListedPage
from app.core.network.web_texts import location_text, page_icon, page_name
from app.ui.shell.dialogs.web_pages.page_model import PageTreeModel
from app.ui.shell.dialogs.web_pages.page_texts import (
    direction_text,
    dropped_text,
    limit_text,
    since_text,
)
from app.ui.text import plain
from app.ui.text.numbers import bandwidth_text, rate_text
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.menus import Menu
from app.ui.widgets.table.cells import header_font
from nep.i18n import _

if TYPE_CHECKING:
    from nep.programs.web.context import PageTopic

Index = QModelIndex | QPersistentModelIndex
PAGE_ROW_HEIGHT, TOPIC_ROW_HEIGHT = 28, 23
_EDGE, _PADDING, _ICON, _GAP = 8, 6, 15, 6
PageColumn = Literal["rate", "bandwidth", "dropped", "disconnect"]
_WIDTHS: dict[PageColumn, int] = {"rate": 66, "bandwidth": 88, "dropped": 78, "disconnect": 34}
_DISCONNECTED_ROLE = "textDisabled"


class _PageHeader(QHeaderView):
    """Header with the titles of the columns that `PageTree` paints itself."""

    def __init__(self, theme: Theme, tree: PageTree) -> None:
        super().__init__(Qt.Orientation.Horizontal, tree)
        self._theme, self._tree = theme, tree
        self.setSectionsClickable(False)
        self.setStretchLastSection(True)

    def sizeHint(self) -> QSize:
        return QSize(super().sizeHint().width(), round(self._theme.scaled(TOPIC_ROW_HEIGHT)) + 2)

    def paintSection(self, painter: QPainter, rect: QRect, _section: int) -> None:
        theme, font = self._theme, header_font(self._theme)
        colour = theme.colour("textTertiary")
        painter.save()
        painter.fillRect(rect, theme.colour("raised"))
        painter.setPen(theme.colour("border"))
        painter.drawLine(rect.bottomLeft(), rect.bottomRight())
        box = QRectF(rect)
        for column, title in column_titles().items():
            paint.text_line(painter, self._tree.cell_rect(column, box), title, font, colour, paint.RIGHT)
        box.setRight(self._tree.cell_rect("rate", box).left())
        paint.text_line(painter, box.adjusted(_EDGE, 0, 0, 0), _("Page and topics"), font, colour)
        painter.restore()


def column_titles() -> dict[PageColumn, str]:
    """Return the translated titles of the columns on the right, by column."""
    return {"rate": _("Rate /s"), "bandwidth": _("Bandwidth"), "dropped": _("Dropped")}


class _RowHeightDelegate(QStyledItemDelegate):
    def __init__(self, theme: Theme, parent: QWidget) -> None:
        super().__init__(parent)
        self.measure(theme)

    def measure(self, theme: Theme) -> None:
        self._page_size, self._topic_size = (
            QSize(40, round(theme.scaled(height))) for height in (PAGE_ROW_HEIGHT, TOPIC_ROW_HEIGHT)
        )

    def sizeHint(self, _option: QStyleOptionViewItem, index: Index) -> QSize:
        return self._topic_size if index.internalId() else self._page_size


class PageTree(QTreeView):
    """Tree view of connected pages and their topics.

    `disconnect_requested` is emitted with the id of a page, and `copy_requested` with the text to copy.
    """

    disconnect_requested = Signal(int)
    copy_requested = Signal(str)

    def __init__(self, theme: Theme, model: PageTreeModel) -> None:
        super().__init__()
        self.theme, self._pages = theme, model
        self._is_keyboard_navigation = False
        self._widths = dict(_WIDTHS)
        self._hovered_index = QPersistentModelIndex()
        self._is_button_hovered = False
        self.setModel(model)
        self._height_delegate = _RowHeightDelegate(theme, self)
        self.setItemDelegate(self._height_delegate)
        self.setHeader(_PageHeader(theme, self))
        self.setAccessibleName(_("Connected pages"))
        self.setProperty("raised", "true")
        self.setProperty("ownFocus", True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setIndentation(0)
        self.setRootIsDecorated(False)
        self.setVerticalScrollMode(QTreeView.ScrollMode.ScrollPerPixel)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setEditTriggers(QTreeView.EditTrigger.NoEditTriggers)
        self.setExpandsOnDoubleClick(False)
        self.setMouseTracking(True)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.customContextMenuRequested.connect(self._show_menu)
        model.rowsInserted.connect(self._expand_new)
        theme.changed.connect(self._measure)

    def current_page(self) -> ListedPage | None:
        """Return the page of the current row, which can be one of its topics; None if no row is current."""
        row = self._pages.page_row(self.currentIndex())
        return None if row is None else row.listed_page

    def disconnect_current(self) -> None:
        """Emit `disconnect_requested` for the current page if it is connected."""
        listed_page = self.current_page()
        if listed_page is not None and listed_page.gone_s is None:
            self.disconnect_requested.emit(listed_page.page.id)

    def copy_current(self) -> None:
        """Emit `copy_requested` with the name of the current topic, or the origin of the current page.

        The address replaces the origin of a page without one.
        """
        topic, listed_page = self._pages.topic(self.currentIndex()), self.current_page()
        if topic is not None:
            self.copy_requested.emit(topic.topic)
        elif listed_page is not None:
            self.copy_requested.emit(listed_page.page.origin or listed_page.page.address)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        self._is_keyboard_navigation = True
        if event.key() == Qt.Key.Key_Delete:
            self.disconnect_current()
        elif event.matches(QKeySequence.StandardKey.Copy):
            self.copy_current()
        elif event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter, Qt.Key.Key_Space}:
            self._toggle(self.currentIndex())
        elif event.key() == Qt.Key.Key_Escape:
            event.ignore()  # the parent widget closes the sheet
        else:
            super().keyPressEvent(event)

    def focusInEvent(self, event: QFocusEvent) -> None:
        self._is_keyboard_navigation = event.reason() != Qt.FocusReason.MouseFocusReason
        super().focusInEvent(event)
        if self._is_keyboard_navigation and not self.currentIndex().isValid():
            self.setCurrentIndex(self._pages.index(0, 0))

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self._is_keyboard_navigation = False
        index = self.indexAt(event.position().toPoint())
        if event.button() != Qt.MouseButton.LeftButton or not index.isValid():
            super().mousePressEvent(event)
            return
        self.setFocus(Qt.FocusReason.MouseFocusReason)
        if not self._is_on_button(event.position().toPoint()):
            self.setCurrentIndex(index)
            if event.position().x() < _EDGE + self.theme.scaled(_ICON) + _GAP:
                self._toggle(index)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        position = event.position().toPoint()
        row = self._pages.page_row(self.indexAt(position))
        if event.button() == Qt.MouseButton.LeftButton and row is not None and self._is_on_button(position):
            self.disconnect_requested.emit(row.id)
            return
        super().mouseReleaseEvent(event)

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        if not self._is_on_button(event.position().toPoint()):
            self._toggle(self.indexAt(event.position().toPoint()))

    def viewportEvent(self, event: QEvent) -> bool:
        if event.type() in {QEvent.Type.MouseMove, QEvent.Type.HoverMove}:
            self._hover(event.position().toPoint())  # type: ignore[attr-defined]
        elif event.type() in {QEvent.Type.Leave, QEvent.Type.HoverLeave}:
            self._hover(QPoint(-1, -1))
        return super().viewportEvent(event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._measure()

    def dataChanged(self, first: Index, last: Index, _roles: Sequence[int] = ()) -> None:
        # Skips QTreeView's size query for each changed cell, which takes 300 ms for 5000 topics. Rows have a
        # fixed height.
        rect = self.visualRect(first).united(self.visualRect(last))
        if not rect.isEmpty():
            rect.setLeft(0)
            rect.setRight(self.viewport().width())
            self.viewport().update(rect)

    def _expand_new(self, parent: QModelIndex, first: int, last: int) -> None:
        for row in range(first, last + 1) if not parent.isValid() else ():
            self.expand(self._pages.index(row, 0))
        if parent.isValid() and self._pages.rowCount(parent) == last - first + 1:
            self.expand(parent)  # Qt doesn't keep a page without topics expanded

    def _toggle(self, index: QModelIndex) -> None:
        if index.isValid() and not index.parent().isValid():
            self.setExpanded(index, not self.isExpanded(index))

    def _is_on_button(self, position: QPoint) -> bool:
        index = self.indexAt(position)
        row = self._pages.page_row(index)
        is_page = row is not None and self._pages.topic(index) is None and row.listed_page.gone_s is None
        return is_page and position.x() >= self.cell_rect("disconnect", QRectF()).left() - _PADDING

    def _hover(self, position: QPoint) -> None:
        index, is_over_button = QPersistentModelIndex(self.indexAt(position)), self._is_on_button(position)
        if (index, is_over_button) != (self._hovered_index, self._is_button_hovered):
            self._hovered_index, self._is_button_hovered = index, is_over_button
            self.viewport().setToolTip(plain.tip(_("Disconnect (Delete)")) if is_over_button else "")
            self.viewport().update()

    def _show_menu(self, position: QPoint) -> None:
        index = self.indexAt(position)
        if not index.isValid():
            return
        self.setCurrentIndex(index)
        menu = Menu(self.theme, self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        text = _("Copy the topic's name") if self._pages.topic(index) is not None else _("Copy the address")
        menu.addAction(text, self.copy_current)
        disconnect_action = menu.addAction(_("Disconnect"), self.disconnect_current)
        listed_page = self.current_page()
        disconnect_action.setEnabled(listed_page is not None and listed_page.gone_s is None)
        menu.popup(self.viewport().mapToGlobal(position))

    def _measure(self) -> None:
        titles, font = column_titles(), header_font(self.theme)
        for column, width in _WIDTHS.items():
            title_width = paint.width_of(font, titles.get(column, "")) + 2 * _PADDING + 1
            self._widths[column] = max(round(self.theme.scaled(width)), round(title_width))
        self._height_delegate.measure(self.theme)

    def drawBranches(self, _painter: QPainter, _rect: QRect, _index: Index) -> None:
        return

    def drawRow(self, painter: QPainter, option: QStyleOptionViewItem, index: Index) -> None:
        row, topic = self._pages.page_row(index), self._pages.topic(index)
        if row is None:
            return
        rect = QRectF(option.rect)
        rect.setLeft(0)
        rect.setWidth(self.viewport().width())
        is_current, theme = index == self.currentIndex(), self.theme
        painter.save()
        if is_current:
            painter.fillRect(rect, theme.colour("selected"))
            painter.fillRect(QRectF(0, rect.top(), 2, rect.height()), theme.colour("accent"))
        elif self._hovered_index == index and self._hovered_index.isValid():
            painter.fillRect(rect, theme.colour("hover"))
        if topic is None:
            if row.number:
                paint.hairline(painter, rect, Qt.Edge.TopEdge, theme.colour("border"))
            self._paint_page(painter, rect, row.listed_page, index)
        else:
            self._paint_topic(
                painter, rect, row.topics[index.row()], is_gone=row.listed_page.gone_s is not None
            )
        if is_current and self._is_keyboard_navigation and self.hasFocus():
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            painter.setPen(QPen(theme.colour("focus"), 2))
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.drawRoundedRect(rect.adjusted(1, 1, -1, -1), 4, 4)
        painter.restore()

    def _paint_icon(self, painter: QPainter, left: float, rect: QRectF, name: str, role: str) -> float:
        side = self.theme.scaled(_ICON)
        icon_area = QRectF(left, rect.center().y() - side / 2, side, side)
        paint_icon(painter, icon_area, name, self.theme.colour(role))
        return left + side + _GAP

    def cell_rect(self, column: PageColumn, rect: QRectF) -> QRectF:
        """Return the rectangle of a column within the rectangle of a row."""
        right = float(self.viewport().width())
        for name in reversed(_WIDTHS):
            if name == column:
                break
            right -= self._widths[name]
        left = right - self._widths[column]
        return QRectF(left + _PADDING, rect.top(), right - left - 2 * _PADDING, rect.height())

    def _font(self, kind: str, *, is_bold: bool = False, is_struck_out: bool = False) -> QFont:
        font = self.theme.font(kind)
        if is_bold:
            font.setWeight(QFont.Weight.DemiBold)
        font.setStrikeOut(is_struck_out)
        return font

    def _paint_page(self, painter: QPainter, rect: QRectF, listed_page: ListedPage, index: Index) -> None:
        theme, is_gone = self.theme, listed_page.gone_s is not None
        left = float(_EDGE)
        if self._pages.rowCount(index):
            chevron = "chevron-down" if self.isExpanded(index) else "chevron-right"
            self._paint_icon(painter, left, rect, chevron, "textSecondary")
        left += theme.scaled(_ICON) + _GAP
        left = self._paint_icon(
            painter,
            left,
            rect,
            page_icon(listed_page.page),
            _DISCONNECTED_ROLE if is_gone else "textSecondary",
        )
        small = self._font("small")
        since = since_text(listed_page)
        button = self.cell_rect("disconnect", rect)
        end = button.left() - _PADDING
        room = QRectF(end - paint.width_of(small, since) - 2, rect.top(), 0, rect.height())
        room.setRight(end)
        paint.text_line(painter, room, since, small, theme.colour("textSecondary"), paint.RIGHT)
        name, font = page_name(listed_page.page), self._font("body", is_bold=True, is_struck_out=is_gone)
        text_area = QRectF(left, rect.top(), max(20.0, room.left() - left - _GAP), rect.height())
        paint.text_line(
            painter, text_area, name, font, theme.colour(_DISCONNECTED_ROLE if is_gone else "text")
        )
        text_area.setLeft(text_area.left() + paint.width_of(font, name) + 8)
        if text_area.width() > theme.scaled(40):
            role = _DISCONNECTED_ROLE if is_gone else "textSecondary"
            paint.text_line(
                painter, text_area, location_text(listed_page.page), self._font("body"), theme.colour(role)
            )
        if not is_gone:
            is_button_hovered = self._is_button_hovered and self._hovered_index == index
            side = theme.scaled(_ICON)
            icon_area = QRectF(button.right() - side, rect.center().y() - side / 2, side, side)
            if is_button_hovered:
                paint.box(
                    painter, icon_area.adjusted(-4, -4, 4, 4), theme.radius("key"), theme.colour("pressed")
                )
            icon_role = "text" if is_button_hovered else "textSecondary"
            paint_icon(painter, icon_area, "x", theme.colour(icon_role))

    def _paint_topic(self, painter: QPainter, rect: QRectF, topic: PageTopic, *, is_gone: bool) -> None:
        theme = self.theme
        role = _DISCONNECTED_ROLE if is_gone else "text"
        left = _EDGE + 2 * (theme.scaled(_ICON) + _GAP)
        icon = "arrow-up-from-line" if topic.is_published else "arrow-down-to-line"
        left = self._paint_icon(painter, left, rect, icon, _DISCONNECTED_ROLE if is_gone else "textSecondary")
        body, small = self._font("body"), self._font("small")
        verb_width = max(paint.width_of(body, each) for each in (_("reads"), _("publishes")))
        quiet = theme.colour(_DISCONNECTED_ROLE if is_gone else "textSecondary")
        verb_rect = QRectF(left, rect.top(), verb_width + 2, rect.height())
        paint.text_line(painter, verb_rect, direction_text(topic), body, quiet)
        left += verb_width + 10
        limit = limit_text(topic)
        limit_width = paint.width_of(small, limit) + 2 if limit else 0.0
        end = self.cell_rect("rate", rect).left() - 2 * _PADDING
        paint.text_line(
            painter, QRectF(end - limit_width, rect.top(), limit_width, rect.height()), limit, small,
            theme.colour(_DISCONNECTED_ROLE if is_gone else "textTertiary"), paint.RIGHT,
        )  # fmt: skip
        name_rect = QRectF(left, rect.top(), max(20.0, end - limit_width - left - _GAP), rect.height())
        name_font = self._font("code", is_struck_out=is_gone)
        paint.text_line(painter, name_rect, topic.topic, name_font, theme.colour(role))
        if is_gone:
            return
        texts: dict[PageColumn, str] = {
            "rate": rate_text(topic.rate_hz),
            "bandwidth": bandwidth_text(topic.bytes_per_s),
        }
        for column, text in texts.items():
            paint.text_line(
                painter, self.cell_rect(column, rect), text, body, theme.colour(role), paint.RIGHT
            )
        self._paint_dropped(painter, self.cell_rect("dropped", rect), topic, body)

    def _paint_dropped(self, painter: QPainter, cell: QRectF, topic: PageTopic, font: QFont) -> None:
        theme, text = self.theme, dropped_text(topic)
        has_dropped = topic.dropped_count > 0
        colour = theme.colour("warn" if has_dropped else "text")
        paint.text_line(painter, cell, text, font, colour, paint.RIGHT)
        if has_dropped:
            side = theme.scaled(13)
            left = cell.right() - paint.width_of(font, text) - side - 5
            icon_area = QRectF(left, cell.center().y() - side / 2, side, side)
            paint_icon(painter, icon_area, "triangle-alert", theme.colour("warn"))
