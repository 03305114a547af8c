"""The commands as QActions: menus, keys and buttons trigger them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeVar

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QActionGroup, QKeySequence
from PySide6.QtWidgets import QAbstractButton, QMenuBar, QWidget

from app.ui.shell.actions.command import Command, UnknownCommandError
from app.ui.theme.theme import Theme
from app.ui.widgets import name_command
from app.ui.widgets.letters import marked
from app.ui.widgets.menus import Menu
from nep.i18n import _

STOP = "run.stop"
ROLES = {
    "settings.open": QAction.MenuRole.PreferencesRole,
    "file.quit": QAction.MenuRole.QuitRole,
    "help.about": QAction.MenuRole.AboutRole,
}
"""Where a Mac has a place of its own for a command, in the menu with the program's name."""

T = TypeVar("T")


class Actions:
    """One QAction for each command; ``do`` is what the commands are run with."""

    def __init__(self, window: QWidget, theme: Theme, commands: Sequence[Command[T]], do: T) -> None:
        self._theme, self._commands = theme, commands
        self._groups: dict[str, QActionGroup] = {}
        self._actions: dict[str, QAction] = {}
        self._why_not: dict[str, Callable[[], str]] = {}
        for command in commands:
            action = self._actions[command.id] = self._make(command, window)
            action.triggered.connect(lambda _on=False, run=command.run: run(do))
            self._why_not[command.id] = partial(command.why_not, do)

    def _make(self, command: Command[Any], window: QWidget) -> QAction:
        action = QAction("\t".join(filter(None, (command.words, command.shows))), window)
        action.setObjectName(command.id)
        if command.icon is not None and not command.group:
            action.setIcon(self._theme.icon(command.icon))
        action.setShortcuts([QKeySequence(key) for key in command.keys_at_first()])
        action.setMenuRole(ROLES.get(command.id, QAction.MenuRole.NoRole))
        if command.everywhere:
            action.setShortcutContext(Qt.ShortcutContext.ApplicationShortcut)
        action.setCheckable(bool(command.group) or command.check)
        if command.group:
            if command.group not in self._groups:
                self._groups[command.group] = QActionGroup(window)
            self._groups[command.group].addAction(action)
        window.addAction(action)
        return action

    def __getitem__(self, name: str) -> QAction:
        """The action of a command; raises UnknownCommandError."""
        try:
            return self._actions[name]
        except KeyError:
            raise UnknownCommandError(name) from None

    def __contains__(self, name: object) -> bool:
        """Whether there is a command of that name."""
        return name in self._actions

    def bind(self, button: QAbstractButton, name: str) -> None:
        """Let a button trigger a command; its tooltip says the command's keys (`Shortcuts.tell`)."""
        name_command(button, name)
        button.clicked.connect(self[name].trigger)

    def set_keys(self, keys_of: Callable[[str], Sequence[str]]) -> None:
        """Give every command the keys that a person chose; the first stands in menus."""
        for name, action in self._actions.items():
            action.setShortcuts([QKeySequence(key) for key in keys_of(name)])

    def why_not(self, name: str) -> str:
        """Why a command can't be done now, in a short sentence without a full stop; "" when it can."""
        self[name]
        return self._why_not[name]()

    def disable(self) -> None:
        """Grey what can't be done now; Stop never is."""
        for name, action in self._actions.items():
            action.setEnabled(name == STOP or not self.why_not(name))

    def enable_all(self) -> None:
        """Let keys do everything again: each command looks itself whether it can be done."""
        for action in self._actions.values():
            action.setEnabled(True)

    def run(self, name: str) -> bool:
        """Do a command; False when it can't be done now. Raises UnknownCommandError."""
        action = self[name]
        if not action.isEnabled():
            return False
        action.trigger()
        return True

    def choose(self, name: str) -> None:
        """Mark one choice of a group, without doing it."""
        self[name].setChecked(True)

    def fill(self, bar: QMenuBar, menus: Sequence[str]) -> dict[str, Menu]:
        """Make these menus in a menu bar; they are returned by name, and say it in the language of now.

        Alt with a letter of its name opens each.

        Those in them are returned as "View/Look".
        """
        titles = marked([_(name) for name in menus])
        made = {name: Menu(self._theme, bar, title) for name, title in zip(menus, titles, strict=True)}
        for menu in made.values():
            bar.addMenu(menu)
        for command in self._commands:
            if not command.menu:
                continue
            place = command.menu
            if command.under:
                place = f"{command.menu}/{command.under}"
                if place not in made:
                    made[place] = Menu(self._theme, made[command.menu], _(command.under))
                    made[command.menu].addMenu(made[place])
            if command.above:
                made[place].addSeparator()
            made[place].addAction(self._actions[command.id])
        return made
