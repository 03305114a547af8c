"""Tests of the guide and the About page: languages, current shortcuts, search and versions to copy."""

from __future__ import annotations

import platform
import re
from pathlib import Path

import pytest
from PySide6.QtCore import Qt, QUrl
from PySide6.QtGui import QGuiApplication, QImage, QTextDocument, QTextImageFormat
from PySide6.QtTest import QTest

from app import resources
from app.ui.shell.commands.commands import Commands
from app.ui.shell.dialogs.about import AboutSheet
from app.ui.shell.dialogs.guide import IMAGE_PIXEL_RATIO, GuidePage, GuideSheet, read_pages
from app.ui.shell.main_window import MainWindow
from app.ui.theme.theme import Theme
from nep import i18n
from nep.version import __version__
from tests.ui.shell_parts import COMMANDS

pytest_plugins = ["tests.ui.shell_fixtures"]
FOLDER = resources.path("guide")
PAGES = sorted(path.name for path in (FOLDER / "en").glob("*.md"))
LANGUAGES = sorted(folder.name for folder in FOLDER.iterdir())
MAX_SIZE, PICTURES_OF_A_LANGUAGE = 110_000, 750_000  # bytes; included in the download
MAX_NAME_LENGTH = 40
TITLES = ["The window", "Blocks", "Robots", "The virtual room", "When something is wrong", "Keys", "Saving"]


def text(language: str, page: str) -> str:
    return (FOLDER / language / page).read_text("utf-8")


def test_guide_has_the_expected_pages_and_exists_in_every_selectable_language() -> None:
    assert [page.title for page in read_pages(FOLDER, "en", lambda _command: "F1")] == TITLES
    assert "es" in LANGUAGES
    assert {code for code, _name in i18n.selectable_languages()} <= set(LANGUAGES), (
        "each language that is offered"
    )


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("page", PAGES)
def test_every_language_has_every_page_with_the_same_keys_and_sections(language: str, page: str) -> None:
    english, other = text("en", page), text(language, page)
    named = re.findall(r"\{key:([^}]*)\}", other)
    assert set(named) <= {command.id for command in COMMANDS}
    assert set(named) == set(re.findall(r"\{key:([^}]*)\}", english))
    for part in (r"(?m)^#", r"(?m)^\|", r"(?m)^!\["):
        assert len(re.findall(part, other)) == len(re.findall(part, english)), part


def test_english_pages_use_the_names_of_the_menu_commands() -> None:
    called = {words for command in COMMANDS for words in (command.text, command.text.format(number=""))}
    called |= {command.submenu for command in COMMANDS}
    for page in PAGES:
        for menu, entry in re.findall(r"\*(File|Edit|View|Run|Robots|Help) > ([^*]+)\*", text("en", page)):
            assert " ".join(entry.split()) in called, (page, menu, entry)


@pytest.mark.parametrize("language", [each for each in LANGUAGES if each != "en"])
@pytest.mark.parametrize("page", PAGES)
def test_translated_pages_use_the_translated_command_names(
    monkeypatch: pytest.MonkeyPatch, language: str, page: str
) -> None:
    monkeypatch.setattr("nep.i18n._current", None)
    i18n.install(language)
    words = i18n.gettext
    path = r"\*([^>*]+) > ([^*]+)\*"
    menus = {words(menu): menu for menu in ("File", "Edit", "View", "Run", "Robots", "Help")}
    called = {words(each.text).format(number="") for each in COMMANDS} | {
        words(each.submenu) for each in COMMANDS if each.submenu
    }
    named = [(menu, " ".join(entry.split())) for menu, entry in re.findall(path, text(language, page))]
    assert [menu for menu, entry in named if menu not in menus or entry not in called] == []
    english = [menu for menu, _entry in re.findall(path, text("en", page))]
    assert [menus[menu] for menu, _entry in named] == english


def named_pictures(page: str) -> list[tuple[str, str, str]]:
    """Return the language, file name and alternative text of each image of a page."""
    return [
        (language, name, words)
        for language in LANGUAGES
        for words, name in re.findall(r"!\[([^\]]*)\]\(([^)]*)\)", text(language, page))
    ]


@pytest.mark.parametrize("page", PAGES)
def test_every_image_exists_in_every_language_and_theme(page: str) -> None:
    for language, name, words in named_pictures(page):
        assert len(words) > MAX_NAME_LENGTH, f"{name}: say what can be seen"
        found = []
        for theme in ("light", "dark"):
            path = FOLDER / language / theme / f"{name}.png"
            image = QImage(str(path))
            assert not image.isNull(), path
            assert round(300 * IMAGE_PIXEL_RATIO) <= image.width() <= round(640 * IMAGE_PIXEL_RATIO), path
            assert path.stat().st_size < MAX_SIZE, path
            found.append((image.size(), image.pixelColor(4, 4).lightness()))
        (light_size, light), (dark_size, dark) = found
        assert light_size == dark_size, f"{name}: the page would jump with the theme"
        assert light > dark, f"{name}: one of them is in the colours of the other"


def test_languages_have_the_same_images_and_all_are_used_and_small() -> None:
    by_language = {
        language: {name for page in PAGES for of, name, _words in named_pictures(page) if of == language}
        for language in LANGUAGES
    }
    assert set(map(frozenset, by_language.values())) == {frozenset(by_language["en"])}
    assert len(by_language["en"]) >= 6
    files = sorted(FOLDER.glob("*/*/*.png"))
    assert {(path.parent.parent.name, path.stem) for path in files} == {
        (language, name) for language, names in by_language.items() for name in names
    }, "what no page names is only a burden"
    assert sum(path.stat().st_size for path in files) < PICTURES_OF_A_LANGUAGE * len(LANGUAGES)


def test_page_shows_images_of_its_language_and_the_current_theme(
    qtbot, guide: GuideSheet, theme: Theme
) -> None:
    def pictures() -> list[QTextImageFormat]:
        found, block = [], guide.page.document().begin()
        while block.isValid():
            looks = [part.fragment().charFormat() for part in block]
            found += [look.toImageFormat() for look in looks if look.isImageFormat()]
            block = block.next()
        return found

    def shown(look: QTextImageFormat) -> QImage:
        return guide.page.document().resource(QTextDocument.ResourceType.ImageResource, QUrl(look.name()))

    guide.list.setCurrentRow(1)
    looks = pictures()
    assert [look.name() for look in looks] == [
        name for language, name, _words in named_pictures(PAGES[1]) if language == "en"
    ]
    room = guide.page.viewport().width()
    assert all(0 < look.width() <= room for look in looks)
    assert looks[0].toolTip()
    light = shown(looks[0]).pixelColor(4, 4).lightness()
    assert light > 128
    assert shown(looks[0]).pixelColor(0, 9) == theme.colour("border"), "it ends where it can be seen"
    assert "shadow" in guide.page.accessibleDescription()
    theme.set_mode("dark")
    qtbot.waitUntil(lambda: shown(pictures()[0]).pixelColor(4, 4).lightness() < 128)
    guide.page.setFixedWidth(300)
    qtbot.waitUntil(lambda: all(look.width() <= 300 for look in pictures()))


def test_missing_translated_image_falls_back_to_english(tmp_path: Path) -> None:
    (tmp_path / "en" / "dark").mkdir(parents=True)
    (tmp_path / "en" / "1.md").write_text("# One\n![A room with a robot](room)\n", "utf-8")
    (tmp_path / "en" / "dark" / "room.png").write_bytes(b"")
    (page,) = read_pages(tmp_path, "fr", lambda _command: "")
    assert page.pictures == (("room", "A room with a robot"),)
    assert page.picture("room", dark=True) == tmp_path / "en" / "dark" / "room.png"
    assert page.picture("room", dark=False) is None
    assert page.matches("robot room")
    assert not page.matches("png")


def test_missing_translated_page_falls_back_to_english(tmp_path: Path) -> None:
    for folder, name in (("en", "1-a.md"), ("en", "2-b.md"), ("fr", "2-b.md")):
        (tmp_path / folder).mkdir(exist_ok=True)
        (tmp_path / folder / name).write_text(f"# {folder} {name}\n", "utf-8")
    pages = read_pages(tmp_path, "fr_CA", lambda _command: "")
    assert [page.title for page in pages] == ["en 1-a.md", "fr 2-b.md"]


def test_pages_show_the_current_shortcuts(tmp_path: Path) -> None:
    (tmp_path / "en").mkdir()
    (tmp_path / "en" / "1.md").write_text("# Keys\nRun: {key:run.run}, {key:none}\n", "utf-8")
    (page,) = read_pages(tmp_path, "en", lambda command: {"run.run": "Ctrl+F5"}.get(command, ""))
    assert page.text == "# Keys\nRun: **Ctrl+F5**, **-**\n"


def test_search_matches_words_in_any_order_and_letter_case() -> None:
    page = GuidePage("Stop", "# Stop\n**Stop** tells *every* robot")
    assert page.matches("robot stop")
    assert page.matches("STOP TELLS")
    assert not page.matches("stop camera")


@pytest.fixture
def guide(qtbot, window: MainWindow, commands: Commands) -> GuideSheet:
    window.show()
    with qtbot.waitExposed(window):
        pass
    commands.run("help.guide")
    found = window.findChild(GuideSheet)
    assert found is not None
    return found


def test_page_list_opens_pages_and_search_lists_matching_pages(qtbot, guide: GuideSheet) -> None:
    assert [guide.list.item(row).text() for row in range(guide.list.count())] == TITLES
    qtbot.waitUntil(guide.list.hasFocus)
    QTest.keyClick(guide.list, Qt.Key.Key_Down)
    assert guide.page.toPlainText().startswith("Blocks\n")
    QTest.keyClick(guide.list, Qt.Key.Key_Slash)
    assert guide.search.hasFocus()
    QTest.keyClicks(guide.search, "ball")
    assert [page.title for page in guide.matching_pages] == ["The virtual room"]
    assert guide.page.toPlainText().startswith("The virtual room")
    assert guide.page.textCursor().selectedText() == "ball"
    QTest.keyClicks(guide.search, "zzz")
    assert guide.no_match_label.isVisible()
    QTest.keyClick(guide.search, Qt.Key.Key_Escape)
    assert not guide.isVisible()


def test_guide_reopens_at_the_last_page(window: MainWindow, commands: Commands, guide: GuideSheet) -> None:
    guide.list.setCurrentRow(4)
    guide.dismiss()
    commands.run("help.guide")
    assert guide.page.toPlainText().startswith("When something is wrong")


def test_pages_have_no_italics_and_no_unresolved_shortcut_placeholders(guide: GuideSheet) -> None:
    for row in range(guide.list.count()):
        guide.list.setCurrentRow(row)
        block = guide.page.document().begin()
        while block.isValid():
            assert not any(part.fragment().charFormat().fontItalic() for part in block)
            block = block.next()
        assert "{key" not in guide.page.toPlainText()


def test_about_lists_and_copies_versions(qtbot, window: MainWindow, commands: Commands) -> None:
    window.show()
    commands.run("help.about")
    (sheet,) = [each for each in window.findChildren(AboutSheet) if each.isVisible()]
    QTest.mouseClick(sheet.copy, Qt.MouseButton.LeftButton)
    copied = QGuiApplication.clipboard().text().splitlines()
    assert copied[0] == f"NEP Studio: {__version__}"
    assert f"Python: {platform.python_version()}" in copied
    assert any(line.startswith("Qt: 6.") for line in copied)
    assert window.toast.text == "Copied version information"
    sheet.dismiss()
