"""Tests of the left end of the toolbar: freeze button, layout menu and panel menu."""

from __future__ import annotations

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QMenu, QPushButton, QWidget

from app.ui.shell.bars.developer_tools import DeveloperTools
from app.ui.shell.commands import menus
from app.ui.shell.commands.commands import Commands
from app.ui.shell.main_window import MainWindow

pytest_plugins = ["tests.ui.shell_fixtures"]


@pytest.fixture
def tools(qtbot, window: MainWindow, commands: Commands) -> DeveloperTools:
    window.show()
    commands.run("layout.developer")
    return window.tools


def live(window: MainWindow, name: str) -> QPushButton:
    """Add a freeze button to a panel and return the button."""
    panel = window.benches["developer"].docks[name].panel
    button = QPushButton(panel)
    button.setCheckable(True)
    button.show()
    panel.freeze_button = lambda: button
    return button


def click(button) -> None:
    QTest.mouseClick(button, Qt.MouseButton.LeftButton)


def test_freeze_button_pauses_and_resumes_all_live_panels(tools, window, commands) -> None:
    one, other = live(window, "inspector"), live(window, "image")
    one.setChecked(True)
    tools.refresh()
    assert not tools.freeze.isChecked(), "not all of it"
    click(tools.freeze)
    assert (one.isChecked(), other.isChecked(), tools.freeze.isChecked()) == (True, True, True)
    assert commands.actions["view.freeze"].isChecked()
    click(tools.freeze)
    assert (one.isChecked(), other.isChecked(), tools.freeze.isChecked()) == (False, False, False)


def test_freeze_button_is_disabled_without_live_panels(tools, window) -> None:
    live(window, "inspector").hide()
    tools.refresh()
    assert not tools.freeze.isEnabled()
    assert window.commands.actions.disabled_reason("view.freeze") == "Nothing to freeze here"
    live(window, "image")
    tools.refresh()
    assert tools.freeze.isEnabled()
    assert window.commands.actions.disabled_reason("view.freeze") == ""


@pytest.fixture
def dropped(monkeypatch: pytest.MonkeyPatch) -> list[tuple[QMenu, QWidget]]:
    """Opened menus, each with the button below which it was opened."""
    seen: list[tuple[QMenu, QWidget]] = []
    monkeypatch.setattr(menus, "open_below", lambda menu, anchor: seen.append((menu, anchor)))
    return seen


def test_layout_button_shows_the_current_name_and_offers_the_other_layouts(tools, window, dropped) -> None:
    window.saved_layouts.save_as(window.bench, "developer", "Two cameras")
    tools.refresh()
    assert tools.layout.text() == "Two cameras"
    assert tools.layout.accessibleName() == "Layout Two cameras"
    click(tools.layout)
    ((menu, below),) = dropped
    assert below is tools.layout
    entries = {each.text(): each for each in menu.actions() if each.text()}
    assert list(entries)[:3] == ["Behaviour", "Developer", "Two cameras"]
    assert entries["Two cameras"].isChecked()
    assert "Reset panels" in entries
    entries["Developer"].trigger()
    tools.refresh()
    assert tools.layout.text() == "Developer"


def test_unavailable_delete_command_is_disabled_only_while_the_layout_menu_is_open(
    tools, commands, dropped
) -> None:
    click(tools.layout)
    ((menu, _below),) = dropped
    assert not commands.actions["layout.delete"].isEnabled()
    menu.aboutToHide.emit()
    assert commands.actions["layout.delete"].isEnabled()


def test_panel_menu_closes_an_open_panel(tools, window, dropped) -> None:
    click(tools.panels)
    ((menu, below),) = dropped
    assert below is tools.panels
    entry = next(each for each in menu.actions() if each.text() == "Console")
    assert entry.isChecked()
    entry.trigger()
    assert "console" not in window.bench.open_names()


def test_layout_menu_is_hidden_with_large_text_in_a_narrow_window(tools, window) -> None:
    window.resize(1100, 700)
    assert tools.layout.isVisible()
    window.theme.set_text_percent(200)
    try:
        assert not tools.layout.isVisible()
        assert tools.freeze.isVisible()
    finally:
        window.theme.set_text_percent(100)
    assert tools.layout.isVisible()
