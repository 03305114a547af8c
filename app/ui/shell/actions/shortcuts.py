"""Keyboard shortcuts: defaults from the command table, changes by the user, and fixed keys.

The settings store only the differences from the defaults. F12 is always Stop. Stop has a second
shortcut, Ctrl+. by default (Cmd+. on macOS, where F12 changes the volume).
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from PySide6.QtCore import QKeyCombination, QObject, Qt, Signal
from PySide6.QtGui import QKeySequence
from PySide6.QtWidgets import QApplication

from app.core.storage.settings import Settings
from app.errors import SettingsError
from app.ui.panels.command import Command, UnknownCommandError
from app.ui.shell.actions.actions import STOP_COMMAND
from app.ui.text import plain
from app.ui.text.numbers import shortcut_text, tip_with_key
from app.ui.widgets import IconButton
from nep.i18n import _, lazy

STOP_KEY = "F12"
MODIFIER_REQUIRED_TEXT = lazy(
    "A single letter can't be a shortcut. Combine it with Ctrl or Alt, or use a function key."
)
FUNCTION_KEYS = range(Qt.Key.Key_F1, Qt.Key.Key_F35 + 1)
MODIFIERS = (
    Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.AltModifier | Qt.KeyboardModifier.MetaModifier
)


@dataclass(frozen=True, slots=True)
class FixedKey:
    """Keys that can't be changed.

    Attributes:
        scope: Part of the window in which the keys work, wrapped in `lazy`.
        label: Function of the keys, wrapped in `lazy`.
        keys: Keys in Qt's portable format, separated by ", ".
    """

    scope: str
    label: str
    keys: str


FIXED_KEYS: tuple[FixedKey, ...] = (
    FixedKey(lazy("Everywhere"), lazy("Close the palette or a dialog, or leave a field"), "Esc"),
    FixedKey(lazy("Everywhere"), lazy("Next control"), "Tab"),
    FixedKey(lazy("Everywhere"), lazy("Previous control"), "Shift+Tab"),
    FixedKey(lazy("Everywhere"), lazy("Press the selected button"), "Space"),
    FixedKey(lazy("Tables and trees"), lazy("Go to the filter"), "/"),
    FixedKey(lazy("Tables and trees"), lazy("Previous or next row"), "Up, Down"),
    FixedKey(lazy("Tables and trees"), lazy("Open row"), "Enter"),
    FixedKey(lazy("Tables and trees"), lazy("Expand or collapse"), "Right, Left"),
    FixedKey(lazy("Inspector"), lazy("Find a key or value"), "Ctrl+F"),
    FixedKey(lazy("Inspector"), lazy("Copy value"), "Ctrl+C"),
    FixedKey(lazy("Inspector"), lazy("Copy path"), "Ctrl+Shift+C"),
    FixedKey(lazy("Inspector"), lazy("Plot the value"), "Ctrl+Shift+L"),
    FixedKey(lazy("Plot"), lazy("Add a curve"), "C"),
    FixedKey(lazy("Plot"), lazy("Pause or resume"), "Space"),
    FixedKey(lazy("Plot"), lazy("Show or hide A and B"), "M"),
    FixedKey(lazy("Plot"), lazy("Place A or B at the mouse pointer"), "A, B"),
    FixedKey(lazy("Plot"), lazy("Move A or B by one value, with Shift by ten"), "Left, Right"),
    FixedKey(lazy("Plot"), lazy("Shorter, longer, entire time range"), "+, -, 0"),
    FixedKey(lazy("Plot"), lazy("Show or hide the selected curve"), "H"),
    FixedKey(lazy("Plot"), lazy("Remove the selected curve"), "Delete"),
    FixedKey(lazy("Timeline"), lazy("Play or pause"), "Space"),
    FixedKey(
        lazy("Timeline"),
        lazy("Previous or next message of the selected topic; with Shift one second"),
        "Left, Right",
    ),
    FixedKey(lazy("Timeline"), lazy("Previous or next bookmark"), "Ctrl+Left, Ctrl+Right"),
    FixedKey(lazy("Timeline"), lazy("Start and end"), "Home, End"),
    FixedKey(lazy("Timeline"), lazy("Set the start or end of the loop here"), "[, ]"),
    FixedKey(lazy("Timeline"), lazy("Turn looping on or off"), "L"),
    FixedKey(lazy("Timeline"), lazy("Add bookmark"), "B"),
    FixedKey(lazy("Timeline"), lazy("Shorter, longer, entire time range"), "+, -, 0"),
    FixedKey(lazy("Sliders"), lazy("One step"), "Left, Right"),
    FixedKey(lazy("Sliders"), lazy("Ten steps"), "PgUp, PgDown"),
    FixedKey(lazy("Sliders"), lazy("Minimum and maximum"), "Home, End"),
    FixedKey(lazy("Blocks"), lazy("Move between blocks and slots"), "Up, Down, Left, Right"),
    FixedKey(lazy("Blocks"), lazy("Edit the block's field, or insert the block from the toolbox"), "Enter"),
    FixedKey(lazy("Blocks"), lazy("Run from the block, or show its value"), "Ctrl+Enter"),
    FixedKey(lazy("Blocks"), lazy("Open the menu of the block or canvas"), "Shift+F10"),
    FixedKey(lazy("Blocks"), lazy("Copy, cut, paste blocks"), "Ctrl+C, Ctrl+X, Ctrl+V"),
    FixedKey(lazy("Blocks"), lazy("Add the block and all blocks below it to the backpack"), "Ctrl+Shift+P"),
    FixedKey(lazy("Blocks"), lazy("Select all blocks and notes"), "Ctrl+A"),
    FixedKey(lazy("Blocks"), lazy("Duplicate block"), "Ctrl+D"),
    FixedKey(lazy("Blocks"), lazy("Delete block"), "Delete, Backspace"),
    FixedKey(lazy("Blocks"), lazy("Move the block with the arrow keys; Enter places it"), "Ctrl+M"),
    FixedKey(lazy("Blocks"), lazy("Move the block with all blocks below it"), "Ctrl+Shift+M"),
    FixedKey(lazy("Blocks"), lazy("Detach the block from its stack"), "Ctrl+Shift+X"),
    FixedKey(lazy("Blocks"), lazy("Disable or enable the block"), "Ctrl+E"),
    FixedKey(lazy("Blocks"), lazy("Clean up the canvas"), "Ctrl+L"),
    FixedKey(lazy("Blocks"), lazy("Go to the toolbox"), "Ctrl+B"),
    FixedKey(lazy("Blocks"), lazy("Go to the canvas"), "Ctrl+Shift+B"),
    FixedKey(lazy("Blocks"), lazy("Go to the next or previous stack"), "Alt+Down, Alt+Up"),
    FixedKey(lazy("Blocks"), lazy("Show a short description of the block"), "Ctrl+J"),
    FixedKey(lazy("Blocks"), lazy("Read the block or its surroundings aloud"), "Alt+I, Alt+Shift+I"),
    FixedKey(lazy("Room"), lazy("Next robot or object"), "Tab"),
    FixedKey(lazy("Room"), lazy("Move the selection; with Shift in small steps"), "Up, Down, Left, Right"),
    FixedKey(lazy("Room"), lazy("Touch the robot's head or bumper"), "Space"),
    FixedKey(lazy("Room"), lazy("Touch head, left hand, right hand"), "H, L, R"),
    FixedKey(lazy("Room"), lazy("Remove the selected object"), "Delete"),
    FixedKey(lazy("Room"), lazy("Open the menu of the room or selection"), "Shift+F10"),
    FixedKey(lazy("Palette"), lazy("Choose"), "Up, Down"),
    FixedKey(lazy("Palette"), lazy("Activate"), "Enter"),
    FixedKey(lazy("Palette"), lazy("Change shortcut"), "Ctrl+Enter"),
)


def normalize_key(key: str) -> str:
    """Convert a shortcut to Qt's portable text format; return "" if it is invalid."""
    return QKeySequence(key).toString(QKeySequence.SequenceFormat.PortableText)


def format_key(combination: QKeyCombination) -> str:
    """Return a key combination in Qt's portable text format."""
    return QKeySequence(combination).toString(QKeySequence.SequenceFormat.PortableText)


def _without_keys(command: Command[Any, Any], taken: set[str], platform: str) -> Command[Any, Any]:
    keys = command.default_keys(platform)
    free_keys = tuple(key for key in keys if normalize_key(key) not in taken)
    return command if free_keys == keys else replace(command, keys=free_keys, mac_keys=())


class Shortcuts(QObject):
    """Current shortcuts of all commands. `changed` is emitted when any of them changes."""

    changed = Signal()

    def __init__(
        self,
        settings: Settings,
        report_error: Callable[[str], object],
        commands: Sequence[Command[Any, Any]],
        *,
        platform: str = sys.platform,
    ) -> None:
        # `report_error` is called with a message if the shortcuts can't be saved; `platform` is a
        # `sys.platform`.
        super().__init__()
        self._settings, self._report_error, self._platform = settings, report_error, platform
        self.commands: Mapping[str, Command[Any, Any]] = {command.id: command for command in commands}
        self._custom_shortcuts: dict[str, tuple[str, ...]] = {}
        self._unused_shortcuts = self._read()  # of commands that don't exist, such as those of removed panels
        self._use_saved()

    def set_commands(self, commands: Sequence[Command[Any, Any]]) -> None:
        """Set the commands in the order of the list.

        New commands lose those default shortcuts that are the defaults of existing ones.
        """
        taken = {key for name in self.commands for key in self.default_shortcuts(name)}
        known = self.commands
        self.commands = {
            each.id: known.get(each.id) or _without_keys(each, taken, self._platform) for each in commands
        }
        self._use_saved()
        self.changed.emit()

    def _use_saved(self) -> None:
        for name in self._unused_shortcuts.keys() & self.commands.keys():
            self._custom_shortcuts[name] = self._unused_shortcuts.pop(name)

    def _read(self) -> dict[str, tuple[str, ...]]:
        shortcuts: dict[str, tuple[str, ...]] = {}
        for name, keys in self._settings.shortcuts.items():
            if isinstance(keys, list):
                valid_keys = tuple(
                    normalize_key(key) for key in keys if isinstance(key, str) and normalize_key(key)
                )
                shortcuts[name] = valid_keys
        return shortcuts

    def default_shortcuts(self, name: str) -> tuple[str, ...]:
        """Return the default shortcuts of a command.

        Raises:
            UnknownCommandError: The name is unknown.
        """
        command = self.commands.get(name)
        if command is None:
            raise UnknownCommandError(name)
        return tuple(normalize_key(key) for key in command.default_keys(self._platform))

    def shortcuts_of(self, name: str) -> tuple[str, ...]:
        """Return the current shortcuts of a command; menus show the first one.

        Default shortcuts that the user has assigned to other commands are omitted. The first shortcut of
        Stop is always F12.
        """
        custom_keys = self._custom_shortcuts.get(name)
        keys = self.default_shortcuts(name) if custom_keys is None else custom_keys
        if custom_keys is None or name == STOP_COMMAND:
            others = [each for other, each in self._custom_shortcuts.items() if other != name]
            keys = tuple(key for key in keys if not any(key in other_keys for other_keys in others))
        if name == STOP_COMMAND:
            return (STOP_KEY, *(key for key in keys if key != STOP_KEY))
        return tuple(key for key in keys if key != STOP_KEY)

    def first_shortcut(self, name: str) -> str:
        """Return the first shortcut of a command, or "" if it has none."""
        return next(iter(self.shortcuts_of(name)), "")

    def is_customised(self, name: str) -> bool:
        """Return True if the shortcuts of a command differ from the defaults."""
        return self.shortcuts_of(name) != self.default_shortcuts(name)

    def command_for(self, key: str) -> str:
        """Return the name of the command to which a shortcut is assigned, or ""."""
        return next((name for name in self.commands if normalize_key(key) in self.shortcuts_of(name)), "")

    def rejection_reason(self, name: str, combination: QKeyCombination) -> str:
        """Return the reason why a shortcut can't be assigned to a command, as a sentence, or "" if it can."""
        key = format_key(combination)
        if key == STOP_KEY:
            return "" if name == STOP_COMMAND else _("F12 always triggers Stop and can't be changed.")
        modifiers = combination.keyboardModifiers() & MODIFIERS
        if not modifiers and combination.key() not in FUNCTION_KEYS:
            return _(MODIFIER_REQUIRED_TEXT)
        for fixed_key in FIXED_KEYS:
            is_own_default = key in self.default_shortcuts(
                name
            )  # Ctrl+F is "find" both in the Inspector and in the blocks
            if (
                key in [normalize_key(each) for each in fixed_key.keys.split(", ")]
                and modifiers
                and not is_own_default
            ):
                return _("{key} is reserved for “{command}” ({place}).").format(
                    key=shortcut_text(key), command=_(fixed_key.label), place=_(fixed_key.scope)
                )
        return ""

    def assign(self, name: str, key: str) -> None:
        """Replace the shortcuts of a command by one, which is removed from other commands.

        Stop keeps F12 in addition.

        Args:
            name: Name of the command.
            key: New shortcut; "" removes all.
        """
        key, owner = normalize_key(key), self.command_for(key)
        if owner and owner != name:
            self._custom_shortcuts[owner] = tuple(each for each in self.shortcuts_of(owner) if each != key)
        self._custom_shortcuts[name] = (key,) if key else ()
        self._save()

    def swap(self, name: str, key: str) -> None:
        """Assign a shortcut to a command, and the command's first shortcut to the one that had it.

        Both commands lose their other shortcuts. F12 stays assigned to Stop.
        """
        owner, old_key = self.command_for(key), self.first_shortcut(name)
        self._custom_shortcuts[name] = (normalize_key(key),)
        if owner and owner != name:
            self._custom_shortcuts[owner] = (old_key,) if old_key and old_key != STOP_KEY else ()
        self._save()

    def reset(self, name: str) -> None:
        """Restore the default shortcuts of a command and remove them from other commands.

        Another command that loses its only shortcut gets its default back, unless that is assigned to a
        third command. After a swap, therefore, no command is left without a shortcut.
        """
        self._custom_shortcuts.pop(name, None)
        for key in self.default_shortcuts(name):
            for other in [
                each
                for each in self._custom_shortcuts
                if each != name and key in self._custom_shortcuts[each]
            ]:
                self._custom_shortcuts[other] = tuple(
                    each for each in self._custom_shortcuts[other] if each != key
                )
                if not self._custom_shortcuts[other] and not any(
                    map(self.command_for, self.default_shortcuts(other))
                ):
                    del self._custom_shortcuts[other]
        self._save()

    def reset_all(self) -> None:
        """Restore the default shortcuts of all commands."""
        self._custom_shortcuts, self._unused_shortcuts = {}, {}
        self._save()

    def _save(self) -> None:
        for name in [name for name in self._custom_shortcuts if not self.is_customised(name)]:
            del self._custom_shortcuts[name]
        try:
            shortcuts = {**self._unused_shortcuts, **self._custom_shortcuts}
            self._settings.shortcuts = {name: list(keys) for name, keys in shortcuts.items()}
        except SettingsError as error:
            self._report_error(str(error))
        self.changed.emit()

    def update_tooltips(self) -> None:
        """Update the shortcuts in the tooltips of all widgets with the property ``command``."""
        for widget in QApplication.allWidgets():
            command = widget.property("command")
            if isinstance(command, str) and command in self.commands:
                text = _(self.commands[command].tip)
                # the tooltip is the only text of an icon button
                if not text or isinstance(widget, IconButton):
                    text = widget.accessibleName()
                widget.setToolTip(plain.tip(tip_with_key(text, ", ".join(self.shortcuts_of(command)))))
