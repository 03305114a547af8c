"""What a command is: one row of the table of commands."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from nep.i18n import _

T = TypeVar("T")


class UnknownCommandError(LookupError):
    """Somebody asked for a command that is not in the table: a mistake in a program, never a person's."""

    def __init__(self, name: str) -> None:
        super().__init__(f"no command '{name}'; the commands are in app.ui.shell.commands.table")
        self.name = name


def _always(_do: object) -> str:
    return ""


@dataclass(frozen=True)
class Command(Generic[T]):
    """One command. ``run`` does it; ``why_not`` says in a short sentence why it can't be done now, else "".

    ``text``, ``menu`` and ``tip`` are marked with `lazy`; people read `words`, in which ``number`` fills the
    hole of that name, and ``menu`` and ``tip`` by `_`. ``tip`` is what a button of it says under the mouse.
    ``group`` makes it one of several choices; ``above`` puts a line over it in its ``menu``; without a menu
    it is only in the palette and among the shortcuts, if it is there. ``under`` names a menu in its ``menu``
    that has it, also marked with `lazy`. ``check`` makes it something that is on or off, ``everywhere`` a key
    that works in all windows. ``shows`` is a key that stands in the menu and that whoever has the keyboard
    hears itself, as text fields hear Ctrl+C. ``mac`` are the keys of a Mac in place of ``keys``: Ctrl is
    written there for Cmd, Meta for the key that says Ctrl.
    """

    id: str
    text: str
    run: Callable[[T], object]
    menu: str = ""
    keys: tuple[str, ...] = ()
    icon: str | None = None
    tip: str = ""
    under: str = ""
    group: str = ""
    above: bool = False
    everywhere: bool = False
    check: bool = False
    mac: tuple[str, ...] = ()
    in_palette: bool = True
    in_shortcuts: bool = True
    why_not: Callable[[T], str] = _always
    number: int | None = None
    shows: str = ""

    @property
    def words(self) -> str:
        """What people read of it: its text, in their language."""
        return _(self.text).format(number=self.number)

    def keys_at_first(self, platform: str = sys.platform) -> tuple[str, ...]:
        """The keys at first, the one that stands in menus before the others."""
        return self.mac if platform == "darwin" and self.mac else self.keys


@dataclass(frozen=True)
class ArgumentCommand(Generic[T]):
    """A command about one thing, asked for as ``id:argument``: ``inspect:/faces``.

    ``run`` gets the text behind the colon and says whether there was such a thing; ValueError for a text that
    can be none.
    """

    id: str
    run: Callable[[T, str], bool]
