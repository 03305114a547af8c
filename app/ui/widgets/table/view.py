"""Table view without a grid, with a plain header and a bar at the selected row."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Generic, TypeVar

from PySide6.QtCore import (
    QEvent,
    QModelIndex,
    QPersistentModelIndex,
    QPoint,
    QRect,
    QRectF,
    Qt,
    Signal,
)
from PySide6.QtGui import (
    QAccessible,
    QAccessibleTableModelChangeEvent,
    QContextMenuEvent,
    QFocusEvent,
    QFont,
    QKeyEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QRegion,
    QResizeEvent,
)
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QTableView,
)

from app.ui.theme.theme import Theme
from app.ui.widgets.menus import Menu
from app.ui.widgets.table.cells import CellDelegate, TableHeader, header_width
from app.ui.widgets.table.columns import ColumnChoice
from app.ui.widgets.table.model import Cell, Column, Order, TableModel

Row = TypeVar("Row")
Index = QModelIndex | QPersistentModelIndex
EDGE, PADDING, ICON = 12, 6, 14
LEFT = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
KEYBOARD_REASONS = frozenset(
    {
        Qt.FocusReason.TabFocusReason,
        Qt.FocusReason.BacktabFocusReason,
        Qt.FocusReason.ShortcutFocusReason,
    }
)


class TableView(QTableView, Generic[Row]):
    """Table view of `Column` descriptions.

    `opened` is emitted with the key of a row that is clicked or activated by Enter, and
    `menu_requested` with the key and the screen position for a context menu.
    """

    opened = Signal(str)
    menu_requested = Signal(str, QPoint)
    filter_requested = Signal()
    order_changed = Signal()

    def __init__(self, theme: Theme, model: TableModel[Row], key: str = "") -> None:
        # `key` is the name of the column that is sorted by default.
        super().__init__()
        self.theme = theme
        self.columns: tuple[Column[Row], ...] = model.columns
        self.order: Order[Row] = Order(next((c for c in self.columns if c.name == key), None))
        self.choice = ColumnChoice(self.columns)
        self.last_visible_column = len(self.columns) - 1
        self.row_height = 26
        self.hovered_row = -1
        self.is_keyboard_navigation = False
        self._fonts: dict[tuple[bool, bool, bool], QFont] = {}
        self._is_large = False
        self.setModel(model)
        self._model = model
        self._cells = CellDelegate(theme, self, self)
        self.setItemDelegate(self._cells)
        self.setHorizontalHeader(TableHeader(theme, self, self))
        header = self.horizontalHeader()
        header.sectionClicked.connect(self._sort)
        header.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        header.customContextMenuRequested.connect(lambda at: self._show_column_menu(header.mapToGlobal(at)))
        self.verticalHeader().hide()
        self.setShowGrid(False)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setTabKeyNavigation(False)
        self.setWordWrap(False)
        self.setMouseTracking(True)
        self.clicked.connect(self._open)
        self.set_row_height(26, large=False)
        self.fit_columns()

    @property
    def all_columns(self) -> Sequence[Column[Row]]:
        """All columns of the table, including hidden ones."""
        return self.columns

    @property
    def sort_order(self) -> Order[Row]:
        """Current sort order."""
        return self.order

    def set_row_height(self, height: int, *, large: bool) -> None:
        """Set the height of all rows and the text size.

        Args:
            height: Height in px.
            large: True for the text size of the comfortable density.
        """
        self.row_height, self._is_large = height, large
        self._fonts.clear()
        rows = self.verticalHeader()
        rows.setSectionResizeMode(QHeaderView.ResizeMode.Fixed)
        rows.setMinimumSectionSize(height)
        rows.setDefaultSectionSize(height)
        self.horizontalHeader().setFixedHeight(height + 1)
        self.fit_columns()
        self.viewport().update()

    def cell_font(self, cell: Cell) -> QFont:
        """Return the font for a cell."""
        key = (cell.mono, cell.bold, cell.is_struck_out)
        if key not in self._fonts:
            font = self.theme.font("bodyLarge" if self._is_large else "body")
            if cell.mono:
                mono = self.theme.font("mono")
                mono.setPixelSize(font.pixelSize())
                font = mono
            if cell.bold:
                font.setWeight(QFont.Weight.Bold)
            font.setStrikeOut(cell.is_struck_out)
            self._fonts[key] = font
        return self._fonts[key]

    def cell_at(self, row: int, column: int) -> Cell:
        """Return the contents of a cell."""
        return self._model.cell_at(row, column)

    def visible_rows(self) -> tuple[int, int]:
        """Return the indexes of the first and last visible row; the last is smaller if no row is visible."""
        first = self.rowAt(0)
        if first < 0:
            return 0, -1
        last = self.rowAt(self.viewport().height() - 1)
        return first, last if last >= 0 else self._model.rowCount() - 1

    def refresh_visible(self) -> None:
        """Repaint the visible cells whose contents have changed."""
        first, last = self.visible_rows()
        self._model.notify_changed(first, last)

    def dataChanged(self, first: Index, last: Index, _roles: Sequence[int] = ()) -> None:
        """Repaint only cells whose contents have changed, whereas Qt would repaint all rows."""
        top, bottom = self.visible_rows()
        columns = [column for column in range(len(self.columns)) if not self.isColumnHidden(column)]
        dirty = QRegion()
        for row in range(max(first.row(), top), min(last.row(), bottom) + 1):
            changed = self._cells.changed_columns(row, columns)
            if changed:
                x = self.columnViewportPosition(changed[0])
                width = self.columnViewportPosition(changed[-1]) + self.columnWidth(changed[-1]) - x
                dirty += QRect(x, self.rowViewportPosition(row), width, self.row_height)
        if not dirty.isEmpty():
            self.viewport().update(dirty)
            self._notify_screen_reader(first.row(), last.row())

    def _notify_screen_reader(self, first: int, last: int) -> None:
        if QAccessible.isActive():
            event = QAccessibleTableModelChangeEvent(
                self, QAccessibleTableModelChangeEvent.ModelChangeType.DataChanged
            )
            event.setFirstRow(first)
            event.setLastRow(last)
            event.setFirstColumn(0)
            event.setLastColumn(len(self.columns) - 1)
            QAccessible.updateAccessibility(event)

    def selected_key(self) -> str | None:
        """Return the key of the selected row, or None."""
        row = self._model.row_at(self.currentIndex())
        return self._model.key_of(row) if row is not None else None

    def select_key(self, key: str) -> None:
        """Select the row with a key without opening it; an unknown key has no effect."""
        index = self._model.index_of(key)
        if index.isValid() and index.row() != self.currentIndex().row():
            self.setCurrentIndex(index)
            self.selectRow(index.row())

    def keyPressEvent(self, event: QKeyEvent) -> None:
        self.is_keyboard_navigation = True
        if event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter}:
            self._open(self.currentIndex())
        elif event.text() == "/":
            self.filter_requested.emit()
        else:
            super().keyPressEvent(event)

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        is_by_keyboard = event.reason() == QContextMenuEvent.Reason.Keyboard
        index = self.currentIndex() if is_by_keyboard else self.indexAt(event.pos())
        row = self._model.row_at(index)
        if row is None:
            return
        key = self._model.key_of(row)
        self.select_key(key)
        position = self.visualRect(index).bottomLeft() if is_by_keyboard else event.pos()
        self.menu_requested.emit(key, self.viewport().mapToGlobal(position))

    def focusInEvent(self, event: QFocusEvent) -> None:
        self.is_keyboard_navigation = event.reason() in KEYBOARD_REASONS
        super().focusInEvent(event)
        if self.is_keyboard_navigation and not self.currentIndex().isValid() and self._model.rowCount():
            self.setCurrentIndex(self._model.index(0, 0))

    def leaveEvent(self, event: QEvent) -> None:
        self._hover(-1)
        super().leaveEvent(event)

    def viewportEvent(self, event: QEvent) -> bool:
        if event.type() in {QEvent.Type.MouseMove, QEvent.Type.HoverMove}:
            self._hover(self.rowAt(round(event.position().y())))  # type: ignore[attr-defined]
        elif event.type() in {QEvent.Type.MouseButtonPress, QEvent.Type.Leave, QEvent.Type.HoverLeave}:
            self.is_keyboard_navigation = False
        return super().viewportEvent(event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self.fit_columns()

    def fit_columns(self) -> None:
        """Update the visible columns and their widths.

        The stretch column takes the remaining width, but is never narrower than its default.
        """
        scaled = [round(self.theme.scaled(column.width)) for column in self.columns]
        room = self.viewport().width()
        visible_columns = self.choice.fitting_columns(scaled, room)
        spare = room - sum(scaled[index] for index in visible_columns)
        for index in sorted(visible_columns):  # translations may be longer; they get the remaining space
            missing_width = header_width(self.theme, self.columns[index]) - scaled[index]
            if not self.columns[index].stretch and missing_width > 0 and spare > 0:
                scaled[index] += min(missing_width, spare)
                spare -= min(missing_width, spare)
        stretch_width = room - sum(
            scaled[index] for index in visible_columns if not self.columns[index].stretch
        )
        for index, column in enumerate(self.columns):
            self.setColumnHidden(index, index not in visible_columns)
            self.setColumnWidth(index, max(scaled[index], stretch_width) if column.stretch else scaled[index])
        self.last_visible_column = max(visible_columns)
        overflows = sum(scaled[index] for index in visible_columns) > room
        policy = Qt.ScrollBarPolicy.ScrollBarAsNeeded if overflows else Qt.ScrollBarPolicy.ScrollBarAlwaysOff
        self.setHorizontalScrollBarPolicy(policy)

    def column_menu(self) -> Menu:
        """Return a new menu to show and hide columns."""
        return self.choice.menu(self.theme, self, self.fit_columns)

    def fill_column_menu(self, menu: Menu) -> None:
        """Replace the entries of a menu by entries to show and hide columns."""
        self.choice.fill(menu, self.fit_columns)

    def _show_column_menu(self, position: QPoint) -> None:
        menu = self.column_menu()
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.popup(position)

    def saved_state(self) -> dict[str, object]:
        """Return the sort order and the visibility of columns, for `restore`."""
        order = self.order
        return {
            "sort": order.column.name if order.column else "",
            "falling": order.is_descending,
            "columns": self.choice.saved_state(),
        }

    def restore(self, state: Mapping[str, object]) -> None:
        """Restore a state returned by `saved_state`; invalid values are replaced by defaults."""
        matches = (column for column in self.columns if column.name == state.get("sort"))
        self.order.column = next(matches, self.columns[0])
        self.order.is_descending = state.get("falling") is True
        self.choice.restore(state.get("columns"))
        self.fit_columns()
        self.order_changed.emit()

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        index = self.currentIndex()
        if self.is_keyboard_navigation and self.hasFocus() and index.isValid():
            painter = QPainter(self.viewport())
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            painter.setPen(QPen(self.theme.colour("focus"), 2))
            top = self.rowViewportPosition(index.row())
            painter.drawRoundedRect(
                QRectF(1, top + 1, self.viewport().width() - 2, self.row_height - 2), 4, 4
            )
            painter.end()

    def _hover(self, row: int) -> None:
        if row != self.hovered_row:
            self.hovered_row = row
            self.viewport().update()

    def _open(self, index: QModelIndex) -> None:
        row = self._model.row_at(index)
        if row is not None:
            self.opened.emit(self._model.key_of(row))

    def _sort(self, section: int) -> None:
        column = self.columns[section]
        if column.key is None:
            return
        is_same_column = self.order.column is column
        self.order = Order(column, not self.order.is_descending if is_same_column else column.is_numeric)
        self.horizontalHeader().viewport().update()
        self.order_changed.emit()
