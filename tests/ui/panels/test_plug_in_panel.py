"""Test of a plug-in panel in one file: listed, docked, refreshed and restored."""

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

from PySide6.QtWidgets import QLabel, QVBoxLayout

from app.ui.panels.base import Panel, PanelContext, PanelWidget


class Counter(PanelWidget):
    """Counts."""

    def __init__(self, context: PanelContext) -> None:
        """Start with none."""
        super().__init__(context, "Counter")
        self.count = 0
        self.label = QLabel(self)
        QVBoxLayout(self).addWidget(self.label)

    def refresh(self) -> None:
        """One more."""
        self.count += 1
        self.label.setText(str(self.count))


PANEL = Panel("counter", "Counter", "hash", (), Counter)
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


def test_plug_in_panel_is_listed_docked_and_refreshed(
    qtbot, plug_in: None, theme: Theme, session: Session
) -> None:
    window = MainWindow(session, theme, {**PANELS, "counter": PanelRegistry()["counter"]}, [])
    qtbot.addWidget(window)
    window.show_layout("developer")
    window.show()
    view = menu_named(window.bar.menus, "View")
    view.aboutToShow.emit()
    entries = {action.text().replace("&", ""): action for action in menu_named(view, "Panels").actions()}
    entries["Counter"].trigger()
    dock = window.bench.docks["counter"]
    assert dock is not None
    qtbot.waitUntil(dock.is_displayed)
    window.tick()
    assert dock.panel.count >= 1
    window.close()
