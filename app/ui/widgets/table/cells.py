"""Painters of the cells and headers of a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Protocol

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QPointF, QRect, QRectF, QSize, Qt
from PySide6.QtGui import QFont, QFontMetricsF, QPainter
from PySide6.QtWidgets import QHeaderView, QStyle, QStyledItemDelegate, QStyleOptionViewItem, QWidget

from app.ui.theme.icons import paint_cached_icon, paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets.indicators import SPARKLINE_SIZE, paint_sparkline
from app.ui.widgets.paint import box as paint_box
from app.ui.widgets.table.model import Cell, Column, Order

Index = QModelIndex | QPersistentModelIndex
EDGE, PADDING, ICON_SIZE = 12, 6, 14
# maximum number of cached cells: some screens, so that the cache does not grow by scrolling
MAX_CACHED_CELLS = 4000
LEFT = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter


class TableAppearance(Protocol):
    """Interface of the table view that the cell and header painters use.

    Attributes:
        row_height: Height of the rows in px.
        hovered_row: Row under the mouse pointer, or -1.
        last_visible_column: Index of the last visible column.
    """

    row_height: int
    hovered_row: int
    last_visible_column: int

    @property
    def all_columns(self) -> Sequence[Column[Any]]:
        """All columns of the table, including hidden ones."""

    @property
    def sort_order(self) -> Order[Any]:
        """Current sort order."""

    def cell_font(self, cell: Cell) -> QFont:
        """Return the font for a cell."""

    def cell_at(self, row: int, column: int) -> Cell:
        """Return the contents of a cell."""

    def columnWidth(self, column: int) -> int:
        """Return the width of a column in px; 0 if it is hidden."""


def padded_rect(rect: QRect, column: int, last: int) -> QRectF:
    """Return the rectangle of a cell without its padding, which is larger at the outer edges.

    Args:
        rect: Rectangle of the cell.
        column: Index of the column.
        last: Index of the last visible column.
    """
    left = EDGE if column == 0 else PADDING
    right = EDGE if column == last else PADDING
    return QRectF(rect.adjusted(left, 0, -right, 0))


def header_font(theme: Theme) -> QFont:
    """Return the font of the header."""
    font = theme.font("small")
    font.setWeight(QFont.Weight.Medium)
    return font


def header_width(theme: Theme, column: Column[Any]) -> int:
    """Return the width in px that the header of a column needs, including its padding."""
    return (
        math.ceil(QFontMetricsF(header_font(theme)).horizontalAdvance(column.translated_title))
        + EDGE
        + PADDING
        + 1
    )


class CellDelegate(QStyledItemDelegate):
    """Delegate that paints cells, and caches the last painted contents to detect changes."""

    def __init__(self, theme: Theme, view: TableAppearance, parent: QWidget) -> None:
        super().__init__(parent)
        self._theme = theme
        self._view = view
        self._painted_cells: dict[tuple[int, int], Cell] = {}

    def changed_columns(self, row: int, columns: Sequence[int]) -> list[int]:
        """Return the columns of a row whose contents differ from the last painted ones."""
        if len(self._painted_cells) > MAX_CACHED_CELLS:
            self._painted_cells.clear()
        cell_at = self._view.cell_at
        painted_cells = self._painted_cells
        return [column for column in columns if painted_cells.get((row, column)) != cell_at(row, column)]

    def sizeHint(self, _option: QStyleOptionViewItem, _index: Index) -> QSize:
        return QSize(40, self._view.row_height)

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: Index) -> None:
        row, column = index.row(), index.column()
        cell = self._painted_cells[row, column] = self._view.cell_at(row, column)
        theme, rect = self._theme, QRect(option.rect)
        is_selected = QStyle.StateFlag.State_Selected in option.state
        painter.save()
        if is_selected:
            painter.fillRect(rect, theme.colour("selected"))
        elif self._view.hovered_row == row:
            painter.fillRect(rect, theme.colour("hover"))
        if is_selected and column == 0:
            painter.fillRect(QRect(rect.left(), rect.top(), 2, rect.height()), theme.colour("accent"))
        is_numeric = self._view.all_columns[column].is_numeric
        cell_rect = padded_rect(rect, column, self._view.last_visible_column)
        if cell.overflows_left:
            cell_rect.setLeft(cell_rect.left() - self._blank_before(row, column))
        role = "selectedText" if is_selected and cell.role == "text" else cell.role
        if is_selected and role == "textTertiary":
            role = "accentText"
        self._paint_cell(painter, cell_rect, cell, role, is_numeric=is_numeric)
        painter.restore()

    def _blank_before(self, row: int, column: int) -> int:
        # Total width of the blank cells at the left of a cell.
        room = 0
        while column > 0 and self._view.cell_at(row, column - 1).is_blank:
            column -= 1
            room += self._view.columnWidth(column)
        return room

    def _paint_cell(self, painter: QPainter, box: QRectF, cell: Cell, role: str, *, is_numeric: bool) -> None:
        theme = self._theme
        if cell.curve:
            curve_rect = QRectF(
                box.left(),
                box.center().y() - SPARKLINE_SIZE.height() / 2,
                box.width(),
                SPARKLINE_SIZE.height(),
            )
            paint_sparkline(painter, curve_rect, cell.curve, theme.colour(role))
            return
        if cell.mark is not None:
            cell.mark.paint(painter, box, theme)
            return
        box = box.adjusted(cell.indent, 0, 0, 0)
        if cell.is_blank:
            return
        font = self._view.cell_font(cell)
        metrics = QFontMetricsF(font)
        colour = theme.colour(role)
        text, advance = cell.text, metrics.horizontalAdvance(cell.text)
        reserved_width = ICON_SIZE + 5.0 if cell.icon else 0.0
        chip = cell.chip
        if chip:
            chip_width = self._chip_width(chip) + 8
            if reserved_width + advance + chip_width <= box.width():
                reserved_width += chip_width
            else:
                chip = None  # the text is preferred
        room = max(0.0, box.width() - reserved_width)
        if advance > room:
            elide_mode = Qt.TextElideMode.ElideMiddle if cell.elide_middle else Qt.TextElideMode.ElideRight
            text = metrics.elidedText(text, elide_mode, room)
            advance = metrics.horizontalAdvance(text)
        x = box.right() - advance - reserved_width if is_numeric else box.left()
        if cell.icon:
            top = box.center().y() - ICON_SIZE / 2
            paint_cached_icon(painter, QRectF(x, top, ICON_SIZE, ICON_SIZE), cell.icon, colour)
            x += ICON_SIZE + 5.0
        if cell.tint and text:
            height = metrics.height() + 2
            tint_rect = QRectF(x - 4, box.center().y() - height / 2, advance + 8, height)
            paint_box(painter, tint_rect, theme.radius("key"), theme.colour(cell.tint))
        painter.setFont(font)
        painter.setPen(colour)
        painter.drawText(QRectF(x, box.top(), advance + 2, box.height()), LEFT, text)
        if chip:
            self._paint_chip(painter, QPointF(x + advance + 8, box.center().y()), chip)

    def _chip_font(self) -> QFont:
        return self._theme.font("caption")

    def _chip_width(self, text: str) -> float:
        return QFontMetricsF(self._chip_font()).horizontalAdvance(text) + 14

    def _paint_chip(self, painter: QPainter, middle: QPointF, text: str) -> None:
        box = QRectF(middle.x(), middle.y() - 9, self._chip_width(text), 18)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(self._theme.colour("accentTint"))
        painter.drawRoundedRect(box, 9, 9)
        painter.setFont(self._chip_font())
        painter.setPen(self._theme.colour("accentText"))
        painter.drawText(box, Qt.AlignmentFlag.AlignCenter, text)


class TableHeader(QHeaderView):
    """Table header with small text; an arrow and a darker title show the sorted column."""

    def __init__(self, theme: Theme, view: TableAppearance, parent: QWidget) -> None:
        super().__init__(Qt.Orientation.Horizontal, parent)
        self._theme = theme
        self._view = view
        self.setHighlightSections(False)
        self.setSectionsClickable(True)
        self.setMinimumSectionSize(28)
        self.setSectionResizeMode(QHeaderView.ResizeMode.Interactive)

    def sizeHint(self) -> QSize:
        return QSize(super().sizeHint().width(), self._view.row_height + 1)

    def paintSection(self, painter: QPainter, rect: QRect, section: int) -> None:
        columns = self._view.all_columns
        if not rect.isValid() or section >= len(columns):
            return
        theme, column = self._theme, columns[section]
        painter.save()
        painter.fillRect(rect, theme.colour("panel"))
        painter.setPen(theme.colour("border"))
        painter.drawLine(rect.bottomLeft(), rect.bottomRight())
        font = header_font(theme)
        box = padded_rect(rect, section, self._view.last_visible_column)
        is_sorted = self._view.sort_order.column is column
        metrics = QFontMetricsF(font)
        arrow_width = 16.0 if is_sorted else 0.0
        text = metrics.elidedText(
            column.translated_title, Qt.TextElideMode.ElideRight, max(0.0, box.width() - arrow_width)
        )
        advance = metrics.horizontalAdvance(text)
        x = box.right() - advance - arrow_width if column.is_numeric else box.left()
        painter.setFont(font)
        painter.setPen(theme.colour("text" if is_sorted else "textTertiary"))
        painter.drawText(QRectF(x, box.top(), advance + 2, box.height()), LEFT, text)
        if is_sorted:
            name = "chevron-up" if self._view.sort_order.is_descending else "chevron-down"
            icon_rect = QRectF(x + advance + 3, box.center().y() - 6.5, 13, 13)
            paint_icon(painter, icon_rect, name, theme.colour("textSecondary"))
        painter.restore()
