"""Interface of the window for commands, menus and the palette."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from PySide6.QtWidgets import QMenuBar, QWidget

from app.ui.panels.base import Panel, ShowToast
from app.ui.shell.docking.dock import Dock
from app.ui.shell.docking.saved_layouts import SavedLayouts
from app.ui.shell.docking.workbench import Workbench
from app.ui.shell.keyboard import PanelFocus
from app.ui.shell.start_page.page import Example
from app.ui.shell.window_state import WindowState
from app.ui.theme.theme import Theme

START_PAGE = "start"  # value of `Shell.showing` for the start page


class Shell(Protocol):
    """Window as seen by commands, menus and the palette."""

    theme: Theme
    state: WindowState
    saved_layouts: SavedLayouts
    panels: Mapping[str, Panel]
    panel_focus: PanelFocus

    @property
    def examples(self) -> Sequence[Example]:
        """Examples on the start page."""

    @property
    def menu_bar(self) -> QMenuBar:
        """Menu bar of the window."""

    @property
    def surface(self) -> QWidget:
        """Parent widget of sheets and menus, in which shortcuts work."""

    @property
    def current_layout(self) -> str:
        """Name of the current layout, or `START`."""

    @property
    def bench(self) -> Workbench | None:
        """Current workbench, or None on the start page."""

    @property
    def show_toast(self) -> ShowToast:
        """Function that shows a toast."""

    def log_problem(self, sentence: str) -> None:
        """Log a problem that needs no action in the Console."""

    def editor(self) -> object:
        """Return the panel of behaviours, or None before it is first shown."""

    @property
    def left(self) -> str:
        """Name of the layout to return to from the start page, or ""."""

    def show_start(self) -> None:
        """Show the start page."""

    def show_examples(self) -> None:
        """Show all examples on the start page and focus the first one."""

    def show_recent(self) -> None:
        """Show the recent files on the start page."""

    def show_layout(self, name: str) -> Workbench:
        """Show a layout in its last state and return its workbench."""

    def open_panel(self, name: str) -> Dock | None:
        """Show a panel; return None if the name is unknown."""

    def open_topic(self, topic: str) -> None:
        """Show a topic in the open panel that fits its type best."""

    def close(self) -> bool:
        """Close the window. Return False if it stays open."""

    @property
    def can_restart(self) -> bool:
        """True if Studio can restart and reopen all documents."""

    def restart(self) -> str:
        """Close the window and restart Studio. Return the reason if that is impossible, or ""."""
