"""The one table of commands: menus, shortcuts, and the names by which panels and alerts ask for them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QActionGroup, QKeySequence
from PySide6.QtWidgets import QMenu, QMenuBar, QWidget

from app.ui.theme import Theme
from app.ui.widgets.menus import Menu

MENUS = ("File", "Edit", "View", "Run", "Robots", "Help")


@dataclass(frozen=True)
class Row:
    """One command. ``group`` makes it one of several choices; ``above`` puts a line over it.

    ``check`` makes it something that is on or off, ``everywhere`` a key that works in all windows.
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


TABLE: tuple[Row, ...] = (
    Row("file.new", "File", "New behaviour", "Ctrl+N", "file-plus"),
    Row("file.open", "File", "Open a file", "Ctrl+O", "folder-open"),
    Row("file.save", "File", "Save", "Ctrl+S", "save", above=True),
    Row("file.save_as", "File", "Save as", "Ctrl+Shift+S"),
    Row("file.start_page", "File", "Start page", "", "house", above=True),
    Row("file.quit", "File", "Quit", "Ctrl+Q", above=True),
    Row("edit.undo", "Edit", "Undo", "Ctrl+Z", "rotate-ccw"),
    Row("edit.redo", "Edit", "Redo", "Ctrl+Shift+Z", "rotate-cw"),
    Row("layout.behaviour", "View", "Behaviour layout", "Alt+1", "blocks", group="layout"),
    Row("layout.developer", "View", "Developer layout", "Alt+2", "activity", group="layout"),
    Row("layout.reset", "View", "Put the panels back"),
    Row("panel.next", "View", "Next panel", "F6"),
    Row("panel.previous", "View", "Previous panel", "Shift+F6"),
    Row("theme.light", "View", "Light", "", "sun", group="theme", above=True),
    Row("theme.dark", "View", "Dark", "", "moon", group="theme"),
    Row("theme.system", "View", "As the system", "", "monitor", group="theme"),
    Row("text.larger", "View", "Larger text", "Ctrl++", "zoom-in", above=True),
    Row("text.smaller", "View", "Smaller text", "Ctrl+-", "zoom-out"),
    Row("text.normal", "View", "Normal text", "Ctrl+0"),
    Row("theme.motion", "View", "Less motion", check=True),
    Row("run.run", "Run", "Run", "F5", "play"),
    Row("run.pause", "Run", "Pause", "F8", "pause"),
    Row("run.step", "Run", "Step", "F10", "step-forward"),
    Row("run.stop", "Run", "Stop the program and all robots", "F12", "square", above=True, everywhere=True),
    Row("robots.virtual", "Robots", "Use the virtual robot", "", "bot"),
    Row("robots.show", "Robots", "Try what a robot can do", "", "eye"),
    Row("help.shortcuts", "Help", "Keyboard shortcuts", "F1", "keyboard"),
    Row("help.about", "Help", "About NEP Studio", "", "info"),
)

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
        if row.shortcut:
            action.setShortcut(QKeySequence(row.shortcut))
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

    def fill(self, bar: QMenuBar) -> dict[str, QMenu]:
        """Make the menus of the table in a menu bar; they are returned by name."""
        menus: dict[str, QMenu] = {name: Menu(self._theme, bar, name) for name in MENUS}
        for made in menus.values():
            bar.addMenu(made)
        for row in TABLE:
            menu = menus[row.menu]
            if row.above:
                menu.addSeparator()
            menu.addAction(self._actions[row.name])
        return menus


def shortcuts() -> list[tuple[str, str]]:
    """Every command that has a key: (words, key)."""
    return [(row.text, row.shortcut) for row in TABLE if row.shortcut]
