"""Tests of Studio's own file dialog: names, places, folders, keyboard, and Stop while it is open."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.core.projects.folder import entries_of, free_name, name_problem
from app.core.session import Session
from app.core.storage.settings import Settings
from app.ui.shell.commands.commands import Commands
from app.ui.shell.dialogs.file_sheet import FileSheet, FolderLocation, known_locations
from app.ui.shell.main_window import MainWindow
from app.ui.theme.theme import Theme
from app.ui.widgets import Button
from app.ui.widgets.file_dialogs import FileKind
from tests.ui.shell_parts import PANELS

pytest_plugins = ["tests.ui.shell_fixtures"]
LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "work"
    (made / "class 3").mkdir(parents=True)
    (made / ".hidden").mkdir()
    for name in ("Greeting.nepb", "a quiz.nepb", "notes.txt", ".secret.nepb"):
        (made / name).write_text("{}", "utf-8")
    return made


@pytest.fixture
def sheet(qtbot: QtBot, window: MainWindow, theme: Theme, folder: Path) -> FileSheet:
    window.show()
    with qtbot.waitExposed(window):
        pass
    theme.set_motion("on")
    return FileSheet(theme, window, lambda: (FolderLocation("Work", "house", folder),))


@pytest.fixture
def taken() -> list[Path]:
    return []


def rows(sheet: FileSheet) -> list[str]:
    return [sheet.list.topLevelItem(number).text(0) for number in range(sheet.list.topLevelItemCount())]


def typed(sheet: FileSheet, name: str) -> None:
    sheet.name.selectAll()
    QTest.keyClicks(sheet.name, name)


def test_folders_are_listed_before_behaviour_files_and_other_files_are_hidden(
    sheet: FileSheet, folder: Path
) -> None:
    sheet.ask_open(folder, print)
    assert rows(sheet) == ["class 3", "a quiz", "Greeting"]
    assert [entry.path.name for entry in entries_of(folder) if entry.is_folder] == ["class 3"]
    assert not sheet.name.isVisible()
    sheet.list.sortByColumn(0, Qt.SortOrder.DescendingOrder)
    assert rows(sheet) == ["class 3", "Greeting", "a quiz"], "folders first, the other way round too"


def test_saving_appends_the_displayed_file_extension(
    sheet: FileSheet, folder: Path, taken: list[Path]
) -> None:
    sheet.ask_save(folder / "New behaviour.nepb", taken.append)
    assert sheet.name.text() == "New behaviour"
    assert sheet.suffix_label.text() == ".nepb"
    assert sheet.name.hasFocus()
    typed(sheet, "Dance")
    assert sheet.done.text() == "Save"
    QTest.keyClick(sheet.name, Qt.Key.Key_Return)
    assert taken == [folder / "Dance.nepb"]
    assert not sheet.isVisible()


def test_file_extension_or_full_path_can_be_typed(sheet: FileSheet, folder: Path, taken: list[Path]) -> None:
    sheet.ask_save(folder / "New.nepb", taken.append)
    typed(sheet, "Dance.nepb")
    assert sheet.target == folder / "Dance.nepb"
    typed(sheet, str(folder / "class 3" / "Dance"))
    assert sheet.target == folder / "class 3" / "Dance.nepb"
    typed(sheet, str(folder / "nowhere" / "Dance"))
    assert sheet.target is None
    assert not sheet.done.isEnabled()


def test_saving_over_an_existing_file_offers_replace_and_keep_both(
    sheet: FileSheet, folder: Path, taken: list[Path]
) -> None:
    sheet.ask_save(folder / "Greeting.nepb", taken.append)
    assert sheet.done.text() == "Replace"
    assert sheet.hint.text() == "“Greeting” already exists. Replace it, or keep both."
    QTest.mouseClick(sheet.keep_both, LEFT)
    assert taken == [folder / "Greeting 2.nepb"]
    sheet.ask_save(folder / "Greeting.nepb", taken.append)
    QTest.mouseClick(sheet.done, LEFT)
    assert taken[1] == folder / "Greeting.nepb"
    sheet.ask_save(folder / "Greeting.nepb", taken.append)
    typed(sheet, "Dance")
    assert not sheet.keep_both.isVisible()
    assert sheet.done.text() == "Save"


def test_suggested_name_skips_numbers_in_use(folder: Path) -> None:
    (folder / "Greeting 2.nepb").write_text("", "utf-8")
    assert free_name(folder, "Greeting") == "Greeting 3"
    assert free_name(folder, "Dance") == "Dance"


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("a/b", "A name can't contain “/”."),
        ("what?", "A name can't contain “?”."),
        (".x", "A name that begins with a full stop hides the file."),
        ("con", "Some computers don't support this file name. Choose another one."),
        ("ends.", "Some computers don't support this file name. Choose another one."),
        ("x" * 121, "This name is too long."),
        ("Ñandú 3", ""),
        ("", ""),
    ],
)
def test_invalid_file_names_are_rejected_with_a_reason(name: str, wrong: str) -> None:
    assert name_problem(name) == wrong


def test_file_with_an_invalid_name_cannot_be_saved(sheet: FileSheet, folder: Path, taken: list[Path]) -> None:
    sheet.ask_save(folder / "x.nepb", taken.append)
    typed(sheet, "what?")
    assert sheet.hint.text() == "A name can't contain “?”."
    assert not sheet.done.isEnabled()
    QTest.keyClick(sheet.name, Qt.Key.Key_Return)
    assert taken == []
    assert sheet.isVisible()


def test_folders_can_be_created_opened_and_left(sheet: FileSheet, folder: Path, taken: list[Path]) -> None:
    sheet.ask_save(folder / "Dance.nepb", taken.append)
    QTest.mouseClick(sheet.new_folder, LEFT)
    QTest.keyClicks(sheet.folder_name, "Class 4")
    QTest.keyClick(sheet.folder_name, Qt.Key.Key_Return)
    assert (folder / "Class 4").is_dir()
    assert sheet.folder == folder / "Class 4"
    assert sheet.hint.text() == "This folder is empty."
    QTest.mouseClick(sheet.up, LEFT)
    assert sheet.folder == folder
    assert sheet.selected_entry is not None
    assert sheet.selected_entry.path.name == "Class 4", "where one came from"
    QTest.mouseClick(sheet.new_folder, LEFT)
    QTest.keyClicks(sheet.folder_name, "Class 4")
    QTest.mouseClick(sheet.create_button, LEFT)
    assert sheet.hint.text() == "“Class 4” already exists."
    assert taken == []


def test_file_in_a_folder_is_opened_by_keyboard(sheet: FileSheet, folder: Path, taken: list[Path]) -> None:
    (folder / "class 3" / "Dance.nepb").write_text("{}", "utf-8")
    sheet.ask_open(folder, taken.append)
    assert sheet.list.hasFocus()
    QTest.keyClick(sheet.list, Qt.Key.Key_Home)
    QTest.keyClick(sheet.list, Qt.Key.Key_Return)
    assert sheet.folder == folder / "class 3"
    QTest.keyClick(sheet.list, Qt.Key.Key_Backspace)
    assert sheet.folder == folder
    QTest.keyClick(sheet.list, Qt.Key.Key_Return)
    QTest.keyClick(sheet.list, Qt.Key.Key_Home)
    QTest.keyClick(sheet.list, Qt.Key.Key_Return)
    assert taken == [folder / "class 3" / "Dance.nepb"]


def test_return_on_a_file_enters_its_name_without_replacing_the_file(
    sheet: FileSheet, folder: Path, taken: list[Path]
) -> None:
    sheet.ask_save(folder / "Dance.nepb", taken.append)
    sheet.list.setFocus()
    QTest.keyClick(sheet.list, Qt.Key.Key_End)
    QTest.keyClick(sheet.list, Qt.Key.Key_Return)
    assert (sheet.name.text(), taken) == ("Greeting", [])
    assert sheet.name.hasFocus()


def test_missing_folder_is_reported_and_the_previous_folder_stays_open(
    sheet: FileSheet, folder: Path
) -> None:
    sheet.ask_open(folder, print)
    sheet.go_to(folder / "gone")
    assert sheet.folder == folder
    assert sheet.hint.text() == "Can't open “gone”: no such file or directory."


def test_suggested_locations_are_existing_folders_without_duplicates(folder: Path, tmp_path: Path) -> None:
    found = known_locations(
        tmp_path, [folder / "Greeting.nepb", folder / "b.nepb", tmp_path / "x" / "gone.nepb"]
    )
    assert found[0].folder == Path.home()
    assert [place.name for place in found].count("work") == 1
    assert all(place.folder.is_dir() for place in found)
    assert len({place.folder for place in found}) == len(found)


def test_stop_works_while_the_file_sheet_stays_open(
    qtbot: QtBot, window: MainWindow, commands: Commands, sheet: FileSheet, folder: Path
) -> None:
    stops: list[str] = []
    commands.actions["run.stop"].triggered.connect(lambda: stops.append("stop"))
    sheet.ask_save(folder / "Dance.nepb", print)
    typed(sheet, "Half a na")
    stop = window.bar.stop
    assert window.childAt(stop.mapTo(window, stop.rect().center())) is stop
    QTest.mouseClick(stop, LEFT)
    QTest.keyClick(sheet.name, Qt.Key.Key_F12)
    assert stops == ["stop", "stop"]
    assert sheet.isVisible()
    QTest.mouseClick(sheet._scrim, LEFT)
    assert sheet.isVisible(), "a press beside it loses nothing"
    assert sheet.name.text() == "Half a na"
    QTest.keyClick(sheet.name, Qt.Key.Key_Escape)
    assert not sheet.isVisible()


@pytest.mark.parametrize("percent", [100, 150, 200])
def test_columns_are_readable_at_every_text_size(
    qtbot: QtBot, sheet: FileSheet, theme: Theme, folder: Path, percent: int
) -> None:
    theme.set_text_percent(percent)
    sheet.ask_open(folder, print)
    header, metrics = sheet.list.header(), sheet.list.fontMetrics()

    def readable() -> bool:
        longest = max(metrics.horizontalAdvance(each.text(1)) for each in sheet._rows())
        return header.sectionSize(1) >= longest and header.sectionSize(0) >= metrics.horizontalAdvance(
            "Greeting"
        )

    qtbot.waitUntil(readable)
    QApplication.processEvents()


def test_open_command_opens_the_file_sheet_with_recent_folders(
    qtbot: QtBot, theme: Theme, session: Session, folder: Path
) -> None:
    session.settings.add_recent(folder / "Greeting.nepb", "Greeting")
    window = MainWindow(session, theme, PANELS, [])
    qtbot.addWidget(window)
    window.show()
    window.commands.run("file.open")
    sheet = window.findChild(FileSheet)
    assert sheet is not None
    assert sheet.isVisible()
    assert "work" in [button.text() for button in sheet.location_list.findChildren(Button)]
    sheet.dismiss()
    window.close()


def test_image_chooser_lists_only_images(sheet: FileSheet, folder: Path, taken: list[Path]) -> None:
    for name in ("cat.PNG", "dog.jpg", "song.mp3"):
        (folder / name).write_bytes(b"")
    sheet.ask_picture(folder, taken.append)
    assert rows(sheet) == ["class 3", "cat.PNG", "dog.jpg"]
    sheet.list.setCurrentItem(sheet.list.topLevelItem(2))
    sheet.done.click()
    assert taken == [folder / "dog.jpg"]
    sheet.ask_open(folder, taken.append)
    assert rows(sheet) == ["class 3", "a quiz", "Greeting"], "the next question is for behaviours again"


def test_folder_is_selected_or_created(sheet: FileSheet, folder: Path, taken: list[Path]) -> None:
    sheet.ask_folder(folder, taken.append)
    assert rows(sheet) == ["class 3"]
    assert sheet.hint.text() == "Files will be saved in “work”.", "no row is chosen by itself"
    sheet.list.setCurrentItem(sheet.list.topLevelItem(0))
    assert sheet.hint.text() == "Files will be saved in “class 3”."
    sheet.done.click()
    sheet.ask_folder(folder, taken.append)
    sheet.new_folder.click()
    sheet.folder_name.setText("album")
    sheet.create_button.click()
    assert sheet.list.hasFocus()
    assert sheet.hint.text() == "Files will be saved in “album”."
    sheet.done.click()
    assert taken == [folder / "class 3", folder / "album"]


def test_settings_stay_open_below_the_file_sheet_and_regain_focus(
    sheet: FileSheet, window: MainWindow, commands: Commands, folder: Path, taken: list[Path]
) -> None:
    commands.run("settings.open")
    settings = commands.view._settings_sheet
    assert settings is not None
    settings.rows[Settings.pictures_folder].control.setFocus()
    sheet.ask_folder(folder, taken.append)
    QApplication.processEvents()
    assert settings.isVisible()
    assert sheet.list.hasFocus()
    QTest.keyClick(sheet.list, Qt.Key.Key_Escape)
    assert not sheet.isVisible()
    assert settings.isVisible()
    assert settings.rows[Settings.pictures_folder].control.hasFocus()
    assert taken == []


def test_save_as_offers_several_file_types(sheet: FileSheet, folder: Path) -> None:
    kinds = FileKind("Picture", ".png"), FileKind("Sharp picture", ".svg")
    taken: list[tuple[str, str]] = []
    (folder / "Tea 1.svg").write_text("<svg/>")

    def ask(name: str) -> None:
        sheet.ask_save_as("Save as image", folder / name, kinds, lambda p, k: taken.append((p.name, k.label)))

    ask("Tea 1")
    assert (sheet.heading.text(), sheet.suffix_label.text(), sheet.name.text()) == (
        "Save as image",
        ".png",
        "Tea 1",
    )
    assert rows(sheet) == ["class 3", "Tea 1.svg"]
    sheet.kind.setCurrentIndex(1)
    assert (sheet.suffix_label.text(), sheet.done.text()) == (".svg", "Replace")
    QTest.mouseClick(sheet.keep_both, LEFT)
    ask("Tea 1")
    assert sheet.suffix_label.text() == ".png", "each question begins with the first kind"
    typed(sheet, "Tea.SVG")
    QTest.keyClick(sheet.name, Qt.Key.Key_Return)
    ask("Tea 1")
    typed(sheet, "Tea.svg")
    sheet.kind.setCurrentIndex(1)
    sheet.kind.setCurrentIndex(0)
    QTest.mouseClick(sheet.done, LEFT)
    assert taken == [("Tea 1 2.svg", "Sharp picture"), ("Tea.svg", "Sharp picture"), ("Tea.png", "Picture")]
    sheet.ask_save(folder / "Dance.nepb", print)
    assert not sheet.kind.isVisible()
    assert sheet.suffix_label.text() == ".nepb"
