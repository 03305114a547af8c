"""What the commands of the table do with a window; panels and alerts ask for them by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Protocol, runtime_checkable

from PySide6.QtGui import QKeySequence, QShortcut

from app.core.journal import Unsaved
from app.ui.actions import Actions, Handler, shortcuts
from app.ui.docks import Dock
from app.ui.files import Asks, Files, SystemDialogs
from app.ui.main_window import MainWindow
from app.ui.popup import Sheet
from app.ui.theme import Mode
from app.ui.widgets.menus import Menu

TEXT_STEP = 25
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


class Commands:
    """Gives a window its menus, shortcuts and named commands."""

    def __init__(self, window: MainWindow, asks: Asks | None = None) -> None:
        self._window = window
        self._session = window.session
        asking = asks if asks is not None else SystemDialogs(window)
        self.files = Files(
            window.session, asking, window.toast.say, lambda: self._show("behaviour"), self._editor
        )
        self.actions = Actions(window, window.theme, self._handlers())
        self._asked: dict[str, Callable[[str], object]] = {
            "panel": window.open_panel,
            "inspect": self._inspect,
            "topic.open": self._inspect,
            "block": self._show_block,
            "connect": self._connect_robot,
            "run.confirm": lambda _nothing: self._session.runs.confirm_still(),
        }
        self._menus = self.actions.fill(window.bar.menus)
        self._recent = Menu(window.theme, window, "Recent")
        self._menus["File"].insertMenu(self.actions["file.save"], self._recent)
        self._panels = Menu(window.theme, window, "Panels")
        self._menus["View"].insertMenu(self.actions["layout.reset"], self._panels)
        self._menus["File"].aboutToShow.connect(self._list_recent)
        self._menus["View"].aboutToShow.connect(self._list_panels)
        window.run = self.run
        self._connect()

    def _handlers(self) -> dict[str, Handler]:
        window, session, files = self._window, self._session, self.files
        return {
            "file.new": files.new,
            "file.open": files.ask_open,
            "file.save": files.save,
            "file.save_as": files.save_as,
            "file.start_page": window.show_start,
            "file.quit": window.close,
            "edit.undo": lambda: self._edit("undo"),
            "edit.redo": lambda: self._edit("redo"),
            "layout.behaviour": lambda: self._show("behaviour"),
            "layout.developer": lambda: self._show("developer"),
            "layout.reset": self._reset,
            "panel.next": lambda: window.next_panel(1),
            "panel.previous": lambda: window.next_panel(-1),
            "theme.light": lambda: self._theme("light"),
            "theme.dark": lambda: self._theme("dark"),
            "theme.system": lambda: self._theme("system"),
            "theme.motion": self._motion,
            "text.larger": lambda: self._text(window.theme.text_percent + TEXT_STEP),
            "text.smaller": lambda: self._text(window.theme.text_percent - TEXT_STEP),
            "text.normal": lambda: self._text(100),
            "run.run": self._run_or_go_on,
            "run.pause": session.runs.pause,
            "run.step": lambda: files.with_newest(session.runs.step),
            "run.stop": session.runs.stop,
            "robots.virtual": self._virtual_robot,
            "robots.show": lambda: window.open_panel("robots"),
            "help.shortcuts": lambda: self._sheet("Keyboard shortcuts", shortcuts()),
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
        for number in range(1, 10):
            keys = QShortcut(QKeySequence(f"Ctrl+{number}"), window)
            keys.activated.connect(lambda number=number: window.panel_number(number))
        self.actions.choose(f"theme.{window.theme.mode}")
        self.actions["theme.motion"].setChecked(window.theme.reduced_motion)

    # -- by name ----------------------------------------------------------------------------------

    def run(self, name: str) -> bool:
        """Do a command by its name; False when there is none.

        ``panel:topics`` shows a panel, ``inspect:/faces`` a topic, ``block:ID`` a block; a problem's
        ``mend_action`` changes the blocks (`app.blocks.mend`).
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

    def _show_block(self, block: str) -> None:
        self._show("behaviour")
        editor = self._editor()
        if isinstance(editor, ShowsBlocks):
            editor.show_block(block)

    def _connect_robot(self, name: str) -> None:
        """A virtual robot starts; for a real one the list of robots shows."""
        description = self._session.document.robots.get(name, {})
        virtual = description.get("rb:robot")
        if isinstance(virtual, Mapping) and virtual.get("virtual") is True:
            self._session.companions.restart_virtual_robot(name)
        else:
            self._window.open_panel("robots")

    def _open_in(self, layout: str, panel: str) -> Dock | None:
        self._show(layout)
        return self._window.open_panel(panel)

    # -- what they do -----------------------------------------------------------------------------

    def _show(self, layout: str) -> None:
        self._window.show_layout(layout)
        self.actions.choose(f"layout.{layout}")

    def _reset(self) -> None:
        if self._window.bench is not None:
            self._window.bench.arrange()

    def _editor(self) -> object:
        bench = self._window.benches.get("behaviour")
        dock = bench.docks.get("behaviour") if bench is not None else None
        return dock.panel if dock is not None else None

    def _edit(self, what: str) -> None:
        editor = self._editor()
        if isinstance(editor, Undoes):
            (editor.undo if what == "undo" else editor.redo)()

    def _theme(self, mode: Mode) -> None:
        self._window.theme.set_mode(mode)
        self._window.state.keep_theme(self._window.theme)

    def _motion(self) -> None:
        self._window.theme.set_reduced_motion(self.actions["theme.motion"].isChecked())
        self._window.state.keep_theme(self._window.theme)

    def _text(self, percent: int) -> None:
        self._window.theme.set_text_percent(percent)
        self._window.state.keep_theme(self._window.theme)

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

    def _sheet(self, title: str, lines: list[tuple[str, str]]) -> None:
        Sheet(self._window.theme, self._window, title, lines).show_over()

    # -- menus that change ------------------------------------------------------------------------

    def _list_recent(self) -> None:
        self._recent.clear()
        recent = self._session.settings.recent
        self._recent.menuAction().setVisible(bool(recent))
        for file in recent:
            entry = self._recent.addAction(file.name)
            entry.setToolTip(str(file.path))
            entry.triggered.connect(lambda _on=False, path=file.path: self.files.open(path))

    def _list_panels(self) -> None:
        self._panels.clear()
        window = self._window
        self._panels.menuAction().setVisible(window.bench is not None)
        if window.bench is None:
            return
        self.actions.choose(f"layout.{window.showing}")
        opened = window.bench.open_names()
        for panel in sorted(window.panels.values(), key=lambda panel: panel.title):
            if panel.name == "behaviour" and window.showing != "behaviour":
                continue
            entry = self._panels.addAction(window.theme.icon(panel.icon), panel.title)
            entry.setCheckable(True)
            entry.setChecked(panel.name in opened)
            entry.triggered.connect(lambda on=False, name=panel.name: self._toggle(name, on))

    def _toggle(self, name: str, on: bool) -> None:
        bench = self._window.bench
        if bench is None:
            return
        if on:
            bench.open(name)
        else:
            bench.docks[name].close()

    # -- at the start -----------------------------------------------------------------------------

    def open_at_start(self, path: Path) -> None:
        """Open the file that was given on the command line."""
        self.files.open(path)

    def demo(self) -> None:
        """Begin with the virtual robot and the first example."""
        cards = self._window.start.example_cards
        self._virtual_robot()
        if cards:
            self.files.example(cards[0].path)

    def offer_unsaved(self, left: list[Unsaved]) -> None:
        """Offer what a Studio that died left behind, one after the other."""
        if not left:
            return
        first, rest = left[0], left[1:]

        def put_back() -> None:
            self.files.recover(first)
            self.offer_unsaved(rest)

        def leave() -> None:
            first.journal.unlink(missing_ok=True)
            self.offer_unsaved(rest)

        self._window.banner.offer(
            "Put back the unsaved work?",
            f"“{first.name}” was not saved when Studio ended last time.",
            ("Put it back", put_back),
            ("Throw it away", leave),
        )
