"""The guide and About: pages in each language, the keys of now, found by words; versions to copy."""

from __future__ import annotations

import platform
import re
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QTest

from app import resources
from app.ui.shell.commands.commands import Commands
from app.ui.shell.commands.table import COMMANDS
from app.ui.shell.dialogs.about import AboutSheet
from app.ui.shell.dialogs.guide import GuidePage, GuideSheet, read_pages
from app.ui.shell.main_window import MainWindow
from nep import i18n
from nep.version import __version__

pytest_plugins = ["tests.ui.shell_fixtures"]
FOLDER = resources.path("guide")
PAGES = sorted(path.name for path in (FOLDER / "en").glob("*.md"))
LANGUAGES = sorted(folder.name for folder in FOLDER.iterdir())
TITLES = ["The window", "Blocks", "Robots", "The virtual room", "When something is wrong", "Keys", "Saving"]


def text(language: str, page: str) -> str:
    return (FOLDER / language / page).read_text("utf-8")


def test_there_is_a_page_for_each_of_what_people_ask() -> None:
    assert [page.title for page in read_pages(FOLDER, "en", lambda _command: "F1")] == TITLES
    assert "es" in LANGUAGES
    assert {code for code, _name in i18n.offered()} <= set(LANGUAGES), "each language that is offered"


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("page", PAGES)
def test_each_language_has_each_page_with_the_same_keys_and_parts(language: str, page: str) -> None:
    english, other = text("en", page), text(language, page)
    named = re.findall(r"\{key:([^}]*)\}", other)
    assert set(named) <= {command.id for command in COMMANDS}
    assert set(named) == set(re.findall(r"\{key:([^}]*)\}", english))
    for part in (r"(?m)^#", r"(?m)^\|"):
        assert len(re.findall(part, other)) == len(re.findall(part, english)), part


def test_what_english_pages_call_commands_is_what_they_are_called() -> None:
    called = {words for command in COMMANDS for words in (command.text, command.text.format(number=""))}
    called |= {command.under for command in COMMANDS}
    for page in PAGES:
        for menu, entry in re.findall(r"\*(File|Edit|View|Run|Robots|Help) > ([^*]+)\*", text("en", page)):
            assert " ".join(entry.split()) in called, (page, menu, entry)


def test_a_language_without_a_page_shows_the_english_one(tmp_path: Path) -> None:
    for folder, name in (("en", "1-a.md"), ("en", "2-b.md"), ("fr", "2-b.md")):
        (tmp_path / folder).mkdir(exist_ok=True)
        (tmp_path / folder / name).write_text(f"# {folder} {name}\n", "utf-8")
    pages = read_pages(tmp_path, "fr_CA", lambda _command: "")
    assert [page.title for page in pages] == ["en 1-a.md", "fr 2-b.md"]


def test_keys_are_those_of_the_moment(tmp_path: Path) -> None:
    (tmp_path / "en").mkdir()
    (tmp_path / "en" / "1.md").write_text("# Keys\nRun: {key:run.run}, {key:none}\n", "utf-8")
    (page,) = read_pages(tmp_path, "en", lambda command: {"run.run": "Ctrl+F5"}.get(command, ""))
    assert page.text == "# Keys\nRun: **Ctrl+F5**, **-**\n"


def test_words_are_found_in_any_order_without_marks() -> None:
    page = GuidePage("Stop", "# Stop\n**Stop** tells *every* robot")
    assert page.has("robot stop")
    assert page.has("STOP TELLS")
    assert not page.has("stop camera")


@pytest.fixture
def guide(qtbot, window: MainWindow, commands: Commands) -> GuideSheet:
    window.show()
    with qtbot.waitExposed(window):
        pass
    commands.run("help.guide")
    found = window.findChild(GuideSheet)
    assert found is not None
    return found


def test_the_list_leads_to_pages_and_the_search_to_those_with_the_words(qtbot, guide: GuideSheet) -> None:
    assert [guide.list.item(row).text() for row in range(guide.list.count())] == TITLES
    qtbot.waitUntil(guide.list.hasFocus)
    QTest.keyClick(guide.list, Qt.Key.Key_Down)
    assert guide.page.toPlainText().startswith("Blocks\n")
    QTest.keyClick(guide.list, Qt.Key.Key_Slash)
    assert guide.search.hasFocus()
    QTest.keyClicks(guide.search, "ball")
    assert [page.title for page in guide.shown] == ["The virtual room"]
    assert guide.page.toPlainText().startswith("The virtual room")
    assert guide.page.textCursor().selectedText() == "ball"
    QTest.keyClicks(guide.search, "zzz")
    assert guide.none.isVisible()
    QTest.keyClick(guide.search, Qt.Key.Key_Escape)
    assert not guide.isVisible()


def test_it_opens_where_it_was_left(window: MainWindow, commands: Commands, guide: GuideSheet) -> None:
    guide.list.setCurrentRow(4)
    guide.shut()
    commands.run("help.guide")
    assert guide.page.toPlainText().startswith("When something is wrong")


def test_nothing_in_a_page_is_italic_and_keys_are_words(guide: GuideSheet) -> None:
    for row in range(guide.list.count()):
        guide.list.setCurrentRow(row)
        block = guide.page.document().begin()
        while block.isValid():
            assert not any(part.fragment().charFormat().fontItalic() for part in block)
            block = block.next()
        assert "{key" not in guide.page.toPlainText()


def test_about_says_what_it_runs_on_and_copies_it(qtbot, window: MainWindow, commands: Commands) -> None:
    window.show()
    commands.run("help.about")
    (sheet,) = [each for each in window.findChildren(AboutSheet) if each.isVisible()]
    QTest.mouseClick(sheet.copy, Qt.MouseButton.LeftButton)
    copied = QGuiApplication.clipboard().text().splitlines()
    assert copied[0] == f"NEP Studio: {__version__}"
    assert f"Python: {platform.python_version()}" in copied
    assert any(line.startswith("Qt: 6.") for line in copied)
    assert window.toast.text == "Copied the versions"
    sheet.shut()
