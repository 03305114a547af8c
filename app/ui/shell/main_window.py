"""Main window: bars, banner, start page and one workbench per layout, refreshed 30 times a second."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial

from PySide6.QtCore import QKeyCombination, QRect, QSize, Qt, QTimer, Signal
from PySide6.QtGui import QCloseEvent, QContextMenuEvent, QKeyEvent, QKeySequence
from PySide6.QtWidgets import QApplication, QMainWindow, QMenuBar, QStackedWidget, QVBoxLayout, QWidget

from app.core.faults import log_errors
from app.core.projects.titles import recent_titles
from app.core.robots.robot_link import NOT_STOPPED, STOPPING
from app.core.session import Session
from app.intents import Intent
from app.ui.intents import BlockEdit, EditBlocks, PlotField, SelectTab
from app.ui.panels.base import Diagnose, Panel, PanelContext, ShowToast
from app.ui.shell.actions.shortcuts import format_key
from app.ui.shell.bars.app_bar import AppBar, robots_chip
from app.ui.shell.bars.banner import AlertBanner
from app.ui.shell.bars.developer_tools import DeveloperTools
from app.ui.shell.bars.question_card import QuestionCard
from app.ui.shell.bars.run_bar import RunBar, ToolBar
from app.ui.shell.bars.status_bar import StatusBar, StatusEntry, StatusFormatter
from app.ui.shell.bars.toast import Toast
from app.ui.shell.commands.commands import Commands
from app.ui.shell.commands.shell import START_PAGE
from app.ui.shell.dialogs.motion_permission import MotionPermissionCard
from app.ui.shell.dialogs.studio_dialogs import StudioDialogs
from app.ui.shell.docking.dock import Dock, dock_for_kinds
from app.ui.shell.docking.layouts import LAYOUTS, Layout, arranged, layout_named
from app.ui.shell.docking.saved_layouts import SavedLayouts
from app.ui.shell.docking.workbench import Workbench
from app.ui.shell.focus_ring import FocusRing
from app.ui.shell.keyboard import PanelFocus
from app.ui.shell.projects import FlushBeforeClose
from app.ui.shell.start_page.open_work import open_work
from app.ui.shell.start_page.page import Example, StartPage
from app.ui.shell.window_state import WindowState
from app.ui.startup.interpreter import GcFreezeTimer, GcTimer
from app.ui.startup.portal import has_system_dialogs
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, label
from app.ui.widgets.file_dialogs import FileDialogs, SystemDialogs
from nep.i18n import _, lazy

TICK_MS = 33
MIN_SIZE = QSize(960, 540)  # leaves room for the system's bars on a screen of 1024 x 600
DEFAULT_SIZE = QSize(1440, 900)
STATUS_REFRESH_TICKS = 8  # ticks between refreshes
ALERTS_COMMAND = "alerts.show"
BLOCK_KEYS: Mapping[QKeySequence.StandardKey, BlockEdit] = {
    QKeySequence.StandardKey.Copy: "copy",
    QKeySequence.StandardKey.Cut: "cut",
    QKeySequence.StandardKey.Paste: "paste",
}
MENU_KEY = QKeyCombination(Qt.KeyboardModifier.ShiftModifier, Qt.Key.Key_F10)
DUPLICATE_KEY = QKeyCombination(Qt.KeyboardModifier.ControlModifier, Qt.Key.Key_D)
BOOKMARK_KEY = QKeyCombination(Qt.KeyboardModifier.ControlModifier, Qt.Key.Key_B)
LOADING_TEXTS = {"behaviour": lazy("Loading blocks…")}
OTHER_LOADING_TEXT = lazy("Loading panels…")


class MainWindow(QMainWindow):
    """Main window of a session, which implements `Shell` for its commands."""

    bench_created = Signal()

    def __init__(
        self,
        session: Session,
        theme: Theme,
        panels: Mapping[str, Panel],
        examples: Sequence[Example] = (),
        *,
        dialogs: FileDialogs | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        # `dialogs` opens file dialogs, by default those of the system or Studio. `clock` returns monotonic
        # seconds; it measures how long a panel has been hidden.
        super().__init__()
        self._clock = clock
        self.session, self.theme, self.panels = session, theme, panels
        self.state = WindowState(session.settings, self.log_problem)
        self.state.keep_theme_updated(theme)
        self.saved_layouts = SavedLayouts(self.state, self.log_problem)
        self.on_closed: Callable[[], object] = lambda: None
        self.can_restart = self.wants_restart = False
        self._current_layout = self._previous_layout = ""
        self.benches: dict[str, Workbench] = {}
        self._prepared_benches: dict[str, Workbench] = {}  # workbenches with panels created in advance
        self._status_formatter = StatusFormatter(session)
        self._last_alerts_state = (-1, False)
        self._source_revision = session.source_revision
        self._ticks = self._half_ticks = 0
        self._has_double_rate = False  # the timer runs at twice the tick rate
        self._is_closed = False
        self._flush_before_close = FlushBeforeClose(self, self.flush, self.close)
        self._build(examples)
        files = dialogs if dialogs is not None else self._file_dialogs()
        focus_question = self.question_card.focus_input
        self.context = PanelContext(
            session, theme, self.open_topic, self.show_toast, self._run_command, files, focus_question,
            lambda topic, path: self.request(PlotField(topic, path)),
            partial(self.open_topic, beside=True),
            lambda panel, topic: self.request(Diagnose(panel, topic)),
            lambda: self.bench.visible_panels() if self.bench is not None else (),
            self.request,
            self._ask_name,
            lambda: "" if self._current_layout == START_PAGE else self._current_layout,
            self,
        )  # fmt: skip
        self.ring = FocusRing(theme, self)
        self.timer = QTimer(self)
        self.timer.setInterval(TICK_MS)
        self.timer.timeout.connect(self._on_half_tick)
        self.gc_freeze = GcFreezeTimer(self)
        self.panel_focus = PanelFocus(lambda: None if self._is_closed else self.bench, self)
        self.commands = Commands(self, session, self.context)
        self._connect()
        self.show_start()

    def _ask_name(
        self,
        question: str,
        verb: str,
        rejection_reason: Callable[[str], str],
        callback: Callable[[str], object],
        name: str = "",
    ) -> None:
        self.commands.view.name_sheet.ask(question, verb, rejection_reason, callback, name)

    def _build(self, examples: Sequence[Example]) -> None:
        theme = self.theme
        self.setWindowTitle("NEP Studio")
        self.setMinimumSize(MIN_SIZE)
        self.resize(DEFAULT_SIZE)
        self.bar = AppBar(theme, LAYOUTS, parent=self)
        self.setMenuWidget(self.bar)
        self.run_bar, self.tool_bar = RunBar(theme), ToolBar(theme)
        self.use_robot = Button(theme, _("Use the virtual robot"), "bot", size="small")
        self.use_robot.allow_shrinking()
        self.tool_bar.add_tool(self.use_robot)
        self.banner = AlertBanner(theme)
        # parents first, because Qt styles a widget and its children again when the parent changes
        self.middle = middle = QWidget(self)
        self.pages = QStackedWidget(middle)
        self.start = StartPage(theme, examples, self.pages)
        self.pages.addWidget(self.start)
        self.status = StatusBar(theme)
        column = QVBoxLayout(middle)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        for widget in (self.run_bar, self.tool_bar):
            column.addWidget(widget)
        column.addWidget(self.pages, 1)
        column.addWidget(self.status)
        self.banner.setParent(middle)  # in no layout, because it floats over the free area of a bar
        self.setCentralWidget(middle)
        self.toast = Toast(theme, self)
        self.question_card = QuestionCard(theme, self, self.session.runs.open_question.answer)
        self.permission_card = MotionPermissionCard(
            theme, self, self.session.fleet.permission, self.log_problem
        )

    def _connect(self) -> None:
        commands, start, run = self.commands, self.start, self._run_command
        actions, files, shortcuts = commands.actions, commands.files, commands.shortcuts
        for bar in (self.bar, self.run_bar, self.tool_bar):
            bar.set_actions(actions)
        self.tools = DeveloperTools(self, self.tool_bar, commands, self.session)
        self.bar.layout_selected.connect(lambda layout: run(f"layout.{layout}"))
        self.use_robot.clicked.connect(actions["robots.start"].trigger)
        self.status.pressed.connect(run)
        start.virtual_robot_pressed.connect(actions["robots.virtual"].trigger)
        start.new_behaviour_pressed.connect(actions["file.new"].trigger)
        start.learn_pressed.connect(actions["help.first_steps"].trigger)
        start.open_pressed.connect(actions["file.open"].trigger)
        start.developer_pressed.connect(actions["layout.developer"].trigger)
        start.example_selected.connect(files.open_example)
        start.file_selected.connect(files.open)
        start.work_selected.connect(self._continue_work)
        start.exited.connect(actions["start_page.leave"].trigger)
        actions["help.first_steps"].triggered.connect(lambda: start.offer_first_steps(False))
        self.banner.on_action = self.request
        self.banner.on_dismiss = self.session.alerts.dismiss
        self.banner.on_more = partial(run, ALERTS_COMMAND)
        self.pages.currentChanged.connect(self._page_changed)
        self.bench_created.connect(shortcuts.update_tooltips)
        shortcuts.changed.connect(self._update_shortcut_texts)
        self._update_shortcut_texts()

    def _update_shortcut_texts(self) -> None:
        shortcuts = self.commands.shortcuts
        self.bar.search.show_key(shortcuts.first_shortcut("palette.open"))
        shortcuts.update_tooltips()

    def _page_changed(self) -> None:
        self.commands.view.update_shortcuts()
        self.tools.refresh()

    def _file_dialogs(self) -> FileDialogs:
        if has_system_dialogs(os.environ, sys.platform):
            return SystemDialogs(self)
        return StudioDialogs(self.theme, self, self.session.settings)

    @property
    def current_layout(self) -> str:
        """Name of the current layout, or `START_PAGE` for the start page."""
        return self._current_layout

    @property
    def surface(self) -> QWidget:
        """Parent widget of sheets and menus, and context of the shortcuts."""
        return self

    @property
    def menu_bar(self) -> QMenuBar:
        """Menu bar of the window."""
        return self.bar.menus

    @property
    def show_toast(self) -> ShowToast:
        """Function that shows a toast, see `Toast`."""
        return self.toast.show_toast

    @property
    def examples(self) -> Sequence[Example]:
        """Examples that the start page offers."""
        return self.start.examples

    def show_start(self) -> None:
        """Show the start page."""
        if self.bench is not None:
            self._previous_layout = self._current_layout
        self._current_layout = START_PAGE
        self.pages.setCurrentWidget(self.start)
        self.show_recent()
        self._show_bars(None)
        self.start.focus_first()

    @property
    def return_layout(self) -> str:
        """Name of the layout to return to from the start page, or "".

        If no layout was shown before, this is "behaviour" if a behaviour isn't blank, else "".
        """
        if self._previous_layout:
            return self._previous_layout
        return "behaviour" if any(not each.is_blank for each in self.session.documents) else ""

    def _continue_work(self, key: str) -> None:
        self.request(SelectTab(key))
        self._run_command("layout.behaviour")

    def show_examples(self) -> None:
        """Show all examples on the start page and focus the first one."""
        self.start.focus_examples()

    def show_recent(self) -> None:
        """Update the recent files on the start page."""
        self.start.show_recent(recent_titles(self.session.settings.recent_files))

    def log_problem(self, message: str) -> None:
        """Log a sentence to the Console, about a problem that requires no action."""
        self.session.console.add("warn", "studio", message)

    def show_layout(self, name: str) -> Workbench:
        """Show a layout and return its workbench, which is created and restored on first use."""
        layout = layout_named(name)
        if layout.name not in self.benches:
            self.commands.add_panels()
            self.benches[layout.name] = bench = self._new_bench(layout)
            self._prepared_benches.pop(layout.name, None)
            self.pages.addWidget(bench)
            bench.resize(self.pages.size())
            self.saved_layouts.restore(bench, layout.name)
            self.bench_created.emit()
        bench = self.benches[layout.name]
        focus = QApplication.focusWidget()
        had_focus = focus is None or self.pages.isAncestorOf(focus)
        self._current_layout = layout.name
        self.pages.setCurrentWidget(bench)
        if had_focus:  # focus the layout only if the focus was in it, not in the switch or a menu
            bench.focus_main_panel()
        self._show_bars(layout.name)
        self.state.save_layout(layout.name)
        return bench

    def _new_bench(self, layout: Layout) -> Workbench:
        # Uses the workbench created in advance, if any.
        bench = self._prepared_benches.get(layout.name)
        if bench is None:
            bench = Workbench(self.theme, layout, self.panels, self.context, self.pages)
            bench.panel_failed.connect(self._panel_failed)
        return bench

    def preload_steps(self) -> list[Callable[[], object]]:
        """Return functions that create in advance the panels of layouts not opened yet, one panel each."""

        def create(layout: Layout, name: str) -> None:
            if not self._is_closed and layout.name not in self.benches:
                self._prepared_benches[layout.name] = bench = self._new_bench(layout)
                bench.preload(name)

        panels = self.panels.values()
        names = [(layout, name) for layout in LAYOUTS for name in arranged(layout, panels).default_panels]
        return [self.commands.add_panels, *(partial(create, layout, name) for layout, name in names)]

    def show_placeholder(self, layout: str) -> None:
        """Show the bars of a layout, and a placeholder until `show_layout` creates its workbench."""
        self._current_layout = layout
        placeholder = Placeholder(layout)
        self.pages.addWidget(placeholder)
        self.pages.setCurrentWidget(placeholder)
        placeholder.setFocus()
        self._show_bars(layout)
        self.bench_created.connect(placeholder.deleteLater)

    def _show_bars(self, layout: str | None) -> None:
        self.bar.show_layout(layout, back=bool(self.return_layout))
        self.run_bar.setVisible(layout == "behaviour")
        self.tool_bar.setVisible(layout == "developer")
        self.status.setVisible(layout is not None)
        self._show_session()
        self._update_status_bar()

    @property
    def bench(self) -> Workbench | None:
        """Current workbench, or None on the start page."""
        return self.benches.get(self.current_layout)

    def find_dock(self, name: str) -> Dock | None:
        """Return the dock of a panel that was created, preferably in the current layout, or None."""
        benches = [self.bench, *self.benches.values()]
        docks = (bench.docks.get(name) for bench in benches if bench is not None)
        return next((dock for dock in docks if dock is not None), None)

    def flush(self, callback: Callable[[], None]) -> None:
        """Apply the pending edit of the block editor to its project, then call `callback`."""
        dock = self.find_dock("behaviour")
        if dock is None:
            callback()
        else:
            dock.panel.flush(callback)

    def show_current_behaviour(self) -> None:
        """Show the current behaviour in the block editor without waiting for the next tick."""
        dock = self.find_dock("behaviour")
        if dock is not None:
            dock.refresh()

    def request(self, intent: Intent) -> bool:
        """Carry out an intent; return False if the object that it names doesn't exist."""
        return self.commands.request(intent)

    def open_panel(self, name: str) -> Dock | None:
        """Show a panel in the current layout; return None if the panel isn't available.

        The panel "behaviour" is always shown in the Behaviour layout, as are all panels from the start
        page.
        """
        layout_name = "behaviour" if name == "behaviour" or self.bench is None else self.current_layout
        return self.show_layout(layout_name).open(name)

    def open_home(self, panel: Panel) -> Dock | None:
        """Show a panel in a layout in which it has a place; return None if the panel isn't available.

        This is the current layout if possible, else the layout of the panel's first place. Of several
        panels of a kind, the most recently used one is shown.
        """
        layouts = [home.layout for home in panel.home]
        is_at_home = self.current_layout in layouts or (not layouts and self.bench is not None)
        layout = self.current_layout if is_at_home else next(iter(layouts), LAYOUTS[0].name)
        return self.show_layout(layout).open_latest(panel.name)

    def open_topic(self, topic: str, *, beside: bool = False) -> None:
        """Show a topic in the open panel that suits its type best, or else in the Inspector.

        Args:
            topic: Key of the topic.
            beside: True to open an additional panel, unless the existing one is empty.
        """
        topic_state = self.session.shown.topic(topic)
        kinds = {topic_state.codec, topic_state.msg_type} if topic_state is not None else set()
        bench = self.bench if self.bench is not None else self.show_layout("developer")
        dock = dock_for_kinds(bench.docks, bench.recently_used(), kinds)
        if dock is None:
            bench = self.show_layout("developer")
            dock = dock_for_kinds(bench.docks, bench.recently_used(), kinds) or bench.open("inspector")
        if dock is not None and beside and dock.panel.subtitle():
            dock = bench.open_another(dock.key)
        if dock is not None:
            dock.show()
            dock.raise_()
            dock.panel.show_topic(topic)

    def _run_command(self, name: str) -> None:
        self.commands.run(name)

    def _edit_blocks(self, edit: BlockEdit) -> None:
        if self.current_layout == "behaviour":
            self.request(EditBlocks(edit))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Handle keys that no widget has accepted, such as those to copy and paste blocks."""
        if self.commands.add_panels() and self.commands.view.run_shortcut(format_key(event.keyCombination())):
            return  # before that, the shortcuts of panels don't work
        edit = next((edit for key, edit in BLOCK_KEYS.items() if event.matches(key)), None)
        if event.keyCombination() == DUPLICATE_KEY:
            edit = "duplicate"
        if edit is not None:
            self._edit_blocks(edit)
        elif event.key() == Qt.Key.Key_Space and self.session.replay is not None and not event.modifiers():
            self._run_command("replay.play")
        elif event.keyCombination() == BOOKMARK_KEY and self.session.replay is not None:
            self._run_command("replay.bookmark")
        elif event.keyCombination() == MENU_KEY and (focus := QApplication.focusWidget()) is not None:
            # Qt itself handles only the Menu key, which many keyboards lack.
            position = focus.rect().center()
            reason = QContextMenuEvent.Reason.Keyboard
            QApplication.sendEvent(focus, QContextMenuEvent(reason, position, focus.mapToGlobal(position)))
        else:
            super().keyPressEvent(event)

    def focusNextPrevChild(self, forward: bool) -> bool:
        """Move the focus by Tab, skipping widgets that the user can't see."""
        return self.panel_focus.skip_hidden(self, forward=forward) or super().focusNextPrevChild(forward)

    def _on_half_tick(self) -> None:
        # The timer runs 60 times a second while images are visible: at 30 Hz about every tenth image would
        # arrive together with another one and be dropped. Otherwise it runs at 30 Hz, the rate of the tick.
        self._half_ticks += 1
        if self._half_ticks % 2 or not self._has_double_rate:
            self.tick()
        elif self.bench is not None:
            self.bench.refresh(video_only=True)
        self.tools.on_half_tick()

    def _update_source(self) -> None:
        # Resets all panels after a change of the source.
        if self._source_revision != self.session.source_revision:
            self._source_revision = self.session.source_revision
            for bench in (*self.benches.values(), *self._prepared_benches.values()):
                bench.notify_source_changed()

    def _update_panels(self) -> None:
        # Suspends hidden panels and adapts the timer rate.
        now = self._clock()
        for bench in self.benches.values():
            bench.update_suspension(now)
        needs_double_rate = self.bench is not None and self.bench.shows_video()
        if needs_double_rate != self._has_double_rate:
            self._has_double_rate, self._half_ticks = needs_double_rate, 1
            self.timer.setInterval(TICK_MS // 2 if needs_double_rate else TICK_MS)

    def tick(self) -> None:
        """Process pending changes of the session and refresh the visible parts of the window."""
        start_s = time.perf_counter()
        self._ticks += 1
        guarded = self.session.guarded
        with guarded(lazy("apply changes")):
            self.session.tick()
        with guarded(lazy("show its state")):
            self._show_session()
        with guarded(lazy("ask a question")):
            self.permission_card.refresh()
        with guarded(lazy("switch the source")):
            self._update_source()
        with guarded(lazy("pause panels")):
            self._update_panels()
        with guarded(lazy("show panels")):
            if self.bench is not None:
                self.bench.refresh()
        duration_ms = (time.perf_counter() - start_s) * 1000
        self._status_formatter.refresh_ms += 0.1 * (duration_ms - self._status_formatter.refresh_ms)

    def _show_session(self) -> None:
        view = self.session.runs.view()
        text, status = robots_chip(self.session)
        self.bar.show_robots(text, status)
        self.toast.refresh()
        self.question_card.show_question(
            self.session.runs.open_question.question, paused=view.state == "paused"
        )
        if self.current_layout == START_PAGE:
            self.bar.stop.show_state(
                _(view.stop_label), has_ring=view.state == "stopping", is_filled=self._may_move()
            )
            is_connected = any(link.state in {"ready", "busy", STOPPING} for link in self.session.fleet.links)
            self.start.show_robot(text if is_connected else "", status)
            self.start.show_open(open_work(self.session))
        elif self.current_layout == "behaviour":
            self.run_bar.show_view(view)
        else:
            self.tool_bar.show_view(view)
            self.use_robot.setVisible(not self.session.fleet.links)
        if self._ticks % STATUS_REFRESH_TICKS == 0:
            with self.session.guarded(lazy("update the status bar")):
                self._update_status_bar()
        with self.session.guarded(lazy("show alerts")):
            self._show_alerts()

    def _update_status_bar(self) -> None:
        # Called less often than the tick, because numbers can't be read at 30 Hz.
        formatter, project = self._status_formatter, self.session.document
        alerts = formatter.alerts(for_developers=self.current_layout == "developer")
        web = formatter.web_pages()
        self.status.commands = {
            alerts[1]: ALERTS_COMMAND,
            formatter.remote_access()[1]: "network.others",
            web[1]: "network.web",
        }
        if self.current_layout == "behaviour":
            self.status.show_entries(
                (formatter.health(), formatter.save_status()),
                (
                    formatter.arming(),
                    formatter.recording(),
                    web,
                    formatter.topics(),
                    formatter.remote_access_plain(),
                ),
            )
        elif self.current_layout == "developer":
            left: tuple[StatusEntry, ...] = (
                alerts,
                formatter.master(),
                formatter.remote_access(),
                web,
                formatter.traffic(),
            )
            left = (*left, formatter.arming(), formatter.lost())
            right: tuple[StatusEntry, ...] = (
                formatter.recording(),
                formatter.flight_recorder(),
                formatter.displayed_messages(),
                formatter.refresh_duration(),
            )
            if self.session.replay is not None:
                left = (alerts, *formatter.replayed_recording(), web)
                right = (
                    formatter.recording(),
                    formatter.flight_recorder(),
                    formatter.live_network_note(),
                    formatter.master(),
                    formatter.refresh_duration(),
                )
            self.status.show_entries(left, right)
        title = (
            "NEP Studio"
            if self.current_layout == START_PAGE
            else f"{self.session.documents.title(project)} - NEP Studio"
        )
        if title != self.windowTitle():
            self.setWindowTitle(title)

    def _is_moving(self) -> bool:
        moving_states = {"busy", STOPPING}
        links = self.session.fleet.links
        return self.session.runs.active or any(link.state in moving_states for link in links)

    def _may_move(self) -> bool:
        # Also True for a robot that hasn't confirmed Stop.
        is_stop_pending = self.session.runs.view().stop_label != "Stop"
        return (
            is_stop_pending
            or self._is_moving()
            or any(link.state == NOT_STOPPED for link in self.session.fleet.links)
        )

    def _show_alerts(self) -> None:
        # Alerts for the current layout, shown in the free area of its bar.
        alerts, is_developer = self.session.alerts, self.current_layout == "developer"
        if (alerts.revision, is_developer) != self._last_alerts_state:
            self._last_alerts_state = (alerts.revision, is_developer)
            reported = alerts.errors_and_warnings(for_developers=is_developer)
            self.banner.show_alerts([alert for alert in reported if not alerts.is_dismissed(alert.id)])
        hosts: Mapping[str, StartPage | RunBar] = {START_PAGE: self.start, "behaviour": self.run_bar}
        host = hosts.get(self.current_layout, self.tool_bar)
        self.run_bar.reserve_banner_room(has_banner=bool(self.banner.identity))
        area = host.banner_area() if self.banner.identity else QRect()
        self.banner.move_to(QRect(host.mapTo(self.middle, area.topLeft()), area.size()))

    def _panel_failed(self, name: str, message: str) -> None:
        self.session.console.add("error", f"panel {name}", message)

    def start_session(self) -> None:
        """Start the session and the tick timer."""
        self.session.start()
        self.timer.start()
        GcTimer(self).start()
        self.gc_freeze.start()
        self.bench_created.connect(self.gc_freeze.start)

    def restart(self) -> str:
        """Close the window and restart Studio.

        Returns:
            The reason why a restart is impossible, or "".
        """
        if self._may_move():
            return _("Press Stop first. Studio can restart when no program is running and no robot is moving")
        self.wants_restart = True
        self.close()
        return ""

    def closeEvent(self, event: QCloseEvent) -> None:
        if not self._is_closed:
            if self._is_moving():
                self.session.runs.stop()  # sent now, so that replies can arrive while the session closes
            if not self._flush_before_close.can_close():
                event.ignore()
                return
            if not self._may_discard_work():
                self.wants_restart = False
                self._flush_before_close.reset()
                event.ignore()
                return
            self._is_closed = True
            self.timer.stop()
            with log_errors("save the state of the window"):
                self._save_state()
            self.hide()
            for bench in (*self.benches.values(), *self._prepared_benches.values()):
                bench.dispose()
            self.session.close()
            self.on_closed()
        super().closeEvent(event)

    def _may_discard_work(self) -> bool:
        # True if no unsaved work would be lost, or the user has confirmed the loss.
        projects = self.session.documents.retry_journals()
        if not projects or self.session.confirm_discard(projects[0]):
            return True
        self.show_layout("behaviour")
        self.session.documents.show(projects[0])
        self.toast.show_toast(
            _(
                "Can't close Studio: this behaviour can't be backed up. Save it, or close again to discard "
                "its changes."
            )
        )
        return False

    def _save_state(self) -> None:
        self.state.save_geometry(self)
        for name, bench in self.benches.items():
            self.saved_layouts.save(bench, name)


class Placeholder(QWidget):
    """Text in place of a layout while it is created, so that the first paint doesn't wait for panels."""

    def __init__(self, layout: str) -> None:
        super().__init__()
        text = _(LOADING_TEXTS.get(layout, OTHER_LOADING_TEXT))
        self.setAccessibleName(text)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setProperty("ownFocus", True)  # it only holds the focus, so it needs no focus ring
        column = QVBoxLayout(self)
        column.addWidget(label(text, "bodyLarge", role="textSecondary"), 1, Qt.AlignmentFlag.AlignCenter)
