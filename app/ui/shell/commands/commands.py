"""Commands of a window: creation of the handlers, and dispatch of commands and intents."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

from app.core.session import Session
from app.intents import Intent
from app.ui.panels.base import Panel, PanelContext, PanelWidget
from app.ui.panels.command import Command, IntentHandler, UnknownCommandError
from app.ui.shell.actions.actions import STOP_COMMAND, Actions
from app.ui.shell.actions.shortcuts import Shortcuts
from app.ui.shell.commands.behaviours import BehaviourCommands, show_blocks_panel
from app.ui.shell.commands.editing import EditCommands
from app.ui.shell.commands.menus import DynamicMenus
from app.ui.shell.commands.palette_entries import PaletteEntries
from app.ui.shell.commands.recording import RecordCommands
from app.ui.shell.commands.replay import ReplayCommands
from app.ui.shell.commands.reporting import ReportCommands
from app.ui.shell.commands.robots import RobotCommands
from app.ui.shell.commands.shell import Shell
from app.ui.shell.commands.table import COMMANDS, INTENT_COMMANDS, INTENTS, MENUS, Handlers
from app.ui.shell.commands.view import ViewCommands
from app.ui.shell.projects import ProjectController
from app.ui.shell.stop_keys import StopKeys

_WINDOW_INTENTS = {handler.kind: handler for handler in INTENTS}


class Commands:
    """Handlers, actions, menus and shortcuts of a window."""

    def __init__(self, shell: Shell, session: Session, context: PanelContext) -> None:
        shortcuts = Shortcuts(session.settings, shell.log_problem, COMMANDS)
        self._shell, self._context = shell, context
        self.session, dialogs = session, context.files
        self.files = ProjectController(
            session, dialogs, shell.show_toast, partial(show_blocks_panel, shell), shell.flush,
            shell.show_current_behaviour,
        )  # fmt: skip
        self.behaviours = BehaviourCommands(shell, session, self.files)
        session.alarms.run_behaviour = self.behaviours.run_named
        self.robots = RobotCommands(shell, session)
        self.view = ViewCommands(shell, session, self.files, shortcuts)
        self.shortcuts = shortcuts
        self.recording = RecordCommands(shell, session, dialogs)
        self.replay = ReplayCommands(shell, session, dialogs)
        self.files.open_recording = self.replay.open
        self.files.open_layout = self.view.import_layout
        self._handlers = Handlers(
            session,
            shell,
            self.files,
            self.behaviours,
            self.robots,
            self.view,
            EditCommands(shell),
            ReportCommands(shell, session, dialogs),
            self.recording,
            self.replay,
        )
        self.actions = Actions(shell.surface, shell.theme, COMMANDS, self._handlers, self._panel_commands)
        self.actions.on_added = lambda: shortcuts.set_commands(self.actions.commands)
        self.entries = PaletteEntries(shell, session, self.actions, shortcuts)
        menus = self.actions.fill_menu_bar(shell.menu_bar, MENUS)
        self.menus = DynamicMenus(shell, session, self.actions, menus, self.view, self.files.open)
        self.view.set_actions(self.actions, self.entries)
        self.actions.select("run.full_speed")
        self.actions["run.from_start"].setChecked(session.fleet.resets_at_start)
        self.stop_keys = StopKeys(
            shell.surface, lambda: shortcuts.shortcuts_of(STOP_COMMAND), self.actions[STOP_COMMAND].trigger
        )

    def add_panels(self) -> bool:
        """Add the commands of the panels, which are otherwise added when they are needed.

        Returns:
            False if they were added before.
        """
        return self.actions.add_contributions()

    def _panel_commands(self) -> Sequence[Command[Handlers, Handlers]]:
        commands: list[Command[Handlers, Handlers]] = []
        for panel in self._shell.panels.values():
            above = ""
            for command in panel.commands:
                commands.append(self._window_command(panel, command, command.after or above))
                above = command.id
        return commands

    def _window_command(
        self, panel: Panel, command: Command[Any, PanelContext], after: str
    ) -> Command[Handlers, Handlers]:
        window_command: Command[Any, Any] = command
        return replace(
            window_command,
            run=lambda _do: self._run_on_panel(panel, command.opens_panel, command.run),
            disabled_reason=lambda _do: command.disabled_reason(self._context),
            after=after,
        )

    def _run_on_panel(self, panel: Panel, opens_panel: bool, act: Callable[[Any], object]) -> bool:
        # Returns False if the panel isn't available, or if `act` does.
        dock = self._shell.open_home(panel) if opens_panel else self._shell.find_dock(panel.name)
        if dock is None or dock.is_placeholder:
            return False
        return act(dock.panel) is not False

    def run(self, name: str) -> bool:
        """Run a command by its id; return False if it is unavailable.

        Raises:
            UnknownCommandError: Neither the window nor a panel has a command with this id.
        """
        return self.actions.run(name)

    def request(self, intent: Intent) -> bool:
        """Carry out an intent by the handler of its class, or else of a base class.

        Returns:
            False if the object that the intent names doesn't exist, or the panel isn't available.

        Raises:
            UnknownCommandError: Neither the window nor a panel handles the intent.
        """
        for kind in type(intent).__mro__:
            if kind in INTENT_COMMANDS:
                return self.run(INTENT_COMMANDS[kind])
            if kind in _WINDOW_INTENTS:
                return _WINDOW_INTENTS[kind].run(self._handlers, intent) is not False
        for kind in type(intent).__mro__:
            if kind in self._panel_intents:
                panel, handler = self._panel_intents[kind]
                act = partial(_handle, handler, intent)
                return self._run_on_panel(panel, handler.opens_panel, act)
        raise UnknownCommandError(type(intent).__name__)

    @cached_property
    def _panel_intents(self) -> dict[type[Intent], tuple[Panel, IntentHandler[Any, Any]]]:
        panels = self._shell.panels.values()
        return {handler.kind: (panel, handler) for panel in panels for handler in panel.intents}


def _handle(handler: IntentHandler[Any, Any], intent: Intent, widget: PanelWidget) -> object:
    return handler.run(widget, intent)
