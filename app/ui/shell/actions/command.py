"""Command of the window: one row of the command table."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from nep.i18n import _

T = TypeVar("T")


class UnknownCommandError(LookupError):
    """Raised for the name of a command that doesn't exist, which is a programming error."""

    def __init__(self, name: str) -> None:
        super().__init__(f"no command '{name}'; the commands are in app.ui.shell.commands.table")
        self.name = name


def _always_available(_do: object) -> str:
    return ""


@dataclass(frozen=True)
class Command(Generic[T]):
    """Action of the window with a text, shortcuts and a place in a menu.

    The texts ``text``, ``menu``, ``tip`` and ``submenu`` are wrapped in `lazy` and translated when they
    are shown. A command without a menu appears only in the palette and in the list of shortcuts.

    Attributes:
        id: Unique name, such as ``file.open``.
        text: Text of the menu entry.
        run: Executes the command.
        menu: Menu that contains the command, or "" for none.
        keys: Default shortcuts.
        icon: Name of the icon.
        tip: Tooltip of buttons for the command.
        submenu: Submenu of ``menu`` that contains the command.
        group: Name of the exclusive group to which the command belongs.
        separator_above: True to insert a separator above the command in the menu.
        in_all_windows: True if the shortcuts work in all windows of Studio.
        is_checkable: True if the action is checkable.
        mac_keys: Default shortcuts on macOS if they differ from ``keys``. As in Qt, Ctrl stands for Cmd
            and Meta for Ctrl.
        in_palette: True to list the command in the palette.
        in_shortcuts: True to list the command in the sheet of shortcuts.
        disabled_reason: Returns a short phrase if the command is unavailable, else "".
        number: Value for the placeholder ``{number}`` in ``text``.
        displayed_key: Shortcut that the menu only shows, because the focused widget handles it, such as
            Ctrl+C in text fields.
    """

    id: str
    text: str
    run: Callable[[T], object]
    menu: str = ""
    keys: tuple[str, ...] = ()
    icon: str | None = None
    tip: str = ""
    submenu: str = ""
    group: str = ""
    separator_above: bool = False
    in_all_windows: bool = False
    is_checkable: bool = False
    mac_keys: tuple[str, ...] = ()
    in_palette: bool = True
    in_shortcuts: bool = True
    disabled_reason: Callable[[T], str] = _always_available
    number: int | None = None
    displayed_key: str = ""

    @property
    def label(self) -> str:
        """Translated text of the command."""
        return _(self.text).format(number=self.number)

    def default_keys(self, platform: str = sys.platform) -> tuple[str, ...]:
        """Return the default shortcuts on a platform, a value of `sys.platform`; menus show the first one."""
        return self.mac_keys if platform == "darwin" and self.mac_keys else self.keys


@dataclass(frozen=True)
class ArgumentCommand(Generic[T]):
    """Command with an argument, written ``id:argument``, such as ``inspect:/faces``.

    Attributes:
        id: Name before the colon.
        run: Executes the command with the text after the colon. Returns False if the object that the
            argument names doesn't exist; raises ValueError if the argument is invalid.
    """

    id: str
    run: Callable[[T, str], bool]
