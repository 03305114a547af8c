"""Commands and intent handlers that panels and the window contribute, as data."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from app.intents import Intent
from nep.i18n import _

T = TypeVar("T")
S = TypeVar("S")
I = TypeVar("I", bound=Intent)  # noqa: E741 - the usual name of a type of intents


class UnknownCommandError(LookupError):
    """Raised for a command or an intent without a handler, which is a programming error."""

    def __init__(self, name: str) -> None:
        super().__init__(
            f"no command '{name}'; commands are in app.ui.shell.commands.table and in descriptions of panels"
        )
        self.name = name


def _always_available(_state: object) -> str:
    return ""


@dataclass(frozen=True)
class Command(Generic[T, S]):
    """Action of the window or of a panel with a text, shortcuts and a place in a menu.

    The texts ``text``, ``menu``, ``tip`` and ``submenu`` are wrapped in `lazy` and translated when they
    are shown. A command without a menu appears only in the palette and in the list of shortcuts.

    Attributes:
        id: Unique name, such as ``file.open``; settings contain it with the user's shortcuts.
        text: Text of the menu entry.
        run: Executes the command; receives the panel's widget, or the handlers of the window.
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
        disabled_reason: Returns a short phrase if the command is unavailable, else ""; receives the
            `PanelContext`, or the handlers of the window.
        number: Value for the placeholder ``{number}`` in ``text``.
        displayed_key: Shortcut that the menu only shows, because the focused widget handles it, such as
            Ctrl+C in text fields.
        after: Id of the command below which a command of a panel is listed; "" lists it below the
            previous command of the panel, or last.
        opens_panel: True if a command of a panel shows the panel; False runs it only if the panel exists.
        keys_layout: Layout in which the shortcuts work, because other panels use the keys; "" for all.
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
    disabled_reason: Callable[[S], str] = _always_available
    number: int | None = None
    displayed_key: str = ""
    after: str = ""
    opens_panel: bool = True
    keys_layout: str = ""

    @property
    def menu_path(self) -> str:
        """Name of the menu, with a slash before a submenu, such as "View/Record"."""
        return f"{self.menu}/{self.submenu}" if self.submenu else self.menu

    @property
    def label(self) -> str:
        """Translated text of the command."""
        return _(self.text).format(number=self.number)

    def default_keys(self, platform: str = sys.platform) -> tuple[str, ...]:
        """Return the default shortcuts on a platform, a value of `sys.platform`; menus show the first one."""
        return self.mac_keys if platform == "darwin" and self.mac_keys else self.keys


@dataclass(frozen=True)
class IntentHandler(Generic[T, I]):
    """Handler of one class of intents.

    Attributes:
        kind: Class of the intents.
        run: Carries out an intent; receives the panel's widget, or the handlers of the window. Returns
            False if the object that the intent names doesn't exist.
        opens_panel: True if the intent shows the panel; False carries it out only if the panel exists.
    """

    kind: type[I]
    run: Callable[[T, I], object]
    opens_panel: bool = True
