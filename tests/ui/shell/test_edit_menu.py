"""Tests of cut, copy, paste and select all in the Edit menu, for text fields and for blocks."""

from __future__ import annotations

import pytest
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QApplication, QLineEdit

from app.ui.shell.commands.commands import Commands
from app.ui.shell.main_window import MainWindow

pytest_plugins = ["tests.ui.shell_fixtures"]


@pytest.fixture
def field(qtbot, window: MainWindow, commands: Commands) -> QLineEdit:
    """Focused text field in the window."""
    made = QLineEdit("hello", window)
    window.show()
    made.show()
    qtbot.waitActive(window)
    made.setFocus()
    qtbot.waitUntil(made.hasFocus)
    return made


def test_edit_commands_apply_to_the_focused_text_field(
    window: MainWindow, commands: Commands, field: QLineEdit
) -> None:
    commands.run("edit.selectAll")
    assert field.selectedText() == "hello"
    commands.run("edit.copy")
    assert QGuiApplication.clipboard().text() == "hello"
    commands.run("edit.cut")
    assert field.text() == ""
    commands.run("edit.paste")
    assert field.text() == "hello"


def test_select_all_applies_to_the_text_field_while_the_menu_bar_has_focus(
    window: MainWindow, commands: Commands, field: QLineEdit
) -> None:
    window.bar.menus.setFocus()
    assert QApplication.focusWidget() is window.bar.menus
    commands.run("edit.selectAll")
    assert field.selectedText() == "hello"


def test_unavailable_edit_commands_are_disabled_with_a_reason(commands: Commands, field: QLineEdit) -> None:
    field.setReadOnly(True)
    assert commands.actions.disabled_reason("edit.paste") == "This text can't be changed"
    assert commands.actions.disabled_reason("edit.copy") == ""
    field.clearFocus()
    field.hide()
    assert commands.actions.disabled_reason("edit.copy") == "Only for blocks and text fields"


def test_edit_commands_show_shortcuts_but_leave_the_keys_to_the_focused_widget(commands: Commands) -> None:
    for what in ("cut", "copy", "paste", "selectAll"):
        action = commands.actions[f"edit.{what}"]
        assert action.shortcuts() == []
        assert action.text().partition("\t")[2].startswith("Ctrl+")
