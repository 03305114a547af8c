"""QActions of all commands, shared by menus, shortcuts and buttons."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeVar

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QActionGroup, QKeySequence
from PySide6.QtWidgets import QAbstractButton, QMenuBar, QWidget

from app.ui.panels.command import Command, UnknownCommandError
from app.ui.theme.theme import Theme
from app.ui.widgets import assign_command
from app.ui.widgets.menus import Menu
from app.ui.widgets.mnemonics import with_mnemonics
from nep.i18n import _

STOP_COMMAND = "run.stop"
MENU_ROLES = {
    "settings.open": QAction.MenuRole.PreferencesRole,
    "file.quit": QAction.MenuRole.QuitRole,
    "help.about": QAction.MenuRole.AboutRole,
}
"""Menu roles of the commands that macOS moves to the application menu."""

T = TypeVar("T")
_log = logging.getLogger(__name__)


class Actions:
    """Collection of QActions, one per command.

    The commands of panels are added when a menu or the palette opens, or when an unknown command is
    looked up, because importing the panels takes time.

    Args:
        window: Window in which the shortcuts work.
        theme: Theme that provides the icons.
        commands: Commands in the order of the menus.
        handlers: Object that is passed to `run` and `disabled_reason` of each command.
        contributions: Returns the commands of panels; called at most once.

    Attributes:
        commands: Commands in the order of menus and palette.
        on_added: Called when the commands of panels were added.
    """

    def __init__(
        self,
        window: QWidget,
        theme: Theme,
        commands: Sequence[Command[T, T]],
        handlers: T,
        contributions: Callable[[], Sequence[Command[T, T]]] = tuple,
    ) -> None:
        self._window, self._theme, self._handlers = window, theme, handlers
        self.commands: Sequence[Command[Any, Any]] = commands
        self.on_added: Callable[[], object] = lambda: None
        self._contributions: Callable[[], Sequence[Command[Any, Any]]] | None = contributions
        self._groups: dict[str, QActionGroup] = {}
        self._actions: dict[str, QAction] = {}
        self._menus: dict[str, Menu] = {}
        self._disabled_reasons: dict[str, Callable[[], str]] = {}
        for command in commands:
            self._add(command)

    def _add(self, command: Command[Any, Any]) -> None:
        action = self._actions[command.id] = self._create_action(command, self._window)
        action.triggered.connect(lambda _on=False: command.run(self._handlers))
        self._disabled_reasons[command.id] = partial(command.disabled_reason, self._handlers)

    def add_contributions(self) -> bool:
        """Add the commands of panels to the actions and the menus; return False if this was done before."""
        contributions, self._contributions = self._contributions, None
        if contributions is None:
            return False
        self.commands = merged(self.commands, contributions())
        for command in self.commands:
            if command.id not in self._actions:
                self._add(command)
                self._insert_into_menu(command)
        self.on_added()
        return True

    def _insert_into_menu(self, command: Command[Any, Any]) -> None:
        menu = self._menus.get(command.menu_path)
        if menu is None:
            return
        position = self.commands.index(command)
        earlier = [each for each in self.commands[:position] if each.menu_path == command.menu_path]
        entries = menu.actions()
        index = entries.index(self._actions[earlier[-1].id]) + 1 if earlier else 0
        added = [menu.addSeparator()] if command.separator_above else []
        for entry in (*added, self._actions[command.id]):
            if index < len(entries):
                menu.insertAction(entries[index], entry)
            else:
                menu.addAction(entry)

    def _create_action(self, command: Command[Any, Any], window: QWidget) -> QAction:
        action = QAction("\t".join(filter(None, (command.label, command.displayed_key))), window)
        action.setObjectName(command.id)
        if command.icon is not None and not command.group:
            action.setIcon(self._theme.icon(command.icon))
        action.setShortcuts([QKeySequence(key) for key in command.default_keys()])
        action.setMenuRole(MENU_ROLES.get(command.id, QAction.MenuRole.NoRole))
        if command.in_all_windows:
            action.setShortcutContext(Qt.ShortcutContext.ApplicationShortcut)
        action.setCheckable(bool(command.group) or command.is_checkable)
        if command.group:
            if command.group not in self._groups:
                self._groups[command.group] = QActionGroup(window)
            self._groups[command.group].addAction(action)
        window.addAction(action)
        return action

    def __getitem__(self, name: str) -> QAction:
        if name not in self._actions:
            self.add_contributions()
        try:
            return self._actions[name]
        except KeyError:
            raise UnknownCommandError(name) from None

    def __contains__(self, name: object) -> bool:
        if name not in self._actions:
            self.add_contributions()
        return name in self._actions

    def bind(self, button: QAbstractButton, name: str) -> None:
        """Connect a button to a command.

        A click triggers the command, and the button's tooltip shows the command's shortcut (see
        `Shortcuts`).
        """
        assign_command(button, name)
        button.clicked.connect(self[name].trigger)

    def set_shortcuts(self, keys_of: Callable[[str], Sequence[str]]) -> None:
        """Set the shortcuts of all commands.

        Args:
            keys_of: Returns the shortcuts of a command by name; menus show the first one.
        """
        for name, action in self._actions.items():
            action.setShortcuts([QKeySequence(key) for key in keys_of(name)])

    def disabled_reason(self, name: str) -> str:
        """Return the reason why a command is unavailable, or "" if it is available.

        The reason is a short phrase without a full stop.

        Raises:
            UnknownCommandError: The name is unknown.
        """
        self[name]
        return self._disabled_reasons[name]()

    def disable_unavailable(self) -> None:
        """Disable the actions of unavailable commands, except for Stop, which is always enabled."""
        for name, action in self._actions.items():
            action.setEnabled(name == STOP_COMMAND or not self.disabled_reason(name))

    def enable_all(self) -> None:
        """Enable all actions, because Qt ignores the shortcuts of disabled actions.

        Each command checks its availability when it is run.
        """
        for action in self._actions.values():
            action.setEnabled(True)

    def run(self, name: str) -> bool:
        """Run a command; return False if it is unavailable.

        Raises:
            UnknownCommandError: The name is unknown.
        """
        action = self[name]
        if not action.isEnabled():
            return False
        action.trigger()
        return True

    def select(self, name: str) -> None:
        """Check the action of an option in an exclusive group without running its command."""
        self[name].setChecked(True)

    def fill_menu_bar(self, bar: QMenuBar, menus: Sequence[str]) -> dict[str, Menu]:
        """Add menus with the actions of all commands to a menu bar.

        Titles are translated and have mnemonics.

        Args:
            bar: Menu bar.
            menus: Names of the menus, which are their English titles, from left to right.

        Returns:
            The menus by name; names of submenus contain a slash, such as "View/Look".
        """
        titles = with_mnemonics([_(name) for name in menus])
        menus_by_path = {
            name: Menu(self._theme, bar, title) for name, title in zip(menus, titles, strict=True)
        }
        for menu in menus_by_path.values():
            bar.addMenu(menu)
        self._menus = menus_by_path
        for command in self.commands:
            if not command.menu:
                continue
            path = command.menu_path
            if path not in menus_by_path:
                menus_by_path[path] = Menu(self._theme, menus_by_path[command.menu], _(command.submenu))
                menus_by_path[command.menu].addMenu(menus_by_path[path])
            if command.separator_above:
                menus_by_path[path].addSeparator()
            menus_by_path[path].addAction(self._actions[command.id])
        return menus_by_path


def merged(commands: Sequence[Command[T, T]], contributions: Sequence[Command[T, T]]) -> list[Command[T, T]]:
    """Insert commands below the commands that their ``after`` names, or at the end.

    A command whose id exists already is logged and left out.
    """
    result = list(commands)
    last_below: dict[str, str] = {}  # command inserted last below another one
    pending = list(contributions)
    while pending:
        ids = [each.id for each in result]
        command = next((each for each in pending if each.after in ids), pending[0])
        pending.remove(command)
        if command.id in ids:
            _log.warning("the command '%s' of a panel is ignored: its id exists already", command.id)
            continue
        above = last_below.get(command.after, command.after)
        result.insert(ids.index(above) + 1 if above in ids else len(result), command)
        last_below[command.after] = command.id
    return result
