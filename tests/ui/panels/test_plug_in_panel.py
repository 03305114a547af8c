"""Test of a plug-in panel in one file: listed, at home in the layout, with its commands and intents."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path
from textwrap import dedent

import pytest
from PySide6.QtWidgets import QMenu, QMenuBar

from app.core.session import Session
from app.ui.panels.registry import PanelRegistry
from app.ui.shell.main_window import MainWindow
from app.ui.theme.theme import Theme
from tests.ui.shell_parts import PANELS

pytest_plugins = ["tests.ui.shell_fixtures"]

SOURCE = '''
"""A panel that counts its refreshes."""

from __future__ import annotations

from dataclasses import dataclass

from PySide6.QtWidgets import QLabel, QVBoxLayout

from app.intents import Intent
from app.ui.panels.base import Panel, PanelContext, PanelWidget
from app.ui.panels.command import Command, IntentHandler
from app.ui.panels.home import RowHome


@dataclass(frozen=True)
class SetCount(Intent):
    """Set the counter."""

    count: int


class Counter(PanelWidget):
    """Counts."""

    def __init__(self, context: PanelContext) -> None:
        """Start with none."""
        super().__init__(context, "Counter")
        self.count = self.reset_count = 0
        self.label = QLabel(self)
        QVBoxLayout(self).addWidget(self.label)

    def refresh(self) -> None:
        """One more."""
        self.count += 1
        self.label.setText(str(self.count))

    def reset(self) -> None:
        """Begin again."""
        self.count = 0
        self.reset_count += 1

    def double(self) -> None:
        """Double the count."""
        self.count *= 2

    def set_count(self, intent: SetCount) -> None:
        """Continue with another number."""
        self.count = intent.count


PANEL = Panel(
    "counter",
    "Counter",
    "hash",
    (),
    Counter,
    home=(RowHome("developer", 1, 1, 200),),
    commands=(
        Command("counter.reset", "Reset the counter", Counter.reset, "View", ("Ctrl+Alt+Z",),
                after="view.freeze"),
        Command("counter.double", "Double the counter", Counter.double, "View", ("F5", "Ctrl+Alt+D"),
                disabled_reason=lambda context: "" if context.layout() else "Not on the start page"),
    ),
    intents=(IntentHandler(SetCount, Counter.set_count),),
)
'''


@pytest.fixture
def plug_in(tmp_path: Path) -> Iterator[None]:
    (tmp_path / "counter.py").write_text(dedent(SOURCE), encoding="utf-8")
    home = importlib.import_module("app.ui.panels.watch")
    home.__path__.append(str(tmp_path))
    yield
    home.__path__.remove(str(tmp_path))
    sys.modules.pop("app.ui.panels.watch.counter", None)
    if hasattr(home, "counter"):
        delattr(home, "counter")


def menu_named(where: QMenuBar | QMenu, name: str) -> QMenu:
    """Return a menu of a menu bar, or a submenu, by its displayed title."""
    return next(
        menu
        for each in where.actions()
        if each.text().replace("&", "") == name and (menu := each.menu()) is not None
    )


@pytest.fixture
def window(qtbot, plug_in: None, theme: Theme, session: Session) -> Iterator[MainWindow]:
    made = MainWindow(session, theme, {**PANELS, "counter": PanelRegistry()["counter"]}, [])
    qtbot.addWidget(made)
    yield made
    made.close()


def test_plug_in_panel_is_listed_and_has_its_home_in_the_layout(qtbot, window: MainWindow) -> None:
    bench = window.show_layout("developer")
    window.show()
    dock = bench.docks["counter"]
    qtbot.waitUntil(dock.is_displayed)
    inspector = bench.docks["inspector"]
    assert dock.x() == inspector.x()
    assert dock.y() > inspector.y()
    view = menu_named(window.bar.menus, "View")
    view.aboutToShow.emit()
    entries = {action.text().replace("&", ""): action for action in menu_named(view, "Panels").actions()}
    assert entries["Counter"].isChecked()
    assert "panel:counter" in {entry.id for entry in window.commands.entries.all()}
    window.tick()
    assert dock.panel.count >= 1
    assert "counter" not in window.show_layout("behaviour").docks


def test_commands_of_a_plug_in_panel_are_in_menu_palette_and_shortcuts(window: MainWindow) -> None:
    view = menu_named(window.bar.menus, "View")
    view.aboutToShow.emit()
    texts = [action.text() for action in view.actions()]
    start = texts.index("Freeze display") + 1
    assert texts[start : start + 2] == ["Reset the counter", "Double the counter"]
    entries = {entry.id: entry for entry in window.commands.entries.all()}
    assert entries["command:counter.reset"].key == "Ctrl+Alt+Z"
    assert entries["command:counter.double"].key == "Ctrl+Alt+D", "F5 is the key of Run"
    assert entries["command:counter.double"].reason == "Not on the start page"
    assert window.commands.shortcuts.command_for("Ctrl+Alt+Z") == "counter.reset"
    assert window.commands.actions["counter.reset"].shortcuts()[0].toString() == "Ctrl+Alt+Z"


def test_commands_of_a_plug_in_panel_open_it_at_home_and_run_on_it(window: MainWindow) -> None:
    window.show_layout("behaviour")
    assert window.context.run("counter.reset") is None
    assert window.current_layout == "developer"
    counter = window.benches["developer"].docks["counter"].panel
    assert counter.reset_count == 1
    counter.count = 4
    assert window.commands.run("counter.double")
    assert counter.count == 8


def test_intent_opens_the_plug_in_panel_that_handles_it(window: MainWindow) -> None:
    intent = sys.modules["app.ui.panels.watch.counter"].SetCount(7)
    bench = window.show_layout("developer")
    bench.docks["counter"].close()
    window.context.request(intent)
    assert "counter" in bench.open_names()
    assert bench.docks["counter"].panel.count == 7
