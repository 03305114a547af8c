"""Timeline panel: transport controls, ruler, and a lane for each topic of the open recording.

Replayed messages can also be sent to the live network (`sending`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from PySide6.QtCore import QEvent, QPoint, Qt
from PySide6.QtGui import QAction, QKeyEvent
from PySide6.QtWidgets import QStackedWidget, QVBoxLayout, QWidget

from app.core.recording.replay.replay import STEP_NS, Replay
from app.core.timeline.lanes import Mark
from app.core.timeline.selection import TimelineSelection
from app.ui.intents import ExportRecording
from app.ui.panels.act.armed_strip import ArmDurationMenu
from app.ui.panels.base import PanelContext, PanelWidget
from app.ui.panels.record.timeline.lanes import BOOKMARKS, ReplayLanes
from app.ui.panels.record.timeline.sending import ReplayStrip, SendChooser
from app.ui.panels.record.timeline.transport import TransportRow
from app.ui.panels.row_actions import RowAction, fill_menu
from app.ui.timeline.view import TimelineView
from app.ui.widgets import Chip, EmptyAction, EmptyState, Segments, Separator
from app.ui.widgets.keyboard import has_no_modifiers
from app.ui.widgets.menus import Menu
from nep.errors import RecordingError
from nep.i18n import _, pgettext
from nep.recordings.bookmarks import Bookmark

FROM_START, BY_CLOCK = "start", "clock"
MAX_INTERVALS = 4000
"""Maximum number of intervals in which messages are counted."""


class TimelinePanel(PanelWidget):
    """Panel with the timeline of the open recording, or an empty state."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, _("Timeline"))
        theme = self.theme
        self._shown_replay: Replay | None = None
        self._lanes: ReplayLanes | None = None
        self._state: tuple[object, ...] = ()
        self.transport, self.canvas = TransportRow(theme), TimelineView(theme, _("Timeline"))
        self.ruler = Segments(
            theme,
            ((FROM_START, _("From start"), None), (BY_CLOCK, _("Clock"), None)),
            FROM_START,
            size="small",
            name=_("Ruler"),
        )
        self.chip = Chip(theme, "", "info", "")
        self.chips, self.header = [self.chip], [self.ruler]
        self.empty = EmptyState(theme, "film", "", "")
        body = QWidget()
        column = QVBoxLayout(body)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        self.strip, self.chooser = ReplayStrip(context), SendChooser(theme)
        self._arm_duration_menu = ArmDurationMenu(theme, self, context.session.acting)
        self._lower_pages = QStackedWidget()
        self._lower_pages.addWidget(self.canvas)
        self._lower_pages.addWidget(self.chooser)
        column.addWidget(self.transport)
        column.addWidget(Separator(theme))
        column.addWidget(self.strip)
        column.addWidget(self._lower_pages, 1)
        self.pages = self.make_page_stack(self.empty, body)
        self.setFocusProxy(self.canvas)
        self.ruler.changed.connect(self._set_ruler)
        self.canvas.position_requested.connect(self._seek)
        self.canvas.range_requested.connect(self._loop)
        self.canvas.lane_selected.connect(self._select_topic)
        self.canvas.lane_opened.connect(self.context.open_topic)
        self.canvas.mark_opened.connect(lambda mark: self._run_on_mark(mark, self.rename_bookmark))
        self.canvas.menu_requested.connect(
            lambda mark, position: self._run_on_mark(mark, lambda each: self._show_menu(each, position))
        )
        self.canvas.viewport_changed.connect(self._request_counts)
        self.transport.bookmark_requested.connect(self._add_bookmark)
        self.transport.arm_requested.connect(self.show_send_chooser)
        self.strip.change_requested.connect(self.show_send_chooser)
        self.chooser.exited.connect(self._close_chooser)
        self.chooser.arming_failed.connect(self.context.show_toast)
        self._update_text()

    # -- display ------------------------------------------------------------------------------------------

    def refresh(self) -> None:
        replay = self.session.replay
        player = replay.player if replay is not None else None
        if replay is None or player is None or replay.opened_recording is None:
            self._shown_replay = None
            self._update_text()
            return
        if replay is not self._shown_replay:
            self._shown_replay, self._state = replay, ()
            self.set_title(_("Timeline"), replay.name)
            self.chip.set(pgettext("message", "recorded"), "info", "")
            self._lanes = ReplayLanes(replay)
            self.canvas.show_range(replay.start_ns, replay.end_ns)
            self.pages.setCurrentIndex(1)
            self.ruler.setVisible(True)
        is_new = replay.densities is not None and replay.densities.collect_results()
        state = (tuple(replay.bookmarks),)
        if self._lanes is not None and (is_new or state != self._state):
            self._state = state
            self.canvas.set_content(self._lanes.content())
        self.transport.show_replay(replay, player)
        self.strip.refresh()
        self.transport.set_armed(is_armed=self.strip.isVisibleTo(self))
        if self._lower_pages.currentWidget() is self.chooser:
            self.chooser.refresh()
        loop_ns = player.loop if player.is_looping else None
        self.canvas.select(TimelineSelection(player.position_ns, loop_ns, replay.selected_topic))

    def _update_text(self) -> None:
        # Shows the progress of opening, the error, or how to open a recording.
        replay = self.session.replay
        status = replay.status if replay is not None else None
        state: tuple[object, ...]
        if replay is None or status is None:
            state = (_("No recording is open"), _("Open a recording or drop one here."), True)
        elif status.stage == "failed":
            state = (
                _("{name} can't be played.").format(name=replay.name),
                f"{status.message[:1].upper()}{status.message[1:]}.",
                True,
            )
        else:
            percent = round(100 * status.progress)
            template = _("Reading the index, {percent} %")
            state = (replay.name, template.format(percent=percent), False)
        if state == self._state and self.pages.currentIndex() == 0:
            return
        self._state = state
        title, hint, has_open_action = state
        self.empty.set_texts(str(title), str(hint), "film")
        action = EmptyAction(
            _("Open a recording"), lambda: self.context.run("replay.open"), "folder-open", is_primary=True
        )
        self.empty.set_actions([action] if has_open_action else [])
        self.pages.setCurrentIndex(0)
        self.set_title(_("Timeline"), "")
        self.chip.set("")
        self.ruler.setVisible(False)

    def source_changed(self) -> None:
        self._shown_replay = None
        self.canvas.clear()
        self._lower_pages.setCurrentWidget(self.canvas)

    def theme_changed(self) -> None:
        self.canvas.repaint_lanes()

    # -- user actions -------------------------------------------------------------------------------------

    def show_topic(self, name: str) -> None:
        """Select a topic. Steps of the replay then lead from one message of this topic to the next."""
        self._select_topic(name)
        self.canvas.show_lane(name)

    def _select_topic(self, topic: str) -> None:
        if self._shown_replay is not None:
            self._shown_replay.select_topic(topic)

    def _seek(self, at_ns: int) -> None:
        if self._shown_replay is not None:
            self._shown_replay.seek(at_ns)

    def _loop(self, start_ns: int, end_ns: int) -> None:
        if self._shown_replay is not None:
            self._shown_replay.loop(start_ns, end_ns)

    def _request_counts(self) -> None:
        # The messages of the visible range are counted in a background thread.
        replay, scale = self._shown_replay, self.canvas.scale
        if replay is not None and replay.densities is not None and scale is not None:
            width = self.canvas.geometry_of_lanes().plot.width()
            intervals = max(1, min(MAX_INTERVALS, round(width)))
            replay.densities.request(scale.start_ns, scale.end_ns + 1, intervals)

    def _set_ruler(self, mode: str) -> None:
        self.canvas.set_clock(is_shown=mode == BY_CLOCK)

    def _add_bookmark(self) -> None:
        self.context.run("replay.bookmark")

    def event(self, event: QEvent) -> bool:
        # Within the panel, F2 and Delete apply to the bookmark at the playhead.
        if isinstance(event, QKeyEvent) and event.key() in BOOKMARK_KEYS and has_no_modifiers(event):
            if event.type() == QEvent.Type.ShortcutOverride and self._shown_replay is not None:
                event.accept()
                return True
            if event.type() == QEvent.Type.KeyPress and self._shown_replay is not None:
                self._run_on_current_bookmark(
                    self.rename_bookmark if event.key() == Qt.Key.Key_F2 else self.delete_bookmark
                )
                return True
        return super().event(event)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if self._shown_replay is None or not self._handle_key(event, self._shown_replay):
            super().keyPressEvent(event)

    def _handle_key(self, event: QKeyEvent, replay: Replay) -> bool:
        modifiers = event.modifiers() & ~Qt.KeyboardModifier.KeypadModifier
        actions: dict[tuple[Qt.KeyboardModifier, int], Callable[[], object]] = {
            (NONE, Qt.Key.Key_Space): replay.toggle,
            (NONE, Qt.Key.Key_Left): lambda: replay.step(forward=False),
            (NONE, Qt.Key.Key_Right): lambda: replay.step(forward=True),
            (SHIFT, Qt.Key.Key_Left): lambda: replay.move(-STEP_NS),
            (SHIFT, Qt.Key.Key_Right): lambda: replay.move(STEP_NS),
            (CONTROL, Qt.Key.Key_Left): lambda: replay.skip(forward=False),
            (CONTROL, Qt.Key.Key_Right): lambda: replay.skip(forward=True),
            (NONE, Qt.Key.Key_Home): lambda: replay.seek(replay.start_ns),
            (NONE, Qt.Key.Key_End): lambda: replay.seek(replay.end_ns),
            (NONE, Qt.Key.Key_BracketLeft): lambda: replay.set_loop_edge(is_start=True),
            (NONE, Qt.Key.Key_BracketRight): lambda: replay.set_loop_edge(is_start=False),
            (NONE, Qt.Key.Key_L): replay.toggle_loop,
            (NONE, Qt.Key.Key_B): self._add_bookmark,
        }
        action = actions.get((modifiers, event.key()))
        if action is None and event.text() in {"[", "]"}:  # typed with AltGr on many keyboard layouts
            action = actions[
                (NONE, Qt.Key.Key_BracketLeft if event.text() == "[" else Qt.Key.Key_BracketRight)
            ]
        if action is None:
            return self.canvas.handle_key(event)
        action()
        return True

    # -- sending ------------------------------------------------------------------------------------------

    def show_send_chooser(self) -> None:
        """Show the page for choosing topics that are sent to the live network."""
        replay = self._shown_replay
        if replay is not None and replay.sending is not None:
            counts = {name: topic.message_count for name, topic in replay.recorded_topics.items()}
            self._lower_pages.setCurrentWidget(self.chooser)
            self.chooser.open(replay.sending, counts, replay.selected_topic)

    def _close_chooser(self) -> None:
        self._lower_pages.setCurrentWidget(self.canvas)
        self.refresh()
        focus_target = self.strip.switch if self.strip.isVisibleTo(self) else self.transport.armed
        focus_target.setFocus(Qt.FocusReason.OtherFocusReason)

    def dispose(self) -> None:
        if self.session.replay is not None:
            self.session.acting.disarm()

    # -- bookmarks ----------------------------------------------------------------------------------------

    def _run_on_mark(self, mark: Mark, action: Callable[[Bookmark], object]) -> None:
        if isinstance(mark.key, Bookmark):
            action(mark.key)

    def _run_on_current_bookmark(self, action: Callable[[Bookmark], object]) -> None:
        bookmark = self._shown_replay.current_bookmark() if self._shown_replay is not None else None
        if bookmark is not None:
            action(bookmark)
        else:
            self.context.show_toast(_("No bookmark at the playhead. Select one, or press B to add one"))

    def _show_menu(self, bookmark: Bookmark, position: QPoint) -> None:
        # Context menu of a bookmark.
        menu = Menu(self.theme, self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        actions = (
            RowAction(_("Rename"), "pencil", lambda: self.rename_bookmark(bookmark)),
            RowAction(_("Delete"), "trash-2", lambda: self.delete_bookmark(bookmark)),
        )
        fill_menu(menu, self.theme, actions).popup(position)

    def rename_bookmark(self, bookmark: Bookmark) -> None:
        """Start editing the name of a bookmark in place."""
        replay = self._shown_replay
        if replay is not None and not self._reject_note(bookmark):
            self.canvas.edit(
                BOOKMARKS,
                bookmark.at_ns,
                bookmark.name,
                lambda name: self._apply_change(lambda: replay.rename_bookmark(bookmark, name.strip())),
                _("Bookmark name"),
            )

    def delete_bookmark(self, bookmark: Bookmark) -> None:
        """Delete a bookmark; the toast offers to undo it."""
        replay = self._shown_replay
        if (
            replay is None
            or self._reject_note(bookmark)
            or not self._apply_change(lambda: replay.remove_bookmark(bookmark))
        ):
            return
        text = _("Deleted the bookmark “{name}”").format(name=bookmark.name) if bookmark.name else ""
        self.context.show_toast(
            text or _("Deleted the bookmark"),
            _("Undo"),
            lambda: self._apply_change(lambda: replay.restore_bookmark(bookmark)),
        )

    def _reject_note(self, bookmark: Bookmark) -> bool:
        if bookmark.is_note:
            self.context.show_toast(
                _("Notes added while recording are part of the file and can't be changed")
            )
        return bookmark.is_note

    def _apply_change(self, change: Callable[[], object]) -> bool:
        # Errors are shown in a toast.
        try:
            change()
        except RecordingError as error:
            self.context.show_toast(_("Can't change the bookmark: {reason}").format(reason=error.reason))
            return False
        except ValueError:  # already deleted
            return True
        return True

    def more_actions(self) -> list[QAction]:
        actions = []
        path = self._shown_replay.path if self._shown_replay is not None else None
        run, request = self.context.run, self.context.request
        rows: list[tuple[str, str, Callable[[], object]]] = [
            (_("Open a recording"), "folder-open", lambda: run("replay.open")),
            (_("Back to live"), "radio-tower", lambda: run("replay.live")),
        ]
        if path is not None:
            export = ExportRecording(path)
            rows.insert(1, (_("Export a range"), "download", lambda: request(export)))
        for text, icon, act in rows:
            action = QAction(self.theme.icon(icon), text, self)
            action.triggered.connect(lambda _on=False, act=act: act())
            actions.append(action)
        for old in self._menu_actions:
            old.deleteLater()
        self._menu_actions = actions
        return [*actions, self._arm_duration_menu.entry()] if path else actions

    _menu_actions: Sequence[QAction] = ()


BOOKMARK_KEYS = {Qt.Key.Key_F2, Qt.Key.Key_Delete}
NONE, SHIFT, CONTROL = (
    Qt.KeyboardModifier.NoModifier,
    Qt.KeyboardModifier.ShiftModifier,
    Qt.KeyboardModifier.ControlModifier,
)
