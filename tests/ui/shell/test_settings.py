"""Tests that each setting applies immediately and is restored at the next start."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QWidget

from app.core.storage.setting import Setting
from app.core.storage.settings import RecentFile, Settings
from app.ui.shell.commands.commands import Commands
from app.ui.shell.dialogs.settings import SettingsSheet
from app.ui.shell.dialogs.shortcuts import ShortcutSheet
from app.ui.shell.main_window import MainWindow
from app.ui.shell.window_state import WindowState
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, ComboBox, Segments
from tests.ui.shell_parts import Answers, robots_in

pytest_plugins = ["tests.ui.shell_fixtures"]


@pytest.fixture
def sheet(qtbot, window: MainWindow, commands: Commands) -> SettingsSheet:
    window.theme.set_motion("on")
    window.show()
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    commands.run("settings.open")
    made = window.findChild(SettingsSheet)
    assert made is not None
    return made


def press(sheet: SettingsSheet, setting: Setting[Any], value: str) -> None:
    segments = sheet.rows[setting].control
    assert isinstance(segments, Segments)
    QTest.mouseClick(segments._segments[value], Qt.MouseButton.LeftButton)


def chosen(sheet: SettingsSheet, setting: Setting[Any]) -> str:
    control = sheet.rows[setting].control
    assert isinstance(control, Segments | ComboBox)
    return control.value


def restart_notice(sheet: SettingsSheet) -> QWidget:
    notice = sheet.rows[Settings.language].notice
    assert notice is not None
    return notice


def shown_text(sheet: SettingsSheet, setting: Setting[Any]) -> str:
    display = sheet.rows[setting].display
    assert display is not None
    return display.text()


def test_appearance_settings_apply_immediately_and_are_saved(
    sheet: SettingsSheet, window: MainWindow, home: Path
) -> None:
    press(sheet, Settings.theme, "dark")
    press(sheet, Settings.text_percent, "150")
    press(sheet, Settings.contrast, "on")
    press(sheet, Settings.motion, "off")
    theme = window.theme
    assert (theme.is_dark, theme.text_percent) == (True, 150)
    assert (theme.is_high_contrast, theme.is_motion_reduced) == (True, False)
    again = Theme("light")
    WindowState(Settings(home), lambda _sentence: None).apply_theme(again)
    assert (again.mode, again.text_percent, again.contrast, again.motion) == ("dark", 150, "on", "off")
    assert again.is_high_contrast
    again.deleteLater()


def test_changes_made_in_menus_are_shown_in_the_settings_sheet(
    sheet: SettingsSheet, commands: Commands
) -> None:
    commands.run("theme.dark")
    commands.run("text.larger")
    commands.run("theme.contrast")
    assert (
        chosen(sheet, Settings.theme),
        chosen(sheet, Settings.text_percent),
        chosen(sheet, Settings.contrast),
    ) == ("dark", "125", "on")
    press(sheet, Settings.contrast, "off")
    assert not commands.actions["theme.contrast"].isChecked()


def test_snapshot_folder_is_saved(
    sheet: SettingsSheet, window: MainWindow, answers: Answers, tmp_path: Path
) -> None:
    settings = window.session.settings
    before = settings.pictures_folder
    assert shown_text(sheet, Settings.pictures_folder) == str(before)
    answers.path = tmp_path
    button = sheet.rows[Settings.pictures_folder].control
    assert isinstance(button, Button)
    button.click()
    assert answers.asked == [f"folder {before}"]
    assert settings.pictures_folder == tmp_path
    assert shown_text(sheet, Settings.pictures_folder) == str(tmp_path)


def test_settings_link_to_the_keyboard_shortcuts(sheet: SettingsSheet, window: MainWindow) -> None:
    QTest.mouseClick(sheet.rows[Settings.shortcuts].control, Qt.MouseButton.LeftButton)
    assert not sheet.isVisible()
    shown = window.findChild(ShortcutSheet)
    assert shown is not None
    assert shown.isVisible()


def test_legacy_reduced_motion_setting_is_migrated(home: Path, theme: Theme) -> None:
    home.mkdir()
    (home / "settings.json").write_text('{"less_motion": true}')
    WindowState(Settings(home), lambda _sentence: None).apply_theme(theme)
    assert theme.is_motion_reduced
    (home / "settings.json").write_text('{"less_motion": "nonsense"}')
    WindowState(Settings(home), lambda _sentence: None).apply_theme(theme)
    assert theme.motion == "system"


# -- recent files ---------------------------------------------------------------------------------


def test_missing_recent_files_are_disabled_and_the_list_can_be_cleared(
    window: MainWindow, commands: Commands, tmp_path: Path
) -> None:
    there = tmp_path / "there.nepb"
    there.write_text("{}", "utf-8")
    settings = window.session.settings
    settings.set_recent([RecentFile(there, "there", 0.0), RecentFile(tmp_path / "gone.nepb", "gone", 0.0)])
    lists = commands.menus
    lists._list_recent()
    entries = {entry.text(): entry.isEnabled() for entry in lists._recent_menu.actions() if entry.text()}
    assert entries == {
        "there": True,
        "gone (missing)": False,
        "Clear recent files": True,
    }
    commands.run("file.forget_recent")
    assert settings.all_recent_files == []
    window.show()
    QTest.mouseClick(window.toast.button, Qt.MouseButton.LeftButton)
    assert [file.name for file in settings.all_recent_files] == ["there", "gone"]


def test_failed_settings_write_is_reported_once_until_a_write_succeeds(tmp_path: Path) -> None:
    (tmp_path / "home").write_text("no folder")
    told: list[str] = []
    state = WindowState(Settings(tmp_path / "home"), told.append)
    for number in range(3):
        state.save(Settings.text_percent, 110 + number)
    assert len(told) == 1
    (tmp_path / "home").unlink()
    state.save(Settings.text_percent, 120)
    assert len(told) == 1
    for file in (tmp_path / "home").iterdir():
        file.unlink()
    (tmp_path / "home").rmdir()
    (tmp_path / "home").write_text("no folder")
    state.save(Settings.text_percent, 130)
    assert len(told) == 2


def test_language_is_saved_for_the_next_start(
    monkeypatch, window: MainWindow, commands: Commands, home: Path
) -> None:
    monkeypatch.setattr("nep.i18n.selectable_languages", lambda: [("en", "English"), ("es", "Español")])
    window.show()
    commands.run("settings.open")
    sheet = window.findChild(SettingsSheet)
    assert sheet is not None
    assert chosen(sheet, Settings.language) == "en"
    assert not restart_notice(sheet).isVisible()
    press(sheet, Settings.language, "es")
    assert restart_notice(sheet).isVisible()
    assert isinstance(restart_notice(sheet), QLabel), "a window of its own keeps no tabs"
    assert Settings(home).language == "es"
    press(sheet, Settings.language, "en")
    assert not restart_notice(sheet).isVisible()


def test_many_languages_are_shown_in_a_drop_down_list(
    monkeypatch, window: MainWindow, commands: Commands, home: Path
) -> None:
    names = [("en", "English"), ("es", "Español"), ("fr", "Français"), ("ja", "日本語")]
    monkeypatch.setattr("nep.i18n.selectable_languages", lambda: names)
    window.show()
    commands.run("settings.open")
    sheet = window.findChild(SettingsSheet)
    assert sheet is not None
    language = sheet.rows[Settings.language].control
    assert isinstance(language, ComboBox)
    assert [language.itemText(at) for at in range(language.count())] == [name for _code, name in names]
    assert language.value == "en"
    assert sheet.initial_focus() is language
    QTest.keyClick(language, Qt.Key.Key_Down)
    assert Settings(home).language == "es"
    assert restart_notice(sheet).isVisible()


def test_settings_show_whether_the_robot_voice_is_available(
    sheet: SettingsSheet, window: MainWindow, commands: Commands
) -> None:
    class Silent:
        problem = "This computer has no voice for French."
        is_busy = False

        def stop(self) -> None:
            """Do nothing, as there is no voice to stop."""

    assert shown_text(sheet, Settings.is_robot_sound_on)
    sheet.dismiss()
    window.session.voices.speaker = Silent()
    commands.run("settings.open")
    assert shown_text(sheet, Settings.is_robot_sound_on).startswith("This computer has no voice for French. ")


def test_language_change_offers_a_restart_that_waits_until_robots_stop(
    qtbot, monkeypatch, window: MainWindow, commands: Commands
) -> None:
    monkeypatch.setattr("nep.i18n.selectable_languages", lambda: [("en", "English"), ("es", "Español")])
    window.can_restart = True
    window.show()
    commands.run("settings.open")
    sheet = window.findChild(SettingsSheet)
    assert sheet is not None
    assert not restart_notice(sheet).isVisible()
    press(sheet, Settings.language, "es")
    assert restart_notice(sheet).isVisible()
    restart = restart_notice(sheet)
    assert isinstance(restart, Button)
    robots = window.session.fleet._links
    robots["Robot 1"] = robots_in("busy").fleet.links[0]
    restart.click()
    assert window.isVisible()
    assert not window.wants_restart
    robots.clear()
    restart.click()
    assert window.wants_restart
    assert not window.isVisible()
    assert Settings(window.session.settings.path.parent).language == "es"
