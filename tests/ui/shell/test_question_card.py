"""Tests of the card with a question of the running behaviour: keyboard, pause and position beside Stop."""

from __future__ import annotations

from typing import cast

import pytest
from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from app.blocks.runtime.events import QuestionChanged
from app.core.run.asking import AskedQuestion, OpenQuestion
from app.core.run.runner import Runner
from app.ui.shell.bars.question_card import QuestionCard
from app.ui.shell.dialogs.overlay import stop_buttons_in
from app.ui.shell.main_window import MainWindow

pytest_plugins = ["tests.ui.shell_fixtures"]

NAME = AskedQuestion(1, 1, "What is your name?")
PET = AskedQuestion(1, 3, "Which one?", ("cat", "dog", "cow"))
AGE = AskedQuestion(1, 2, "How old are you?")


@pytest.fixture
def card(qtbot, window: MainWindow) -> QuestionCard:
    """Question card of a visible, active window."""
    window.show()
    qtbot.waitExposed(window)
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    return window.question_card


@pytest.fixture
def said(card: QuestionCard, monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, str]]:
    got: list[tuple[int, str]] = []
    monkeypatch.setattr(card, "_on_answer", lambda question, words: got.append((question.number, words)))
    return got


def test_question_gets_focus_and_enter_answers(card, said, window) -> None:
    before = window.bar.home
    before.setFocus()
    card.show_question(NAME, paused=False)
    assert card.isVisible()
    assert QApplication.focusWidget() is card.field
    assert card.text_label.text() == card.field.accessibleName() == "What is your name?"
    QTest.keyClicks(card.field, "Ada")
    QTest.keyClick(card.field, Qt.Key.Key_Return)
    assert said == [(1, "Ada")]
    card.show_question(None, paused=False)
    assert not card.isVisible()


def test_escape_answers_with_an_empty_text(card, said) -> None:
    card.show_question(NAME, paused=False)
    QTest.keyClicks(card.field, "Ada")
    QTest.keyClick(card.field, Qt.Key.Key_Escape)
    assert said == [(1, "")]


def test_button_answers_and_the_next_question_starts_empty(card, said) -> None:
    card.show_question(NAME, paused=False)
    QTest.keyClicks(card.field, "Ada")
    QTest.mouseClick(card.button, Qt.MouseButton.LeftButton)
    card.show_question(AGE, paused=False)
    assert (said, card.field.text(), card.text_label.text()) == ([(1, "Ada")], "", "How old are you?")
    assert QApplication.focusWidget() is card.field


def test_refresh_keeps_the_typed_text(card, said) -> None:
    card.show_question(NAME, paused=False)
    QTest.keyClicks(card.field, "Ad")
    card.show_question(NAME, paused=False)
    QTest.keyClicks(card.field, "a")
    assert card.field.text() == "Ada"


def test_input_is_disabled_while_paused(card, said) -> None:
    card.show_question(NAME, paused=False)
    QTest.keyClicks(card.field, "Ada")
    card.show_question(NAME, paused=True)
    QTest.keyClicks(card.field, "x")
    QTest.keyClick(card.field, Qt.Key.Key_Return)
    assert (said, card.field.text(), card.button.isEnabled()) == ([], "Ada", False)
    card.show_question(NAME, paused=False)
    QTest.keyClick(card.field, Qt.Key.Key_Return)
    assert said == [(1, "Ada")]


@pytest.mark.parametrize("words", ["", "👍" * 3, "A very long question, " * 20])
@pytest.mark.parametrize("size", [(1024, 600), (1440, 900)])
def test_card_stays_inside_the_window_and_does_not_cover_stop(card, window, words, size) -> None:
    window.resize(*size)
    card.show_question(AskedQuestion(1, 1, words), paused=False)
    assert window.rect().contains(card.geometry())
    assert card.text_label.text()
    stops = [QRect(stop.mapTo(window, QPoint()), stop.size()) for stop in stop_buttons_in(window)]
    assert stops
    assert not [stop for stop in stops if stop.intersects(card.geometry())]


class Answered:
    """Fake runner that records answers to questions."""

    def __init__(self, run: int) -> None:
        self.run = run
        self.got: list[tuple[int, str]] = []

    def answer(self, question: int, words: str) -> None:
        self.got.append((question, words))


def test_only_the_current_question_can_be_answered_and_only_once() -> None:
    asking, runner = OpenQuestion(), Answered(4)
    asking.on_event(QuestionChanged(run=4, text="Nobody runs yet", question=9))
    assert asking.question is None
    asking.reset(cast("Runner", runner))
    asking.on_event(QuestionChanged(run=4, text="Name?", question=1))
    shown = asking.question
    assert shown is not None
    asking.on_event(QuestionChanged(run=4, text="Age?", question=2))
    asking.answer(shown, "late")
    assert runner.got == []
    newest = asking.question
    assert newest is not None
    asking.answer(newest, "7")
    asking.answer(newest, "8")
    assert (runner.got, asking.question) == ([(2, "7")], None)
    asking.on_event(QuestionChanged(run=4, question=0))
    assert asking.question is None
    asking.on_event(QuestionChanged(run=4, text="Name?", question=3))
    asking.clear()
    assert asking.question is None


def test_choices_are_large_buttons_and_a_click_answers(card, said) -> None:
    card.show_question(PET, paused=False)
    assert [each.text() for each in card.choices.buttons] == ["cat", "dog", "cow"]
    assert all(each.height() >= 48 and each.isVisible() for each in card.choices.buttons)
    assert not card.field.isVisible()
    QTest.mouseClick(card.choices.buttons[1], Qt.MouseButton.LeftButton)
    assert said == [(3, "dog")]
    card.show_question(NAME, paused=False)
    assert card.field.isVisible()
    assert QApplication.focusWidget() is card.field
    assert not card.choices.buttons


@pytest.mark.parametrize(
    ("keys", "answer"),
    [
        ([Qt.Key.Key_Return], "cat"),
        ([Qt.Key.Key_Right, Qt.Key.Key_Space], "dog"),
        ([Qt.Key.Key_Right, Qt.Key.Key_Right, Qt.Key.Key_Left, Qt.Key.Key_Enter], "dog"),
        ([Qt.Key.Key_Down, Qt.Key.Key_Up, Qt.Key.Key_Up, Qt.Key.Key_Return], "cat"),
        ([Qt.Key.Key_Tab, Qt.Key.Key_Tab, Qt.Key.Key_Return], "cow"),
        ([Qt.Key.Key_3], "cow"),
        ([Qt.Key.Key_Escape], ""),
    ],
)
def test_choices_are_selected_by_keyboard(card, said, keys, answer) -> None:
    card.show_question(PET, paused=False)
    for key in keys:
        focus = QApplication.focusWidget()
        assert focus is not None
        QTest.keyClick(focus, key)
    assert said == [(3, answer)]


def test_number_key_without_a_matching_choice_has_no_effect(card, said) -> None:
    card.show_question(PET, paused=False)
    QTest.keyClick(card.choices.buttons[0], Qt.Key.Key_4)
    QTest.keyClick(card.choices.buttons[0], Qt.Key.Key_1, Qt.KeyboardModifier.ControlModifier)
    assert said == []


def test_choices_are_disabled_while_paused_and_keys_are_ignored(card, said) -> None:
    card.show_question(PET, paused=False)
    card.show_question(PET, paused=True)
    assert QApplication.focusWidget() is card
    for key in (Qt.Key.Key_Return, Qt.Key.Key_2, Qt.Key.Key_Escape):
        QTest.keyClick(card, key)
    QTest.mouseClick(card.choices.buttons[1], Qt.MouseButton.LeftButton)
    assert said == []
    card.show_question(PET, paused=False)
    assert QApplication.focusWidget() is card.choices.buttons[0]
    QTest.keyClick(card.choices.buttons[0], Qt.Key.Key_2)
    assert said == [(3, "dog")]


@pytest.mark.parametrize("size", [(1024, 600), (1440, 900)])
def test_long_choices_wrap_and_many_choices_scroll_to_the_focused_choice(card, window, size, qtbot) -> None:
    window.resize(*size)
    many = tuple(f"{number} " + "a choice of some length " * 8 for number in range(12))
    card.show_question(AskedQuestion(1, 4, "Which one? " * 20, many), paused=False)
    assert window.rect().contains(card.geometry())
    stops = [QRect(stop.mapTo(window, QPoint()), stop.size()) for stop in stop_buttons_in(window)]
    assert not [stop for stop in stops if stop.intersects(card.geometry())]
    assert card.choices.buttons[0].height() > 2 * card.choices.buttons[0].fontMetrics().height()
    for _each in range(11):
        focus = QApplication.focusWidget()
        assert focus is not None
        QTest.keyClick(focus, Qt.Key.Key_Down)
    last = card.choices.buttons[11]
    assert last.hasFocus()
    qtbot.waitUntil(lambda: last.visibleRegion().boundingRect() == last.rect())


@pytest.mark.parametrize("away_between", [True, False])
def test_question_with_more_choices_than_the_previous_question_shows_all_choices(
    card, qtbot, away_between: bool
) -> None:
    card.show_question(AskedQuestion(1, 7, "Play?", ("yes", "no")), paused=False)
    QTest.qWait(1)
    if away_between:
        card.show_question(None, paused=False)
        QTest.qWait(1)
    card.show_question(AskedQuestion(1, 8, "Which?", ("red", "green", "a blue like the sky")), paused=False)
    qtbot.waitUntil(
        lambda: all(each.visibleRegion().boundingRect() == each.rect() for each in card.choices.buttons)
    )


def test_short_choices_are_placed_side_by_side(card) -> None:
    card.show_question(AskedQuestion(1, 5, "Play?", ("yes", "no")), paused=False)
    yes, no = card.choices.buttons
    assert yes.y() == no.y()
    assert yes.geometry().right() < no.x()
