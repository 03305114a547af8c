"""Tests of switching layouts, panels and focus in every order without a crash."""

from __future__ import annotations

from itertools import permutations

import pytest
from PySide6.QtCore import QCoreApplication, QEvent
from PySide6.QtWidgets import QStackedWidget

from app.ui.panels.base import Panel, PanelWidget
from app.ui.panels.home import RowHome
from app.ui.panels.registry import PanelRegistry
from app.ui.shell.docking.dock import Dock
from app.ui.shell.docking.layouts import LAYOUTS
from app.ui.shell.docking.workbench import Workbench
from app.ui.widgets.keyboard import tab_stops
from tests.ui.fakes import Session
from tests.ui.panel_case import Window

# Stands in for the blocks panel before its web view exists: nothing in it takes the focus.
HOME = (RowHome("behaviour", 0, 0, 626),)
BLOCKS = Panel(
    "behaviour", "Behaviour", "blocks", (), lambda context: PanelWidget(context, "Behaviour"), home=HOME
)
STOPS = 3  # number of tab stops to check in each panel


class Layouts(QStackedWidget):
    """Stack of the workbenches of all layouts, as in the main window."""

    def __init__(self) -> None:
        super().__init__()
        shell = Window(Session.full())
        self.session = shell.session
        self.panels = {**PanelRegistry(), "behaviour": BLOCKS}
        self.benches = {
            layout.name: Workbench(shell.theme, layout, self.panels, shell.context()) for layout in LAYOUTS
        }
        for bench in self.benches.values():
            self.addWidget(bench)
            bench.resize(1440, 800)
            bench.reset_layout()
        self.resize(1440, 800)

    def switch(self, name: str) -> Workbench:
        """Show a layout as the main window does and process deferred events."""
        bench = self.benches[name]
        self.setCurrentWidget(bench)
        bench.focus_main_panel()
        self.settle()
        return bench

    def settle(self) -> None:
        """Process events and deferred deletions, and refresh all workbenches."""
        for _ in range(3):
            QCoreApplication.processEvents()
            QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)
        for bench in self.benches.values():
            bench.refresh()


@pytest.fixture
def layouts(qtbot) -> Layouts:
    made = Layouts()
    qtbot.addWidget(made)
    made.show()
    yield made
    for bench in made.benches.values():
        bench.dispose()


def rest_of(bench: Workbench) -> list[str]:
    """Return the names of the failed docks of a workbench."""
    return [name for name, dock in bench.docks.items() if dock.has_failed]


@pytest.mark.parametrize("order", [*permutations(layout.name for layout in LAYOUTS)])
def test_every_panel_of_one_layout_survives_switching_to_the_other_layout(
    layouts: Layouts, order: tuple[str, ...]
) -> None:
    first, second = order
    for name in layouts.panels:
        bench = layouts.switch(first)
        if (first, name) == ("developer", "behaviour"):
            continue  # covered by its own layout
        dock = bench.open(name)
        assert isinstance(dock, Dock)
        layouts.settle()
        for number in range(STOPS):
            bench.focus_panel(dock)
            stops = list(tab_stops(dock, dock))
            if number < len(stops):
                stops[number].setFocus()
            layouts.switch(second)
            layouts.switch(first)
        dock.close()
        layouts.settle()
    assert not rest_of(layouts.benches[first])
    assert not rest_of(layouts.benches[second])


def test_robot_cards_survive_switching_tabs_and_layouts(layouts: Layouts) -> None:
    bench = layouts.switch("developer")
    dock = bench.open("robots")  # a tab next to Topics
    layouts.settle()
    bench.focus_panel(dock)
    for name in ("topics", "robots", "topics", "robots"):
        bench.focus_panel(bench.docks[name])
        layouts.switch("behaviour")
        layouts.switch("developer")
    dock.resize(dock.width() - 1, dock.height())
    assert dock.panel.cards["turn"].form.isVisibleTo(dock)
    assert not dock.has_failed
