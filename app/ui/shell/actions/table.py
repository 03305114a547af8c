"""The one table of commands: menus, shortcuts, and the names by which panels and alerts ask for them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QActionGroup, QKeySequence
from PySide6.QtWidgets import QMenuBar, QWidget

from app.ui.theme.theme import Theme
from app.ui.widgets.menus import Menu

MENUS = ("File", "Edit", "View", "Run", "Robots", "Help")


@dataclass(frozen=True)
class Row:
    """One command. ``group`` makes it one of several choices; ``above`` puts a line over it.

    Without a ``menu`` it is only in the palette and among the shortcuts. ``check`` makes it something that is
    on or off, ``everywhere`` a key that works in all windows. ``also`` are more keys beside ``shortcut``,
    ``mac`` those of a Mac in place of all: Ctrl is written there for Cmd, Meta for the key that says Ctrl.
    """

    name: str
    menu: str
    text: str
    shortcut: str = ""
    icon: str | None = None
    group: str = ""
    above: bool = False
    everywhere: bool = False
    check: bool = False
    also: tuple[str, ...] = ()
    mac: tuple[str, ...] = ()

    def keys_at_first(self, platform: str = sys.platform) -> tuple[str, ...]:
        """The keys at first, the one that stands in menus before the others."""
        if platform == "darwin" and self.mac:
            return self.mac
        return (self.shortcut, *self.also) if self.shortcut else ()


TABLE: tuple[Row, ...] = (
    Row("file.new", "File", "New behaviour", "Ctrl+N", "file-plus"),
    Row("file.open", "File", "Open a file", "Ctrl+O", "folder-open"),
    Row("file.save", "File", "Save", "Ctrl+S", "save", above=True),
    Row("file.save_as", "File", "Save as", "Ctrl+Shift+S"),
    Row("file.earlier", "File", "Earlier versions"),
    Row("tab.close", "File", "Close the behaviour", "Ctrl+W", "x"),
    Row("tab.reopen", "File", "Open the closed one again", "Ctrl+Shift+T", "history"),
    Row("file.forget_recent", "", "Clear the list of recent files"),
    Row("file.start_page", "File", "Start page", "", "house", above=True),
    Row("settings.open", "File", "Settings", "Ctrl+,", "settings"),
    Row("file.quit", "File", "Quit", "Ctrl+Q", above=True),
    Row("edit.undo", "Edit", "Undo", "Ctrl+Z", "rotate-ccw"),
    Row("edit.redo", "Edit", "Redo", "Ctrl+Shift+Z", "rotate-cw", also=("Ctrl+Y",)),
    Row("blocks.find", "Edit", "Find in the blocks", "Ctrl+F", "search", above=True),
    Row("blocks.search", "Edit", "Find a block to add"),
    Row("palette.open", "View", "Find a command or panel", "Ctrl+K", "search"),
    # with Option (Alt) a Mac types signs, and Cmd+Tab is the system's
    Row(
        "layout.behaviour",
        "View",
        "Behaviour layout",
        "Alt+1",
        "blocks",
        group="layout",
        above=True,
        mac=("Ctrl+Alt+1",),
    ),
    Row(
        "layout.developer",
        "View",
        "Developer layout",
        "Alt+2",
        "activity",
        group="layout",
        mac=("Ctrl+Alt+2",),
    ),
    Row("layout.keep", "View", "Keep this layout as"),
    Row("layout.rename", "View", "Rename this layout"),
    Row("layout.delete", "View", "Delete this layout", "", "trash-2"),
    Row("layout.reset", "View", "Put the panels back"),
    Row("panel.next", "View", "Next panel", "F6"),
    Row("panel.previous", "View", "Previous panel", "Shift+F6"),
    *(Row(f"panel.{n}", "", f"Go to panel {n}", f"Ctrl+{n}") for n in range(1, 10)),
    Row("tab.next", "View", "Next behaviour", "Ctrl+Tab", above=True, mac=("Meta+Tab", "Ctrl+Shift+]")),
    Row(
        "tab.previous",
        "View",
        "Previous behaviour",
        "Ctrl+Shift+Tab",
        mac=("Meta+Shift+Tab", "Ctrl+Shift+["),
    ),
    Row("view.freeze", "View", "Freeze what shows", "", "snowflake", check=True, above=True),
    Row("theme.light", "View", "Light", "", "sun", group="theme", above=True),
    Row("theme.dark", "View", "Dark", "", "moon", group="theme"),
    Row("theme.system", "View", "As the system", "", "monitor", group="theme"),
    Row("text.larger", "View", "Larger text", "Ctrl++", "zoom-in", above=True),
    Row("text.smaller", "View", "Smaller text", "Ctrl+-", "zoom-out"),
    Row("text.normal", "View", "Normal text", "Ctrl+0"),
    Row("theme.contrast", "View", "High contrast", check=True, above=True),
    Row("theme.motion", "View", "Less motion", check=True),
    Row("run.run", "Run", "Run", "F5", "play"),
    Row("run.pause", "Run", "Pause", "F8", "pause"),
    Row("run.step", "Run", "Step", "F10", "step-forward"),
    Row("run.full_speed", "Run", "Full speed", "", group="pace", above=True),
    Row("run.slow", "Run", "Slow motion: 0.5 s a block", "", group="pace"),
    Row("run.very_slow", "Run", "Very slow: 1.5 s a block", "", group="pace"),
    Row(
        "run.stop",
        "Run",
        "Stop the program and all robots",
        "F12",
        "square",
        above=True,
        everywhere=True,
        also=("Ctrl+.",),  # F12 is a key for sound on Macs and many laptops
    ),
    Row("robots.virtual", "Robots", "Use the virtual Pepper", "", "bot"),
    Row("robots.turtle", "Robots", "Use the virtual Turtle", "", "bot"),
    Row("robots.show", "Robots", "Try what a robot can do", "", "eye", above=True),
    Row("robots.ask", "Robots", "Ask again before real robots move", "", "footprints"),
    Row("network.others", "Robots", "Let other computers connect", "", "wifi", above=True),
    Row("help.shortcuts", "Help", "Keyboard shortcuts", "F1", "keyboard"),
    Row("help.doctor", "Help", "Connection doctor", "", "stethoscope"),
    Row("help.log", "Help", "Show the log", "", "folder-open"),
    Row("help.about", "Help", "About NEP Studio", "", "info"),
)

ROLES = {
    "settings.open": QAction.MenuRole.PreferencesRole,
    "file.quit": QAction.MenuRole.QuitRole,
    "help.about": QAction.MenuRole.AboutRole,
}
"""Where a Mac has a place of its own for a command, in the menu with the program's name."""

Handler = Callable[[], object]


class Actions:
    """QActions of the table, in menus; every row needs a handler, KeyError names the first without one."""

    def __init__(self, window: QWidget, theme: Theme, handlers: Mapping[str, Handler]) -> None:
        self._theme = theme
        self._groups: dict[str, QActionGroup] = {}
        self._actions: dict[str, QAction] = {}
        for row in TABLE:
            self._actions[row.name] = self._make(row, window, theme, handlers[row.name])

    def _make(self, row: Row, window: QWidget, theme: Theme, handler: Handler) -> QAction:
        action = QAction(row.text, window)
        action.setObjectName(row.name)
        if row.icon is not None and not row.group:
            action.setIcon(theme.icon(row.icon))
        action.setShortcuts([QKeySequence(key) for key in row.keys_at_first()])
        action.setMenuRole(ROLES.get(row.name, QAction.MenuRole.NoRole))
        if row.everywhere:
            action.setShortcutContext(Qt.ShortcutContext.ApplicationShortcut)
        action.setCheckable(bool(row.group) or row.check)
        if row.group:
            if row.group not in self._groups:
                self._groups[row.group] = QActionGroup(window)
            self._groups[row.group].addAction(action)
        action.triggered.connect(lambda _on=False: handler())
        window.addAction(action)
        return action

    def __getitem__(self, name: str) -> QAction:
        """The action of that name."""
        return self._actions[name]

    def __contains__(self, name: object) -> bool:
        """Whether the table has a command of that name."""
        return name in self._actions

    def set_keys(self, keys_of: Callable[[str], Sequence[str]]) -> None:
        """Give every command the keys that a person chose; the first stands in menus."""
        for name, action in self._actions.items():
            action.setShortcuts([QKeySequence(key) for key in keys_of(name)])

    def disable(self, why_not: Callable[[str], str]) -> None:
        """Grey what can't be done now; Stop never is."""
        for name, action in self._actions.items():
            action.setEnabled(name == "run.stop" or not why_not(name))

    def enable_all(self) -> None:
        """Let keys do everything again: each command looks itself whether it can be done."""
        for action in self._actions.values():
            action.setEnabled(True)

    def run(self, name: str) -> bool:
        """Do a command by its name; False when there is none or it can't be done now."""
        action = self._actions.get(name)
        if action is None or not action.isEnabled():
            return False
        action.trigger()
        return True

    def choose(self, name: str) -> None:
        """Mark one choice of a group, without doing it."""
        self._actions[name].setChecked(True)

    def fill(self, bar: QMenuBar) -> dict[str, Menu]:
        """Make the menus of the table in a menu bar; they are returned by name."""
        menus: dict[str, Menu] = {name: Menu(self._theme, bar, name) for name in MENUS}
        for made in menus.values():
            bar.addMenu(made)
        for row in TABLE:
            if not row.menu:
                continue
            menu = menus[row.menu]
            if row.above:
                menu.addSeparator()
            menu.addAction(self._actions[row.name])
        return menus


def shortcuts() -> list[tuple[str, str]]:
    """Every command that has a key: (words, key)."""
    return [(row.text, row.keys_at_first()[0]) for row in TABLE if row.keys_at_first()]
