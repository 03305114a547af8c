"""Interface of the window for commands, menus and the palette."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from PySide6.QtWidgets import QMenuBar, QWidget

from app.intents import Intent
from app.ui.panels.base import Panel, ShowToast
from app.ui.shell.docking.dock import Dock
from app.ui.shell.docking.saved_layouts import SavedLayouts
from app.ui.shell.docking.workbench import Workbench
from app.ui.shell.keyboard import PanelFocus
from app.ui.shell.start_page.page import Example
from app.ui.shell.window_state import WindowState
from app.ui.theme.theme import Theme

START_PAGE = "start"  # value of `Shell.current_layout` for the start page


class Shell(Protocol):
    """Interface of the main window that commands, menus and the palette use.

    Attributes:
        theme: Theme of the window.
        state: Saved state of the window.
        saved_layouts: Saved arrangements of the layouts.
        panels: Descriptions of the available panels, by name.
        panel_focus: Keyboard navigation between panels.
    """

    theme: Theme
    state: WindowState
    saved_layouts: SavedLayouts
    panels: Mapping[str, Panel]
    panel_focus: PanelFocus

    @property
    def examples(self) -> Sequence[Example]:
        """Examples that the start page offers."""

    @property
    def menu_bar(self) -> QMenuBar:
        """Menu bar of the window."""

    @property
    def surface(self) -> QWidget:
        """Parent widget of sheets and menus, and context of the shortcuts."""

    @property
    def current_layout(self) -> str:
        """Name of the current layout, or `START_PAGE` for the start page."""

    @property
    def bench(self) -> Workbench | None:
        """Current workbench, or None on the start page."""

    @property
    def show_toast(self) -> ShowToast:
        """Function that shows a toast, see `Toast`."""

    def log_problem(self, message: str) -> None:
        """Log a sentence to the Console, about a problem that requires no action."""

    def request(self, intent: Intent) -> bool:
        """Carry out an intent; return False if the object that it names doesn't exist."""

    def flush(self, callback: Callable[[], None]) -> None:
        """Apply the pending edit of the block editor to its document, then call `callback`."""

    def show_current_behaviour(self) -> None:
        """Show the current behaviour in the block editor without waiting for the next tick."""

    @property
    def return_layout(self) -> str:
        """Name of the layout to return to from the start page, or "" if there is none."""

    def show_start(self) -> None:
        """Show the start page."""

    def show_examples(self) -> None:
        """Show all examples on the start page and focus the first one."""

    def show_recent(self) -> None:
        """Update the recent files on the start page."""

    def show_layout(self, name: str) -> Workbench:
        """Show a layout with its last arrangement, and return its workbench."""

    def open_panel(self, name: str) -> Dock | None:
        """Show a panel in the current layout; return None if the panel isn't available."""

    def open_home(self, panel: Panel) -> Dock | None:
        """Show a panel in a layout in which it has a place; return None if the panel isn't available."""

    def find_dock(self, name: str) -> Dock | None:
        """Return the dock of a panel that was created, preferably in the current layout, or None."""

    def open_topic(self, topic: str) -> None:
        """Show a topic in the open panel that suits its type best."""

    def close(self) -> bool:
        """Close the window; return False if it stays open."""

    @property
    def can_restart(self) -> bool:
        """True if Studio can restart and reopen all documents."""

    def restart(self) -> str:
        """Close the window and restart Studio.

        Returns:
            The reason why a restart is impossible, or "".
        """
