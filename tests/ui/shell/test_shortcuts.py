"""Tests of the keyboard shortcuts: defaults, customisation, and F12 for Stop, which cannot be changed."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtCore import QKeyCombination, Qt
from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtTest import QTest

from app.core.storage.settings import Settings
from app.robots.description.description import Parameter
from app.ui.panels.robots.robots.controls.number import UnboundedNumberEdit
from app.ui.panels.watch.console.list import LogFindField
from app.ui.shell.actions.shortcuts import FIXED_KEYS, Shortcuts
from app.ui.shell.bars.app_bar import AppBar
from app.ui.shell.commands import table
from app.ui.shell.commands.commands import Commands
from app.ui.shell.dialogs.command_palette import CommandPalette
from app.ui.shell.dialogs.shortcuts import ShortcutSheet
from app.ui.shell.docking.layouts import LAYOUTS
from app.ui.shell.main_window import MainWindow
from app.ui.text.numbers import shortcut_text, tip_with_key
from app.ui.theme.theme import Theme
from app.ui.widgets.inputs.fields import FilterField
from app.ui.widgets.lists.entry_list import Heading
from app.ui.widgets.lists.fuzzy import Match
from tests.ui.shell_parts import COMMANDS

pytest_plugins = ["tests.ui.shell_fixtures"]
CTRL = Qt.KeyboardModifier.ControlModifier
NONE = Qt.KeyboardModifier.NoModifier


@pytest.fixture
def keys(qapp: object, tmp_path: Path) -> Shortcuts:
    return Shortcuts(Settings(tmp_path), lambda _sentence: None, COMMANDS)


def test_default_shortcuts_are_unique(keys: Shortcuts) -> None:
    given = [key for row in COMMANDS for key in keys.shortcuts_of(row.id)]
    assert sorted(given) == sorted(set(given))
    assert all(key == QKeySequence(key).toString() for key in given)


def test_ctrl_y_triggers_redo(window: MainWindow, commands: Commands, keys: Shortcuts) -> None:
    assert keys.shortcuts_of("edit.redo") == ("Ctrl+Shift+Z", "Ctrl+Y")
    assert [key.toString() for key in commands.actions["edit.redo"].shortcuts()] == ["Ctrl+Shift+Z", "Ctrl+Y"]
    assert keys.command_for("Ctrl+Y") == "edit.redo"


def test_macos_shortcuts_avoid_system_keys_and_option_characters(qapp: object, tmp_path: Path) -> None:
    """On macOS, Qt maps Ctrl to Cmd and Meta to Ctrl; Option types characters, Cmd+Tab switches programs."""
    keys = Shortcuts(Settings(tmp_path), lambda _sentence: None, COMMANDS, platform="darwin")
    given = [key for row in COMMANDS for key in keys.shortcuts_of(row.id)]
    assert sorted(given) == sorted(set(given))
    assert not {"Ctrl+Tab", "Ctrl+Shift+Tab", "Ctrl+H", "Ctrl+M", "Ctrl+Space"} & set(given)
    assert not [key for key in given if key.startswith("Alt+")]
    arrows = ("Left", "Right", "Up", "Down", "Home", "End", "Backspace", "Delete")
    assert not [key for key in given if key.endswith(arrows)], "they move in the text of a field"
    assert keys.shortcuts_of("tab.next") == ("Meta+Tab", "Ctrl+Shift+]")
    assert keys.shortcuts_of("layout.behaviour") == ("Ctrl+Alt+1",)
    assert not keys.is_customised("tab.next")


def test_shortcuts_are_formatted_with_macos_symbols() -> None:
    assert shortcut_text("Ctrl+Shift+S", "darwin") == "⇧⌘S"
    assert shortcut_text("Meta+Tab", "darwin") == "⌃Tab"
    assert shortcut_text("Ctrl++", "darwin") == "⌘+"
    assert shortcut_text("Ctrl+Shift+S", "linux") == "Ctrl+Shift+S"
    assert shortcut_text("Ctrl+C, Ctrl+Shift+V", "darwin") == "⌘C, ⇧⌘V"
    assert tip_with_key("Save", "Ctrl+S", "darwin") == "Save (⌘S)"
    assert tip_with_key("Save", "Ctrl+S", "linux") == "Save (Ctrl+S)"
    assert tip_with_key("Save", "", "darwin") == "Save"


def test_macos_menu_bar_is_native_and_uses_application_menu_roles(
    qtbot, theme: Theme, window: MainWindow, commands
) -> None:
    for platform, native in (("darwin", True), ("linux", False), ("win32", False)):
        bar = AppBar(theme, LAYOUTS, platform)
        qtbot.addWidget(bar)
        assert bar.is_menu_bar_native == native
    roles = {name: commands.actions[name].menuRole() for name in ("settings.open", "file.quit", "help.about")}
    assert set(roles.values()) == {
        QAction.MenuRole.PreferencesRole, QAction.MenuRole.QuitRole, QAction.MenuRole.AboutRole,
    }  # fmt: skip
    assert commands.actions["file.save"].menuRole() == QAction.MenuRole.NoRole


@pytest.mark.parametrize("held", [CTRL, Qt.KeyboardModifier.ShiftModifier])
def test_text_navigation_keys_are_handled_by_the_text_field(
    qtbot, theme: Theme, held: Qt.KeyboardModifier
) -> None:
    left: list[str] = []
    field = FilterField(theme, "Filter")
    qtbot.addWidget(field)
    field.exited.connect(lambda: left.append("filter"))
    words = LogFindField(theme)
    qtbot.addWidget(words)
    words.exited.connect(lambda: left.append("console"))
    number = UnboundedNumberEdit(theme, Parameter("n", "n", "number", default=5))
    qtbot.addWidget(number)
    number.setText("5")
    for each in (field, words, number):
        QTest.keyClick(each, Qt.Key.Key_Down, held)
    assert (left, number.text()) == ([], "5")
    for each in (field, words, number):
        QTest.keyClick(each, Qt.Key.Key_Down, Qt.KeyboardModifier.KeypadModifier)  # like a Mac's arrow keys
    assert (left, number.text()) == (["filter", "console"], "4")


def test_changed_shortcut_is_saved(keys: Shortcuts, tmp_path: Path) -> None:
    keys.assign("file.save", "Ctrl+Alt+S")
    again = Shortcuts(Settings(tmp_path), lambda _sentence: None, COMMANDS)
    assert again.shortcuts_of("file.save") == ("Ctrl+Alt+S",)
    assert again.is_customised("file.save")
    assert not again.is_customised("file.open")


def test_reassigned_shortcut_is_removed_from_its_previous_command(keys: Shortcuts) -> None:
    keys.assign("file.open", "Ctrl+S")
    assert keys.shortcuts_of("file.save") == ()
    assert keys.command_for("Ctrl+S") == "file.open"


def test_two_commands_swap_their_shortcuts(keys: Shortcuts) -> None:
    keys.swap("file.open", "Ctrl+S")
    assert (keys.shortcuts_of("file.open"), keys.shortcuts_of("file.save")) == (("Ctrl+S",), ("Ctrl+O",))


def test_a_single_shortcut_or_all_shortcuts_can_be_reset(keys: Shortcuts, tmp_path: Path) -> None:
    keys.swap("file.open", "Ctrl+S")
    keys.reset("file.open")
    assert (keys.shortcuts_of("file.open"), keys.shortcuts_of("file.save")) == (("Ctrl+O",), ("Ctrl+S",))
    keys.swap("file.open", "Ctrl+S")
    keys.assign("file.new", "Ctrl+S")  # "Open" has no shortcut now, "Save" has Ctrl+O
    keys.reset("file.open")
    assert (keys.shortcuts_of("file.open"), keys.shortcuts_of("file.save")) == (("Ctrl+O",), ())
    assert keys.shortcuts_of("file.new") == ("Ctrl+S",)
    keys.reset_all()
    assert keys.shortcuts_of("file.save") == ("Ctrl+S",)
    assert Settings(tmp_path).shortcuts == {}


def test_stop_keeps_f12_and_may_have_a_second_shortcut(keys: Shortcuts) -> None:
    keys.assign("run.stop", "")
    assert keys.shortcuts_of("run.stop") == ("F12",)
    keys.assign("run.stop", "Ctrl+.")
    assert keys.shortcuts_of("run.stop") == ("F12", "Ctrl+.")
    keys.swap("run.stop", "F5")
    assert keys.shortcuts_of("run.stop") == ("F12", "F5")
    assert keys.shortcuts_of("run.run") == ()
    keys.reset("run.stop")
    assert keys.shortcuts_of("run.stop") == ("F12", "Ctrl+.")


def test_default_second_shortcut_of_stop_yields_to_a_user_assignment(tmp_path: Path, qapp: object) -> None:
    settings = Settings(tmp_path)
    settings.shortcuts = {"run.step": ["Ctrl+."]}
    keys = Shortcuts(settings, print, COMMANDS)
    assert keys.shortcuts_of("run.stop") == ("F12",)
    assert keys.command_for("Ctrl+.") == "run.step"
    keys.reset("run.step")
    assert keys.shortcuts_of("run.stop") == ("F12", "Ctrl+.")


def test_f12_cannot_be_assigned_to_another_command_even_in_the_settings_file(
    tmp_path: Path, qapp: object
) -> None:
    settings = Settings(tmp_path)
    settings.shortcuts = {"run.run": ["F12"], "run.stop": [], "no.such": ["F2"], "file.open": 7}
    keys = Shortcuts(settings, lambda _sentence: None, COMMANDS)
    assert keys.shortcuts_of("run.run") == ()
    assert keys.shortcuts_of("run.stop") == ("F12",)
    assert keys.shortcuts_of("file.open") == ("Ctrl+O",)


def test_saved_shortcut_of_a_panel_applies_once_its_commands_are_added(tmp_path: Path, qapp: object) -> None:
    settings = Settings(tmp_path)
    settings.shortcuts = {"print.ask": ["F7"], "removed.command": ["F6"]}
    keys = Shortcuts(settings, print, table.COMMANDS)
    assert keys.command_for("F7") == ""
    keys.assign("file.new", "F4")
    assert settings.shortcuts == {
        "print.ask": ["F7"], "removed.command": ["F6"], "file.new": ["F4"],
    }  # fmt: skip
    keys.set_commands(COMMANDS)
    assert keys.shortcuts_of("print.ask") == ("F7",)
    assert keys.shortcuts_of("file.new") == ("F4",)
    assert keys.shortcuts_of("help.doctor") == ()  # F4 is in use


@pytest.mark.parametrize(
    ("key", "held", "said"),
    [
        (Qt.Key.Key_S, NONE, "single letter"),
        (Qt.Key.Key_Return, NONE, "single letter"),
        (Qt.Key.Key_A, Qt.KeyboardModifier.ShiftModifier, "single letter"),
        (Qt.Key.Key_F12, NONE, "F12 always"),
        (Qt.Key.Key_C, CTRL, "Ctrl+C is reserved"),
        (Qt.Key.Key_F4, NONE, ""),
        (Qt.Key.Key_S, CTRL, ""),
    ],
)
def test_invalid_shortcuts_are_rejected_with_a_reason(
    keys: Shortcuts, key: Qt.Key, held: Qt.KeyboardModifier, said: str
) -> None:
    refusal = keys.rejection_reason("file.open", QKeyCombination(held, key))
    assert said in refusal
    assert bool(refusal) == bool(said)


# -- shortcut sheet -------------------------------------------------------------------------------


@pytest.fixture
def sheet(qtbot, window: MainWindow, commands: Commands) -> ShortcutSheet:
    window.theme.set_motion("on")
    window.show()
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    commands.run("layout.developer")
    QTest.keyClick(window, Qt.Key.Key_F1)
    made = window.findChild(ShortcutSheet)
    assert made is not None
    assert made.isVisible()
    return made


def choose(sheet: ShortcutSheet, words: str) -> None:
    sheet.field.setText(words)
    entry = sheet.rows.entry
    assert entry is not None
    assert entry.text == words


def press(sheet: ShortcutSheet, key: Qt.Key, held: Qt.KeyboardModifier = NONE) -> None:
    QTest.keyClick(sheet.field, key, held)


def test_shortcut_sheet_lists_every_command_and_every_fixed_shortcut(
    sheet: ShortcutSheet, commands: Commands
) -> None:
    shown = [line.entry.id for line in sheet.rows.line_model.lines if isinstance(line, Match)]
    assert shown == list(dict.fromkeys(shown))
    assert set(shown) == {f"command:{row.id}" for row in commands.actions.commands if row.in_shortcuts} | {
        f"fixed:{number}" for number in range(len(FIXED_KEYS))
    }
    headings = [line.text for line in sheet.rows.line_model.lines if isinstance(line, Heading)]
    assert len(headings) == len(set(headings))
    assert {"File", "View", "Run", "Blocks"} <= set(headings)


def test_changed_shortcut_applies_immediately_to_action_tooltip_and_palette(
    sheet: ShortcutSheet, window: MainWindow, commands: Commands
) -> None:
    choose(sheet, "Pause")
    press(sheet, Qt.Key.Key_Return)
    press(sheet, Qt.Key.Key_F7)
    assert sheet.hint.text() == "The shortcut of “Pause” is now F7."
    assert commands.actions["run.pause"].shortcut() == QKeySequence("F7")
    assert window.tool_bar.pause.toolTip() == "Pause (F7)"
    paused: list[str] = []
    commands.actions["run.pause"].triggered.connect(lambda: paused.append("pause"))
    press(sheet, Qt.Key.Key_Escape)
    assert not sheet.isVisible()
    QTest.keyClick(window, Qt.Key.Key_F7)
    QTest.keyClick(window, Qt.Key.Key_F8)
    assert paused == ["pause"]
    commands.view.open_palette()
    palette = window.findChild(CommandPalette)
    assert palette is not None
    palette.field.setText("pause")
    assert palette.rows.entry is not None
    assert palette.rows.entry.key == "F7"


def test_shortcut_conflict_names_the_other_command_and_can_swap(
    sheet: ShortcutSheet, commands: Commands
) -> None:
    choose(sheet, "Open a file")
    press(sheet, Qt.Key.Key_Return)
    press(sheet, Qt.Key.Key_S, CTRL)
    assert "“Save”" in sheet.hint.text()
    assert commands.shortcuts.shortcuts_of("file.open") == ("Ctrl+O",)
    assert sheet.swap.isVisible()
    QTest.mouseClick(sheet.swap, Qt.MouseButton.LeftButton)
    assert commands.shortcuts.shortcuts_of("file.open") == ("Ctrl+S",)
    assert commands.shortcuts.shortcuts_of("file.save") == ("Ctrl+O",)
    assert not sheet.swap.isVisible()


def test_esc_cancels_recording_a_shortcut(sheet: ShortcutSheet, commands: Commands) -> None:
    choose(sheet, "Save")
    press(sheet, Qt.Key.Key_Return)
    press(sheet, Qt.Key.Key_Escape)
    assert sheet.isVisible()
    assert commands.shortcuts.shortcuts_of("file.save") == ("Ctrl+S",)


def test_f12_stops_while_a_shortcut_is_recorded(sheet: ShortcutSheet, commands: Commands) -> None:
    stops: list[str] = []
    commands.actions["run.stop"].triggered.connect(lambda: stops.append("stop"))
    choose(sheet, "Save")
    press(sheet, Qt.Key.Key_Return)
    press(sheet, Qt.Key.Key_F12)
    assert stops == ["stop"]
    assert commands.shortcuts.shortcuts_of("file.save") == ("Ctrl+S",)


def test_recording_a_shortcut_does_not_trigger_its_current_command(
    sheet: ShortcutSheet, commands: Commands
) -> None:
    done: list[str] = []
    commands.actions["text.larger"].triggered.connect(lambda: done.append("larger"))
    choose(sheet, "Save")
    press(sheet, Qt.Key.Key_Return)
    press(sheet, Qt.Key.Key_Plus, CTRL)
    assert done == []
    assert "“Larger text”" in sheet.hint.text()


def test_shortcuts_are_removed_and_reset(sheet: ShortcutSheet, commands: Commands) -> None:
    keys = commands.shortcuts
    choose(sheet, "Save")
    sheet.rows.setFocus()
    sheet.field.setFocus()
    sheet._remove_shortcut()
    assert keys.shortcuts_of("file.save") == ()
    assert sheet.reset.isEnabled()
    QTest.mouseClick(sheet.reset, Qt.MouseButton.LeftButton)
    assert keys.shortcuts_of("file.save") == ("Ctrl+S",)
    keys.assign("file.save", "F3")
    QTest.mouseClick(sheet.reset_all, Qt.MouseButton.LeftButton)
    assert keys.shortcuts_of("file.save") == ("Ctrl+S",)
    choose(sheet, "Stop the program and all robots")
    sheet._remove_shortcut()
    assert sheet.hint.text() == "F12 is now the only shortcut for Stop."
    assert keys.shortcuts_of("run.stop") == ("F12",)
    sheet._remove_shortcut()
    assert sheet.hint.text() == "F12 can't be removed: it always triggers Stop."


def test_ctrl_enter_in_the_palette_opens_the_shortcut_sheet(
    sheet: ShortcutSheet, window: MainWindow, commands: Commands
) -> None:
    sheet.dismiss()
    commands.view.open_palette()
    palette = window.findChild(CommandPalette)
    assert palette is not None
    palette.field.setText("save as")
    QTest.keyClick(palette.field, Qt.Key.Key_Return, CTRL)
    assert not palette.isVisible()
    assert sheet.isVisible()
    assert sheet.rows.entry is not None
    assert sheet.rows.entry.name == "file.save_as"
    press(sheet, Qt.Key.Key_F7)
    assert commands.shortcuts.shortcuts_of("file.save_as") == ("F7",)


def test_ctrl_f_searches_blocks_only_in_the_behaviour_layout(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    find = commands.actions["blocks.find"]
    asked: list[str] = []
    find.triggered.connect(lambda: asked.append("find"))
    window.show()
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    commands.run("layout.behaviour")
    assert find.shortcut() == QKeySequence("Ctrl+F")
    QTest.keyClick(window, Qt.Key.Key_F, CTRL)
    assert asked == ["find"]
    commands.run("layout.developer")
    assert find.shortcut().isEmpty()
    QTest.keyClick(window, Qt.Key.Key_F, CTRL)
    assert asked == ["find"]
    commands.run("layout.behaviour")
    assert find.shortcut() == QKeySequence("Ctrl+F")
