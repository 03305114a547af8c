"""Tests of action cards: state, replacement, remaining time, reply and last tries."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

from app.robots.description.inputs import Parameter
from app.robots.description.model import Action, DataField
from app.ui.panels.robots.robots.action_card import ActionCard
from app.ui.panels.robots.robots.invocations import fields_text, progress_of
from app.ui.theme.theme import Theme
from tests.ui.sample_data import Invocation

MOVE = Action(
    "go_far", "go far", "move", "Movement",
    (Parameter("distance", "distance", "number", -1, 1, 0.05, "m", 0.5),),
    "%robot go far", None, "/c", "/a", risk="moves", cancellable=True, timeout_s=10,
    feedback=(DataField("moved", "moved", "number", "m"),),
    output=(DataField("moved", "moved", "number", "m"), DataField("seconds", "seconds", "number", "s")),
)  # fmt: skip


@pytest.fixture
def card(qtbot) -> ActionCard:
    titles = {"show_emotion": "show emotion"}
    made = ActionCard(Theme("light"), MOVE, lambda _: (), title_of=lambda name: titles.get(name, name))
    qtbot.addWidget(made)
    made.resize(700, 200)
    made.show()
    return made


def tried(state: str = "running", **more: object) -> Invocation:
    return Invocation("1", "go_far", state, input={"distance": 0.5}, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (tried("sent"), "sent"),
        (tried("accepted", waits_for=("say", "show_emotion")), "waits for say and show emotion"),
        (tried("accepted", replaces=("turn",)), "replaces turn"),
        (tried(feedback={"moved": 0.2}), "moved 0.20 m"),
        (tried(elapsed_s=2.14), "for 2.1 s"),
    ],
)
def test_card_shows_the_current_state_of_the_action(card, made, words) -> None:
    card.show_invocation(made)
    assert card.text_label.text() == words
    assert card.try_button.text() == "Cancel"


def test_remaining_time_is_counted_down(card) -> None:
    card.show_invocation(tried(left_s=7.3))
    assert card.remaining_label.text() == "8 s left"
    assert card.remaining_label.isVisible()
    card.show_invocation(tried(left_s=-0.1))
    assert card.remaining_label.text() == "0 s left"
    card.show_invocation(tried())
    assert not card.remaining_label.isVisible()


def test_timeout_is_shown_as_a_sentence_below_the_card(card) -> None:
    card.show_invocation(tried("failed", error="go far took longer than 10 s"))
    assert (card.result.text, card.error.text()) == ("failed", "Go far took longer than 10 s.")
    assert card.try_button.text() == "Try"


def test_replaced_action_names_its_replacement_and_stopped_action_shows_no_text(card) -> None:
    card.show_invocation(tried("canceled", error="replaced by turn", elapsed_s=1.0))
    assert (card.result.text, card.error.text()) == ("stopped after 1.0 s", "Replaced by turn.")
    assert card.error.property("role") == "textSecondary"  # a replaced action isn't an error
    card.show_invocation(tried("canceled", elapsed_s=1.0), may_move=True)
    assert card.result.text == "ended after 1.0 s"  # the robot's standstill isn't confirmed
    card.show_invocation(tried("canceled", error="stopped", elapsed_s=1.0))
    assert not card.error.isVisible()


def test_robot_reply_is_shown_next_to_the_result(card) -> None:
    card.show_invocation(tried("succeeded", output={"moved": 0.5, "seconds": 1.4}, elapsed_s=1.5))
    assert card.text_label.text() == "moved 0.50 m"


@pytest.mark.parametrize(
    ("feedback", "share"),
    [
        ({"moved": 0.25}, 0.5),
        ({"moved": 9}, 1.0),
        ({"progress": 0.3}, 0.3),
        ({"moved": "far"}, None),
        ({}, None),
    ],
)
def test_feedback_as_a_fraction_of_the_input_is_a_progress_bar(card, feedback, share) -> None:
    assert progress_of(MOVE, {"distance": -0.5}, feedback) == share
    card.show_invocation(tried(feedback=feedback))
    assert card.progress.isVisible() == (share is not None)


@pytest.mark.parametrize(
    "field", [DataField("percent", "done", "number"), DataField("charge", "charge", "number", "%")]
)
def test_feedback_in_per_cent_is_a_progress_bar(field) -> None:
    action = Action("load", "load", "x", "X", (), "load", None, "/c", "/a", feedback=(field,))
    assert progress_of(action, {}, {field.name: 40}) == 0.4
    assert fields_text((DataField("open", "open", "boolean"),), {"open": True}) == "open yes"


def show(card: ActionCard, tries: Sequence[Invocation]) -> list[str]:
    card.show_tries(tries)
    return [f"{row.input_text}: {row.result}" for row in card.tries.rows]


def test_last_tries_are_listed_with_buttons_that_restore_their_input_values(card) -> None:
    assert not card.history_button.isVisible()
    done = Invocation(
        "1", "go_far", "succeeded", input={"distance": 0.25}, output={"moved": 0.25}, elapsed_s=1
    )
    late = Invocation("2", "go_far", "failed", error="go far took longer than 10 s", input={"distance": -0.5})
    other = Invocation("3", "say", "succeeded")
    running = Invocation("4", "go_far", "running")
    assert show(card, [done, late, other, running]) == [
        "distance -0.5 m: Go far took longer than 10 s",
        "distance 0.25 m: done in 1.0 s, moved 0.25 m",
    ]
    assert card.history_button.isVisible()
    assert not card.tries.isVisible()
    QTest.mouseClick(card.history_button, Qt.MouseButton.LeftButton)
    assert card.tries.isVisible()
    QTest.mouseClick(card.tries.rows[1], Qt.MouseButton.LeftButton)
    assert card.form.input() == {"distance": 0.25}
    many = [Invocation(str(n), "go_far", "canceled", error="stopped") for n in range(9)]
    assert len(show(card, many)) == 5


def test_ctrl_enter_tries_the_action(card, qtbot) -> None:
    with qtbot.waitSignal(card.try_requested) as told:
        QTest.keyClick(card, Qt.Key.Key_Return, Qt.KeyboardModifier.ControlModifier)
    assert told.args == [{"distance": 0.5}]
    card.show_invocation(tried())
    with qtbot.assertNotEmitted(card.try_requested):
        QTest.keyClick(card, Qt.Key.Key_Return, Qt.KeyboardModifier.ControlModifier)
