"""Commands of a window: creation of the handlers, and dispatch by id."""

from __future__ import annotations

from functools import partial

from app.core.session import Session
from app.ui.shell.actions.actions import STOP_COMMAND, Actions
from app.ui.shell.actions.command import UnknownCommandError
from app.ui.shell.actions.shortcuts import Shortcuts
from app.ui.shell.commands.acting import ActingCommands
from app.ui.shell.commands.behaviours import BehaviourCommands, show_blocks_panel
from app.ui.shell.commands.editing import EditCommands
from app.ui.shell.commands.menus import DynamicMenus
from app.ui.shell.commands.palette_entries import PaletteEntries
from app.ui.shell.commands.recording import RecordCommands
from app.ui.shell.commands.replay import ReplayCommands
from app.ui.shell.commands.reporting import ReportCommands
from app.ui.shell.commands.robots import RobotCommands
from app.ui.shell.commands.shell import Shell
from app.ui.shell.commands.table import ARGUMENT_COMMANDS, COMMANDS, MENUS, Handlers
from app.ui.shell.commands.variables import VariableCommands
from app.ui.shell.commands.view import ViewCommands
from app.ui.shell.projects import ProjectController
from app.ui.shell.stop_keys import StopKeys
from app.ui.widgets.file_dialogs import FileDialogs

_ARGUMENT_COMMANDS_BY_ID = {command.id: command for command in ARGUMENT_COMMANDS}


class Commands:
    """Handlers, actions, menus and shortcuts of a window."""

    def __init__(self, shell: Shell, session: Session, dialogs: FileDialogs) -> None:
        shortcuts = Shortcuts(session.settings, shell.log_problem, COMMANDS)
        self.session = session
        self.files = ProjectController(
            session, dialogs, shell.show_toast, partial(show_blocks_panel, shell), shell.editor
        )
        self.behaviours = BehaviourCommands(shell, session, self.files, dialogs)
        session.alarms.run_behaviour = self.behaviours.run_named
        self.robots = RobotCommands(shell, session, self.files, self.behaviours.undo)
        self.view = ViewCommands(shell, session, self.files, shortcuts)
        self.shortcuts = shortcuts
        self.recording = RecordCommands(shell, session, dialogs)
        self.variables = VariableCommands(shell, session, self.files)
        self.replay = ReplayCommands(shell, session, dialogs)
        self.files.open_recording = self.replay.open
        self.files.open_layout = self.view.import_layout
        self._handlers = Handlers(
            session,
            shell,
            self.files,
            self.variables,
            self.behaviours,
            self.robots,
            self.view,
            EditCommands(shell),
            ReportCommands(shell, session, self.files, dialogs),
            self.recording,
            self.replay,
            ActingCommands(shell),
        )
        self.actions = Actions(shell.surface, shell.theme, COMMANDS, self._handlers)
        self.entries = PaletteEntries(shell, session, COMMANDS, self.actions.disabled_reason, shortcuts)
        menus = self.actions.fill_menu_bar(shell.menu_bar, MENUS)
        self.menus = DynamicMenus(shell, session, self.actions, menus, self.view, self.files.open)
        self.view.set_actions(self.actions, self.entries)
        self.actions.select("run.full_speed")
        self.actions["run.from_start"].setChecked(session.fleet.resets_at_start)
        self.stop_keys = StopKeys(
            shell.surface, lambda: shortcuts.shortcuts_of(STOP_COMMAND), self.actions[STOP_COMMAND].trigger
        )

    def run(self, name: str) -> bool:
        """Run a command by its id or ``id:argument``.

        Examples are ``panel:topics`` to show a panel, ``inspect:/faces`` to inspect a topic, and
        ``block:ID`` to scroll to a block.

        Returns:
            False if the command is unavailable, or if the object that the argument names doesn't exist.

        Raises:
            UnknownCommandError: The id isn't in `app.ui.shell.commands.table`.
            ValueError: The argument is invalid.
        """
        id, colon, argument = name.partition(":")
        if not colon:
            return self.actions.run(id)
        command = _ARGUMENT_COMMANDS_BY_ID.get(id)
        if command is None:
            raise UnknownCommandError(id)
        return command.run(self._handlers, argument)
