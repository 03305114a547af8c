"""Sent panel: log of published messages, service calls, replays and clicks, with sender and result."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QAction, QGuiApplication, QKeySequence
from PySide6.QtWidgets import QHBoxLayout, QStackedWidget, QVBoxLayout, QWidget

from app.core.run.acting.sent_log import SentRecord
from app.ui.intents import OpenPanel, SelectService
from app.ui.panels.base import Blocker, Panel, PanelContext, PanelWidget, filter_blocker
from app.ui.panels.home import TabHome
from app.ui.panels.row_actions import RowAction, fill_menu, show_messages
from app.ui.text.numbers import group_digits
from app.ui.widgets import ElidedLabel, EmptyAction, EmptyState, IconButton, Separator
from app.ui.widgets.inputs.fields import FilterField
from app.ui.widgets.menus import Menu
from app.ui.widgets.table.model import Cell, Column, TableModel
from app.ui.widgets.table.view import TableView
from nep.i18n import _, lazy, ngettext

SENDERS = {
    "publish": ("send", lazy("Publish")),
    "service": ("spline", lazy("Services")),
    "replay": ("film", lazy("Replay")),
    "image": ("mouse-pointer-click", lazy("Image")),
    "switch": ("triangle-alert", lazy("Studio")),
}
"""Icon and name of each kind of sender, by id."""
MAX_TIP_CHARS = 1000
STATE_UPDATE_TICKS = 6  # refreshes at 30 Hz


def clock_text(record: SentRecord) -> str:
    """Format the time of the last send as HH:MM:SS."""
    return time.strftime("%H:%M:%S", time.localtime(record.at_s))


def format_line(record: SentRecord) -> str:
    """Format a log entry as a line for the clipboard."""
    sender = _(SENDERS[record.origin][1])
    count_prefix = f"{group_digits(record.count)} \u00d7 " if record.count > 1 else ""
    return " ".join(
        filter(None, (clock_text(record), f"[{sender}]", record.name, count_prefix + record.result_text))
    )


class SentPanel(PanelWidget):
    """Panel with the table of log entries and their number below."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, _("Sent"))
        self.acting = context.session.acting
        self._last_revision: object = None
        self._ticks = 0
        self.filter = FilterField(self.theme, _("Filter sent messages"))
        self.repeat_button = IconButton(
            self.theme, "repeat", _("Send or call the selected entry again"), size=26
        )
        self.header = [self.filter, self.repeat_button]
        self.model: TableModel[SentRecord] = TableModel(_columns(), lambda each: str(each.number))
        self.table = TableView(self.theme, self.model)
        self.table.setAccessibleName(_("Sent messages, newest first"))
        self.foot = ElidedLabel("small", "textTertiary")
        self.total = ElidedLabel("small", "textTertiary")
        self.empty = EmptyState(self.theme, "send", "", "")
        self.setFocusProxy(self.table)
        self._make_actions()
        self._connect()
        self._arrange()
        self.refresh()

    def _make_actions(self) -> None:
        self._copy_action = QAction(_("Copy"), self.table)
        self._copy_action.setShortcut(QKeySequence(QKeySequence.StandardKey.Copy))
        self._copy_action.setShortcutContext(Qt.ShortcutContext.WidgetShortcut)
        self._copy_action.triggered.connect(self.copy)
        self.table.addAction(self._copy_action)
        self._clear_action = QAction(_("Clear"), self)
        self._clear_action.triggered.connect(self.clear)

    def _connect(self) -> None:
        self.filter.textChanged.connect(self._rebuild)
        self.filter.exited.connect(lambda: self.table.setFocus(Qt.FocusReason.ShortcutFocusReason))
        self.repeat_button.clicked.connect(self.repeat)
        self.table.filter_requested.connect(self.focus_filter)
        self.table.menu_requested.connect(self._show_menu)
        self.table.opened.connect(self.show_row)
        self.table.selectionModel().currentRowChanged.connect(self._update_repeat_button)

    def _arrange(self) -> None:
        footer = QWidget()
        row = QHBoxLayout(footer)
        row.setContentsMargins(12, 4, 12, 4)
        row.addWidget(self.foot, 1)
        row.addWidget(self.total)
        page = QWidget()
        layout = QVBoxLayout(page)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(0)
        layout.addWidget(self.table, 1)
        layout.addWidget(Separator(self.theme))
        layout.addWidget(footer)
        self.pages: QStackedWidget = self.make_page_stack(self.empty, page)

    # -- display ------------------------------------------------------------------------------------------

    def refresh(self) -> None:
        self._ticks += 1
        if self.acting.sent_log.revision != self._last_revision:
            self._rebuild()
        elif self._ticks % STATE_UPDATE_TICKS == 0:
            self._update_repeat_button()

    def _rebuild(self) -> None:
        log, keywords = self.acting.sent_log, self.filter.text().casefold().split()
        self._last_revision = log.revision
        rows = [
            each for each in reversed(log.records) if all(keyword in _haystack(each) for keyword in keywords)
        ]
        self.model.set_rows(rows)
        self.table.refresh_visible()
        self.pages.setCurrentIndex(1 if rows else 0)
        if keywords and log.records:
            self.empty.set_texts(_("No matches"), _("Clear the filter to see all sent messages."), "search")
            self.empty.set_actions([EmptyAction(_("Clear the filter"), self.filter.clear, "x")])
        else:
            text = _("Messages you publish, calls, replays and clicks in images are listed here.")
            self.empty.set_texts(_("Nothing sent yet"), text, "send")
            publish = EmptyAction(_("Publish a message"), lambda: self.context.run("publish.new"), "send")
            self.empty.set_actions([publish])
        self.foot.setText(_("Messages and calls you send by hand are listed here"))
        self.total.setText(self._total_text())
        self._update_repeat_button()

    def _total_text(self) -> str:
        log = self.acting.sent_log
        if log.since_s is None:
            return ""
        clock = time.strftime("%H:%M", time.localtime(log.since_s))
        template = ngettext("{count} sent since {time}", "{count} sent since {time}", log.total)
        return template.format(count=group_digits(log.total), time=clock)

    def selected_record(self) -> SentRecord | None:
        """Return the selected entry, or None."""
        key = self.table.selected_key()
        return self.acting.sent_log.get(int(key)) if key else None

    def _can_repeat(self, record: SentRecord | None) -> bool:
        return record is not None and record.resend is not None and self.acting.arming.allows(record.target)

    def _update_repeat_button(self) -> None:
        self.repeat_button.setEnabled(self._can_repeat(self.selected_record()))

    def blockers(self) -> list[Blocker]:
        filter_text = self.filter.text().strip()
        return [filter_blocker(self.title(), filter_text, self.filter.clear)] if filter_text else []

    # -- user actions -------------------------------------------------------------------------------------

    def repeat(self) -> None:
        """Send the selected entry again. Show a confirmation if necessary, or the reason on failure."""
        record = self.selected_record()
        reason = self.acting.resend(record.number) if record is not None else ""
        if reason:
            self.context.show_toast(reason)
        if self.acting.question is not None:
            self.context.request(OpenPanel("publish"))  # this panel asks for confirmation
        self.refresh()

    def copy(self) -> None:
        """Copy the selected entry to the clipboard."""
        record = self.selected_record()
        if record is not None:
            self._copy_text(format_line(record), _("Copied the line"))

    def _copy_text(self, text: str, message: str) -> None:
        QGuiApplication.clipboard().setText(text)
        self.context.show_toast(message)

    def clear(self) -> None:
        """Clear the log."""
        self.acting.sent_log.clear()
        self.refresh()

    def show_row(self, key: str) -> None:
        """Show the topic or service of an entry in the panel for it.

        Args:
            key: Key of the entry.
        """
        record = self.acting.sent_log.get(int(key))
        if record is None or not record.name:
            return
        if record.origin == "service":
            self.context.request(SelectService(record.name))
        else:
            show_messages(self.context, record.name)

    def menu_of(self, key: str) -> Menu | None:
        """Return the context menu of an entry, or None if the log no longer contains the entry."""
        record = self.acting.sent_log.get(int(key))
        if record is None:
            return None
        menu = Menu(self.theme, self)
        if record.resend is not None:
            text = _("Call again") if record.origin == "service" else _("Send again")
            can_repeat = self._can_repeat(record)
            text = text if can_repeat else _("{what} (not armed)").format(what=text)
            menu.addAction(self.theme.icon("repeat"), text, self.repeat).setEnabled(can_repeat)
        actions = [RowAction(_("Copy the line"), "copy", self.copy)]
        if record.text:
            toast = _("Copied the request") if record.origin == "service" else _("Copied the message")
            copy_label = _("Copy the request") if record.origin == "service" else _("Copy the message")
            actions.append(RowAction(copy_label, "braces", lambda: self._copy_text(record.text, toast)))
        if record.name:
            is_call = record.origin == "service"
            show_label = _("Open the service") if is_call else _("Show messages")
            actions.append(
                RowAction(show_label, "spline" if is_call else "list-tree", lambda: self.show_row(key))
            )
        return fill_menu(menu, self.theme, actions)

    def _show_menu(self, key: str, position: QPoint) -> None:
        menu = self.menu_of(key)
        if menu is not None:
            menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
            menu.popup(position)

    # -- overrides ----------------------------------------------------------------------------------------

    def more_actions(self) -> Sequence[QAction]:
        self._clear_action.setEnabled(bool(self.acting.sent_log.records))
        return (self._clear_action,)

    def focus_filter(self) -> bool:
        self.filter.setFocus(Qt.FocusReason.ShortcutFocusReason)
        self.filter.selectAll()
        return True

    def save_state(self) -> dict[str, object]:
        return self.table.saved_state()

    def restore_state(self, state: Mapping[str, object]) -> None:
        self.table.restore(state)


def _haystack(record: SentRecord) -> str:
    return f"{record.name} {record.result_text} {_(SENDERS[record.origin][1])}".casefold()


def _columns() -> tuple[Column[SentRecord], ...]:
    def state_cell(record: SentRecord) -> Cell:
        icon, text = SENDERS[record.origin]
        if record.is_error:
            return Cell(icon="circle-x", role="error", accessible_text=_("failed"))
        role = "warn" if record.origin == "switch" else "textTertiary"
        return Cell(icon=icon, role=role, accessible_text=_(text))

    def content_cell(record: SentRecord) -> Cell:
        return Cell(record.result_text, role="error" if record.is_error else "text")

    def count_cell(record: SentRecord) -> Cell:
        return Cell(f"\u00d7 {group_digits(record.count)}" if record.count > 1 else "", role="textSecondary")

    def target_cell(record: SentRecord) -> Cell:
        return Cell(record.name, mono=True, elide_middle=True) if record.name else Cell(_("Studio"))

    def sender_cell(record: SentRecord) -> Cell:
        return Cell(_(SENDERS[record.origin][1]), role="textSecondary")

    def tip(record: SentRecord) -> str:
        return "\n".join(filter(None, (record.result_text, record.text[:MAX_TIP_CHARS])))

    return (
        Column("at", lazy("Time"), 92, lambda each: Cell(clock_text(each), mono=True, role="textSecondary")),
        Column("sign", "", 34, state_cell, label=lazy("Kind")),
        Column("name", lazy("Sent to"), 112, target_cell, tip=lambda each: each.name),
        Column("what", lazy("Result"), 110, content_cell, stretch=True, tip=tip),
        Column("count", lazy("Count"), 60, count_cell, is_numeric=True, hide_order=1),
        Column("asker", lazy("Sent from"), 90, sender_cell, hide_order=2),
    )  # fmt: skip


PANEL = Panel(
    "sent",
    lazy("Sent"),
    "send",
    (),
    SentPanel,
    home=(TabHome("developer", "console"), TabHome("behaviour", "problems")),
)
