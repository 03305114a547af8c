"""Table of a list of objects: one row per object, one column per key, sortable, with CSV export."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from PySide6.QtCore import QPoint, Qt, Signal
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QHBoxLayout, QStackedWidget, QVBoxLayout, QWidget

from app.core.messages.object_table import (
    MAX_COLUMNS,
    MAX_ROWS,
    MISSING,
    ObjectRow,
    Steps,
    column_name,
    columns_of,
    format_table_csv,
    is_list_of_objects,
    lists_of_objects,
    query_rows,
    rows_of,
    sort_key,
    value_at,
)
from app.ui.panels.watch.inspector.values import size_of, value_text
from app.ui.text import plain
from app.ui.text.numbers import group_digits
from app.ui.theme.theme import Theme
from app.ui.widgets import ElidedLabel, EmptyState, IconButton, Separator
from app.ui.widgets.menus import Menu, open_below
from app.ui.widgets.table.model import Cell, Column, TableModel
from app.ui.widgets.table.view import TableView
from nep.i18n import _, ngettext
from nep.messages.fields import path_text

SORT_INTERVAL_S = 1.0
"""Interval in s at which rows are sorted again, so that rows with changing values remain readable."""
CHAR_WIDTH, MIN_COLUMN_WIDTH, MAX_COLUMN_WIDTH = 8, 56, 220
"""Width of a character, and limits of a column's width, in px."""
COLUMN_PADDING = 24


class ObjectsView(QWidget):
    """Table of the objects in a list, below a line with the path of the list and the number of rows.

    Signals:
        reveal_requested: Path of an object to select in the tree.

    Args:
        toast: Shows a toast.
    """

    reveal_requested = Signal(object)

    def __init__(self, theme: Theme, toast: Callable[[str], None]) -> None:
        super().__init__()
        self._theme, self._toast = theme, toast
        self._value: object = None
        self._requested_steps: Steps = ()
        self._steps: Steps | None = None
        self._columns: tuple[Steps, ...] = ()
        self._sorted_at_s = 0.0
        self._row_height = 26
        self.table: TableView[ObjectRow] | None = None
        self.text_label = ElidedLabel("small", "textSecondary")
        self.choose = IconButton(theme, "chevron-down", _("Choose a list in the message"), size=24)
        self.choose.clicked.connect(self._show_list_menu)
        self.copy = IconButton(theme, "copy", _("Copy the table as CSV"), size=24)
        self.copy.clicked.connect(self.copy_csv)
        self.empty = EmptyState(
            theme,
            "table-2",
            _("No lists of objects"),
            _("The table shows lists whose elements are objects."),
        )
        row = QHBoxLayout()
        row.setContentsMargins(12, 3, 8, 3)
        row.setSpacing(4)
        row.addWidget(self.text_label, 1)
        row.addWidget(self.choose)
        row.addWidget(self.copy)
        self.pages = QStackedWidget()
        self.pages.addWidget(self.empty)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addLayout(row)
        column.addWidget(Separator(theme))
        column.addWidget(self.pages, 1)

    @property
    def rows(self) -> list[ObjectRow]:
        """Rows in display order."""
        return self._model.rows() if self.table is not None else []

    def set_row_height(self, height: int) -> None:
        """Set the height of all rows."""
        self._row_height = height
        if self.table is not None:
            self.table.set_row_height(height, large=False)

    def reset(self) -> None:
        """Reset the table for another topic."""
        self._requested_steps, self._steps, self._value = (), None, None
        self._remove_table()

    def select_list(self, steps: Steps) -> None:
        """Select the list to show in this message and in later ones.

        Args:
            steps: Path of the list. If there is no list of objects at this path, the nearest one
                above it is shown, else the first one in the message.
        """
        self._requested_steps = steps

    def show_message(self, value: object, now: float) -> None:
        """Show the selected list of a message, or its first list.

        Args:
            value: Decoded message.
            now: Monotonic time in s.
        """
        self._value = value
        steps = self._find_list(value)
        if steps != self._steps:
            self._steps = steps
            self._sorted_at_s = 0.0
        items = value_at(value, steps) if steps is not None else MISSING
        self._show(rows_of(items), size_of(items), path_text(steps) if steps else "", now)
        self.choose.setVisible(True)

    def show_query_objects(self, results: Iterable[tuple[str, object]], now: float) -> None:
        """Show the objects found by a query.

        Args:
            results: Path and value of each result.
            now: Monotonic time in s.
        """
        self._value, self._steps = None, None
        rows = query_rows(results)
        self._show(rows, len(rows), "", now)
        self.choose.setVisible(False)

    def _find_list(self, value: object) -> Steps | None:
        for length in range(len(self._requested_steps), -1, -1):
            if is_list_of_objects(value_at(value, self._requested_steps[:length])):
                return self._requested_steps[:length]
        paths = lists_of_objects(value, 1)
        return paths[0] if paths else None

    def _show(self, rows: list[ObjectRow], total: int, path: str, now: float) -> None:
        columns = columns_of(rows)
        self.copy.setEnabled(bool(columns))
        if not columns:
            self._remove_table()
            self.text_label.setText("")
            return
        if columns != self._columns or self.table is None:
            self._make_table(columns, rows)
        self._update_rows(rows, now)
        self._set_status(len(rows), total, path)

    def _set_status(self, shown_count: int, total: int, path: str) -> None:
        if shown_count < total and shown_count >= MAX_ROWS:
            text = _("the first {shown} of {count} rows").format(
                shown=group_digits(shown_count), count=group_digits(total)
            )
        else:
            text = ngettext("{count} row", "{count} rows", shown_count).format(
                count=group_digits(shown_count)
            )
        if len(self._columns) >= MAX_COLUMNS:
            text = _("{rows}, the first {count} columns").format(rows=text, count=MAX_COLUMNS)
        self.text_label.setText(f"{path}   {text}" if path else text)

    def _update_rows(self, rows: list[ObjectRow], now: float) -> None:
        # Keeps the previous order except for one re-sort per second.
        table = self.table
        if table is None:
            return
        if now - self._sorted_at_s >= SORT_INTERVAL_S or now < self._sorted_at_s:
            self._sorted_at_s = now
            rows = table.order.sort(rows)
        else:
            positions = {row.name: number for number, row in enumerate(self._model.rows())}
            rows.sort(key=lambda row: positions.get(row.name, len(positions) + row.index))
        self._model.set_rows(rows)
        table.refresh_visible()

    def _resort(self) -> None:
        if self.table is not None:
            self._model.set_rows(self.table.order.sort(sorted(self._model.rows(), key=lambda row: row.index)))
            self.table.refresh_visible()

    def _make_table(self, columns: tuple[Steps, ...], rows: Sequence[ObjectRow]) -> None:
        before = self.table.saved_state() if self.table is not None else None
        self._remove_table()
        self._columns = columns
        table_columns = [_index_column(rows)]
        table_columns += [_column(column, rows) for column in columns]
        self._model = _ObjectModel(table_columns, lambda row: row.name)
        table = self.table = TableView(self._theme, self._model, "#")
        table.setAccessibleName(_("Objects"))
        if before is not None:
            table.restore(before)
        table.set_row_height(self._row_height, large=False)
        table.order_changed.connect(self._resort)
        table.menu_requested.connect(self._show_menu)
        self.pages.addWidget(table)
        self.pages.setCurrentWidget(table)
        self.setFocusProxy(table)

    def _remove_table(self) -> None:
        if self.table is not None:
            self.setFocusProxy(None)  # type: ignore[arg-type]
            self.pages.setCurrentWidget(self.empty)
            self.pages.removeWidget(self.table)
            self.table.deleteLater()
            self.table, self._columns = None, ()

    def copy_csv(self) -> None:
        """Copy the table to the clipboard as CSV, in display order."""
        if self.table is not None:
            QGuiApplication.clipboard().setText(format_table_csv("#", self._columns, self._model.rows()))
            count = len(self._model.rows())
            template = ngettext("Copied {count} row as CSV", "Copied {count} rows as CSV", count)
            self._toast(template.format(count=group_digits(count)))

    def _show_list_menu(self) -> None:
        menu = Menu(self._theme, self)
        for steps in lists_of_objects(self._value):
            action = menu.addAction(plain.escape_menu_text(path_text(steps) if steps else _("Message")))
            action.setCheckable(True)
            action.setChecked(steps == self._steps)
            action.triggered.connect(lambda _on=False, steps=steps: self._list_selected(steps))
        if menu.isEmpty():  # Qt shows no empty menu, and would never delete it
            menu.deleteLater()
            return
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        open_below(menu, self.choose)

    def _list_selected(self, steps: Steps) -> None:
        self.select_list(steps)
        self.show_message(self._value, self._sorted_at_s)

    def _show_menu(self, key: str, position: QPoint) -> None:
        menu = Menu(self._theme, self)
        menu.addAction(self._theme.icon("copy"), _("Copy the table as CSV"), self.copy_csv)
        if self._steps is not None:
            steps = (*self._steps, int(key))
            show = lambda: self.reveal_requested.emit(steps)  # noqa: E731
            menu.addAction(self._theme.icon("list-tree"), _("Show in the tree"), show)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.popup(position)


class _ObjectModel(TableModel[ObjectRow]):
    """Table model that gives access to its rows in display order."""

    def rows(self) -> list[ObjectRow]:
        return list(self._rows.rows)


def _index_column(rows: Sequence[ObjectRow]) -> Column[ObjectRow]:
    # Index of the object in the list.
    width = _column_width("#", [row.name for row in rows])
    return Column("#", "#", width, _name_cell, lambda row: row.index, is_verbatim=True)


def _name_cell(row: ObjectRow) -> Cell:
    return Cell(row.name, role="textTertiary", mono=True)


def _column(steps: Steps, rows: Sequence[ObjectRow]) -> Column[ObjectRow]:
    name = column_name(steps)
    first = [row.at(steps) for row in rows[:20]]
    is_numeric = all(isinstance(value, (int, float)) or value in (None, MISSING) for value in first)
    return Column(
        name,
        name,
        _column_width(name, [_cell_text(value) for value in first]),
        lambda row: Cell(_cell_text(value := row.at(steps)), role=_role(value), mono=True),
        lambda row: sort_key(row.at(steps)),
        is_numeric=is_numeric,
        tip=lambda row: _cell_text(row.at(steps)),
        is_verbatim=True,
    )


def _cell_text(value: object) -> str:
    if value is MISSING:
        return ""
    return value.replace("\n", "⏎") if isinstance(value, str) else value_text(value)


def _role(value: object) -> str:
    if isinstance(value, str):
        return "ok"
    return "textTertiary" if value is None else "text"


def _column_width(header: str, cell_texts: Sequence[str]) -> int:
    # Computed from the header with its sort arrow and the first rows.
    char_count = max([len(header) + 2, *(len(each) for each in cell_texts[:20])])
    return min(MAX_COLUMN_WIDTH, max(MIN_COLUMN_WIDTH, char_count * CHAR_WIDTH + COLUMN_PADDING))
