"""Tests of the list of earlier versions, which open as copies and overwrite no file."""

from __future__ import annotations

import datetime as dt
import os
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

from app.core.projects.block_diff import Difference
from app.core.projects.versions import save_version
from app.ui.shell.commands.commands import Commands
from app.ui.shell.dialogs.version_history import VersionHistorySheet, difference_text
from app.ui.shell.main_window import MainWindow
from app.ui.text.dates import date_time_text
from app.ui.widgets import Button
from app.ui.widgets.lists.entry_list import Heading
from app.ui.widgets.lists.fuzzy import Match
from tests.ui.shell.test_files import BLOCKS, changed, saved

pytest_plugins = ["tests.ui.shell_fixtures"]


@pytest.fixture
def shown(qtbot, window: MainWindow) -> MainWindow:
    window.theme.set_motion("on")
    window.show()
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    return window


def opened(qtbot, commands: Commands, window: MainWindow) -> VersionHistorySheet:
    commands.run("file.earlier")
    (sheet,) = window.findChildren(VersionHistorySheet)
    qtbot.waitUntil(lambda: sheet.has_read_all)
    return sheet


def rows(sheet: VersionHistorySheet) -> list[tuple[str, str]]:
    told = []
    for line in sheet.rows.line_model.lines:
        if isinstance(line, Match):
            told.append((line.entry.text.partition(",")[0], line.entry.note or line.entry.reason))
        else:
            assert isinstance(line, Heading)
            told.append((line.text, ""))
    return told


def test_each_save_creates_a_version_that_lists_its_differences(
    qtbot, commands, shown, tmp_path: Path
) -> None:
    commands.files.open(saved(tmp_path / "Mine.nepb"))
    for id in "xy":
        shown.session.document.apply_edit(changed(id))
        commands.run("file.save")
    sheet = opened(qtbot, commands, shown)
    assert sheet.heading.text() == "Earlier versions of Mine"
    other = "1 block, 1 added, 1 removed since"
    assert rows(sheet) == [("Today", other), ("Today", other)]
    assert sheet.rows.hasFocus()


def test_enter_opens_the_selected_version_as_a_copy(qtbot, commands, shown, tmp_path: Path) -> None:
    path = saved(tmp_path / "Mine.nepb")
    commands.files.open(path)
    for id in "xy":
        shown.session.document.apply_edit(changed(id))
        commands.run("file.save")
    before = path.read_bytes()
    sheet = opened(qtbot, commands, shown)
    oldest = Path(sheet.rows.line_model.lines[1].entry.name)
    QTest.keyClick(sheet.rows, Qt.Key.Key_Down)
    QTest.keyClick(sheet.rows, Qt.Key.Key_Return)
    assert not sheet.isVisible()
    document = shown.session.document
    assert (document.workspace, document.path) == (BLOCKS, None)
    assert document.name.startswith("Mine, ")
    assert ":" not in document.name
    assert len(shown.session.documents) == 2
    assert shown.toast.text == f"Opened {document.name} as a copy"
    document.apply_edit(changed("mine now"))
    assert (path.read_bytes(), oldest.is_file()) == (before, True)


def test_button_and_double_click_open_a_version(qtbot, commands, shown, tmp_path: Path) -> None:
    path = saved(tmp_path / "Mine.nepb")
    save_version(path)
    commands.files.open(path)
    sheet = opened(qtbot, commands, shown)
    QTest.mouseClick(sheet.button, Qt.MouseButton.LeftButton)
    assert len(shown.session.documents) == 2
    commands.files.open(path)
    sheet = opened(qtbot, commands, shown)
    middle = sheet.rows.visualRect(sheet.rows.currentIndex()).center()
    QTest.mouseClick(sheet.rows.viewport(), Qt.MouseButton.LeftButton, pos=middle)
    assert sheet.isVisible(), "one click only chooses"
    QTest.mouseDClick(sheet.rows.viewport(), Qt.MouseButton.LeftButton, pos=middle)
    assert len(shown.session.documents) == 3


def test_unreadable_version_is_reported_and_does_not_open(qtbot, commands, shown, tmp_path: Path) -> None:
    path = saved(tmp_path / "Mine.nepb")
    path.write_text("not json", "utf-8")
    save_version(path)
    commands.files.open(saved(path))
    sheet = opened(qtbot, commands, shown)
    assert rows(sheet) == [("Today", "Mine is damaged or not a behaviour")]
    QTest.keyClick(sheet.rows, Qt.Key.Key_Return)
    assert sheet.isVisible()


def test_versions_of_other_files_with_the_same_name_are_listed_below(
    qtbot, commands, shown, tmp_path: Path
) -> None:
    for folder in ("here", "there"):
        (tmp_path / folder).mkdir()
        save_version(saved(tmp_path / folder / "Mine.nepb"))
    commands.files.open(tmp_path / "here" / "Mine.nepb")
    sheet = opened(qtbot, commands, shown)
    same = ("Today", "1 block, unchanged since")
    assert rows(sheet) == [same, ("Versions of other files named Mine", ""), same]


def test_explanation_replaces_an_empty_version_list(qtbot, commands, shown, tmp_path: Path) -> None:
    commands.files.open(saved(tmp_path / "Mine.nepb"))
    sheet = opened(qtbot, commands, shown)
    assert not sheet.rows.isVisible()
    assert sheet.empty.isVisible()
    sheet.dismiss()


def test_behaviour_without_a_file_is_saved_from_the_version_list(
    qtbot, commands, shown, answers, tmp_path
) -> None:
    answers.path = tmp_path / "New.nepb"
    shown.session.document.apply_edit(BLOCKS)
    sheet = opened(qtbot, commands, shown)
    save = next(each for each in sheet.empty.findChildren(Button) if each.accessibleName() == "Save")
    assert save.hasFocus()
    QTest.keyClick(save, Qt.Key.Key_Space)
    assert answers.path.is_file()
    assert not sheet.isVisible()


def test_version_time_is_formatted_in_plain_words() -> None:
    now = dt.datetime(2026, 11, 20, 15, 0, tzinfo=dt.timezone.utc)
    told = [date_time_text(now - dt.timedelta(days=days, hours=1), now) for days in (0, 1, 3, 400)]
    assert told == ["Today, 14:00", "Yesterday, 14:00", "17 November, 14:00", "16 October 2025, 14:00"]


def test_version_differences_are_described_in_plain_words() -> None:
    assert difference_text(Difference(14)) == "14 blocks, unchanged since"
    assert difference_text(Difference(1, is_rearranged=True)) == "1 block, reordered"
    found = Difference(14, added_count=3, removed_count=1, changed_count=2)
    assert difference_text(found) == "14 blocks, 3 added, 1 removed, 2 changed since"


def test_long_version_list_stays_inside_the_window(qtbot, commands, shown, tmp_path: Path) -> None:
    path = tmp_path / "Mine.nepb"
    for number in range(25):
        saved(path)
        path.write_bytes(path.read_bytes() + b" " * number)
        os.utime(path, (number * 1000, number * 1000))
        save_version(path)
    commands.files.open(path)
    shown.theme.set_text_percent(200)
    try:
        sheet = opened(qtbot, commands, shown)
        assert shown.rect().contains(sheet.geometry())
        assert sheet.rows.height() > 100
    finally:
        shown.theme.set_text_percent(100)
