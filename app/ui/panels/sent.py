"""Sent panel: log of published messages, service calls, replays and clicks, with sender and result."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence

from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QAction, QGuiApplication, QKeySequence
from PySide6.QtWidgets import QHBoxLayout, QStackedWidget, QVBoxLayout, QWidget

from app.core.run.acting.sent_log import SentRecord
from app.ui.panels.base import Hindrance, Panel, PanelContext, PanelWidget, filter_hindrance
from app.ui.panels.row_actions import RowAction, filled, show_messages
from app.ui.text.numbers import grouped
from app.ui.widgets import ElidedLabel, EmptyAction, EmptyState, IconButton, Separator
from app.ui.widgets.inputs.fields import FilterField
from app.ui.widgets.menus import Menu
from app.ui.widgets.table.model import Cell, Column, TableModel
from app.ui.widgets.table.view import TableView
from nep.i18n import _, lazy, ngettext

ASKERS = {
    "publish": ("send", lazy("Publish")),
    "service": ("spline", lazy("Services")),
    "replay": ("film", lazy("Replay")),
    "image": ("mouse-pointer-click", lazy("Image")),
    "switch": ("triangle-alert", lazy("Studio")),
}
"""Icon and name of each kind of sender."""
MAX_TIP_CHARS = 1000
STATE_UPDATE_TICKS = 6  # refreshes at 30 Hz


def clock_words(record: SentRecord) -> str:
    """Format the time of the last send as HH:MM:SS."""
    return time.strftime("%H:%M:%S", time.localtime(record.at_s))


def line_of(record: SentRecord) -> str:
    """Format a log entry as a line for the clipboard."""
    asker = _(ASKERS[record.asker][1])
    often = f"{grouped(record.count)} \u00d7 " if record.count > 1 else ""
    return " ".join(filter(None, (clock_words(record), f"[{asker}]", record.name, often + record.words)))


class SentPanel(PanelWidget):
    """Panel with the table of log entries and their number below."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, _("Sent"))
        self.acting = context.session.acting
        self._seen: object = None
        self._ticks = 0
        self.filter = FilterField(self.theme, _("Filter sent messages"))
        self.again = IconButton(self.theme, "repeat", _("Send or call the selected entry again"), size=26)
        self.header = [self.filter, self.again]
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
        self._copy = QAction(_("Copy"), self.table)
        self._copy.setShortcut(QKeySequence(QKeySequence.StandardKey.Copy))
        self._copy.setShortcutContext(Qt.ShortcutContext.WidgetShortcut)
        self._copy.triggered.connect(self.copy)
        self.table.addAction(self._copy)
        self._clear = QAction(_("Clear"), self)
        self._clear.triggered.connect(self.clear)

    def _connect(self) -> None:
        self.filter.textChanged.connect(self._rebuild)
        self.filter.leave.connect(lambda: self.table.setFocus(Qt.FocusReason.ShortcutFocusReason))
        self.again.clicked.connect(self.repeat)
        self.table.filter_wanted.connect(self.focus_filter)
        self.table.menu_wanted.connect(self._show_menu)
        self.table.opened.connect(self.show_row)
        self.table.selectionModel().currentRowChanged.connect(self._offer_again)

    def _arrange(self) -> None:
        below = QWidget()
        row = QHBoxLayout(below)
        row.setContentsMargins(12, 4, 12, 4)
        row.addWidget(self.foot, 1)
        row.addWidget(self.total)
        listed = QWidget()
        inside = QVBoxLayout(listed)
        inside.setContentsMargins(0, 0, 0, 0)
        inside.setSpacing(0)
        inside.addWidget(self.table, 1)
        inside.addWidget(Separator(self.theme))
        inside.addWidget(below)
        self.pages: QStackedWidget = self.show_one_of(self.empty, listed)

    # -- display ------------------------------------------------------------------------------------------

    def refresh(self) -> None:
        self._ticks += 1
        if self.acting.sent.revision != self._seen:
            self._rebuild()
        elif self._ticks % STATE_UPDATE_TICKS == 0:
            self._offer_again()

    def _rebuild(self) -> None:
        log, words = self.acting.sent, self.filter.text().casefold().split()
        self._seen = log.revision
        rows = [each for each in reversed(log.records) if all(word in _haystack(each) for word in words)]
        self.model.set_rows(rows)
        self.table.tell_visible_changed()
        self.pages.setCurrentIndex(1 if rows else 0)
        if words and log.records:
            self.empty.set_texts(_("No matches"), _("Clear the filter to see all sent messages."), "search")
            self.empty.set_actions([EmptyAction(_("Clear the filter"), self.filter.clear, "x")])
        else:
            said = _("Messages you publish, calls, replays and clicks in images are listed here.")
            self.empty.set_texts(_("Nothing sent yet"), said, "send")
            publish = EmptyAction(_("Publish a message"), lambda: self.context.run("publish.new"), "send")
            self.empty.set_actions([publish])
        self.foot.setText(_("Messages and calls you send by hand are listed here"))
        self.total.setText(self._total_words())
        self._offer_again()

    def _total_words(self) -> str:
        log = self.acting.sent
        if log.since_s is None:
            return ""
        clock = time.strftime("%H:%M", time.localtime(log.since_s))
        said = ngettext("{count} since {time}", "{count} since {time}", log.total)
        return said.format(count=grouped(log.total), time=clock)

    def chosen(self) -> SentRecord | None:
        """Return the selected entry, or None."""
        key = self.table.chosen_key()
        return self.acting.sent.get(int(key)) if key else None

    def _may_again(self, record: SentRecord | None) -> bool:
        return record is not None and record.again is not None and self.acting.arming.allows(record.target)

    def _offer_again(self) -> None:
        self.again.setEnabled(self._may_again(self.chosen()))

    def hindrances(self) -> list[Hindrance]:
        words = self.filter.text().strip()
        return [filter_hindrance(self.title(), words, self.filter.clear)] if words else []

    # -- user actions -------------------------------------------------------------------------------------

    def repeat(self) -> None:
        """Send the selected entry again if its target is armed."""
        record = self.chosen()
        why_not = self.acting.repeat(record.number) if record is not None else ""
        if why_not:
            self.context.toast(why_not)
        if self.acting.question is not None:
            self.context.run("panel:publish")  # this panel asks for confirmation
        self.refresh()

    def copy(self) -> None:
        """Copy the selected entry to the clipboard."""
        record = self.chosen()
        if record is not None:
            self._to_clipboard(line_of(record), _("Copied the line"))

    def _to_clipboard(self, text: str, said: str) -> None:
        QGuiApplication.clipboard().setText(text)
        self.context.toast(said)

    def clear(self) -> None:
        """Clear the log."""
        self.acting.sent.clear()
        self.refresh()

    def show_row(self, key: str) -> None:
        """Show the topic or the service of an entry in its panel."""
        record = self.acting.sent.get(int(key))
        if record is None or not record.name:
            return
        if record.asker == "service":
            self.context.run(f"service.call:{record.name}")
        else:
            show_messages(self.context, record.name)

    def menu_of(self, key: str) -> Menu | None:
        """Return the context menu of an entry."""
        record = self.acting.sent.get(int(key))
        if record is None:
            return None
        menu = Menu(self.theme, self)
        if record.again is not None:
            words = _("Call again") if record.asker == "service" else _("Send again")
            may = self._may_again(record)
            words = words if may else _("{what} (not armed)").format(what=words)
            menu.addAction(self.theme.icon("repeat"), words, self.repeat).setEnabled(may)
        actions = [RowAction(_("Copy the line"), "copy", self.copy)]
        if record.text:
            copied = _("Copied the request") if record.asker == "service" else _("Copied the message")
            copies = _("Copy the request") if record.asker == "service" else _("Copy the message")
            actions.append(RowAction(copies, "braces", lambda: self._to_clipboard(record.text, copied)))
        if record.name:
            is_call = record.asker == "service"
            shows = _("Open the service") if is_call else _("Show messages")
            actions.append(RowAction(shows, "spline" if is_call else "list-tree", lambda: self.show_row(key)))
        return filled(menu, self.theme, actions)

    def _show_menu(self, key: str, at: QPoint) -> None:
        menu = self.menu_of(key)
        if menu is not None:
            menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
            menu.popup(at)

    # -- overrides ----------------------------------------------------------------------------------------

    def more_actions(self) -> Sequence[QAction]:
        self._clear.setEnabled(bool(self.acting.sent.records))
        return (self._clear,)

    def focus_filter(self) -> bool:
        self.filter.setFocus(Qt.FocusReason.ShortcutFocusReason)
        self.filter.selectAll()
        return True

    def save_state(self) -> dict[str, object]:
        return self.table.saved_state()

    def restore_state(self, state: Mapping[str, object]) -> None:
        self.table.restore(state)


def _haystack(record: SentRecord) -> str:
    return f"{record.name} {record.words} {_(ASKERS[record.asker][1])}".casefold()


def _columns() -> tuple[Column[SentRecord], ...]:
    def sign(record: SentRecord) -> Cell:
        icon, words = ASKERS[record.asker]
        if record.is_bad:
            return Cell(icon="circle-x", role="error", said=_("failed"))
        role = "warn" if record.asker == "switch" else "textTertiary"
        return Cell(icon=icon, role=role, said=_(words))

    def what(record: SentRecord) -> Cell:
        return Cell(record.words, role="error" if record.is_bad else "text")

    def count(record: SentRecord) -> Cell:
        return Cell(f"\u00d7 {grouped(record.count)}" if record.count > 1 else "", role="textSecondary")

    def to(record: SentRecord) -> Cell:
        return Cell(record.name, mono=True, middle=True) if record.name else Cell(_("Studio"))

    def asked(record: SentRecord) -> Cell:
        return Cell(_(ASKERS[record.asker][1]), role="textSecondary")

    def tip(record: SentRecord) -> str:
        return "\n".join(filter(None, (record.words, record.text[:MAX_TIP_CHARS])))

    return (
        Column("at", lazy("Time"), 92, lambda each: Cell(clock_words(each), mono=True, role="textSecondary")),
        Column("sign", "", 34, sign, words=lazy("Kind")),
        Column("name", lazy("Sent to"), 112, to, tip=lambda each: each.name),
        Column("what", lazy("Result"), 110, what, stretch=True, tip=tip),
        Column("count", lazy("Count"), 60, count, figures=True, yields=1),
        Column("asker", lazy("Sent from"), 90, asked, yields=2),
    )  # fmt: skip


PANEL = Panel("sent", lazy("Sent"), "send", (), SentPanel)
