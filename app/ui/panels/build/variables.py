"""Variables panel: variables of the behaviour with their current values, or the last ones after a run."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from PySide6.QtCore import QPoint, Qt, Signal
from PySide6.QtGui import QAction, QKeyEvent
from PySide6.QtWidgets import QVBoxLayout

from app.intents import Intent, RenameVariable
from app.ui.intents import DeleteVariable, ShowNextUse, ToggleVariableWatch
from app.ui.panels.base import Panel, PanelContext
from app.ui.panels.build.variable_values import ask_value
from app.ui.panels.home import RowHome, TabHome
from app.ui.panels.table_panel import TablePanel, TableTexts
from app.ui.widgets import ElidedLabel, EmptyAction, IconButton
from app.ui.widgets.menus import Menu
from app.ui.widgets.table.model import Cell, Column, Order, TableModel
from app.ui.widgets.table.view import TableView
from nep.i18n import _, lazy, ngettext

if TYPE_CHECKING:
    from app.blocks.model.program import Variable
    from app.blocks.runtime.variables import VariableValue

TABLE_TEXTS = TableTexts(
    title=lazy("Variables"),
    filter=lazy("Filter variables"),
    no_matches=lazy("No matching variables"),
    clear_filter_hint=lazy("Clear the filter to see all variables."),
)
CHANGE_HIGHLIGHT_S = 0.8
"""Time in s for which a new value is highlighted."""
INDENT = 19
MAX_WITHOUT_FILTER = 8
"""Maximum number of variables for which the filter is hidden."""
ICONS = {"number": "hash", "text": "quote", "boolean": "toggle-left", "list": "list", "other": "braces"}


@dataclass(frozen=True, slots=True)
class VariableRow:
    """Row of a variable, or of an item of a list.

    Attributes:
        variable: Variable of the row.
        value: Value of the variable, also in the row of an item; None before the first run.
        is_expanded: True if the list is expanded.
        item: Number of the item, counted from 1; 0 for the variable itself.
        is_new: True for a moment after the value changed.
        has_ended: True if the run has ended.
    """

    variable: Variable
    value: VariableValue | None
    is_expanded: bool = False
    item: int = 0
    is_new: bool = False
    has_ended: bool = False

    @property
    def key(self) -> str:
        """Key that identifies the row across updates of the table."""
        return f"{self.variable.id} {self.item}"

    @property
    def value_text(self) -> str:
        """Value as short text; "" before the first run.

        A list is shown with its number of items, followed by the items if it is collapsed.
        """
        if self.value is None:
            return ""
        if self.item:
            return self.value.items[self.item - 1]
        if self.value.kind != "list" or not self.value.length:
            return self.value.text if self.value.kind != "list" else _("empty")
        count = ngettext("{count} item", "{count} items", self.value.length).format(count=self.value.length)
        return count if self.is_expanded else f"{count}: {', '.join(self.value.items)}"


def name_cell(row: VariableRow) -> Cell:
    """Return the cell with name and type icon of the variable; lists have an arrow for expanding."""
    if row.item:
        return Cell(str(row.item), role="textTertiary", indent=INDENT)
    kind = row.value.kind if row.value is not None else ""
    if kind == "list":
        icon: str | None = "chevron-down" if row.is_expanded else "chevron-right"
    else:
        icon = ICONS.get(kind, "variable")
    return Cell(row.variable.name, icon)


def value_cell(row: VariableRow) -> Cell:
    """Return the cell with the value, highlighted after a change and grey after the end of the run."""
    if row.is_new and not row.item:
        return Cell(row.value_text, role="changed", tint="changedTint")
    return Cell(row.value_text, role="textSecondary" if row.has_ended else "text")


COLUMNS: tuple[Column[VariableRow], ...] = (
    Column("name", lazy("Name"), 150, name_cell, lambda row: row.variable.name.casefold()),
    Column(
        "value", lazy("Value"), 160, value_cell, stretch=True,
        tip=lambda row: row.value.text if row.value is not None and not row.item else row.value_text,
    ),
)  # fmt: skip


def rows_of(
    variables: Sequence[Variable],
    values: Mapping[str, VariableValue],
    expanded_ids: Collection[str],
    order: Order[VariableRow],
    *,
    changed_ids: Collection[str] = (),
    has_ended: bool = False,
) -> list[VariableRow]:
    """Return the rows of the table, sorted.

    Args:
        variables: Variables of the behaviour.
        values: Values by variable id.
        expanded_ids: Ids of expanded lists, which are followed by the rows of their first items.
        order: Sort order of the variables.
        changed_ids: Ids of variables whose value has just changed.
        has_ended: True if the run has ended.
    """
    rows: list[VariableRow] = []
    variable_rows = [
        VariableRow(
            each,
            values.get(each.id),
            each.id in expanded_ids,
            is_new=each.id in changed_ids,
            has_ended=has_ended,
        )
        for each in variables
    ]
    for row in order.sort(variable_rows):
        rows.append(row)
        if row.is_expanded and row.value is not None:
            rows += [
                VariableRow(row.variable, row.value, item=number, has_ended=has_ended)
                for number in range(1, len(row.value.items) + 1)
            ]
    return rows


class VariablesPanel(TablePanel[VariableRow]):
    """Panel with the table of variables. The context menu of a variable contains the actions."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, TABLE_TEXTS, "variable")
        self.clock: Callable[[], float] = time.monotonic
        self.add_button = IconButton(self.theme, "plus", _("New variable"), size=26)
        self.add_button.clicked.connect(lambda: context.run("variable.new"))
        self.status_label = ElidedLabel("body", "textSecondary")
        self.header = [self.status_label, self.filter, self.add_button]
        self.table.horizontalHeader().hide()  # name and value need no header, and the panel is low
        self.table.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.table.customContextMenuRequested.connect(self._show_menu)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(self.pages, 1)
        column.addWidget(self.line)
        column.addWidget(self.foot)
        self.line.hide()
        self.foot.hide()
        self._expanded_ids: set[str] = set()
        self._variables: tuple[Variable, ...] = ()
        self._last_state: tuple[object, ...] = ()
        self._values: Mapping[str, VariableValue] = {}
        self._change_times_s: dict[str, float] = {}  # time of the last change, by variable

    def make_model(self) -> TableModel[VariableRow]:
        return TableModel(COLUMNS, lambda row: row.key)

    def make_table(self, model: TableModel[VariableRow]) -> TableView[VariableRow]:
        table = _VariableTable(self.theme, model, "")
        table.expand_requested.connect(self._set_expanded)
        table.rename_requested.connect(lambda key: self._request_for(RenameVariable, key))
        table.delete_requested.connect(lambda key: self._request_for(DeleteVariable, key))
        return table

    # -- display ------------------------------------------------------------------------------------------

    def refresh(self) -> None:
        runs, project = self.session.runs, self.session.document
        program = project.newest_program()
        if program is None:
            return
        is_own_run = runs.document is project
        now = self.clock()
        values = runs.values if is_own_run else {}
        state = (
            project.key,
            program.variables,
            runs.values_revision if is_own_run else -1,
            is_own_run and runs.active,
        )
        expired_ids = [id for id, since in self._change_times_s.items() if now - since >= CHANGE_HIGHLIGHT_S]
        for id in expired_ids:
            del self._change_times_s[id]
        if state == self._last_state and not expired_ids:
            return
        if state[:1] == self._last_state[:1] and is_own_run and runs.active:
            self._change_times_s.update(
                {id: now for id, value in values.items() if self._values.get(id) != value}
            )
        self._last_state, self._variables, self._values = state, program.variables, values
        self.rebuild()

    def rebuild(self) -> None:
        keywords = self.filter_words()
        matches = [
            each for each in self._variables if all(keyword in each.name.casefold() for keyword in keywords)
        ]
        runs = self.session.runs
        has_ended = not (runs.active and runs.document is self.session.document)
        self.model.set_rows(
            rows_of(
                matches,
                self._values,
                self._expanded_ids,
                self.table.order,
                changed_ids=self._change_times_s,
                has_ended=has_ended,
            )
        )
        self.filter.setVisible(len(self._variables) > MAX_WITHOUT_FILTER or bool(keywords))
        self.status_label.setText(self._status_text(has_ended=has_ended))
        self.table.refresh_visible()
        self.show_table(bool(matches), bool(keywords))

    def _status_text(self, *, has_ended: bool) -> str:
        if not self._variables or not self._values:
            return ""
        return _("Final values") if has_ended else _("Live")

    def show_table(self, has_rows: bool, is_filtered: bool) -> None:
        if has_rows or is_filtered:
            super().show_table(has_rows, is_filtered)
            self.doctor.hide()
        else:  # the empty state does not depend on the master
            self.pages.setCurrentIndex(1)
            self.update_empty_state()

    def update_empty_state(self) -> None:
        self.empty.set_texts(
            _("No variables yet"),
            _("A variable stores a number, a text or a list under a name. Its value is shown here."),
            "variable",
        )
        new = EmptyAction(
            _("New variable"), lambda: self.context.run("variable.new"), "plus", is_primary=True
        )
        self.empty.set_actions([new])

    # -- user actions -------------------------------------------------------------------------------------

    def open_row(self, key: str) -> None:
        row = self.model.row_at(self.model.index_of(key))
        if row is not None and row.value is not None and row.value.kind == "list" and not row.item:
            self._set_expanded(key, row.variable.id not in self._expanded_ids)

    def _set_expanded(self, key: str, is_expanded: bool) -> None:
        row = self.model.row_at(self.model.index_of(key))
        if row is None or (is_expanded and row.item):
            return
        (self._expanded_ids.add if is_expanded else self._expanded_ids.discard)(row.variable.id)
        self.rebuild()
        self.table.select_key(VariableRow(row.variable, row.value).key)

    def _request_for(self, make: Callable[[str], Intent], key: str) -> None:
        row = self.model.row_at(self.model.index_of(key))
        if row is not None:
            self.context.request(make(row.variable.id))

    def menu_of(self, key: str) -> Menu | None:
        """Return the context menu of a variable, or None if the table no longer contains the variable."""
        row = self.model.row_at(self.model.index_of(key))
        if row is None:
            return None
        menu = Menu(self.theme, self)
        runs = self.session.runs
        is_running = runs.active and runs.document is self.session.document
        is_used = bool(row.variable.python)
        id, request = row.variable.id, self.context.request
        entries: tuple[tuple[str, str, Callable[[], object], bool], ...] = (
            (_("Show next to the blocks"), "eye", lambda: request(ToggleVariableWatch(id)), True),
            (_("Show where it is used"), "search", lambda: request(ShowNextUse(id)), is_used),
            (_("Change the value"), "pencil", lambda: ask_value(self.context, id), is_running and is_used),
            (_("Rename"), "text-cursor-input", lambda: request(RenameVariable(id)), True),
            (_("Delete"), "trash-2", lambda: request(DeleteVariable(id)), True),
        )
        for text, icon, run, is_enabled in entries:
            action = QAction(self.theme.icon(icon), text, menu)
            action.setEnabled(is_enabled)
            action.triggered.connect(lambda _on=False, run=run: run())
            menu.addAction(action)
        return menu

    def _show_menu(self, position: QPoint) -> None:
        row = self.model.row_at(self.table.indexAt(position))
        menu = self.menu_of(self.model.key_of(row)) if row is not None else None
        if menu is not None:
            menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
            menu.popup(self.table.viewport().mapToGlobal(position))


class _VariableTable(TableView[VariableRow]):
    """Table of variables: Right expands a list, Left collapses it, F2 renames, Delete deletes."""

    expand_requested = Signal(str, bool)
    rename_requested = Signal(str)
    delete_requested = Signal(str)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        key = self.selected_key()
        if key is not None and event.key() in {Qt.Key.Key_Left, Qt.Key.Key_Right}:
            self.is_keyboard_navigation = True
            self.expand_requested.emit(key, event.key() == Qt.Key.Key_Right)
        elif key is not None and event.key() == Qt.Key.Key_F2:
            self.rename_requested.emit(key)
        elif key is not None and event.key() == Qt.Key.Key_Delete:
            self.delete_requested.emit(key)
        else:
            super().keyPressEvent(event)


PANEL = Panel(
    "variables",
    TABLE_TEXTS.title,
    "variable",
    (),
    VariablesPanel,
    home=(RowHome("behaviour", 0, 1, 124, tab=1), TabHome("developer", "console")),
)
