"""Inspector panel: newest message of one topic, with functions to find, compare and copy values."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from PySide6.QtCore import QModelIndex, QPoint, Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QAbstractButton, QVBoxLayout

from app.core.messages.reader import LARGE_BYTES, MessageReader, ReadResult
from app.core.network.topics import split_key
from app.core.networks.kinds import find_kind
from app.core.networks.networks import topic_label
from app.core.timeline.times import clock_text
from app.ui.intents import NewValueAlarm, OpenPanel, PublishMessage
from app.ui.panels.base import ANY_TYPE, Blocker, Panel, PanelContext, PanelWidget, paused_blocker
from app.ui.panels.home import RowHome
from app.ui.panels.watch.inspector.actions import InspectorActions
from app.ui.panels.watch.inspector.body import LARGE, NOTHING, RAW, TABLE, TREE, InspectorBody
from app.ui.panels.watch.inspector.diff import NO_BASE, count_changes
from app.ui.panels.watch.inspector.footer import message_info
from app.ui.panels.watch.inspector.pace import UpdateLimiter
from app.ui.panels.watch.inspector.tree_model import TreeNode, field_of, steps_of
from app.ui.panels.watch.inspector.values import decode_now, payload_or_default
from app.ui.widgets import Chip, IconButton
from app.ui.widgets.field_drag import FieldDrag
from app.ui.widgets.menus import Menu
from nep.i18n import _, lazy, pgettext
from nep.messages.codecs import content_of
from nep.messages.fields import path_text

if TYPE_CHECKING:
    from app.core.messages.lazy_json import JsonIndex
    from app.core.messages.query import QueryResult
    from app.core.network.topics import Topic
    from app.core.network.watches import Suspendable, Watch
    from nep.messages.message import Message

MAX_EXPANDED_ROWS = 24
FADE_REPAINT_HZ = 7.0  # lower than the rate of message updates, which paint the marks too
PREVIOUS_MESSAGE, PINNED_MESSAGE = lazy("Previous message"), lazy("Pinned message")


class InspectorPanel(PanelWidget):
    """Panel with the message of one topic as tree, table or bytes."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, _("Inspector"))
        self.clock = time.monotonic
        self._topic = ""
        self._watch: Watch | None = None
        self._shown_message: Message | None = None
        self._requested_large_message: Message | None = None  # large message that the user asked to decode
        self._reading: ReadResult | None = None  # decoded message in the tree
        self._is_raw_mode = self._is_table_mode = False
        self._since_ns = 0  # start of the subscription
        self._update_limiter, self._fade_limiter = UpdateLimiter(), UpdateLimiter(burst=1, hz=FADE_REPAINT_HZ)
        self._info_cache: tuple[Message | None, str] = (None, "")
        self._value: object = None
        self._previous_value: object = NO_BASE  # previous value of the topic, for comparison
        self._pinned_value: object = NO_BASE
        self._pinned_text = ""
        self.reader = MessageReader()
        self.body = InspectorBody(self.theme, self._search_source, context.show_toast)
        self._make_header()
        self._make_body()
        self._show_empty()

    # -- construction -------------------------------------------------------------------------------------

    def _make_header(self) -> None:
        theme = self.theme
        self.live = Chip(theme, "", "info", "")
        self.freeze = IconButton(theme, "snowflake", _("Freeze this panel"), checkable=True, size=26)
        pin = _("Pin this message to compare others with it")
        self.pin = IconButton(theme, "pin", pin, checkable=True, size=26)
        self.freeze.toggled.connect(lambda _on: self._refresh_now())
        self.pin.toggled.connect(self._pin)
        self.header = [self.live, self.freeze, self.pin]

    def _make_body(self) -> None:
        body = self.body
        self.model, self.tree, self.finder = body.model, body.tree, body.finder
        self.mode, self.strip, self.foot, self.bytes = body.mode, body.strip, body.foot, body.bytes
        self.query, self.history = body.query, body.history
        self.history.selection_changed.connect(self._history_selected)
        self.finder.query_changed.connect(self._query_changed)
        self.inspector_actions = InspectorActions(
            self.theme, self, body, lambda: self._shown_message, self._full_value,
            find=self.focus_filter, toast=self.context.show_toast,
            plot=lambda path: self.context.plot(self._topic, path),
        )  # fmt: skip
        self.foot.copy_value.clicked.connect(self.inspector_actions.copy_value)
        self.foot.copy_path.clicked.connect(self.inspector_actions.copy_path)
        self.foot.plot.clicked.connect(self.inspector_actions.plot)
        self.tree.drag_started.connect(self._start_drag)
        body.objects.reveal_requested.connect(self._reveal)
        self.tree.selectionModel().currentChanged.connect(self._row_selected)
        self.tree.customContextMenuRequested.connect(self._show_menu)
        self.mode.changed.connect(self._set_mode)
        self.compare = body.compare
        self.compare.toggled.connect(lambda _on: self._show_value())
        self.strip.changes_only_toggled.connect(lambda _on: self._show_value())
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(body)

    # -- display ------------------------------------------------------------------------------------------

    def show_topic(self, name: str) -> None:
        """Switch to another topic, or to none if the name is empty."""
        if name == self._topic:
            return
        self._close_watch()
        self.history.reset()
        self._topic = name
        self._shown_message = self._requested_large_message = self._reading = None
        self._value, self._previous_value, self._pinned_value = None, NO_BASE, NO_BASE
        self._is_raw_mode = False
        self.model.clear()
        self.query.discard_pending()
        self.body.objects.reset()
        self.foot.clear()
        self._update_limiter.reset()
        for button in (self.freeze, self.pin):
            button.setChecked(False)
        self.set_title(_("Inspector"), topic_label(name))
        if name:
            self._since_ns = time.time_ns()
            self._watch = self.world.watch(name)
            self.history.start(self.world.series, name)
            self.world.mark_seen(name)
        self._show_empty()

    def source_changed(self) -> None:
        topic = self._topic
        self.show_topic("")
        self.show_topic(topic)

    def refresh(self) -> None:
        if not self._topic:
            return
        topic, is_recorded = self.world.topic(self._topic), not self.world.is_live
        self.history.clamp_selection()
        is_earlier = self.history.selected_number is not None
        self.live.set(*chip_state(topic, self.is_frozen, is_recorded=is_recorded, is_earlier=is_earlier))
        newest, is_shown = topic.newest if topic is not None and topic.gone_s is None else None, False
        if (
            topic is not None
            and newest is not None
            and newest is not self._shown_message
            and not self.is_display_fixed
        ):
            is_shown = self._update_limiter.try_acquire(self.clock())
            if is_shown:
                self._show_message(newest)
        elif is_recorded and newest is None and self._shown_message is not None and not self.is_display_fixed:
            self._show_no_message()
        if self.body.page == NOTHING:
            self._show_waiting(topic)
        reading = self.reader.pop_result()
        if reading is not None and not self._is_raw_mode:
            self._show_decoded(reading)
        query_result = self.query.pop_result(self.clock())
        if query_result is not None and self._value is not None:
            self._show_query_result(query_result)
        self.history.refresh(is_busy=is_shown)
        self._repaint_fading(is_shown=is_shown)

    def _repaint_fading(self, *, is_shown: bool) -> None:
        # A message that was just shown has painted its marks already.
        if is_shown:
            self._fade_limiter.drain(self.clock())
        elif (
            self.body.page == TREE and self.tree.is_fading() and self._fade_limiter.try_acquire(self.clock())
        ):
            self.tree.viewport().update()

    def _refresh_now(self) -> None:
        self._update_limiter.reset()
        self.refresh()

    def _show_no_message(self) -> None:
        # The playhead is before the topic's first message.
        self.reader.clear()
        self._shown_message = self._requested_large_message = self._reading = None
        self._value, self._previous_value = None, NO_BASE
        self.model.clear()
        self.query.discard_pending()
        self.foot.clear()
        self._show_page(NOTHING)

    def _show_waiting(self, topic: Topic | None) -> None:
        problem = self.world.networks.read_problem(self._topic)
        if problem:
            self.body.show_undecodable(topic_label(self._topic), problem, self.doctor_action(self._topic))
        else:
            has_publisher = topic is not None and topic.publishers > 0
            self.body.show_waiting(topic_label(self._topic), has_publisher, self.doctor_action(self._topic))

    def _show_message(self, message: Message) -> None:
        is_large = message.size_bytes > LARGE_BYTES and content_of(message.codec) != "image"
        if self._is_raw_mode:
            self._show_raw(message, "")
        elif is_large and message.codec != "json" and message is not self._requested_large_message:
            self._offer_large(message)
        elif is_large:
            self._decode_in_background(message)
        else:
            self._show_decoded(decode_now(message))

    def _decode_in_background(self, message: Message) -> None:
        # Decoded in the reader's thread; the old contents are shown until then.
        if self.history.selected_number is not None:  # the user waits for exactly this message
            self.reader.submit(message)
        elif not self.reader.submit_throttled(message, self.clock()):
            return
        if self._shown_message is None or self.body.page == LARGE:
            self.body.show_large(message.size_bytes, _("Reading the message…"))
            self._show_page(LARGE)

    def _show_decoded(self, reading: ReadResult) -> None:
        message = reading.message
        if reading.error is not None:
            self._show_raw(message, reading.error)
            return
        is_new = message is not self._shown_message
        self._shown_message, self._reading = message, reading
        if is_new:
            self._previous_value = self._value if self._value is not None else NO_BASE
            topic = self.world.topic(self._topic)
            previous = topic.previous if topic is not None else None
            if self.history.selected_number is not None:
                previous = self.history.previous_message()
            if message.size_bytes <= LARGE_BYTES and previous is not None:
                self._previous_value = payload_or_default(previous, self._previous_value)
            self.finder.invalidate_matches()
        self._value = reading.value
        self._show_value()
        self.foot.show_info(self._message_info(message))
        self._show_page(TABLE if self._is_table_mode else TREE)

    def _message_info(self, message: Message) -> str:
        # Cached per message, because latency and age are those at its arrival.
        if message is not self._info_cache[0]:
            kind = find_kind(split_key(self._topic)[0])
            is_recorded = not self.world.is_live
            self._info_cache = (message, message_info(message, self._since_ns, kind, is_recorded=is_recorded))
        return self._info_cache[1]

    def _show_value(self) -> None:
        if self._shown_message is None or self._value is None:
            return
        if self.query.has_query:
            self.strip.hide()
            self.query.request_evaluation(self._value)
            return
        if self._is_table_mode:
            self.strip.hide()
            self.body.objects.show_message(self._value, self.clock())
            return
        is_first = not self.model.rowCount()
        base: object = NO_BASE
        if self.is_comparing:
            base = self._pinned_value if self.pin.isChecked() else self._previous_value
            compared_with = self._pinned_text if self.pin.isChecked() else _(PREVIOUS_MESSAGE)
            self.strip.set_summary(compared_with, *count_changes(self._value, base))
        self.strip.setVisible(self.is_comparing and self.body.page == TREE)
        changes_only = (
            self.is_comparing and base is not NO_BASE and self.strip.changes_only_button.isChecked()
        )
        self.model.set_value(self._value, self.clock(), base, changes_only=changes_only)
        if is_first:
            self.tree.expand_small(MAX_EXPANDED_ROWS)

    def _show_query_result(self, result: QueryResult) -> None:
        if self._is_table_mode:
            self.body.objects.show_query_objects(result.values.items(), self.clock())
            return
        is_first = not self.model.rowCount()
        self.model.set_value(result.values, self.clock())
        if is_first:
            self.tree.expand_small(MAX_EXPANDED_ROWS)

    def _show_raw(self, message: Message, reason: str) -> None:
        self._shown_message = message
        self.foot.show_info(self._message_info(message))
        self.bytes.show_bytes(message.data)
        text = _("Can't decode the message as {codec}: {reason}.").format(codec=message.codec, reason=reason)
        self.body.error_label.setText(text if reason else "")
        self._show_page(RAW)

    def _offer_large(self, message: Message) -> None:
        self._shown_message = message
        explanation = _("{codec} messages larger than 1 MB are decoded only on request.").format(
            codec=message.codec
        )
        self.body.show_large(message.size_bytes, explanation, self._decode_large)
        self._show_page(LARGE)

    def _decode_large(self) -> None:
        # Also freezes the panel, because the next message would replace this one.
        if self._shown_message is not None:
            self._requested_large_message = self._shown_message
            self.freeze.setChecked(True)
            self.reader.submit(self._shown_message)
            self.body.show_large(self._shown_message.size_bytes, _("Reading the message…"))

    def _show_page(self, page: int) -> None:
        self.body.show_page(page, is_comparing=self.is_comparing)
        self.inspector_actions.set_enabled(page == TREE)

    def _show_empty(self) -> None:
        choose = lambda: self.context.request(OpenPanel("topics"))  # noqa: E731
        self.body.show_empty(topic_label(self._topic), choose, self.doctor_action(self._topic))
        if not self._topic:
            self.live.set("")
        for button in (self.freeze, self.pin):
            button.setVisible(bool(self._topic))
        self._show_page(NOTHING)

    # -- user actions -------------------------------------------------------------------------------------

    @property
    def is_frozen(self) -> bool:
        """True while the user has frozen the display."""
        return self.freeze.isChecked()

    @property
    def is_display_fixed(self) -> bool:
        """True if new messages don't change the display: it is frozen, or an earlier message is selected."""
        return self.is_frozen or self.history.selected_number is not None

    @property
    def is_comparing(self) -> bool:
        """True if the tree shows the differences to another message."""
        return (self.compare.isChecked() or self.pin.isChecked()) and not self.query.has_query

    def awaited_topic(self) -> str:
        return self._topic if self._shown_message is None else ""

    def blockers(self) -> list[Blocker]:
        return [paused_blocker(self.title(), self._resume_updates)] if self.is_display_fixed else []

    def _resume_updates(self) -> None:
        self.history.select(None)
        self.freeze.setChecked(False)

    def _pin(self, is_pinned: bool) -> None:
        self._pinned_value = self._value if is_pinned and self._value is not None else NO_BASE
        stamp_ns = self._shown_message.stamp_ns if self._shown_message is not None else None
        self._pinned_text = _(PINNED_MESSAGE)
        if self.history.selected_number is not None and stamp_ns is not None and 0 <= stamp_ns < 2**62:
            time_text = clock_text(stamp_ns)
            self._pinned_text = _("{message} from {clock}").format(message=_(PINNED_MESSAGE), clock=time_text)
        self._show_value()

    def _history_selected(self) -> None:
        self.reader.clear()
        message = self.history.selected_message()
        if message is not None:
            self._show_message(message)
        elif self.history.selected_number is None:
            self.freeze.setChecked(False)
            self._refresh_now()

    def _query_changed(self, text: str) -> None:
        # "" ends the query.
        if not text and not self.query.has_query:
            return
        self.finder.set_invalid(is_invalid=not self.query.set_query(text))
        self.compare.setVisible(not text)  # parts of messages can't be compared, and the query needs the room
        self.model.clear()
        self._show_value()

    def _set_mode(self, mode: str) -> None:
        self._is_raw_mode, self._is_table_mode = mode == "raw", mode == "table"
        if self._is_table_mode and self.body.page == TREE and not self.query.has_query:
            index = self.tree.currentIndex()
            self.body.objects.select_list(steps_of(self.model.node(index)) if index.isValid() else ())
        displayed = self._shown_message
        if displayed is None:
            return
        if self._reading is not None and self._reading.message is displayed and not self._is_raw_mode:
            self._show_decoded(self._reading)
        elif self.world.topic(self._topic) is not None:
            self._show_message(displayed)

    def _row_selected(self, index: QModelIndex) -> None:
        self.foot.show_path(self.model.node(index).path if index.isValid() else "")

    def _reveal(self, steps: object) -> None:
        self.mode.set_value("tree")
        self._set_mode("tree")
        self.body.reveal(steps)
        self.tree.setFocus(Qt.FocusReason.OtherFocusReason)

    def _start_drag(self, node: TreeNode) -> None:
        path = field_of(node)
        if path:
            FieldDrag(self.tree.viewport(), self._topic, path)

    def _full_value(self) -> object:
        # A query or the table may show only parts of the message.
        shows_parts = self.query.has_query or self._is_table_mode
        return self._value if shows_parts else self.model.value()

    def _search_source(self) -> tuple[object, JsonIndex | None]:
        return self._full_value(), self._reading.index if self._reading is not None else None

    def _show_menu(self, position: QPoint) -> None:
        menu = Menu(self.theme, self)
        menu.addActions(self.inspector_actions.menu_actions())
        index = self.tree.currentIndex()
        if index.isValid() and self._topic and not split_key(self._topic)[0]:
            request = self.context.request
            alarm = NewValueAlarm(self._topic, path_text(steps_of(self.model.node(index))))
            menu.addSeparator()
            menu.addAction(self.theme.icon("bell"), _("New alarm"), lambda: request(alarm))
            publish = PublishMessage(self._topic)
            menu.addAction(self.theme.icon("send"), _("Publish to this topic"), lambda: request(publish))
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.popup(self.tree.viewport().mapToGlobal(position))

    def more_actions(self) -> list[QAction]:
        return self.inspector_actions.menu_actions()

    def focus_filter(self) -> bool:
        if self.body.bar.isVisible():
            self.finder.field.setFocus(Qt.FocusReason.ShortcutFocusReason)
            self.finder.field.selectAll()
        return self.body.bar.isVisible()

    def theme_changed(self) -> None:
        self.tree.row_height = round(self.theme.scaled(self.theme.size("row", "tree")))
        self.tree.doItemsLayout()
        self.body.objects.set_row_height(self.row_height())

    def save_state(self) -> dict[str, object]:
        return {
            "topic": self._topic,
            "compare": self.compare.isChecked(),
            "changes_only": self.strip.changes_only_button.isChecked(),
            "table": self._is_table_mode,
            "query": self.finder.field.text() if self.finder.is_query else "",
        }

    def restore_state(self, state: Mapping[str, object]) -> None:
        topic = state.get("topic")
        if isinstance(topic, str):
            self.show_topic(topic)
        self.compare.setChecked(state.get("compare") is True)
        self.strip.changes_only_button.setChecked(state.get("changes_only") is True)
        self._is_table_mode = state.get("table") is True
        query = state.get("query")
        if isinstance(query, str) and query.startswith("$"):
            self.finder.field.setText(query)

    def _close_watch(self) -> None:
        self.reader.clear()
        self.history.pause()
        if self._watch is not None:
            self._watch.close()
            self._watch = None

    def resume(self) -> None:
        if self._watch is not None and self._watch.is_suspended:
            self._since_ns = time.time_ns()
            self.history.start(self.world.series, self._topic)
        super().resume()

    def suspend(self) -> None:
        self.history.pause()
        super().suspend()

    def freeze_button(self) -> QAbstractButton:
        return self.freeze

    def suspendables(self) -> Iterable[Suspendable | None]:
        return (self._watch,)

    def dispose(self) -> None:
        self._close_watch()
        self.reader.close()
        self.query.close_worker()


def chip_state(
    topic: Topic | None, is_frozen: bool, *, is_recorded: bool = False, is_earlier: bool = False
) -> tuple[str, str, str]:
    """Return the contents of the chip with the state of topic and panel.

    Args:
        topic: Topic shown; None if it no longer exists.
        is_frozen: True while the display is frozen.
        is_recorded: True if the message is from a recording.
        is_earlier: True if an earlier message is selected.

    Returns:
        Text, status and icon; an icon of "" stands for the default icon of the status.
    """
    if is_frozen:
        return pgettext("message", "frozen"), "off", "snowflake"
    if is_earlier:
        return pgettext("message", "earlier"), "off", "history"
    if is_recorded:
        return pgettext("message", "recorded"), "info", ""
    if topic is None:
        return pgettext("topic", "gone"), "off", ""
    # no messages arrive any more
    if topic.is_stale and not (topic.measured_rates is not None and topic.measured_rates[0] > 0):
        return pgettext("topic", "not responding"), "warn", ""
    if topic.gone_s is not None:
        return _("gone for {seconds} s").format(seconds=int(topic.gone_s)), "off", ""
    return pgettext("message", "live"), "info", ""


PANEL = Panel(
    "inspector",
    lazy("Inspector"),
    "list-tree",
    (ANY_TYPE,),
    InspectorPanel,
    allows_multiple=True,
    home=(RowHome("developer", 1, 0, 780),),
)
