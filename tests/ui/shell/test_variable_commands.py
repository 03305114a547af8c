"""Tests of the commands to create, rename, delete, find and set variables."""

from __future__ import annotations

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

from app.blocks.model.workspace import parse_workspace
from app.intents import RenameVariable
from app.ui.intents import DeleteVariable, ShowNextUse
from app.ui.panels.build.behaviour.variable_commands import uses_of
from app.ui.panels.build.variable_values import ask_value, parse_value
from app.ui.shell.commands.commands import Commands
from app.ui.shell.dialogs.name import NameSheet
from app.ui.shell.main_window import MainWindow
from tests.blocks.samples import block, get, number, started, workspace, write
from tests.ui.shell_parts import PlainPanel

pytest_plugins = ["tests.ui.shell_fixtures"]

SAVED = workspace(
    started(
        block("variables_set", "set", VAR={"id": "s"}, VALUE=number(3)),
        block("control_forever", "loop", BODY=[write(get("s") | {"id": "get"})]),
    ),
    variables=("s", "n"),
)
SAVED["variables"] = [{"id": "s", "name": "Score"}, {"id": "n", "name": "名前"}]


@pytest.fixture
def shown(qtbot, window: MainWindow, commands: Commands) -> MainWindow:
    window.theme.set_motion("on")
    window.show()
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    commands.run("layout.behaviour")
    window.session.document.apply_edit(SAVED)
    return window


def editor(window: MainWindow) -> PlainPanel:
    dock = window.find_dock("behaviour")
    assert dock is not None
    assert isinstance(dock.panel, PlainPanel)
    return dock.panel


def sheet_of(window: MainWindow) -> NameSheet:
    (sheet,) = window.findChildren(NameSheet)
    return sheet


def typed(sheet: NameSheet, words: str) -> NameSheet:
    sheet.field.selectAll()
    QTest.keyClick(sheet.field, Qt.Key.Key_Delete)
    sheet.field.insert(words)  # QTest can't type other scripts
    sheet.field.textEdited.emit(words)
    return sheet


def test_new_variable_is_named_in_a_sheet_and_created(shown: MainWindow, commands: Commands) -> None:
    commands.run("variable.new")
    sheet = sheet_of(shown)
    assert sheet.heading.text() == "New variable"
    assert (sheet.field.text(), sheet.field.selectedText()) == ("count", "count"), "it can be taken as it is"
    assert sheet.button.isEnabled()
    assert not typed(sheet, "").button.isEnabled()
    typed(sheet, " points ")
    assert sheet.button.isEnabled()
    QTest.keyClick(sheet.field, Qt.Key.Key_Return)
    assert not sheet.isVisible()
    assert editor(shown).edited == [{"do": "new", "name": "points", "list": False}]
    commands.run("variable.new_list")
    assert (sheet.heading.text(), sheet.field.text()) == ("New list", "list")
    QTest.keyClick(typed(sheet, "names").field, Qt.Key.Key_Return)
    assert editor(shown).edited[1] == {"do": "new", "name": "names", "list": True}


def test_suggested_variable_name_is_unused(shown: MainWindow, commands: Commands) -> None:
    used = [{"id": str(number), "name": name} for number, name in enumerate(["count", "Count 2"])]
    shown.session.document.apply_edit({**SAVED, "variables": used})
    commands.run("variable.new")
    assert sheet_of(shown).field.text() == "count 3"


@pytest.mark.parametrize("name", ["score", "SCORE", "名前"])
def test_existing_variable_name_is_reported_while_typing(
    shown: MainWindow, commands: Commands, name: str
) -> None:
    commands.run("variable.new")
    sheet = sheet_of(shown)
    typed(sheet, name)
    assert sheet.error_label.text() == f"A variable named “{name}” already exists. Choose another name."
    assert not sheet.button.isEnabled()
    QTest.keyClick(sheet.field, Qt.Key.Key_Return)
    assert sheet.isVisible()
    typed(sheet, "x" * 61)
    assert "60 characters" in sheet.error_label.text()
    QTest.keyClick(typed(sheet, "").field, Qt.Key.Key_Return)
    assert sheet.error_label.text() == "Enter a name for the variable."
    assert editor(shown).edited == []


def test_variable_can_be_renamed_to_a_name_that_differs_only_in_letter_case(
    shown: MainWindow, commands: Commands
) -> None:
    commands.request(RenameVariable("s"))
    sheet = sheet_of(shown)
    assert (sheet.heading.text(), sheet.field.text()) == ("New name for “Score”", "Score")
    QTest.keyClick(typed(sheet, "score").field, Qt.Key.Key_Return)
    assert editor(shown).edited == [{"do": "rename", "id": "s", "name": "score"}]
    commands.request(RenameVariable("gone"))
    assert not sheet.isVisible()


def test_deleting_a_variable_reports_removed_blocks_and_can_be_undone(
    shown: MainWindow, commands: Commands
) -> None:
    commands.request(DeleteVariable("s"))
    assert editor(shown).edited == [{"do": "delete", "id": "s"}]
    assert shown.toast.text == "Deleted “Score” and 2 blocks that used it"
    shown.toast.button.click()
    assert editor(shown).edited[1] == {"do": "undo"}
    commands.request(DeleteVariable("n"))
    assert shown.toast.text == "Deleted “名前”"


def test_find_command_steps_through_the_uses_of_a_variable(shown: MainWindow, commands: Commands) -> None:
    for _ in range(3):
        commands.request(ShowNextUse("s"))
    assert [edit["id"] for edit in editor(shown).edited] == ["set", "get", "set"]
    commands.request(ShowNextUse("n"))
    assert len(editor(shown).edited) == 3
    assert uses_of(parse_workspace(SAVED), "s") == ["set", "get"]


def test_value_cannot_be_set_while_the_behaviour_does_not_run(shown: MainWindow) -> None:
    ask_value(shown.context, "s")
    assert not shown.findChildren(NameSheet)


@pytest.mark.parametrize(
    ("words", "value"),
    [("3", 3), ("-1", -1), ("2,5", 2.5), (" 7 ", 7), ("true", True), ("No", False), ("", ""), ("Ada", "Ada"),
     ("0,2", 0.2), ("1.234,5", "1.234,5"), ("1_000", "1_000"),
     ("1e999", "1e999"), ("nan", "nan"), ("18446744073709551615", 2**64 - 1)],
)  # fmt: skip
def test_typed_value_is_parsed_as_number_boolean_or_text(words: str, value: object) -> None:
    made = parse_value(words)
    assert made == value
    assert type(made) is type(value)
