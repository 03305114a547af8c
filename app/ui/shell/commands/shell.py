"""What commands, menus and the palette may use of the window that they belong to."""

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

START = "start"  # what `Shell.showing` says of the start page


class Shell(Protocol):
    """What commands, menus and the palette use of the window: what shows, and how to show something else."""

    theme: Theme
    state: WindowState
    saved_layouts: SavedLayouts
    panels: Mapping[str, Panel]
    panel_focus: PanelFocus

    @property
    def examples(self) -> Sequence[Example]:
        """The examples of the start page."""

    @property
    def menu_bar(self) -> QMenuBar:
        """Where the menus are."""

    @property
    def surface(self) -> QWidget:
        """The widget over which sheets and menus open, and in which keys work."""

    @property
    def showing(self) -> str:
        """The name of the layout that shows, or `START`."""

    @property
    def bench(self) -> Workbench | None:
        """The workbench that shows; None on the start page."""

    @property
    def say(self) -> ShowToast:
        """Says for some seconds what the person just did."""

    def complain(self, sentence: str) -> None:
        """Say in the Console what went wrong and needs nobody's hand."""

    def editor(self) -> object:
        """The panel of behaviours; None until it was first shown."""

    @property
    def left(self) -> str:
        """The layout that leads back from the start page to the work; "" when there is none."""

    def show_start(self) -> None:
        """Show the start page."""

    def show_examples(self) -> None:
        """Show all examples of the start page, and give the keyboard to the first."""

    def show_recent(self) -> None:
        """Show on the start page which files were opened lately."""

    def show_layout(self, name: str) -> Workbench:
        """Show a layout, as it was left."""

    def open_panel(self, name: str) -> Dock | None:
        """Show a panel; None when there is no such panel."""

    def open_topic(self, topic: str) -> None:
        """Show a topic in the open panel that fits it best."""

    def close(self) -> bool:
        """Close the window; whether it did."""

    @property
    def can_restart(self) -> bool:
        """Whether Studio can start again by itself, with everything that is open."""

    def restart(self) -> str:
        """Close the window and start Studio again; why that can't be done now, "" when it is done."""
