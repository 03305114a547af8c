"""Inspector panel: newest message of one topic, with functions to find, compare and copy values."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from PySide6.QtCore import QModelIndex, QPoint, Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QAbstractButton, QVBoxLayout

from app.core.messages.inspected import InspectedMessage, Mode
from app.core.messages.pace import UpdateLimiter
from app.core.network.topics import split_key
from app.core.networks.networks import topic_label
from app.ui.intents import NewValueAlarm, OpenPanel, PublishMessage
from app.ui.panels.base import ANY_TYPE, Blocker, Panel, PanelContext, PanelWidget, paused_blocker
from app.ui.panels.home import RowHome
from app.ui.panels.watch.inspector.actions import InspectorActions
from app.ui.panels.watch.inspector.body import TREE, InspectorBody
from app.ui.panels.watch.inspector.tree_model import TreeNode, field_of, steps_of
from app.ui.panels.watch.inspector.values import as_container, image_summary
from app.ui.widgets import Chip, EmptyAction, IconButton
from app.ui.widgets.field_drag import FieldDrag
from app.ui.widgets.menus import Menu
from nep.i18n import _, lazy, pgettext
from nep.messages.fields import path_text

if TYPE_CHECKING:
    from app.core.messages.lazy_json import JsonIndex
    from app.core.network.topics import Topic
    from app.core.network.watches import Suspendable, Watch

FADE_REPAINT_HZ = 7.0  # lower than the rate of message updates, which paint the marks too


class InspectorPanel(PanelWidget):
    """Panel with the message of one topic as tree, table or bytes."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, _("Inspector"))
        self.clock = time.monotonic
        self.inspected = InspectedMessage(image_summary)
        self._watch: Watch | None = None
        self._fade_limiter = UpdateLimiter(burst=1, hz=FADE_REPAINT_HZ)
        self.body = InspectorBody(
            self.theme, self._search_source, context.show_toast,
            empty_action=self._empty_action, decode_large=self._decode_large,
        )  # fmt: skip
        self._make_header()
        self._make_body()
        self._show_topic()

    # -- construction -------------------------------------------------------------------------------------

    def _make_header(self) -> None:
        theme = self.theme
        self.live = Chip(theme, "", "info", "")
        self.freeze = IconButton(theme, "snowflake", _("Freeze this panel"), checkable=True, size=26)
        pin = _("Pin this message to compare others with it")
        self.pin = IconButton(theme, "pin", pin, checkable=True, size=26)
        self.freeze.toggled.connect(lambda _on: self._follow())
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
            self.theme, self, body,
            lambda: self.inspected.message, lambda: as_container(self.inspected.value),
            find=self.focus_filter, toast=self.context.show_toast,
            plot=lambda path: self.context.plot(self.inspected.key, path),
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
        self.compare.toggled.connect(lambda _on: self._show())
        self.strip.changes_only_toggled.connect(lambda _on: self._show())
        self.inspector_actions.set_enabled(False)
        body.pages.currentChanged.connect(lambda page: self.inspector_actions.set_enabled(page == TREE))
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(body)

    # -- display ------------------------------------------------------------------------------------------

    def show_topic(self, name: str) -> None:
        """Switch to another topic, or to none if the name is empty."""
        if name == self.inspected.key:
            return
        self._close_watch()
        self.history.reset()
        self.inspected.open(name)
        self.body.objects.reset()
        for button in (self.freeze, self.pin):
            button.setChecked(False)
        self.set_title(_("Inspector"), topic_label(name))
        if name:
            self.foot.since_ns = time.time_ns()
            self._watch = self.world.watch(name)
            self.history.start(self.world.series, name)
            self.world.mark_seen(name)
        self._show_topic()

    def _show_topic(self) -> None:
        has_topic = bool(self.inspected.key)
        for button in (self.freeze, self.pin):
            button.setVisible(has_topic)
        if not has_topic:
            self.live.set("")
        self._show()

    def _show(self) -> None:
        self.body.show_message(self.inspected, self.clock())

    def source_changed(self) -> None:
        topic = self.inspected.key
        self.show_topic("")
        self.show_topic(topic)

    def refresh(self) -> None:
        key, world, now = self.inspected.key, self.world, self.clock()
        if not key:
            return
        topic, is_recorded = world.topic(key), not world.is_live
        self.history.clamp_selection()
        is_earlier = self.history.selected_number is not None
        self.live.set(*chip_state(topic, self.is_frozen, is_recorded=is_recorded, is_earlier=is_earlier))
        is_shown = self.inspected.update(
            topic,
            now,
            is_paused=self.is_display_fixed,
            is_recorded=is_recorded,
            problem=world.networks.read_problem(key),
        )
        if is_shown:
            self.body.show_message(self.inspected, now)
        query_result = self.query.pop_result(now)
        if query_result is not None:
            self.body.show_query_result(query_result, now)
        self.history.refresh(is_busy=is_shown)
        self._repaint_fading(now, is_shown=is_shown)

    def _repaint_fading(self, now: float, *, is_shown: bool) -> None:
        # A message that was just shown has painted its marks already.
        if is_shown:
            self._fade_limiter.drain(now)
        elif self.body.page == TREE and self.tree.is_fading() and self._fade_limiter.try_acquire(now):
            self.tree.viewport().update()

    def _follow(self) -> None:
        self.inspected.allow_update()
        self.refresh()

    def _empty_action(self, key: str) -> EmptyAction:
        choose = lambda: self.context.request(OpenPanel("topics"))  # noqa: E731
        return self.doctor_action(key) if key else EmptyAction(_("Choose a topic"), choose, "list")

    def _decode_large(self) -> None:
        # Also freezes the panel, because the next message would replace this one.
        self.freeze.setChecked(True)
        self.inspected.decode_large()
        self.refresh()

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
        return self.body.is_comparing(self.inspected)

    def awaited_topic(self) -> str:
        return self.inspected.key if self.inspected.message is None else ""

    def blockers(self) -> list[Blocker]:
        return [paused_blocker(self.title(), self._resume_updates)] if self.is_display_fixed else []

    def _resume_updates(self) -> None:
        self.history.select(None)
        self.freeze.setChecked(False)

    def _pin(self, is_pinned: bool) -> None:
        is_earlier = self.history.selected_number is not None
        self.inspected.pin(is_pinned=is_pinned, is_earlier=is_earlier)
        self._show()

    def _history_selected(self) -> None:
        is_newest = self.history.selected_number is None
        message = self.history.selected_message()
        if is_newest or message is not None:
            self.inspected.select(message, self.history.previous_message())
        if is_newest:
            self.freeze.setChecked(False)
        self._follow()

    def _query_changed(self, text: str) -> None:
        # "" ends the query.
        if not text and not self.query.has_query:
            return
        self.finder.set_invalid(is_invalid=not self.query.set_query(text))
        self.compare.setVisible(not text)  # parts of messages can't be compared, and the query needs the room
        self.model.clear()
        self._show()

    def _set_mode(self, mode: Mode) -> None:
        if mode == "table" and self.body.page == TREE and not self.query.has_query:
            index = self.tree.currentIndex()
            self.body.objects.select_list(steps_of(self.model.node(index)) if index.isValid() else ())
        self.inspected.set_mode(mode)
        self.refresh()

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
            FieldDrag(self.tree.viewport(), self.inspected.key, path)

    def _search_source(self) -> tuple[object, JsonIndex | None]:
        reading = self.inspected.reading
        return as_container(self.inspected.value), reading.index if reading is not None else None

    def _show_menu(self, position: QPoint) -> None:
        menu = Menu(self.theme, self)
        menu.addActions(self.inspector_actions.menu_actions())
        index = self.tree.currentIndex()
        if index.isValid() and self.inspected.key and not split_key(self.inspected.key)[0]:
            request = self.context.request
            alarm = NewValueAlarm(self.inspected.key, path_text(steps_of(self.model.node(index))))
            menu.addSeparator()
            menu.addAction(self.theme.icon("bell"), _("New alarm"), lambda: request(alarm))
            publish = PublishMessage(self.inspected.key)
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
            "topic": self.inspected.key,
            "compare": self.compare.isChecked(),
            "changes_only": self.strip.changes_only_button.isChecked(),
            "table": self.inspected.mode == "table",
            "query": self.finder.field.text() if self.finder.is_query else "",
        }

    def restore_state(self, state: Mapping[str, object]) -> None:
        topic = state.get("topic")
        if isinstance(topic, str):
            self.show_topic(topic)
        self.compare.setChecked(state.get("compare") is True)
        self.strip.changes_only_button.setChecked(state.get("changes_only") is True)
        self.inspected.mode = "table" if state.get("table") is True else "tree"
        query = state.get("query")
        if isinstance(query, str) and query.startswith("$"):
            self.finder.field.setText(query)

    def _close_watch(self) -> None:
        self.history.pause()
        if self._watch is not None:
            self._watch.close()
            self._watch = None

    def resume(self) -> None:
        if self._watch is not None and self._watch.is_suspended:
            self.foot.since_ns = time.time_ns()
            self.history.start(self.world.series, self.inspected.key)
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
        self.inspected.close()
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
