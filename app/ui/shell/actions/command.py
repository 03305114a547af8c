"""Command of the window, as a row in the command table."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from nep.i18n import _

T = TypeVar("T")


class UnknownCommandError(LookupError):
    """Raised for a command that isn't in the table, which is a programming error."""

    def __init__(self, name: str) -> None:
        super().__init__(f"no command '{name}'; the commands are in app.ui.shell.commands.table")
        self.name = name


def _always_available(_do: object) -> str:
    return ""


@dataclass(frozen=True)
class Command(Generic[T]):
    """Action of the window with a text, keys and a place in a menu.

    A command without a menu appears only in the palette (``in_palette``) and in the list of shortcuts
    (``in_shortcuts``).

    Attributes:
        id: Unique name, such as ``file.open``.
        text, menu, tip, under: Wrapped in `lazy` and translated when shown; `words` is the translated text.
        run: Executes the command.
        why_not: Returns a short phrase if the command is unavailable, else "".
        tip: Tooltip of buttons for the command.
        under: Submenu of ``menu`` that contains the command.
        group: Name of the exclusive group that the command belongs to.
        above: True to insert a separator above the command in the menu.
        everywhere: True if the key works in all windows.
        check: True if the action is checkable.
        mac: Keys on macOS in place of ``keys``. As in Qt, Ctrl stands for Cmd and Meta for Ctrl.
        number: Value for the placeholder ``number`` of ``text``.
        shows: Key shown in the menu but handled by the focused widget, as Ctrl+C is by text fields.
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
        """Return the default keys on a platform. The first one is shown in menus."""
        return self.mac_keys if platform == "darwin" and self.mac_keys else self.keys


@dataclass(frozen=True)
class ArgumentCommand(Generic[T]):
    """Command with an argument, written ``id:argument``, such as ``inspect:/faces``.

    ``run`` gets the text after the colon. It returns False if the argument refers to nothing, and raises
    ValueError if the argument is invalid.
    """

    id: str
    run: Callable[[T, str], bool]
