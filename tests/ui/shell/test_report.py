"""Tests of the report sheet (contents, saving, result) and of the link to new versions."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest
from PySide6.QtCore import Qt, QUrl
from PySide6.QtGui import QDesktopServices
from PySide6.QtTest import QTest

from app.core.projects.file_format import read_file
from app.core.reports.crash import Crash
from app.core.reports.crash_reports import ALERT_ID, CrashReports, show_crash_alert
from app.core.session import Session
from app.ui.shell.commands.commands import Commands
from app.ui.shell.commands.reporting import ReportCommands
from app.ui.shell.commands.table import COMMANDS, releases_commands
from app.ui.shell.dialogs.report import ReportSheet, documents_folder
from app.ui.shell.main_window import MainWindow
from app.ui.theme.theme import Theme
from app.ui.widgets import Button
from nep.version import RELEASES_PAGE, __version__
from tests.pseudo import untranslated
from tests.ui.clipping import clipped
from tests.ui.panels.test_words import said_by
from tests.ui.shell_parts import Answers

pytest_plugins = ["tests.ui.shell_fixtures"]
SECRET = {"blocks": {"blocks": [{"type": "events_started", "id": "of-mine"}]}}


class Opened:
    """Fake of `QDesktopServices.openUrl` that records URLs."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.urls: list[str] = []
        self.works = True
        monkeypatch.setattr(QDesktopServices, "openUrl", self._open)

    def _open(self, url: QUrl) -> bool:
        self.urls.append(url.toString())
        return self.works


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> Opened:
    return Opened(monkeypatch)


@pytest.fixture
def session(session: Session, monkeypatch: pytest.MonkeyPatch) -> Session:
    """Session whose doctor does not run and has no findings."""
    monkeypatch.setattr(session.doctor, "start", lambda: None)
    return session


@pytest.fixture
def sheet(window: MainWindow, commands: Commands, theme: Theme) -> ReportSheet:
    theme.set_motion(True)
    window.show()
    assert commands.run("help.report")
    found = window.findChild(ReportSheet)
    assert found is not None
    return found


def written(qtbot, sheet: ReportSheet) -> None:
    sheet.write.click()
    qtbot.waitUntil(sheet.write.isEnabled)


def inside(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def lines(sheet: ReportSheet) -> str:
    return " ".join(text for _where, text in said_by(sheet))


def test_report_sheet_focuses_the_text_field_and_lists_the_report_contents(sheet: ReportSheet) -> None:
    assert sheet.isVisible()
    assert sheet.description.edit.hasFocus()
    for words in ("Nothing is sent", "Included", "connection doctor", "Not included", "Keys, passwords"):
        assert words in lines(sheet)
    assert not sheet.work.isVisible(), "nothing is open that could go in"
    assert "unless" not in lines(sheet)
    assert not sheet.show_file.isVisible()


def test_save_dialog_suggests_a_name_with_the_date(sheet: ReportSheet, answers: Answers) -> None:
    sheet.write.click()
    (asked,) = answers.asked
    assert asked.startswith(f"Write report: {documents_folder() / 'nep-studio-report-'}")
    assert asked.endswith(".zip")
    assert sheet.write.isEnabled(), "who gives up can go on"


def test_typed_text_is_written_and_the_file_can_be_shown(
    qtbot, sheet: ReportSheet, answers: Answers, tmp_path: Path, opened: Opened
) -> None:
    answers.path = tmp_path / "report"
    QTest.keyClicks(sheet.description.edit, "It stopped")
    written(qtbot, sheet)
    found = inside(tmp_path / "report.zip")
    assert found["what-happened.txt"] == b"It stopped"
    assert b"Qt: 6" in found["versions.txt"]
    assert not [name for name in found if name.startswith("work/")]
    assert sheet.state.text().startswith("Report saved to ")
    assert sheet.description.text() == ""
    assert sheet.show_file.hasFocus()
    sheet.show_file.click()
    assert opened.urls == [QUrl.fromLocalFile(str(tmp_path)).toString()]


def test_folder_path_is_shown_when_the_file_manager_cannot_be_opened(
    qtbot, window: MainWindow, sheet: ReportSheet, answers: Answers, tmp_path: Path, opened: Opened
) -> None:
    opened.works = False
    answers.path = tmp_path / "report.zip"
    written(qtbot, sheet)
    sheet.show_file.click()
    assert window.toast._label.text() == f"The file is in {tmp_path}"


def test_behaviours_are_included_in_a_report_only_if_enabled_each_time(
    qtbot, window: MainWindow, sheet: ReportSheet, session: Session, answers: Answers, tmp_path: Path
) -> None:
    sheet.dismiss()
    session.document.apply_edit(SECRET)
    assert window.commands.run("help.report")
    assert sheet.work.isVisible()
    assert not sheet.work.isChecked()
    assert "Your behaviours, unless you include them below" in lines(sheet)
    assert sheet.names.text() == "Open behaviours: “New behaviour”"
    answers.path = tmp_path / "without.zip"
    written(qtbot, sheet)
    sheet.work.click()
    answers.path = tmp_path / "with.zip"
    written(qtbot, sheet)
    assert b"of-mine" not in b"".join(inside(tmp_path / "without.zip").values())
    found = inside(tmp_path / "with.zip")
    (tmp_path / "it.nepb").write_bytes(found["work/New behaviour.nepb"])
    assert read_file(tmp_path / "it.nepb").always.workspace.blocks == SECRET
    sheet.dismiss()
    assert window.commands.run("help.report")
    assert not sheet.work.isChecked()


def test_unwritable_target_is_reported_and_typed_text_is_kept(
    qtbot, sheet: ReportSheet, answers: Answers, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("no folder")
    answers.path = tmp_path / "file" / "report.zip"
    sheet.description.set_text("It stopped")
    written(qtbot, sheet)
    assert sheet.state.text().startswith("Can't write report.zip (")
    assert sheet.state.text().endswith("choose another folder.")
    assert sheet.description.text() == "It stopped"
    assert not sheet.show_file.isVisible()
    assert sheet.write.hasFocus()


def test_report_finished_after_the_sheet_is_closed_is_announced_by_a_toast(
    qtbot, window: MainWindow, sheet: ReportSheet, answers: Answers, tmp_path: Path
) -> None:
    answers.path = tmp_path / "report.zip"
    sheet.write.click()
    sheet.dismiss()
    qtbot.waitUntil(lambda: window.toast._label.text().startswith("Report saved to"))


def test_banner_offers_a_crash_report_that_contains_the_crash(
    qtbot, window: MainWindow, session: Session, home: Path, answers: Answers, tmp_path: Path
) -> None:
    CrashReports().add(Crash("studio", "by signal 11", "where it was"))
    window.show()
    show_crash_alert(session.alerts, CrashReports())
    window.tick()
    banner = window.banner.banner
    assert banner.isVisible()
    assert banner.button.text() == "Report a problem"
    banner.button.click()
    sheet = window.findChild(ReportSheet)
    assert sheet is not None
    assert "1 crash report" in lines(sheet)
    assert not session.alerts.has(ALERT_ID)
    answers.path = tmp_path / "report.zip"
    written(qtbot, sheet)
    crashes = [data for name, data in inside(tmp_path / "report.zip").items() if name.startswith("crashes/")]
    assert b"where it was" in crashes[0]


def test_dismissed_crash_is_not_offered_again(window: MainWindow, session: Session, home: Path) -> None:
    CrashReports().add(Crash("robot", "by signal 11"))
    window.show()
    show_crash_alert(session.alerts, CrashReports())
    window.tick()
    window.banner.banner.close_button.click()
    window.tick()
    assert not window.banner.isVisible()
    session.alerts.resolve(ALERT_ID)  # as after a restart
    show_crash_alert(session.alerts, CrashReports())
    assert not session.alerts.has(ALERT_ID)


def test_report_sheet_is_operated_by_keyboard(
    qtbot, sheet: ReportSheet, answers: Answers, tmp_path: Path
) -> None:
    answers.path = tmp_path / "report.zip"
    QTest.keyClicks(sheet.description.edit, "By keys")
    reached = []
    for _step in range(6):
        QTest.keyClick(sheet.focusWidget(), Qt.Key.Key_Tab)
        reached.append(sheet.focusWidget())
        if reached[-1] is sheet.write:
            break
    assert sheet.write in reached
    QTest.keyClick(sheet.write, Qt.Key.Key_Return)
    qtbot.waitUntil(lambda: (tmp_path / "report.zip").exists() and sheet.write.isEnabled())
    QTest.keyClick(sheet.show_file, Qt.Key.Key_Escape)
    assert not sheet.isVisible()


@pytest.mark.parametrize("percent", [100, 200])
def test_texts_of_the_report_sheet_are_translated_and_not_clipped(
    qtbot,
    pseudo: None,
    theme: Theme,
    window: MainWindow,
    session: Session,
    answers: Answers,
    tmp_path: Path,
    percent: int,
) -> None:
    theme.set_motion(True)
    theme.set_text_percent(percent)
    window.show()
    session.document.apply_edit(SECRET)
    CrashReports().add(Crash("studio", "how"))
    window.commands.run("help.report")
    sheet = window.findChild(ReportSheet)
    assert sheet is not None
    answers.path = tmp_path / "report.zip"
    written(qtbot, sheet)
    data = (str(tmp_path), "report", "zip", "Esc", session.document.name, *str(tmp_path).split("/"))
    assert [text for _where, text in said_by(sheet) if untranslated(text, *data)] == []
    qtbot.waitUntil(lambda: clipped(sheet) == [])  # Qt defers layouts
    assert all(each.width() >= each.sizeHint().width() for each in (sheet.write, sheet.show_file))


# ---- commands


def test_palette_and_menu_contain_the_report_command(window: MainWindow, commands: Commands) -> None:
    assert "help.report" in [entry.name for entry in commands.entries.all() if entry.kind == "command"]
    menus = [each.menu() for each in window.menu_bar.actions()]
    assert commands.actions["help.report"] in menus[-1].actions()


def test_new_version_entry_exists_only_when_the_project_has_a_web_page() -> None:
    assert releases_commands("") == ()
    (made,) = releases_commands("https://example.org/releases")
    assert (made.id, made.menu) == ("help.releases", "Help")
    assert ("help.releases" in {each.id for each in COMMANDS}) == bool(RELEASES_PAGE)


@pytest.mark.parametrize("works", [True, False])
def test_checking_for_a_new_version_only_opens_the_releases_page(
    window: MainWindow, session: Session, answers: Answers, opened: Opened, works: bool
) -> None:
    opened.works = works
    said: list[str] = []
    monkey = ReportCommands(window, session, answers)
    window.toast.show_toast = lambda words, *_more: said.append(words)  # type: ignore[method-assign]
    monkey.open_releases_page("https://example.org/releases")
    assert opened.urls == ["https://example.org/releases"]
    assert f"This is NEP Studio {__version__}." in said[0]
    assert ("example.org" in said[0]) is not works


def test_buttons_of_the_report_sheet_have_accessible_names(sheet: ReportSheet) -> None:
    assert all(button.accessibleName() for button in sheet.findChildren(Button))
