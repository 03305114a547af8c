"""Tests of the command palette: matching, ranking, execution and live panels below it."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, QRect, QSize, Qt
from PySide6.QtGui import QRegion
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from app.core.network.topics import Topic
from app.core.projects.open_project import OpenProject
from app.core.storage.settings import RecentFile
from app.ui.shell.commands.commands import Commands
from app.ui.shell.dialogs.command_palette import CommandPalette
from app.ui.shell.dialogs.overlay import Overlay
from app.ui.shell.main_window import MainWindow
from app.ui.shell.start_page.page import Example
from app.ui.widgets import StopButton
from app.ui.widgets.lists import fuzzy
from app.ui.widgets.lists.entry_list import Heading
from app.ui.widgets.lists.fuzzy import Entry, Finder, Match, match
from tests.ui.shell_parts import PlainPanel

pytest_plugins = ["tests.ui.shell_fixtures"]
CTRL = Qt.KeyboardModifier.ControlModifier


def found(*words: str, query: str) -> list[str]:
    entries = [Entry(f"command:{each}", each) for each in words]
    return [each.entry.text for each in Finder(entries).find(query, 20)[0]]


def bold(query: str, words: str) -> str:
    fits = match(query, words)
    assert fits is not None
    return "|".join(words[begin:end] for begin, end in fits[1])


def test_match_at_word_start_scores_higher_than_inside_a_word() -> None:
    assert found("Unsaved", "Save", "Auto save", query="save") == ["Save", "Auto save", "Unsaved"]


def test_positions_of_matched_letters_are_reported() -> None:
    assert bold("reco", "Save last 60 s of the recording") == "reco"
    assert bold("rp", "Reset panels") == "R|p"
    assert bold("text larger", "Larger text") == "Larger|text"
    assert bold("ab", "ÄAB") == "AB"


@pytest.mark.parametrize("query", ["xyz", "savex", "zz top", "keyboard mouse"])
def test_entries_that_lack_a_word_of_the_query_are_not_found(query: str) -> None:
    assert found("Save", "Keyboard shortcuts", "Stop the program", query=query) == []


def test_available_commands_rank_above_unavailable_commands() -> None:
    entries = [Entry("command:a", "Let go", reason="Nothing is held"), Entry("command:b", "Go up")]
    assert [each.entry.text for each in Finder(entries).find("go", 20)[0]] == ["Go up", "Let go"]


def test_scattered_letters_do_not_match() -> None:
    assert found("Show the inside of every panel that is open", query="hif") == []
    assert found("Close the behaviour", query="tour") == []  # Enter would close a tab


@pytest.mark.parametrize(
    ("query", "words"),
    [("rp", "Reset panels"), ("ob", "Open another behaviour"), ("vl", "Volver a poner los paneles")],
)
def test_query_of_initials_matches_a_command(query: str, words: str) -> None:
    topics = [Entry(f"topic:/{query}", f"/{query}"), Entry(f"topic:/a{query}", f"/a{query}")]
    other = Entry("command:x", f"Take the {query}x away")
    rows, _count = Finder([*topics, Entry("command:layout.reset", words)]).find(query, 20)
    assert [each.entry.text for each in rows] == [words, f"/{query}", f"/a{query}"]
    rows, _count = Finder([other, Entry("command:layout.reset", words)]).find(query, 20)
    assert rows[0].entry is other, "whole letters of a command are still better than initials"


@pytest.mark.parametrize("query", ["p", "pt b", "bp", "pbx", "tb"])
def test_query_that_is_not_initials_is_not_matched_as_initials(query: str) -> None:
    assert not fuzzy.is_initials(query, "Reset panels")


def test_whole_words_rank_first_and_all_matches_of_ten_thousand_entries_are_counted() -> None:
    many = [Entry(f"topic:/robot{n}/joint/{n % 97}", f"/robot{n}/joint/{n % 97}") for n in range(10_000)]
    finder = Finder([*many, Entry("command:x", "Joists and beams")])
    rows, count = finder.find("joint", 40)
    assert count == 10_000
    assert len(rows) == 40
    rows, count = finder.find("robot77 joi", 40)
    assert count == sum("robot77" in entry.text for entry in many)
    assert rows[0].entry.text == "/robot77/joint/77"
    rows, count = finder.find("joi", 40)
    assert rows[0].entry.text == "Joists and beams"
    assert count == 10_001


def test_fuzzy_comparison_is_limited_among_ten_thousand_topics(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only the best candidates get the expensive comparison, which keeps a query below 4 ms."""
    finder = Finder(
        [Entry(f"topic:/robot{n}/joint/{n % 97}", f"/robot{n}/joint/{n % 97}") for n in range(10_000)]
    )
    compared: list[str] = []
    monkeypatch.setattr(fuzzy, "match", lambda query, words: compared.append(words) or match(query, words))
    for query in ("j", "jo", "joi", "joint", "joint 9", "robot9999"):
        compared.clear()
        assert finder.find(query, 40)[0]
        assert 0 < len(compared) <= fuzzy.MAX_FUZZY_ENTRIES
        assert fuzzy.MAX_FUZZY_ENTRIES * 10 <= 10_000


class Steady(Overlay):
    """Overlay whose size and position do not depend on the text size."""

    top = 300

    def preferred_size(self, room: QSize) -> QSize:
        return QSize(300, 200)


# -- in the window --------------------------------------------------------------------------------


@pytest.fixture
def palette(qtbot, window: MainWindow, commands: Commands) -> CommandPalette:
    """Command palette, opened over the Developer layout."""
    window.theme.set_motion("on")
    window.show()
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    commands.run("layout.developer")
    QTest.keyClick(window, Qt.Key.Key_K, CTRL)
    made = window.findChild(CommandPalette)
    assert made is not None
    assert made.isVisible()
    return made


def words(palette: CommandPalette) -> list[str]:
    return [line.entry.text for line in palette.rows.line_model.lines if isinstance(line, Match)]


def headings(palette: CommandPalette) -> list[str]:
    return [line.text for line in palette.rows.line_model.lines if isinstance(line, Heading)]


def test_palette_is_640_px_wide_128_px_from_the_top_and_focused(
    palette: CommandPalette, window: MainWindow
) -> None:
    assert (palette.width(), palette.y()) == (640, 128)
    assert abs(palette.geometry().center().x() - window.rect().center().x()) <= 1
    assert palette.field.hasFocus()
    assert palette.rows.entry is not None


def test_palette_opens_in_120_ms_and_immediately_with_reduced_motion(
    qtbot, palette: CommandPalette, window: MainWindow
) -> None:
    assert palette.graphicsEffect() is None
    palette.dismiss()
    window.theme.set_motion("off")
    palette.open()
    assert palette._open_animation.duration() == 120
    qtbot.waitUntil(lambda: palette.graphicsEffect() is None)


def test_stop_button_stays_undimmed_and_clickable_above_the_palette(
    palette: CommandPalette, window: MainWindow
) -> None:
    stop = window.tool_bar.stop
    middle = stop.mapTo(window, stop.rect().center())
    assert window.childAt(middle) is stop
    beside = stop.mapTo(window, QPoint(-30, stop.height() // 2))
    assert window.childAt(beside) is palette._scrim
    pressed: list[str] = []
    window.commands.actions["run.stop"].triggered.connect(lambda: pressed.append("stop"))
    QTest.mouseClick(stop, Qt.MouseButton.LeftButton)
    assert pressed == ["stop"]


@pytest.mark.parametrize("layout", ["behaviour", "developer"])
def test_overlay_cutout_follows_the_stop_button_when_the_text_size_changes(
    qtbot, palette: CommandPalette, window: MainWindow, layout: str
) -> None:
    """An overlay of constant geometry gets no resize event that would update its cutout."""
    palette.dismiss()
    window.commands.run(f"layout.{layout}")
    window.theme.set_text_percent(150)
    stop = next(each for each in window.findChildren(StopButton) if each.isVisible())
    qtbot.waitUntil(lambda: stop.size() == stop.sizeHint())
    sheet = Steady(window.theme, window, "Steady")
    sheet.open()
    qtbot.waitUntil(lambda: sheet.graphicsEffect() is None)

    def follows() -> None:
        body = QRect(stop.mapTo(window, QPoint()), stop.size()).adjusted(4, 4, -4, -4)
        hole = QRegion(sheet._scrim.rect()) - sheet._scrim.mask()
        assert hole.boundingRect() == body
        assert not sheet.geometry().intersects(body)

    for percent in (200, 125, 100):
        window.theme.set_text_percent(percent)
        qtbot.waitUntil(lambda: stop.size() == stop.sizeHint())
        qtbot.waitUntil(follows)


def test_f12_stops_while_the_palette_is_open(palette: CommandPalette, commands: Commands) -> None:
    stops: list[str] = []
    commands.actions["run.stop"].triggered.connect(lambda: stops.append("stop"))
    QTest.keyClick(palette.field, Qt.Key.Key_F12)
    assert stops == ["stop"]
    assert palette.isVisible()


def test_command_is_found_and_run(palette: CommandPalette, window: MainWindow) -> None:
    QTest.keyClicks(palette.field, "dark")
    assert words(palette)[0] == "Dark"
    QTest.keyClick(palette.field, Qt.Key.Key_Return)
    assert not palette.isVisible()
    assert window.theme.is_dark
    palette.open()
    assert headings(palette)[0] == "Recently used"
    assert words(palette)[0] == "Dark"


def test_recently_used_commands_are_saved_in_the_settings(
    palette: CommandPalette, window: MainWindow
) -> None:
    QTest.keyClicks(palette.field, "larger")
    QTest.keyClick(palette.field, Qt.Key.Key_Return)
    assert window.session.settings.palette_entries == ("command:text.larger",)


def test_results_are_selected_by_keyboard(palette: CommandPalette) -> None:
    order = words(palette)

    def chosen_after(key: Qt.Key) -> str:
        QTest.keyClick(palette.field, key)
        entry = palette.rows.entry
        assert entry is not None
        return entry.text

    assert chosen_after(Qt.Key.Key_Down) == order[1]
    assert chosen_after(Qt.Key.Key_Up) == order[0]
    assert chosen_after(Qt.Key.Key_Up) == order[0]
    page = order.index(chosen_after(Qt.Key.Key_PageDown))
    assert 3 < page < 20
    assert chosen_after(Qt.Key.Key_End) == order[-1]
    assert chosen_after(Qt.Key.Key_Home) == order[0]


def test_esc_and_ctrl_k_close_the_palette_and_restore_focus(
    palette: CommandPalette, window: MainWindow
) -> None:
    palette.dismiss()
    panel = window.benches["developer"].docks["topics"].panel
    assert isinstance(panel, PlainPanel)
    panel.filter.setFocus()
    palette.open()
    QTest.keyClick(palette.field, Qt.Key.Key_Escape)
    assert not palette.isVisible()
    assert panel.filter.hasFocus()
    palette.open()
    QTest.keyClick(palette.field, Qt.Key.Key_K, CTRL)
    assert not palette.isVisible()


def test_click_outside_closes_the_palette(palette: CommandPalette) -> None:
    QTest.mouseClick(palette._scrim, Qt.MouseButton.LeftButton, pos=QPoint(20, 400))
    assert not palette.isVisible()


def test_tab_stays_inside_the_palette(palette: CommandPalette) -> None:
    for _ in range(3):
        QTest.keyClick(QApplication.focusWidget(), Qt.Key.Key_Tab)
        focus = QApplication.focusWidget()
        assert focus is not None
        assert palette.isAncestorOf(focus)


def test_panels_topics_and_files_are_found(
    palette: CommandPalette, window: MainWindow, tmp_path: Path
) -> None:
    palette.dismiss()
    topics = window.session.shown.topics
    topics._topics["/faces"] = Topic("/faces", "json", "json")
    topics.revision += 1
    file = tmp_path / "faces.nepb"
    file.write_text("{}", "utf-8")
    gone = RecentFile(tmp_path / "gone" / "old faces.nepb", "old faces", 0.0)
    window.session.settings.set_recent([RecentFile(file, "faces", 0.0), gone])
    palette.open()
    QTest.keyClicks(palette.field, "faces")
    assert {"Topics", "Recent files"} <= set(headings(palette))
    lines = {line.entry.text: line.entry for line in palette.rows.line_model.lines if isinstance(line, Match)}
    assert lines["old faces"].reason == "No longer in gone"
    assert lines["faces"].reason == ""
    palette.field.setText("/faces")
    QTest.keyClick(palette.field, Qt.Key.Key_Return)
    inspector = window.benches["developer"].docks["inspector"].panel
    assert isinstance(inspector, PlainPanel)
    assert inspector.topics == ["/faces"]
    palette.open()
    palette.field.setText("console")
    QTest.keyClick(palette.field, Qt.Key.Key_Return)
    dock = window.panel_focus.focused_dock()
    assert dock is not None
    assert dock.description.name == "console"


def test_examples_are_found_and_open_as_new_behaviours(palette, window: MainWindow, tmp_path: Path) -> None:
    path = tmp_path / "Tour.nepb"
    OpenProject().save(path)
    window.start.examples = (Example(path, "Tour guide", "Shows the room", ()),)
    palette.dismiss()
    palette.open()
    QTest.keyClicks(palette.field, "tour g")
    rows = [each.entry.text for each in palette.rows.line_model.lines if isinstance(each, Match)]
    assert (rows, headings(palette)) == (["Tour guide"], ["Examples"])
    QTest.keyClick(palette.field, Qt.Key.Key_Return)
    assert window.session.document.name == "Tour"
    assert window.session.document.path is None


def test_unavailable_command_shows_the_reason_and_is_not_run(
    palette: CommandPalette, window: MainWindow
) -> None:
    palette.field.setText("smaller text")
    entry = palette.rows.entry
    assert entry is not None
    assert entry.reason == "Text is at its smallest"
    QTest.keyClick(palette.field, Qt.Key.Key_Return)
    assert palette.isVisible()
    assert window.theme.text_percent == 100


def test_empty_result_is_reported(palette: CommandPalette) -> None:
    palette.field.setText("qqqq")
    assert palette.rows.entry is None
    assert palette.no_result_label.text() == "No results for “qqqq”."
    assert palette.no_result_label.isVisible()
    QTest.keyClick(palette.field, Qt.Key.Key_Return)
    assert palette.isVisible()


def test_result_list_is_bounded_with_ten_thousand_topics(palette: CommandPalette, window: MainWindow) -> None:
    palette.dismiss()
    for number in range(10_000):
        window.session.shown.topics._topics[f"/t{number}"] = Topic(f"/t{number}", "json", "json")
    window.session.shown.topics.revision += 1
    palette.open()
    assert len(palette.rows.line_model.lines) < 120
    QTest.keyClicks(palette.field, "t9")
    assert len(palette.rows.line_model.lines) < 120
    assert palette.foot.result_text.endswith(f" of {len(palette._finder.entries)}")
    assert palette.height() < 600


def test_screen_reader_text_contains_command_menu_and_shortcut(palette: CommandPalette) -> None:
    palette.field.setText("stop the program")
    index = palette.rows.currentIndex()
    spoken = index.data(Qt.ItemDataRole.AccessibleTextRole)
    assert spoken == "Stop the program and all robots, Run, key F12"
    assert palette.field.accessibleName()
    assert palette.accessibleName() == "Command palette"


def test_search_field_in_the_app_bar_opens_the_palette(palette: CommandPalette, window: MainWindow) -> None:
    palette.dismiss()
    assert window.bar.search.toolTip() == "Find a command or panel (Ctrl+K)"
    QTest.mouseClick(window.bar.search, Qt.MouseButton.LeftButton)
    assert palette.isVisible()
