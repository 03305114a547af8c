"""Tests of saved layouts: names, restoring after a restart and damaged settings."""

from __future__ import annotations

import json

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

from app.core.session import Session
from app.ui.shell.commands.commands import Commands
from app.ui.shell.dialogs.name import NameSheet
from app.ui.shell.main_window import MainWindow
from app.ui.theme.theme import Theme
from tests.ui.shell_parts import PANELS

pytest_plugins = ["tests.ui.shell_fixtures"]


@pytest.fixture
def shown(qtbot, window: MainWindow, commands: Commands) -> MainWindow:
    window.theme.set_motion("on")
    window.show()
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    commands.run("layout.developer")
    return window


def opened(window: MainWindow) -> set[str]:
    assert window.bench is not None
    return set(window.bench.open_names())


def keep_as(window: MainWindow, commands: Commands, name: str) -> NameSheet:
    commands.run("layout.keep")
    sheet = window.findChild(NameSheet)
    assert sheet is not None
    sheet.field.setText(name)
    QTest.keyClick(sheet.field, Qt.Key.Key_Return)
    return sheet


def menu(window: MainWindow, commands: Commands) -> dict[str, bool]:
    commands.menus._refresh("View")
    entries = commands.menus._layout_submenu.actions()
    return {entry.text(): entry.isChecked() for entry in entries if entry.isCheckable()}


def use(window: MainWindow, commands: Commands, name: str) -> None:
    menu(window, commands)
    next(e for e in commands.menus._layout_submenu.actions() if e.text() == name).trigger()


def test_layout_is_saved_under_a_name_and_the_built_in_layout_is_unchanged(
    shown: MainWindow, commands: Commands
) -> None:
    before = opened(shown)
    keep_as(shown, commands, "Only topics")
    assert shown.toast.text == "Saved layout “Only topics”"
    for name in before - {"topics"}:
        shown.bench.docks[name].close()
    assert menu(shown, commands) == {"Behaviour": False, "Developer": False, "Only topics": True}
    use(shown, commands, "Developer")
    assert opened(shown) == before
    use(shown, commands, "Only topics")
    assert opened(shown) == {"topics"}


def test_duplicate_long_or_empty_layout_names_are_reported(shown: MainWindow, commands: Commands) -> None:
    sheet = keep_as(shown, commands, "developer")
    assert sheet.isVisible()
    assert sheet.error_label.text() == "“developer” already exists."
    sheet.field.setText("x" * 41)
    QTest.keyClick(sheet.field, Qt.Key.Key_Return)
    assert "40 characters" in sheet.error_label.text()
    sheet.field.setText("  ")
    QTest.keyClick(sheet.field, Qt.Key.Key_Return)
    assert sheet.error_label.text() == "Enter a name for the layout."
    QTest.keyClick(sheet.field, Qt.Key.Key_Escape)
    assert not sheet.isVisible()
    assert shown.saved_layouts.all() == ()


def test_layout_is_renamed(shown: MainWindow, commands: Commands) -> None:
    keep_as(shown, commands, "One")
    commands.run("layout.rename")
    sheet = shown.findChild(NameSheet)
    assert sheet is not None
    assert sheet.field.text() == "One"
    sheet.field.setText("Two")
    QTest.keyClick(sheet.field, Qt.Key.Key_Return)
    assert [own.name for own in shown.saved_layouts.all()] == ["Two"]
    assert shown.saved_layouts.custom_name("developer") == "Two"


def test_deleted_layout_is_restored_by_undo(shown: MainWindow, commands: Commands) -> None:
    keep_as(shown, commands, "One")
    shown.bench.docks["console"].close()
    small = opened(shown)
    commands.run("layout.delete")
    assert shown.saved_layouts.all() == ()
    assert opened(shown) > small
    QTest.mouseClick(shown.toast.button, Qt.MouseButton.LeftButton)
    assert [own.name for own in shown.saved_layouts.all()] == ["One"]
    assert shown.saved_layouts.custom_name("developer") == "One"
    assert opened(shown) == small


def test_selected_layout_is_restored_after_restart(
    qtbot, shown: MainWindow, commands: Commands, session: Session, theme: Theme
) -> None:
    keep_as(shown, commands, "Mine")
    shown.bench.docks["console"].close()
    left = opened(shown)
    shown.close()
    other = MainWindow(session, theme, PANELS, [])
    qtbot.addWidget(other)
    again = other.commands
    again.run("layout.developer")
    assert other.saved_layouts.custom_name("developer") == "Mine"
    assert opened(other) == left
    use(other, again, "Developer")
    assert "console" in opened(other)


DAMAGED: tuple[object, ...] = (
    {"open": "x"},
    {"open": ["topics"], "docks": "no base64"},
    {"open": ["topics"], "docks": "AAAA", "panels": 7},
    {"open": [1, None, "no such panel"], "docks": 12, "wide": []},
    {"base": "developer"},
)


@pytest.mark.parametrize("damaged", DAMAGED)
def test_damaged_layout_falls_back_to_its_default_and_is_logged_in_the_console(
    qtbot, session: Session, theme: Theme, damaged: object
) -> None:
    session.settings.layouts = {"developer": damaged, "own:": 3, "own:Old": {"base": "gone"}}
    window = MainWindow(session, theme, PANELS, [])
    qtbot.addWidget(window)
    window.commands.run("layout.developer")
    assert {"topics", "inspector", "image", "console"} <= opened(window)
    said = [record.text for record in session.console.records]
    assert "Can't restore the layout “Developer”; using its default." in said
    assert window.saved_layouts.all() == ()
    window.close()


def test_settings_of_the_wrong_type_are_ignored(qtbot, session: Session, theme: Theme) -> None:
    stored = {"layouts": "none", "chosen_layouts": {"developer": 5}}
    session.settings.path.parent.mkdir(exist_ok=True)
    session.settings.path.write_text(json.dumps(stored))
    window = MainWindow(session, theme, PANELS, [])
    qtbot.addWidget(window)
    window.commands.run("layout.developer")
    assert "topics" in opened(window)
    window.close()


def test_unavailable_entries_of_the_view_menu_are_disabled(shown: MainWindow, commands: Commands) -> None:
    lists = commands.menus
    lists._refresh("View")
    assert not commands.actions["layout.delete"].isEnabled()
    assert not commands.actions["text.smaller"].isEnabled()
    assert commands.actions["run.stop"].isEnabled()
    commands.actions.enable_all()
    keep_as(shown, commands, "One")
    lists._refresh("View")
    assert commands.actions["layout.delete"].isEnabled()
    commands.actions.enable_all()


def test_palette_lists_custom_layouts(shown: MainWindow, commands: Commands) -> None:
    keep_as(shown, commands, "Two cameras")
    use(shown, commands, "Developer")
    found = {entry.text: entry for entry in commands.entries.all()}
    commands.view.run_entry(found["Two cameras"])
    assert shown.saved_layouts.custom_name("developer") == "Two cameras"


def test_unwritable_layout_is_reported_as_not_saved(shown: MainWindow, commands: Commands) -> None:
    path = shown.session.settings.path
    keep_as(shown, commands, "One")
    path.unlink()
    path.mkdir()  # stands for a disk that can't be written
    keep_as(shown, commands, "Two")
    assert shown.toast.text == "Can't save layout “Two”. It will be lost when Studio closes."
    assert "Two" in menu(shown, commands)
    shown.session.tick()
    alert = next(each for each in shown.session.alerts.active if each.id == "settings")
    assert alert.title == "Settings you change now are lost when Studio closes."
    commands.run("layout.delete")
    assert shown.toast.text == "This change couldn't be saved. “Two” will reappear when Studio restarts."
    commands.behaviours.clear_recent()
    message = "This change couldn't be saved. The recent files will reappear when Studio restarts."
    assert shown.toast.text == message
    commands.run("robots.ask")
    assert shown.toast.text == "Until you close Studio, it will ask again before a real robot moves"
    path.rmdir()
    keep_as(shown, commands, "Three")
    assert shown.toast.text == "Saved layout “Three”"
    shown.session._next_check_s = 0.0
    shown.session.tick()
    assert not shown.session.alerts.has("settings")
