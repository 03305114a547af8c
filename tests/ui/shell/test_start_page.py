"""Tests of the start page: cards, examples and open work."""

from __future__ import annotations

import datetime as dt
import json
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QScrollArea

from app import resources
from app.core.storage.settings import RecentFile
from app.ui.shell.start_page.cards import CardTitle, StartCard
from app.ui.shell.start_page.open_work import OpenWork
from app.ui.shell.start_page.page import StartPage, read_examples
from app.ui.shell.start_page.preview import Row, category_of, rows
from app.ui.text.dates import relative_day_text
from app.ui.theme.theme import Theme
from app.ui.widgets import Button
from app.ui.widgets.buttons import LinkButton
from tests.ui.shell_parts import examples

pytest_plugins = ["tests.ui.shell_fixtures"]
NOW = dt.datetime(2026, 11, 20, 9, 0, tzinfo=dt.timezone.utc)


@pytest.fixture
def page(qtbot, theme: Theme, tmp_path: Path) -> StartPage:
    theme.apply()
    made = StartPage(theme, examples(tmp_path))
    made.resize(1440, 820)
    qtbot.addWidget(made)
    made.show_recent([])
    made.show()
    return made


def words(page: StartPage) -> str:
    labels = [shown.text() for shown in page.findChildren(QLabel) if shown.isVisible()]
    return " | ".join(
        [*labels, *(button.text() for button in page.findChildren(Button) if button.isVisible())]
    )


def test_start_page_offers_a_robot_a_behaviour_and_examples(page: StartPage) -> None:
    seen = words(page)
    for part in ("What would you like to do?", "Use the virtual robot", "New behaviour", "Open an example"):
        assert part in seen
    assert "First steps" in seen
    assert "Find mine" not in seen
    assert "Recent" not in seen
    assert [card.text() for card in page.example_cards] == ["Greeting", "Quiz"]


def test_start_page_has_exactly_one_primary_button(page: StartPage) -> None:
    assert [b.text() for b in page.findChildren(Button) if b.kind == "primary"] == ["Use the virtual robot"]


def cards(page: StartPage) -> list[StartCard]:
    """Return the start cards from left to right."""
    return sorted(page.findChildren(StartCard), key=lambda card: (card.y(), card.x()))


def filled(page: StartPage) -> list[str]:
    return [b.text() for b in page.findChildren(Button) if b.kind == "primary"]


def test_new_user_is_offered_the_first_steps_before_other_cards(qtbot, page: StartPage) -> None:
    page.offer_first_steps()
    page.focus_first()
    qtbot.waitUntil(lambda: cards(page)[0] is page.learn_card)
    assert page.learn_card.width() > max(card.width() for card in cards(page)[1:])
    assert filled(page) == ["First steps"]
    assert "First steps (five minutes)" in words(page)
    button = page.focusWidget()
    assert isinstance(button, Button)
    assert button.text() == "First steps"
    order = []
    while len(order) < 4:
        order.append(button.text())
        button = button.nextInFocusChain()
    assert order == ["First steps", "Cancel", "Use the virtual robot", "New behaviour"]


def test_declining_the_first_steps_offer_restores_the_three_cards(qtbot, page: StartPage) -> None:
    before = cards(page)
    page.offer_first_steps()
    (no,) = [each for each in page.findChildren(Button) if each.text() == "Cancel"]
    no.setFocus()
    QTest.mouseClick(no, Qt.MouseButton.LeftButton)
    assert not page.offers_first_steps
    qtbot.waitUntil(lambda: cards(page) == before)
    assert not no.isVisible()
    assert filled(page) == ["Use the virtual robot"]
    assert page.focusWidget().text() == "Use the virtual robot"
    assert "Learn in five minutes" in words(page)


def test_first_steps_are_not_offered_when_work_is_open(page: StartPage) -> None:
    page.offer_first_steps()
    page.show_open([OpenWork("a", "Greeting")])
    assert not page.offers_first_steps


def test_start_page_buttons_emit_their_signals(qtbot, page: StartPage, tmp_path: Path) -> None:
    told: list[object] = []
    page.virtual_robot_pressed.connect(lambda: told.append("robot"))
    page.new_behaviour_pressed.connect(lambda: told.append("new"))
    page.example_selected.connect(told.append)
    page.learn_pressed.connect(lambda: told.append("learn"))
    page.developer_pressed.connect(lambda: told.append("developer"))
    for button in page.findChildren(Button):
        if button.text() in {"Use the virtual robot", "New behaviour", "First steps"}:
            QTest.mouseClick(button, Qt.MouseButton.LeftButton)
    QTest.keyClick(page.example_cards[1], Qt.Key.Key_Space)
    (developers,) = [each for each in page.findChildren(LinkButton) if "Developer" in each.text()]
    QTest.mouseClick(developers, Qt.MouseButton.LeftButton)
    assert told == ["robot", "new", "learn", tmp_path / "Quiz.nepb", "developer"]


def test_open_work_is_listed_first_and_opens_its_tab(page: StartPage) -> None:
    assert "Open now" not in words(page)
    page.show_open(
        [OpenWork("a", "Greeting", is_unsaved=True), OpenWork("b", "Quiz", path="/q.nepb", is_running=True)]
    )
    assert "Open now" in words(page)
    assert [row.accessibleName() for row in page.open_work.rows] == [
        "Continue with Greeting, unsaved changes",
        "Continue with Quiz, running",
    ]
    told: list[str] = []
    page.work_selected.connect(told.append)
    QTest.mouseClick(page.open_work.rows[1], Qt.MouseButton.LeftButton)
    QTest.keyClick(page.open_work.rows[0], Qt.Key.Key_Space)
    assert told == ["b", "a"]
    page.show_open([])
    assert "Open now" not in words(page)


def test_examples_command_shows_all_examples_and_focuses_the_first(page: StartPage) -> None:
    page.focus_examples()
    assert page.focusWidget() is page.example_cards[0]
    assert all(card.isVisible() for card in page.example_cards)


def test_examples_command_scrolls_the_examples_into_view(qtbot, page: StartPage) -> None:
    page.resize(1280, 700)
    page.show_open([OpenWork("a", "Greeting")])
    page.hide()
    page.show()
    page.focus_examples()
    for card in page.example_cards:
        qtbot.waitUntil(lambda card=card: card.visibleRegion().boundingRect() == card.rect())


def test_returning_to_the_start_page_scrolls_to_the_top(qtbot, page: StartPage) -> None:
    page.resize(1100, 500)
    bar = page.findChild(QScrollArea).verticalScrollBar()
    page.focus_examples()
    qtbot.waitUntil(lambda: bar.value() > 0)
    page.focus_first()
    assert bar.value() == 0


def test_rows_of_unchanged_open_work_are_reused(page: StartPage) -> None:
    work = [OpenWork("a", "Greeting")]
    page.show_open(work)
    row = page.open_work.rows[0]
    page.show_open(list(work))
    assert page.open_work.rows == [row]


def test_recent_files_are_listed_with_their_date(page: StartPage, tmp_path: Path) -> None:
    page.show_recent(
        [RecentFile(tmp_path / f"{n}.nepb", f"Story {n}", NOW.timestamp() - n * 86400) for n in range(4)], NOW
    )
    QTest.qWait(1)
    assert "Recent" in words(page)
    assert [row.accessibleName() for row in page.recent_rows] == [
        "Open Story 0, Today, 9:00",
        "Open Story 1, Yesterday",
        "Open Story 2, 18 November",
    ]
    page.show_recent([])
    assert "Recent" not in words(page)


@pytest.mark.parametrize(
    ("days", "said"),
    [(0, "Today, 9:00"), (1, "Yesterday"), (3, "17 November"), (400, "16 October 2025")],
)
def test_recent_dates_are_formatted_relative_to_today(days: int, said: str) -> None:
    assert relative_day_text(NOW - dt.timedelta(days=days), NOW) == said


def test_robots_chip_is_shown_only_with_a_robot(qtbot, page: StartPage) -> None:
    assert not page.robot_card.chip.isVisible()
    page.show_robot("Pepper ready", "ok")
    assert page.robot_card.chip.isVisible()
    title = page.robot_card.findChild(CardTitle)
    assert title is not None
    half = page.robot_card.width() / 2
    qtbot.waitUntil(lambda: title.x() + title.width() < page.robot_card.chip.x() < half)  # beside its title
    page.show_robot("", "off")
    assert not page.robot_card.chip.isVisible()


@pytest.mark.parametrize("percent", [100, 150, 200])
def test_start_page_clips_no_text_at_any_text_size(
    qtbot, page: StartPage, theme: Theme, percent: int
) -> None:
    page.resize(1100, 660)
    theme.set_text_percent(percent)
    QTest.qWait(1)
    for shown in page.findChildren(QLabel):
        if shown.isVisible() and shown.text():
            room = shown.heightForWidth(shown.width()) if shown.wordWrap() else shown.sizeHint().height()
            assert shown.height() >= room, shown.text()


def test_card_art_is_hidden_with_large_text_in_a_low_window(qtbot, page: StartPage, theme: Theme) -> None:
    page.resize(1024, 530)
    theme.set_text_percent(200)
    first = page.robot_card
    qtbot.waitUntil(lambda: not first.art.isVisible())
    page.resize(1024, 900)
    qtbot.waitUntil(first.art.isVisible)


def test_first_three_examples_have_a_description_and_preview_rows_that_start_with_an_event() -> None:
    found = read_examples(resources.folder() / "examples")
    assert len(found) >= 3
    for example in found[:3]:
        assert example.text
        assert len(example.rows) >= 3
        assert example.rows[0].category == "events"


def test_example_titles_and_descriptions_are_translated(pseudo) -> None:
    for each in read_examples(resources.folder() / "examples"):
        assert each.name.startswith("[")
        assert each.text.startswith("[")


def test_damaged_example_is_skipped(tmp_path: Path) -> None:
    (tmp_path / "a.nepb").write_text("{", "utf-8")
    (tmp_path / "b.nepb").write_text(json.dumps({"workspace": 3}), "utf-8")
    (tmp_path / "c.nepb").write_text(json.dumps({"name": "C", "workspace": {}}), "utf-8")
    assert [example.name for example in read_examples(tmp_path)] == ["C"]
    assert read_examples(tmp_path / "nowhere") == ()


@pytest.mark.parametrize(
    ("kind", "category"),
    [
        ("control_wait", "control"),
        ("robot_pepper_do_say", "robot"),
        ("robot_virtual_pepper_get_battery", "sensors"),
        ("robot_pepper_when_touched", "events"),
    ],
)
def test_block_category_is_derived_from_the_block_type(kind: str, category: str) -> None:
    assert category_of(kind) == category


def test_preview_rows_follow_the_block_order_and_indent_nested_blocks() -> None:
    inner = {"type": "robot_pepper_do_say", "inputs": {"TEXT": {"shadow": {"type": "values_text"}}}}
    repeat = {
        "type": "control_repeat",
        "inputs": {"TIMES": {}, "DO": {"block": inner}},
        "next": {"block": inner},
    }
    top = {"type": "events_started", "next": {"block": repeat}}
    found = rows({"blocks": {"blocks": [{"type": "values_text"}, top]}})
    assert found == (
        Row(0, "events", 7, 0),
        Row(0, "control", 6, 1),
        Row(1, "robot", 3, 1),
        Row(0, "robot", 3, 1),
    )


@pytest.mark.parametrize("workspace", [{}, {"blocks": 3}, {"blocks": {"blocks": [1, None]}}])
def test_workspace_without_blocks_has_no_preview_rows(workspace: dict[str, object]) -> None:
    assert rows(workspace) == ()


def test_first_row_of_examples_is_shown_and_all_examples_on_request(qtbot, theme: Theme) -> None:
    shipped = read_examples(resources.path("examples"))
    page = StartPage(theme, shipped)
    qtbot.addWidget(page)
    page.resize(1440, 820)
    page.show()
    assert len(shipped) == 8
    shown = lambda: [card.text() for card in page.example_cards if card.isVisible()]  # noqa: E731
    assert shown() == ["Greeting", "Reaction to touch", "Tour guide", "A quiz"]
    (link,) = [each for each in page.findChildren(LinkButton) if "examples" in each.text()]
    assert link.text() == "All eight examples"
    QTest.keyClick(link, Qt.Key.Key_Space)
    assert len(shown()) == 8
    assert link.text() == "Fewer examples"
    QTest.mouseClick(link, Qt.MouseButton.LeftButton)
    assert len(shown()) == 4


def test_show_all_link_is_hidden_with_few_examples(page: StartPage) -> None:
    assert not [each for each in page.findChildren(LinkButton) if each.isVisible() and "All" in each.text()]


def test_card_art_is_hidden_when_the_cards_need_more_room_later(qtbot, page: StartPage) -> None:
    page.resize(1024, 530)
    art = page.new_card.art
    qtbot.waitUntil(art.isVisible)
    button = page.new_card.findChildren(Button)[0]
    button.setMinimumWidth(700)
    qtbot.waitUntil(lambda: not art.isVisible())
