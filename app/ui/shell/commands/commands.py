"""What the commands of the table do with a window; panels and alerts ask for them by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from PySide6.QtCore import Qt, QUrl
from PySide6.QtGui import QDesktopServices

from app.core.faults import log_folder
from app.core.robots.virtual_processes import VIRTUAL_ROBOTS
from app.errors import SettingsError
from app.ui.shell.actions.shortcuts import STOP
from app.ui.shell.actions.table import Actions, Handler
from app.ui.shell.commands.robot_fixes import RobotMends
from app.ui.shell.commands.tabs import Tabs
from app.ui.shell.commands.view import UNTIL_END, Habits
from app.ui.shell.dialogs.network_access import OthersSheet
from app.ui.shell.dialogs.sheet import Sheet
from app.ui.shell.docking.dock import Dock
from app.ui.shell.documents.controller import Files
from app.ui.shell.main_window import START, MainWindow
from app.ui.shell.stop_keys import StopKeys
from app.ui.startup.single_instance import Asked
from app.ui.widgets.file_dialogs import Asks, SystemDialogs
from nep.system.lazy_import import later

if TYPE_CHECKING:
    from app.ui.shell.dialogs import version_history
else:
    version_history = later("app.ui.shell.dialogs.version_history")

PACES = {"run.full_speed": 0.0, "run.slow": 0.5, "run.very_slow": 1.5}
ABOUT = (
    "See what robots say, and tell them what to do.",
    "NEP Studio is free software (MIT licence).",
    "Inter and JetBrains Mono: SIL Open Font License 1.1. Icons: Lucide, ISC licence.",
)


@runtime_checkable
class Undoes(Protocol):
    """A panel whose edits can be undone."""

    def undo(self) -> None:
        """Take back the last edit."""

    def redo(self) -> None:
        """Do it again."""


@runtime_checkable
class ShowsBlocks(Protocol):
    """A panel that can bring a block into view."""

    def show_block(self, block: str) -> None:
        """Scroll to a block by its id."""


@runtime_checkable
class FindsBlocks(Protocol):
    """A panel that finds blocks by words."""

    def find_blocks(self, *, to_add: bool) -> None:
        """Ask for the words: of blocks in the behaviour, or of blocks to add."""


class Commands:
    """Gives a window its menus, shortcuts and named commands."""

    def __init__(self, window: MainWindow, asks: Asks | None = None) -> None:
        self._window = window
        self._session = window.session
        asking = asks if asks is not None else SystemDialogs(window)
        self.files = Files(window.session, asking, window.toast.say, self._show_behaviour, window.editor)
        self.tabs = Tabs(window.session, self.files, self._show_behaviour)
        self.habits = Habits(window, self.files)
        self._others: OthersSheet | None = None
        self._earlier: version_history.EarlierSheet | None = None
        handlers = self._handlers() | self.tabs.handlers() | self.habits.handlers()
        self.actions = Actions(window, window.theme, handlers)
        self._asked: dict[str, Callable[[str], object]] = {
            "panel": window.open_panel,
            "inspect": self._inspect,
            "topic.open": self._inspect,
            "block": self._show_block,
            "connect": self._connect_robot,
            "key": lambda key: self.actions.run(self.habits.shortcuts.holder(key)),
            "run.confirm": lambda _nothing: self._session.runs.confirm_still(),
            **self.tabs.asked(),
            **RobotMends(window.session, self.files, window.toast.say, lambda: self._edit("undo")).asked(),
        }
        self.habits.use(self.actions, self.actions.fill(window.bar.menus))
        shortcuts = self.habits.shortcuts
        self.stop_keys = StopKeys(window, lambda: shortcuts.of(STOP), self.actions[STOP].trigger)
        window.run = self.run
        window.status.opened.connect(self._ask_about_others)
        self._connect()

    def _handlers(self) -> dict[str, Handler]:
        window, session, files = self._window, self._session, self.files
        return {
            "file.new": files.new,
            "file.open": files.ask_open,
            "file.save": files.save,
            "file.save_as": files.save_as,
            "file.earlier": lambda: files.with_newest(self._earlier_versions),
            "file.start_page": self._start_page,
            "file.quit": window.close,
            "edit.undo": lambda: self._edit("undo"),
            "edit.redo": lambda: self._edit("redo"),
            "blocks.find": self._find_in_blocks,
            "blocks.search": lambda: self._find_in_blocks(to_add=True),
            "run.run": self._run_or_go_on,
            "run.pause": session.runs.pause,
            "run.step": lambda: files.with_newest(session.runs.step),
            **{name: partial(session.runs.set_pace, pace_s) for name, pace_s in PACES.items()},
            "run.stop": session.runs.stop,
            "robots.virtual": self._virtual_robot,
            "robots.turtle": self._virtual_turtle,
            "robots.ask": self._ask_before_moving,
            "network.others": self._ask_about_others,
            "robots.show": lambda: window.open_panel("robots"),
            "help.doctor": self._doctor,
            "help.log": self._show_log,
            "help.about": lambda: self._sheet("NEP Studio", [(line, "") for line in ABOUT]),
        }

    def _connect(self) -> None:
        window, start = self._window, self._window.start
        window.bar.layout_chosen.connect(self._show)
        window.bar.stop_pressed.connect(self._session.runs.stop)
        for bar in (window.run_bar, window.tool_bar):
            bar.run_pressed.connect(self._run_or_go_on)
            bar.pause_pressed.connect(self._session.runs.pause)
            bar.step_pressed.connect(lambda: self.run("run.step"))
            bar.stop_pressed.connect(self._session.runs.stop)
            bar.confirm_pressed.connect(self._session.runs.confirm_still)
        window.run_bar.offer_paces([self.actions[name] for name in PACES])
        self.actions.choose("run.full_speed")
        window.use_robot.clicked.connect(self._start_robot)
        start.virtual_robot.connect(self._virtual_robot)
        start.new_behaviour.connect(self.files.new)
        start.example_chosen.connect(self.files.example)
        start.file_chosen.connect(self.files.open)
        start.open_pressed.connect(self.files.ask_open)
        start.developer_pressed.connect(lambda: self._show("developer"))
        window.banner.on_action = self.run
        window.banner.on_dismiss = self._session.alerts.dismiss
        window.banner.on_more = lambda: self._open_in("developer", "alerts")

    # -- by name ----------------------------------------------------------------------------------

    def run(self, name: str) -> bool:
        """Do a command by its name; False when there is none.

        ``panel:topics`` shows a panel, ``inspect:/faces`` a topic, ``block:ID`` a block; a problem's
        ``mend_action`` changes the blocks (`app.blocks.fixes.fixes`).
        """
        if name in self.actions:
            return self.actions.run(name)
        verb, _, argument = name.partition(":")
        asked = self._asked.get(verb)
        if asked is not None:
            asked(argument)
            return True
        words, _, panel = name.partition(".")
        if words == "panel":
            return self._window.open_panel(panel) is not None
        return self.files.mend(name)

    def _inspect(self, topic: str) -> None:
        dock = self._open_in("developer", "inspector")
        if dock is not None:
            dock.panel.show_topic(topic)
            self.habits.mark_topic(topic)

    def _show_block(self, block: str) -> None:
        self._show("behaviour")
        editor = self._window.editor()
        if isinstance(editor, ShowsBlocks):
            editor.show_block(block)

    def _connect_robot(self, name: str) -> None:
        """A virtual robot starts; for a real one the list of robots shows."""
        link = self._session.fleet.link(name)
        described = link.robot.source if link is not None else self._session.document.robots.get(name, {})
        kind = described.get("rb:robot")
        model = str(kind.get("model")) if isinstance(kind, Mapping) and kind.get("virtual") is True else ""
        if model in VIRTUAL_ROBOTS:
            self._session.companions.restart_virtual_robot(name, model)
        else:
            self._window.open_panel("robots")

    def _open_in(self, layout: str, panel: str) -> Dock | None:
        self._show(layout)
        return self._window.open_panel(panel)

    # -- what they do -----------------------------------------------------------------------------

    def _show(self, layout: str) -> None:
        self.habits.show_layout(layout)

    def _show_behaviour(self) -> None:
        """The blocks, in front of whatever shares their place."""
        self._open_in("behaviour", "behaviour")

    def _start_page(self) -> None:
        self._window.show_start()
        self._window.state.keep_layout(START)

    def _edit(self, what: str) -> None:
        editor = self._window.editor()
        if isinstance(editor, Undoes):
            (editor.undo if what == "undo" else editor.redo)()

    def _find_in_blocks(self, *, to_add: bool = False) -> None:
        self._show("behaviour")
        editor = self._window.editor()
        if isinstance(editor, FindsBlocks):
            editor.find_blocks(to_add=to_add)

    def _run_or_go_on(self) -> None:
        runs = self._session.runs
        if runs.view().state == "paused":
            runs.go_on()
        else:
            self.files.with_newest(runs.run)

    def _start_robot(self) -> None:
        self._session.companions.start_virtual_robot()

    def _virtual_robot(self) -> None:
        self._start_robot()
        self._show("behaviour")

    def _virtual_turtle(self) -> None:
        self._session.companions.start_virtual_robot("Turtle", "diffdrive")
        if self._window.bench is None:
            self._show("behaviour")
        self._window.toast.say("The virtual Turtle is coming")

    def _ask_before_moving(self) -> None:
        words = "Studio asks again before a real robot moves"
        try:
            self._session.fleet.moving.forget()
        except SettingsError as error:
            self._window.complain(str(error))
            words += f", {UNTIL_END}"
        self._window.toast.say(words)

    def _doctor(self) -> None:
        self._session.doctor.look()
        if self._window.bench is None:
            self._open_in("developer", "doctor")
        else:
            self._window.open_panel("doctor")

    def _show_log(self) -> None:
        """Open the folder of the log files, which is there even when nothing was ever wrong."""
        folder = log_folder()
        try:
            folder.mkdir(0o700, parents=True, exist_ok=True)
        except OSError as error:
            self._window.toast.say(f"{folder} can't be made: {(error.strerror or str(error)).lower()}")
            return
        if not QDesktopServices.openUrl(QUrl.fromLocalFile(str(folder))):
            self._window.toast.say(f"The log files are in {folder}")

    def _earlier_versions(self) -> None:
        window, document = self._window, self._session.document
        if self._earlier is None:
            self._earlier = version_history.EarlierSheet(
                window.theme, window, self.files.copy, self.files.save
            )
        self._earlier.show_for(document.name, document.path, document.workspace)

    def _ask_about_others(self) -> None:
        window = self._window
        if self._others is None:
            self._others = OthersSheet(window.theme, window, self._session.reach)
        self._others.open()

    def _sheet(self, title: str, lines: list[tuple[str, str]]) -> None:
        Sheet(self._window.theme, self._window, title, lines).show_over()

    # -- at the start -----------------------------------------------------------------------------

    def do_asked(self, asked: Asked) -> None:
        """Do what a start asks, this one or a later one that found this window."""
        if asked.files:
            self.files.open_all(asked.files)
        elif asked.demo:
            self.demo()
        window = self._window
        if window.isVisible():
            window.setWindowState(window.windowState() & ~Qt.WindowState.WindowMinimized)
            window.raise_()
            window.activateWindow()

    @property
    def left(self) -> str:
        """The layout that a person worked in last, if there is something in it; "" for the start page."""
        last = self._window.state.layout
        there = {"developer": True, "behaviour": any(not each.blank for each in self._session.documents)}
        return last if there.get(last, False) else ""

    def demo(self) -> None:
        """Begin with the virtual robot and the first example."""
        cards = self._window.start.example_cards
        self._virtual_robot()
        if cards:
            self.files.example(cards[0].path)
