"""Console panel: log records of Studio, programs and robots, newest first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QAction, QGuiApplication, QKeySequence
from PySide6.QtWidgets import QHBoxLayout, QStackedWidget, QVBoxLayout

from app.intents import ShowConsole
from app.ui.panels.base import Blocker, Panel, PanelContext, PanelWidget, filter_blocker
from app.ui.panels.command import IntentHandler
from app.ui.panels.home import RowHome, TabHome
from app.ui.panels.watch.console.list import (
    LEVEL_STYLES,
    RECORD_ROLE,
    ConsoleModel,
    LineDelegate,
    LineList,
    LogFindField,
    RecordFilter,
    format_line,
)
from app.ui.text import plain
from app.ui.text.numbers import group_digits
from app.ui.widgets import Button, EmptyAction, EmptyState, IconButton
from app.ui.widgets.menus import Menu, open_below
from nep.i18n import _, lazy, ngettext

if TYPE_CHECKING:
    from app.core.world.console import ConsoleRecord

LEVEL_LABELS = {
    "debug": lazy("All, including details"),
    "all": lazy("Everything"),
    "warn": lazy("Warnings and errors"),
    "error": lazy("Errors only"),
}
VISIBLE_LEVELS = {
    "debug": frozenset(LEVEL_STYLES),
    "all": frozenset(LEVEL_STYLES) - {"debug"},
    "warn": frozenset({"warn", "error", "critical"}),
    "error": frozenset({"error", "critical"}),
}
MAX_NODES = 20


class ConsolePanel(PanelWidget):
    """Panel with the list of log records, and filters by level, node and text."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, _("Console"))
        self._last_revision = -1
        self._last_filter: tuple[object, ...] = ()
        self._unseen_count = 0
        self.level = "all"
        self.node = ""
        self.filter_button = IconButton(self.theme, "filter", _("Choose which lines are shown"), size=26)
        self.filter_button.clicked.connect(self._show_menu)
        self.header = [self.filter_button]
        self.find_field = LogFindField(self.theme)
        self.find_field.textChanged.connect(self.refresh)
        self.find_field.exited.connect(self._focus_lines)
        self.find_field.hide()
        self.model = ConsoleModel()
        self.list = self._make_list()
        self.empty = EmptyState(self.theme, "terminal", _("No events yet"), "")
        self.newest_button = Button(self.theme, "", "arrow-up", size="small")
        self.newest_button.setParent(self.list)
        self.newest_button.hide()
        self.newest_button.clicked.connect(self.list.scrollToTop)
        self.list.verticalScrollBar().valueChanged.connect(self._on_scrolled)
        self.pages = QStackedWidget()
        self.pages.addWidget(self.empty)
        self.pages.addWidget(self.list)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 4, 0, 4)
        column.setSpacing(4)
        row = QHBoxLayout()
        row.setContentsMargins(8, 0, 8, 0)
        row.addWidget(self.find_field)
        column.addLayout(row)
        column.addWidget(self.pages)

    def _make_list(self) -> LineList:
        line_list = LineList()
        line_list.setModel(self.model)
        self._delegate = LineDelegate(self.theme, lambda: self.density, self.text_font)
        line_list.setItemDelegate(self._delegate)
        line_list.find_requested.connect(self.focus_filter)
        line_list.resized.connect(self._position_newest_button)
        self._copy_action = QAction(_("Copy"), line_list)
        self._copy_action.setShortcut(QKeySequence(QKeySequence.StandardKey.Copy))
        self._copy_action.setShortcutContext(Qt.ShortcutContext.WidgetShortcut)
        self._copy_action.triggered.connect(self.copy)
        line_list.addAction(self._copy_action)
        line_list.customContextMenuRequested.connect(self._show_actions)
        self._copy_all_action = QAction(_("Copy all lines"), self)
        self._copy_all_action.triggered.connect(self._copy_everything)
        self._clear_action = QAction(_("Clear"), self)
        self._clear_action.triggered.connect(self.clear)
        self._find_action = QAction(_("Find text"), self)
        self._find_action.triggered.connect(self.focus_filter)
        return line_list

    # display

    def source_changed(self) -> None:
        self._last_revision = -1
        self.model.reset_records((), self._current_filter())

    def refresh(self) -> None:
        console = self.world.console
        filter_state = (self.level, self.node, self.find_field.text())
        if (console.revision, filter_state) == (self._last_revision, self._last_filter):
            return
        records, record_filter = console.records, self._current_filter()
        if filter_state != self._last_filter:
            self.model.reset_records(records, record_filter)
            self.list.scrollToTop()
        else:
            self._update_records(records)
        self._last_revision, self._last_filter = console.revision, filter_state
        self.pages.setCurrentIndex(1 if self.model.rowCount() else 0)
        self._update_empty_state()

    def _update_records(self, records: Sequence[ConsoleRecord]) -> None:
        # Keeps the visible lines in place when the user has scrolled down.
        scroll_bar = self.list.verticalScrollBar()
        scroll_position = scroll_bar.value()
        added_count = self.model.update_records(records, self._current_filter())
        if scroll_position > 0 and added_count:
            self.list.doItemsLayout()
            scroll_bar.setValue(scroll_position + added_count * self._delegate.row_height())
            self._unseen_count += added_count
            self._update_newest_button()
        elif added_count:
            self.list.scrollToTop()

    def _current_filter(self) -> RecordFilter:
        return RecordFilter(VISIBLE_LEVELS[self.level], self.node, self.find_field.text())

    def _on_scrolled(self, value: int) -> None:
        if value == 0:
            self._unseen_count = 0
        self._update_newest_button()

    def _update_newest_button(self) -> None:
        is_scrolled = self.list.verticalScrollBar().value() > 0
        if self._unseen_count:
            template = ngettext("{count} new", "{count} new", self._unseen_count)
            self.newest_button.set_label(template.format(count=group_digits(self._unseen_count)), "arrow-up")
        else:
            self.newest_button.set_label(_("Jump to newest"), "arrow-up")
        self.newest_button.setVisible(is_scrolled)
        self.newest_button.adjustSize()
        self._position_newest_button()

    def _position_newest_button(self) -> None:
        viewport = self.list.viewport()
        self.newest_button.move(viewport.width() - self.newest_button.width() - 12, 8)

    def _update_empty_state(self) -> None:
        is_filtered = self.level in {"warn", "error"} or self.node or self.find_field.text()
        if not is_filtered:
            self.empty.set_texts(_("No events yet"), _("Log messages of programs and robots appear here."))
            self.empty.set_actions([self.doctor_action()])
        elif self.node or self.find_field.text():
            self.empty.set_texts(_("No matching lines"), _("Show all lines, or wait for a matching one."))
            self.empty.set_actions([EmptyAction(_("Show all lines"), self.clear_filters, "x")])
        else:
            hint = _("Choose “{everything}” to see all lines.").format(everything=_(LEVEL_LABELS["all"]))
            self.empty.set_texts(_("No problems reported"), hint)
            self.empty.set_actions([])

    def blockers(self) -> list[Blocker]:
        active_filters = [
            self.find_field.text(),
            self.node,
            _(LEVEL_LABELS[self.level]) if self.level in {"warn", "error"} else "",
        ]
        text = ", ".join(filter(None, active_filters))
        return [filter_blocker(self.title(), text, self.clear_filters)] if text else []

    # filters

    def set_level(self, level: str) -> None:
        """Set which levels are shown: "debug" (all), "all" (all but debug), "warn" (and above) or "error"."""
        if level in VISIBLE_LEVELS:
            self.level = level
            self._update_filter_button()

    def set_node(self, node: str) -> None:
        """Show only the records of one node; "" for all nodes."""
        self.node = node
        self._update_filter_button()

    def clear_filters(self) -> None:
        """Remove all filters."""
        self.find_field.clear()
        self.find_field.hide()
        self.set_node("")
        self.set_level("all")

    def clear(self) -> None:
        """Delete all stored records."""
        self.world.console.clear()
        self.refresh()

    def _update_filter_button(self) -> None:
        template = _("Showing: {level} from {node}") if self.node else _("Showing: {level}")
        self.filter_button.set_name(template.format(level=_(LEVEL_LABELS[self.level]), node=self.node))
        self.filter_button.setProperty("chosen", self.level != "all" or bool(self.node))
        self.refresh()

    def _show_menu(self) -> None:
        menu = Menu(self.theme, self)
        for level, text in LEVEL_LABELS.items():
            self._add_choice(menu, _(text), level == self.level, partial(self.set_level, level))
        nodes = sorted({record.origin for record in self.world.console.records} | {self.node} - {""})
        if nodes:
            menu.addSeparator()
            self._add_choice(menu, _("From all sources"), not self.node, partial(self.set_node, ""))
        for node in nodes[:MAX_NODES]:
            if node:
                self._add_choice(menu, node, node == self.node, partial(self.set_node, node))
        menu.addSeparator()
        menu.addAction(self._find_action)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        open_below(menu, self.filter_button)

    @staticmethod
    def _add_choice(menu: Menu, text: str, is_chosen: bool, choose: partial[None]) -> None:
        action = menu.addAction(plain.escape_menu_text(text))
        action.setCheckable(True)
        action.setChecked(is_chosen)
        action.triggered.connect(lambda _on=False: choose())

    def _show_actions(self, position: QPoint) -> None:
        menu = Menu(self.theme, self)
        menu.addActions([self._copy_action, self._copy_all_action, self._find_action, self._clear_action])
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.popup(self.list.viewport().mapToGlobal(position))

    def more_actions(self) -> Sequence[QAction]:
        return (self._find_action, self._copy_all_action, self._clear_action)

    def focus_filter(self) -> bool:
        self.find_field.show()
        self.find_field.setFocus(Qt.FocusReason.ShortcutFocusReason)
        self.find_field.selectAll()
        return True

    def _focus_lines(self) -> None:
        self.list.setFocus(Qt.FocusReason.OtherFocusReason)

    # copying

    def copy(self) -> None:
        """Copy the selected lines to the clipboard, oldest first."""
        self._copy_rows(sorted((index.row() for index in self.list.selectedIndexes()), reverse=True))

    def _copy_everything(self) -> None:
        self._copy_rows(range(self.model.rowCount() - 1, -1, -1))

    def _copy_rows(self, rows: Sequence[int]) -> None:
        if rows:
            records = [self.model.index(row, 0).data(RECORD_ROLE) for row in rows]
            QGuiApplication.clipboard().setText("\n".join(format_line(record) for record in records))
            template = ngettext("Copied {count} line", "Copied {count} lines", len(rows))
            self.context.show_toast(template.format(count=group_digits(len(rows))))

    # appearance and saved state

    def theme_changed(self) -> None:
        super().theme_changed()
        self.list.doItemsLayout()  # row heights depend on the font
        self._update_newest_button()

    def save_state(self) -> dict[str, object]:
        return {"level": self.level}

    def restore_state(self, state: Mapping[str, object]) -> None:
        self.set_level(str(state.get("level", "all")))


PANEL = Panel(
    "console",
    lazy("Console"),
    "terminal",
    (),
    ConsolePanel,
    home=(TabHome("behaviour", "problems"), RowHome("developer", 2, 1, 394)),
    intents=(IntentHandler(ShowConsole, lambda _panel, _intent: None),),
)
