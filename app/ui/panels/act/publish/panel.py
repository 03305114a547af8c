"""Publish panel: list of saved messages, arming switch, and the form of the selected message."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterable, Mapping, Sequence

from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QStackedWidget, QVBoxLayout

from app.core.network.topics import split_key
from app.core.network.watches import Suspendable, Watch
from app.core.run.acting.acting import result_text
from app.core.run.acting.arming import Target
from app.core.run.acting.shelf import MAX_MESSAGES, SavedMessage
from app.core.run.acting.templates import format_empty_message, format_message
from app.ui.intents import PublishMessage
from app.ui.panels.act.armed_strip import ArmDurationMenu, ArmedStrip
from app.ui.panels.act.publish.message_form import MessageForm
from app.ui.panels.act.publish.shelf_list import SavedMessageList, state_cell
from app.ui.panels.base import Panel, PanelContext, PanelWidget
from app.ui.panels.command import Command, IntentHandler
from app.ui.panels.home import TabHome
from app.ui.panels.row_actions import RowAction, fill_menu
from app.ui.text.numbers import group_digits, rate_text
from app.ui.widgets import Button, EmptyAction, EmptyState, label
from app.ui.widgets.inputs.fields import FilterField
from app.ui.widgets.lists.scroll_areas import ScrollColumn
from app.ui.widgets.lists.split_list import ListDetailView
from app.ui.widgets.menus import Menu
from app.ui.widgets.paint import show_when
from nep.errors import NepError
from nep.i18n import _, lazy, ngettext

LIST_WIDTH_PX, SIDE_BY_SIDE_PX, LIST_HEIGHT_PX = 236, 520, 130
STATE_UPDATE_TICKS = 6  # refreshes at 30 Hz


class PublishPanel(PanelWidget):
    """Panel with the list of messages at the left (at the top if narrow) and the form of the selected one."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, _("Publish"))
        self.acting = context.session.acting
        self._last_state: tuple[object, ...] = ()
        self._ticks = 0
        self._requested_id = ""
        self._template_watch: Watch | None = None
        self._template_topic = ""
        self.count_label = label("", "small", role="textSecondary")
        self.chips = [self.count_label]
        self.new_button = Button(self.theme, _("New"), "plus", size="small")
        self.new_button.setAccessibleName(_("New message"))
        self.new_button.clicked.connect(lambda: self.open_for(""))
        self.header = [self.new_button]
        self.strip = ArmedStrip(context)
        self._duration_menu = ArmDurationMenu(self.theme, self, self.acting)
        self.filter = FilterField(self.theme, _("Filter saved messages"))
        self.filter.setMaximumWidth(16_777_215)
        self.list = SavedMessageList(self.theme, lambda each: state_cell(each, self.acting))
        self.form = MessageForm(self.theme, self._type_of)
        self.empty = EmptyState(
            self.theme,
            "send",
            _("No saved messages"),
            _(
                "Right-click a topic or a received message and choose “Publish to this topic”, or create a "
                "new message."
            ),
            [EmptyAction(_("New"), lambda: self.open_for(""), "plus", is_primary=True)],
        )
        self._connect()
        self._arrange()
        self.refresh()

    def _connect(self) -> None:
        self.filter.textChanged.connect(lambda _text: self._rebuild())
        self.filter.exited.connect(lambda: self.list.setFocus(Qt.FocusReason.ShortcutFocusReason))
        message_list, form = self.list, self.form
        message_list.filter_requested.connect(self.focus_filter)
        message_list.selected.connect(lambda _id: self._show_selected())
        message_list.send_requested.connect(lambda _id: self.send())
        message_list.copy_requested.connect(self.copy)
        message_list.delete_requested.connect(self.delete)
        message_list.menu_requested.connect(self._show_menu)
        form.changed.connect(self._message_edited)
        form.send_requested.connect(self.send)
        form.repeat_requested.connect(self.repeat)
        form.template_requested.connect(self.insert_template)

    def _arrange(self) -> None:
        scroll = ScrollColumn(_("Selected message"))
        scroll.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        scroll.column.insertWidget(0, self.form)
        scroll.column.setStretchFactor(self.form, 1)
        scroll.column.setStretch(scroll.column.count() - 1, 0)  # the form takes the remaining height
        self._list_detail_view = ListDetailView(
            self.theme,
            (self.filter, self.list, scroll),
            list_px=LIST_WIDTH_PX,
            list_height_px=LIST_HEIGHT_PX,
            narrow_px=SIDE_BY_SIDE_PX,
        )
        self.pages = QStackedWidget()
        self.pages.addWidget(self.empty)
        self.pages.addWidget(self._list_detail_view)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(self.strip)
        column.addWidget(self.pages, 1)

    # -- display ------------------------------------------------------------------------------------------

    def refresh(self) -> None:
        self._ticks += 1
        self.strip.refresh()
        self._poll_template()
        acting, topics = self.acting, self.session.live.topics
        state = (acting.saved_messages.revision, acting.revision, acting.arming.revision, topics.revision)
        if state != self._last_state:
            self._last_state = state
            self._rebuild()
            self.form.topic_field.set_completions(sorted(topic.name for topic in topics.existing_topics()))
        elif self._ticks % STATE_UPDATE_TICKS == 0:
            self._update_sending()
            self.list.refresh_visible()

    def source_changed(self) -> None:
        self._last_state = ()
        self._stop_template_watch()

    def _rebuild(self) -> None:
        messages = self.acting.saved_messages.messages
        keywords = self.filter.text().casefold().split()
        rows = [
            each
            for each in messages
            if each.id == self._requested_id
            or all(keyword in f"{each.name} {each.topic}".casefold() for keyword in keywords)
        ]
        selected = self._requested_id or self.list.selected_key() or ""
        model = self.list.model()
        model.set_rows(rows)  # type: ignore[attr-defined]  # always a TableModel
        if rows:
            ids = {each.id for each in rows}
            target = selected if selected in ids else rows[0].id
            if self.list.selected_key() != target:
                self.list.select_key(target)
        self._requested_id = ""
        self.list.refresh_visible()
        self.pages.setCurrentIndex(1 if messages else 0)
        text = ngettext("{count} saved message", "{count} saved messages", len(messages))
        self.count_label.setText(text.format(count=len(messages)) if messages else "")
        self._show_selected()

    @property
    def message(self) -> SavedMessage | None:
        """Selected message, or None."""
        return self.acting.saved_messages.get(self.list.selected_key() or "")

    def _show_selected(self) -> None:
        message = self.message
        self.form.setVisible(message is not None)
        if message is not None:
            if self.form.message is not None and self.form.message.id != message.id:
                self._stop_template_watch()
            self.form.show_message(message)
            self._update_sending()

    def _update_sending(self) -> None:
        # Updates the texts of the buttons and the result of sending.
        message, form, acting = self.message, self.form, self.acting
        if message is None:
            return
        problem = acting.problem_of(message)
        form.show_problem(problem)
        is_armed = acting.arming.allows(Target("topic", message.topic))
        is_sending = acting.outbox.is_sending(message.id)
        can_send = not problem and self.world.is_live
        form.send_button.setEnabled(can_send)
        form.send_button.set_label(
            _("Send") if is_armed else _("Arm and send"), "send" if is_armed else "lock"
        )
        form.repeat_button.setEnabled(can_send or is_sending)
        form.repeat_button.set_label(
            _("Stop sending") if is_sending else _("Start sending"), "square" if is_sending else "repeat"
        )
        form.rate_field.setEnabled(not is_sending)
        form.last_result_label.setText(self._last_result_text(message))
        form.count_label.setText(self._count_text(message))

    def _last_result_text(self, message: SavedMessage) -> str:
        result, at_s = self.acting.last_results.get(message.id), self.acting.last_sent_s.get(message.id)
        if result is None or at_s is None:
            return ""
        clock = dt.datetime.fromtimestamp(at_s, tz=dt.timezone.utc).astimezone().strftime("%H:%M:%S")
        return _("last at {time}: {what}").format(time=clock.lstrip("0"), what=result_text(result))

    def _count_text(self, message: SavedMessage) -> str:
        repeated = self.acting.outbox.repeated(message.id)
        if repeated is None:
            return ""
        text = ngettext("{count} sent, {rate}/s", "{count} sent, {rate}/s", repeated.count)
        return text.format(count=group_digits(repeated.count), rate=rate_text(repeated.measured_hz))

    def _type_of(self, topic: str) -> str:
        entry = self.session.live.topics.get(topic)
        return entry.msg_type if entry is not None else ""

    def badge(self) -> tuple[str, str] | None:
        count = len(self.acting.outbox.repeated_messages)
        return (str(count), "warn") if count else None

    # -- user actions -------------------------------------------------------------------------------------

    def open_for(self, key: str) -> bool:
        """Select the newest saved message for a topic, or create one from the topic's last message.

        A toast reports that no more messages can be saved.

        Args:
            key: Key of the topic; "" creates an empty message.

        Returns:
            False if the topic is in another network, to which Studio can't publish.
        """
        network, topic = split_key(key)
        if network:
            self.context.show_toast(_("You can only publish to topics of Studio's own network"))
            return False
        saved = [each for each in self.acting.saved_messages.messages if topic and each.topic == topic]
        msg_type = self._type_of(topic) or "json"
        message = (
            saved[-1] if saved else self.acting.new_message(topic, msg_type, format_empty_message(msg_type))
        )
        if message is None:
            text = _("You have {count} saved messages, the maximum. Delete one first.")
            self.context.show_toast(text.format(count=MAX_MESSAGES))
            return True
        self._requested_id = message.id
        self.filter.clear()
        self._rebuild()
        if not saved and topic:
            self.insert_template()
        field = self.form.edit if topic else self.form.topic_field
        field.setFocus(Qt.FocusReason.OtherFocusReason)
        return True

    def insert_template(self) -> None:
        """Insert the topic's last message into the form, or its next one if none was received yet.

        If the topic has no publisher, or if this is called while waiting for the message, insert the
        fields of the message type instead.
        """
        message = self.message
        if message is None:
            return
        topic = self.session.live.topics.get(message.topic)
        if self._template_watch is not None or topic is None or not topic.publishers:
            self._stop_template_watch()
            self.form.replace_text(format_empty_message(message.msg_type))
            if topic is None or not topic.publishers:
                self.context.show_toast(_("No publisher on this topic: using the fields of the message type"))
            return
        if topic.msg_type != message.msg_type:
            self.form.set_type(topic.msg_type)
        self._template_topic = message.topic
        self._template_watch = self.session.live.watch(message.topic)
        self.form.template_button.set_label(_("Waiting for a message"), "hourglass")
        self._poll_template()

    def _poll_template(self) -> None:
        if self._template_watch is None:
            return
        topic = self.session.live.topics.get(self._template_topic)
        newest = topic.newest if topic is not None else None
        if newest is None:
            return
        self._stop_template_watch()
        try:
            self.form.replace_text(format_message(newest))
        except NepError as error:
            self.context.show_toast(str(error))

    def _stop_template_watch(self) -> None:
        if self._template_watch is not None:
            self._template_watch.close()
            self._template_watch = None
            self.form.template_button.set_label(_("Use the last message"), "history")

    def _message_edited(self, message: object) -> None:
        if isinstance(message, SavedMessage):
            self.acting.saved_messages.set_message(message)
            if self.acting.outbox.is_sending(message.id):
                self.acting.stop_sending(
                    message.id
                )  # repeated sending must not continue with outdated values
            self._update_sending()

    def send(self) -> None:
        """Send the selected message once."""
        message = self.message
        if message is not None:
            self._show_reason(self.acting.send(message))

    def repeat(self) -> None:
        """Start or stop repeated sending of the selected message."""
        message = self.message
        if message is None:
            return
        if self.acting.outbox.is_sending(message.id):
            self.acting.stop_sending(message.id)
            self.refresh()
        else:
            self._show_reason(self.acting.send(message, rate_hz=message.rate_hz))

    def _show_reason(self, reason: str) -> None:
        if reason:
            self.context.show_toast(reason)
        self.refresh()

    def copy(self, id: str) -> None:
        """Duplicate a message."""
        duplicate = self.acting.saved_messages.copy(id)
        if duplicate is not None:
            self._requested_id = duplicate.id
            self._rebuild()

    def delete(self, id: str) -> None:
        """Delete a message; the toast offers to undo it."""
        self.acting.stop_sending(id)
        removed = self.acting.saved_messages.remove(id)
        if removed is not None:
            text = _("Deleted “{name}”").format(name=removed.name)
            self.context.show_toast(text, _("Undo"), self._undo_delete)
            self._rebuild()

    def _undo_delete(self) -> None:
        restored = self.acting.saved_messages.restore()
        if restored is not None:
            self._requested_id = restored.id
            self._rebuild()

    def menu_of(self, id: str) -> Menu:
        """Return the context menu of a message."""
        is_sending = self.acting.outbox.is_sending(id)
        text = _("Stop sending") if is_sending else _("Start sending")
        actions = [
            RowAction(_("Send"), "send", self.send),
            RowAction(text, "square" if is_sending else "repeat", self.repeat),
            RowAction(_("Duplicate"), "copy", lambda: self.copy(id)),
            RowAction(_("Delete"), "trash-2", lambda: self.delete(id)),
        ]
        return fill_menu(Menu(self.theme, self), self.theme, actions)

    def _show_menu(self, id: str, position: QPoint) -> None:
        menu = self.menu_of(id)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.popup(position)

    # -- overrides ----------------------------------------------------------------------------------------

    def more_actions(self) -> Sequence[QAction]:
        return (self._duration_menu.entry(),)

    def focus_filter(self) -> bool:
        show_when(self.filter, True)
        self.filter.setFocus(Qt.FocusReason.ShortcutFocusReason)
        self.filter.selectAll()
        return True

    def theme_changed(self) -> None:
        self.list.fit_rows()
        self._list_detail_view.fit()

    def save_state(self) -> dict[str, object]:
        return {"message": self.list.selected_key() or ""}

    def restore_state(self, state: Mapping[str, object]) -> None:
        self._requested_id = str(state.get("message", ""))
        self._rebuild()

    def suspendables(self) -> Iterable[Suspendable | None]:
        return (self._template_watch,)

    def dispose(self) -> None:
        self._stop_template_watch()
        self.acting.disarm()


PANEL = Panel(
    "publish",
    lazy("Publish"),
    "send",
    (),
    PublishPanel,
    home=(TabHome("developer", "topics"), TabHome("behaviour", "behaviour")),
    commands=(
        Command(
            "publish.new",
            lazy("Publish a message"),
            lambda panel: panel.open_for(""),
            icon="send",
            tip=lazy("Creates a message; nothing is sent until you arm sending"),
            after="alarm.new",
        ),
    ),
    intents=(IntentHandler(PublishMessage, lambda panel, intent: panel.open_for(intent.topic)),),
)
