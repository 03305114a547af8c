"""Keyboard shortcuts: defaults of the command table, changes by the user, and fixed keys.

The settings store only the differences from the table, under "shortcuts". F12 is always Stop. Stop also has a
second key, Ctrl+. by default (Cmd+. on macOS, where F12 changes the volume).
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QKeyCombination, QObject, Qt, Signal
from PySide6.QtGui import QKeySequence
from PySide6.QtWidgets import QApplication

from app.core.storage.settings import Settings
from app.errors import SettingsError
from app.ui.shell.actions.actions import STOP
from app.ui.shell.actions.command import Command, UnknownCommandError
from app.ui.text import plain
from app.ui.text.numbers import spoken_key, tip_with_key
from app.ui.widgets import IconButton
from nep.i18n import _, lazy

STOP_KEY = "F12"
NEEDS_MODIFIER = lazy(
    "A single letter can't be a shortcut. Combine it with Ctrl or Alt, or use a function key."
)
FUNCTION_KEYS = range(Qt.Key.Key_F1, Qt.Key.Key_F35 + 1)
MODIFIERS = (
    Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.AltModifier | Qt.KeyboardModifier.MetaModifier
)


@dataclass(frozen=True, slots=True)
class Fixed:
    """Keys that can't be changed, with the place where they work and their function (both `lazy`)."""

    place: str
    words: str
    key: str


FIXED: tuple[Fixed, ...] = (
    Fixed(lazy("Everywhere"), lazy("Close the palette or a dialog, or leave a field"), "Esc"),
    Fixed(lazy("Everywhere"), lazy("Next control"), "Tab"),
    Fixed(lazy("Everywhere"), lazy("Previous control"), "Shift+Tab"),
    Fixed(lazy("Everywhere"), lazy("Press the selected button"), "Space"),
    Fixed(lazy("Tables and trees"), lazy("Go to the filter"), "/"),
    Fixed(lazy("Tables and trees"), lazy("Previous or next row"), "Up, Down"),
    Fixed(lazy("Tables and trees"), lazy("Open row"), "Enter"),
    Fixed(lazy("Tables and trees"), lazy("Expand or collapse"), "Right, Left"),
    Fixed(lazy("Inspector"), lazy("Find a key or value"), "Ctrl+F"),
    Fixed(lazy("Inspector"), lazy("Copy value"), "Ctrl+C"),
    Fixed(lazy("Inspector"), lazy("Copy path"), "Ctrl+Shift+C"),
    Fixed(lazy("Inspector"), lazy("Plot the value"), "Ctrl+Shift+L"),
    Fixed(lazy("Plot"), lazy("Add a curve"), "C"),
    Fixed(lazy("Plot"), lazy("Pause or resume"), "Space"),
    Fixed(lazy("Plot"), lazy("Show or hide A and B"), "M"),
    Fixed(lazy("Plot"), lazy("Place A or B at the mouse pointer"), "A, B"),
    Fixed(lazy("Plot"), lazy("Move A or B by one value, with Shift by ten"), "Left, Right"),
    Fixed(lazy("Plot"), lazy("Shorter, longer, entire time range"), "+, -, 0"),
    Fixed(lazy("Plot"), lazy("Show or hide the selected curve"), "H"),
    Fixed(lazy("Plot"), lazy("Remove the selected curve"), "Delete"),
    Fixed(lazy("Timeline"), lazy("Play or pause"), "Space"),
    Fixed(
        lazy("Timeline"),
        lazy("Previous or next message of the selected topic; with Shift one second"),
        "Left, Right",
    ),
    Fixed(lazy("Timeline"), lazy("Previous or next bookmark"), "Ctrl+Left, Ctrl+Right"),
    Fixed(lazy("Timeline"), lazy("Start and end"), "Home, End"),
    Fixed(lazy("Timeline"), lazy("Set the start or end of the loop here"), "[, ]"),
    Fixed(lazy("Timeline"), lazy("Turn looping on or off"), "L"),
    Fixed(lazy("Timeline"), lazy("Add bookmark"), "B"),
    Fixed(lazy("Timeline"), lazy("Shorter, longer, entire time range"), "+, -, 0"),
    Fixed(lazy("Sliders"), lazy("One step"), "Left, Right"),
    Fixed(lazy("Sliders"), lazy("Ten steps"), "PgUp, PgDown"),
    Fixed(lazy("Sliders"), lazy("Minimum and maximum"), "Home, End"),
    Fixed(lazy("Blocks"), lazy("Move between blocks and slots"), "Up, Down, Left, Right"),
    Fixed(lazy("Blocks"), lazy("Edit the block's field, or insert the block from the toolbox"), "Enter"),
    Fixed(lazy("Blocks"), lazy("Run from the block, or show its value"), "Ctrl+Enter"),
    Fixed(lazy("Blocks"), lazy("Open the menu of the block or canvas"), "Shift+F10"),
    Fixed(lazy("Blocks"), lazy("Copy, cut, paste blocks"), "Ctrl+C, Ctrl+X, Ctrl+V"),
    Fixed(lazy("Blocks"), lazy("Add the block and all blocks below it to the backpack"), "Ctrl+Shift+P"),
    Fixed(lazy("Blocks"), lazy("Select all blocks and notes"), "Ctrl+A"),
    Fixed(lazy("Blocks"), lazy("Duplicate block"), "Ctrl+D"),
    Fixed(lazy("Blocks"), lazy("Delete block"), "Delete, Backspace"),
    Fixed(lazy("Blocks"), lazy("Move the block with the arrow keys; Enter places it"), "Ctrl+M"),
    Fixed(lazy("Blocks"), lazy("Move the block with all blocks below it"), "Ctrl+Shift+M"),
    Fixed(lazy("Blocks"), lazy("Detach the block from its stack"), "Ctrl+Shift+X"),
    Fixed(lazy("Blocks"), lazy("Disable or enable the block"), "Ctrl+E"),
    Fixed(lazy("Blocks"), lazy("Clean up the canvas"), "Ctrl+L"),
    Fixed(lazy("Blocks"), lazy("Go to the toolbox"), "Ctrl+B"),
    Fixed(lazy("Blocks"), lazy("Go to the canvas"), "Ctrl+Shift+B"),
    Fixed(lazy("Blocks"), lazy("Go to the next or previous stack"), "Alt+Down, Alt+Up"),
    Fixed(lazy("Blocks"), lazy("Show a short description of the block"), "Ctrl+J"),
    Fixed(lazy("Blocks"), lazy("Read the block or its surroundings aloud"), "Alt+I, Alt+Shift+I"),
    Fixed(lazy("Room"), lazy("Next robot or object"), "Tab"),
    Fixed(lazy("Room"), lazy("Move the selection; with Shift in small steps"), "Up, Down, Left, Right"),
    Fixed(lazy("Room"), lazy("Touch the robot's head or bumper"), "Space"),
    Fixed(lazy("Room"), lazy("Touch head, left hand, right hand"), "H, L, R"),
    Fixed(lazy("Room"), lazy("Remove the selected object"), "Delete"),
    Fixed(lazy("Room"), lazy("Open the menu of the room or selection"), "Shift+F10"),
    Fixed(lazy("Palette"), lazy("Choose"), "Up, Down"),
    Fixed(lazy("Palette"), lazy("Activate"), "Enter"),
    Fixed(lazy("Palette"), lazy("Change shortcut"), "Ctrl+Enter"),
)


def normal(key: str) -> str:
    """Convert a key to Qt's portable spelling for comparison and storage; "" if it is invalid."""
    return QKeySequence(key).toString(QKeySequence.SequenceFormat.PortableText)


def key_of(pressed: QKeyCombination) -> str:
    """Return the key of a key press in Qt's portable spelling."""
    return QKeySequence(pressed).toString(QKeySequence.SequenceFormat.PortableText)


class Shortcuts(QObject):
    """Current keys of all commands; emits `changed` when any of them changes."""

    changed = Signal()

    def __init__(
        self,
        settings: Settings,
        complain: Callable[[str], object],
        commands: Sequence[Command[Any]],
        *,
        platform: str = sys.platform,
    ) -> None:
        # `complain` is called with a sentence if the shortcuts can't be saved; `platform` is a
        # `sys.platform`.
        super().__init__()
        self._settings, self._complain, self._platform = settings, complain, platform
        self.commands: Mapping[str, Command[Any]] = {command.id: command for command in commands}
        self._own = self._read()

    def _read(self) -> dict[str, tuple[str, ...]]:
        kept: dict[str, object] = self._settings.get("shortcuts", {})
        found: dict[str, tuple[str, ...]] = {}
        for name, keys in kept.items():
            if name in self.commands and isinstance(keys, list):
                good = tuple(normal(key) for key in keys if isinstance(key, str) and normal(key))
                found[name] = good
        return found

    def default(self, name: str) -> tuple[str, ...]:
        """Return the default keys of a command.

        Raises:
            UnknownCommandError: The name is unknown.
        """
        command = self.commands.get(name)
        if command is None:
            raise UnknownCommandError(name)
        return tuple(normal(key) for key in command.keys_at_first(self._platform))

    def of(self, name: str) -> tuple[str, ...]:
        """Return the current keys of a command. The first one is shown in menus and tooltips."""
        keys = self._own.get(name, self.default(name))
        if name == STOP:
            given = {key for other, own in self._own.items() if other != STOP for key in own}
            return (STOP_KEY, *(key for key in keys if key != STOP_KEY and key not in given))
        return tuple(key for key in keys if key != STOP_KEY)

    def first(self, name: str) -> str:
        """Return the first key of a command, or ""."""
        return next(iter(self.of(name)), "")

    def own(self, name: str) -> bool:
        """Return True if the keys of a command differ from the defaults."""
        return self.of(name) != self.default(name)

    def holder(self, key: str) -> str:
        """Return the name of the command that has a key, or ""."""
        return next((name for name in self.commands if normal(key) in self.of(name)), "")

    def refusal(self, name: str, pressed: QKeyCombination) -> str:
        """Return the reason why a command can't have a key, as a sentence, or "" if it can."""
        key = key_of(pressed)
        if key == STOP_KEY:
            return "" if name == STOP else _("F12 always stops and can't be changed.")
        held = pressed.keyboardModifiers() & MODIFIERS
        if not held and pressed.key() not in FUNCTION_KEYS:
            return _(NEEDS_MODIFIER)
        for fixed in FIXED:
            own = key in self.default(name)  # Ctrl+F is "find" both in the Inspector and in the blocks
            if key in [normal(each) for each in fixed.key.split(", ")] and held and not own:
                return _("{key} is reserved for “{command}” ({place}).").format(
                    key=spoken_key(key), command=_(fixed.words), place=_(fixed.place)
                )
        return ""

    def give(self, name: str, key: str) -> None:
        """Replace the keys of a command by one key, and remove that key from other commands.

        Stop gets the key in addition to F12.
        """
        key, holder = normal(key), self.holder(key)
        if holder and holder != name:
            self._own[holder] = tuple(each for each in self.of(holder) if each != key)
        self._own[name] = (key,) if key else ()
        self._keep()

    def swap(self, name: str, key: str) -> None:
        """Assign a key to a command, and the command's first key to the previous holder."""
        holder, before = self.holder(key), self.first(name)
        self._own[name] = (normal(key),)
        if holder and holder != name:
            self._own[holder] = (before,) if before and before != STOP_KEY else ()
        self._keep()

    def reset(self, name: str) -> None:
        """Restore the default keys of a command and remove them from commands that have taken them.

        Each such command gets its own default key back unless that is taken, so that no command is left
        without a key after a swap.
        """
        self._own.pop(name, None)
        for key in self.default(name):
            for other in [each for each in self._own if each != name and key in self._own[each]]:
                self._own[other] = tuple(each for each in self._own[other] if each != key)
                if not self._own[other] and not any(map(self.holder, self.default(other))):
                    del self._own[other]
        self._keep()

    def reset_all(self) -> None:
        """Restore the default keys of all commands."""
        self._own = {}
        self._keep()

    def _keep(self) -> None:
        for name in [name for name in self._own if not self.own(name)]:
            del self._own[name]
        try:
            self._settings.set("shortcuts", {name: list(keys) for name, keys in self._own.items()})
        except SettingsError as error:
            self._complain(str(error))
        self.changed.emit()

    def update_tooltips(self) -> None:
        """Update the keys in the tooltips of all buttons with the property ``command``."""
        for widget in QApplication.allWidgets():
            command = widget.property("command")
            if isinstance(command, str):
                said = _(self.commands[command].tip)
                # the tooltip is the only text of an icon button
                if not said or isinstance(widget, IconButton):
                    said = widget.accessibleName()
                widget.setToolTip(plain.tip(tip_with_key(said, ", ".join(self.of(command)))))
