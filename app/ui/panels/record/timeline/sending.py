"""Sending of replayed topics to the live network: arming strip, and page for choosing the topics."""

from __future__ import annotations

from typing import NamedTuple

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QHBoxLayout, QLineEdit, QWidget

from app.core.recording.replay.sending import ReplaySending, late_text
from app.core.run.acting.arming import Target
from app.ui.panels.act.armed_strip import ArmedStrip
from app.ui.panels.base import PanelContext
from app.ui.text import plain
from app.ui.text.numbers import group_digits
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, label
from app.ui.widgets.flow_layout import Flow
from app.ui.widgets.lists.scroll_areas import ScrollColumn
from app.ui.widgets.menus import FieldContextMenu
from app.ui.widgets.table.model import Cell, Column, TableModel
from app.ui.widgets.table.view import TableView
from nep.i18n import _, lazy, ngettext

MIN_TABLE_HEIGHT_PX = 96
NAME_WIDTH_PX = 240


class ReplayStrip(ArmedStrip):
    """Arming strip for a replay, visible while topics are armed or a confirmation is pending.

    Signals:
        change_requested: The page for choosing topics should be shown.
    """

    is_for_replay = True
    change_requested = Signal()

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context)
        self.change = Button(context.theme, _("Topics"), "plus", kind="ghost", size="small")
        self.change.setAccessibleName(_("Choose which topics are sent"))
        self.change.setToolTip(plain.tip(self.change.accessibleName()))
        self.change.clicked.connect(self.change_requested)
        self._flow.addWidget(self.change)

    @property
    def sending(self) -> ReplaySending | None:
        """Controller that sends topics of the open recording, or None."""
        replay = self._context.session.replay
        return replay.sending if replay is not None else None

    def refresh(self) -> None:
        super().refresh()
        self.setVisible(self.sending is not None and (self._is_on or self.acting.question is not None))

    def summary_text(self) -> str:
        active = self.sending.outbox.active_topics if self.sending is not None else ()
        if not active:
            return ""
        count, dropped_count = sum(each.count for each in active), sum(each.dropped_count for each in active)
        subscriber_count = max(each.subscriber_count for each in active)
        sent = ngettext("{count} sent", "{count} sent", count).format(count=group_digits(count))
        late = [late_text(dropped_count)] if dropped_count else []
        receivers_text = ngettext("{count} subscriber", "{count} subscribers", subscriber_count).format(
            count=subscriber_count
        )
        return ", ".join((sent, *late, receivers_text if subscriber_count else _("no subscribers")))

    def token_text(self, target: Target) -> str:
        routes = self.sending.routes if self.sending is not None else {}
        recorded = [topic for topic, name in routes.items() if name == target.name != topic]
        if not recorded:
            return target.name
        return _("{topic} as {name}").format(topic=recorded[0], name=target.name)


class SendRow(NamedTuple):
    """Row of a recorded topic.

    Attributes:
        topic: Name of the topic in the recording.
        message_count: Number of recorded messages.
        name: Name under which the topic is sent; None if it is not sent.
        moves_robot: True if the topic moves a robot.
    """

    topic: str
    message_count: int
    name: str | None
    moves_robot: bool


class SendChooser(QWidget):
    """Table for choosing the topics to send and their names on the live network.

    The table is shown in place of the lanes.

    Signals:
        exited: The page should be closed.
        arming_failed: Reason why sending can't be armed.
    """

    exited = Signal()
    arming_failed = Signal(str)

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._sending: ReplaySending | None = None
        self._counts: dict[str, int] = {}
        self._last_state: object = None
        self.model: TableModel[SendRow] = TableModel(_columns(), lambda row: row.topic)
        self.table: TableView[SendRow] = TableView(theme, self.model, "topic")
        self.table.setAccessibleName(_("Topics that can be sent"))
        self.table.setMinimumHeight(round(theme.scaled(MIN_TABLE_HEIGHT_PX)))
        self.text_label = label("", "small", role="textSecondary", wrap=True)
        self.text_label.setMinimumWidth(0)
        self.problem = label("", "small", role="error", wrap=True)
        self.problem.setMinimumWidth(0)
        self.name = QLineEdit()
        self.name.setAccessibleName(_("Topic name on the live network"))
        self.name.setProperty("focusRadius", theme.radius("control"))
        self.name.setMinimumWidth(round(theme.scaled(NAME_WIDTH_PX) / 2))
        self.name.setMaximumWidth(round(theme.scaled(NAME_WIDTH_PX)))
        FieldContextMenu(theme, self.name)
        self.arm = Button(theme, _("Arm and send"), "lock", kind="primary", size="small")
        self.cancel = Button(theme, _("Cancel"), size="small")
        self.table.opened.connect(self._toggle)
        self.table.order_changed.connect(self._show_rows)
        self.table.selectionModel().currentRowChanged.connect(self._show_name)
        self.name.textEdited.connect(self._name_edited)
        self.name.returnPressed.connect(self._arm)
        self.arm.clicked.connect(self._arm)
        self.cancel.clicked.connect(self.exited)
        self._arrange()

    def _arrange(self) -> None:
        footer = Flow(gap=8, row_gap=6)
        footer.addWidget(label(_("Sent as"), "small", role="textSecondary"))
        for field in (self.name, self.arm, self.cancel):
            footer.addWidget(field)
        scroll = ScrollColumn(_("Topics sent"), margins=(12, 8, 12, 8), gap=6)
        scroll.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        below = QWidget()
        below.setLayout(footer)
        for index, widget in enumerate((self.text_label, self.table, self.problem, below)):
            scroll.column.insertWidget(index, widget)
        scroll.column.setStretchFactor(self.table, 1)
        scroll.column.setStretch(scroll.column.count() - 1, 0)  # the table takes the remaining height
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.addWidget(scroll)

    def open(self, sending: ReplaySending, counts: dict[str, int], selected: str) -> None:
        """Show the topics of a recording.

        Args:
            sending: Controller that sends the topics.
            counts: Number of recorded messages by topic.
            selected: Topic whose row is selected.
        """
        self._sending, self._counts, self._last_state = sending, counts, None
        sending.analyze()
        self.problem.setText("")
        self.refresh()
        self.table.select_key(selected)
        self._show_name()
        self.table.setFocus(Qt.FocusReason.OtherFocusReason)

    def refresh(self) -> None:
        """Update the table if the topics to send have changed."""
        sending = self._sending
        if sending is None or self._last_state == (sending, sending.revision):
            return
        self._last_state = (sending, sending.revision)
        self._show_rows()
        hint = _(
            "While sending is armed, the selected topics are also sent to the live network during playback."
        )
        moving = _("Topics that move a robot are marked and need confirmation.")
        reading = _("Checking which topics move robots…")
        self.text_label.setText(f"{hint} {moving if sending.is_analyzed else reading}")
        self.problem.setVisible(bool(self.problem.text()))
        self.arm.setEnabled(bool(sending.routes) and sending.is_analyzed)

    def _show_rows(self) -> None:
        sending = self._sending
        if sending is None:
            return
        rows = []
        for topic, count in self._counts.items():
            name = sending.routes.get(topic)
            rows.append(SendRow(topic, count, name, sending.moves_robot(topic, name or topic)))
        self.model.set_rows(self.table.order.sort(rows))
        self.table.viewport().update()

    def _toggle(self, topic: str) -> None:
        sending = self._sending
        if sending is not None:
            self._set_problem(sending.select(topic, None if topic in sending.routes else ""))
            self._show_name()

    def _show_name(self) -> None:
        # The text field for the name edits the selected row.
        topic = self.table.selected_key() or ""
        routes = self._sending.routes if self._sending is not None else {}
        name = routes.get(topic, "")
        self.name.setEnabled(bool(topic))
        self.name.setPlaceholderText(topic)
        self.name.setText(name if name != topic else "")

    def _name_edited(self, text: str) -> None:
        topic = self.table.selected_key()
        if topic and self._sending is not None:
            self._set_problem(self._sending.select(topic, text))

    def _set_problem(self, problem: str) -> None:
        self.problem.setText(problem)
        self._last_state = None
        self.refresh()
        if problem:
            self.arm.setEnabled(False)

    def _arm(self) -> None:
        if self._sending is None or not self.arm.isEnabled():
            return
        reason = self._sending.arm()
        if reason:
            self.arming_failed.emit(reason)
        else:
            self.exited.emit()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape:
            self.exited.emit()
        elif event.key() not in {Qt.Key.Key_Tab, Qt.Key.Key_Backtab}:
            event.accept()  # keys must not reach the panel while the lanes are hidden


def _columns() -> tuple[Column[SendRow], ...]:
    def sent_cell(row: SendRow) -> Cell:
        if row.name is not None:
            return Cell(icon="check", role="accentText", accessible_text=_("sent"))
        return Cell(icon="minus", role="textTertiary", accessible_text=_("not sent"))

    def moves_cell(row: SendRow) -> Cell:
        return (
            Cell(icon="triangle-alert", role="warn", accessible_text=_("moves a robot"))
            if row.moves_robot
            else Cell()
        )

    return (
        Column("sent", "", 40, sent_cell, label=lazy("Send")),
        Column("topic", lazy("Topic"), 170, lambda row: Cell(row.topic, mono=True),
               key=lambda row: row.topic, stretch=True, tip=lambda row: row.topic),
        Column("moves", "", 40, moves_cell, label=lazy("Moves a robot"),
               tip=lambda row: _("Moves a robot; needs confirmation.") if row.moves_robot else ""),
        Column("as", lazy("Sent as"), 190, lambda row: Cell(row.name or "", mono=True, role="accentText"),
               tip=lambda row: row.name or ""),
        Column("messages", lazy("Messages"), 90, lambda row: Cell(group_digits(row.message_count)),
               key=lambda row: row.message_count, is_numeric=True, hide_order=1),
    )  # fmt: skip
