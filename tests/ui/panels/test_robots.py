from __future__ import annotations

import datetime as dt
import time
from dataclasses import replace

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

from app.robots.description.model import DataField
from app.ui.panels.robots.robots.invocations import feedback_text, progress_of
from app.ui.panels.robots.robots.list import seen_text
from app.ui.panels.robots.robots.panel import PANEL, RobotsPanel
from app.ui.widgets.inputs.fields import LongTextField
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, button, press
from tests.ui.sample_data import ACTIONS, Invocation, pepper


@pytest.fixture
def window(qapp) -> Window:
    return Window(Session.full())


@pytest.fixture
def panel(qtbot, window) -> RobotsPanel:
    made = window.make(PANEL, (1032, 800))
    qtbot.addWidget(made)
    assert isinstance(made, RobotsPanel)
    return made


def test_every_action_except_stop_is_a_card(panel) -> None:
    assert list(panel.cards) == [action.name for action in ACTIONS if action.name != "stop"]
    assert (panel.name.text(), panel.chip.text, panel.about.text()) == (
        "Pepper",
        "ready",
        "virtual, 6 actions",
    )
    assert panel.cards["walk"].risk.text == "moves the robot"


def test_try_button_sends_the_input_of_the_form(panel, window) -> None:
    panel.cards["turn"].form.set_input({"angle": -45.0})
    press(panel.cards["turn"].try_button)
    assert window.session.asked("Pepper") == [("invoke", "turn", {"angle": -45.0, "speed": 40.0})]


def test_rejected_input_is_reported_below_its_row(panel, window) -> None:
    card = panel.cards["say"]
    field = card.findChild(LongTextField)
    assert field is not None
    field.set_text("")
    press(card.try_button)
    assert "not be empty" in card.form._error_labels["text"].text()
    assert field.is_invalid
    assert window.session.fleet.links[0].invocations == {}


@pytest.mark.parametrize(
    ("state", "error", "chip", "status", "sentence"),
    [
        ("succeeded", None, "done in 1.4 s", "ok", ""),
        ("canceled", None, "stopped after 1.4 s", "off", ""),
        ("failed", "the way is blocked", "failed", "error", "The way is blocked."),
        ("failed", None, "failed", "error", "The robot reported no reason."),
    ],
)
def test_result_of_an_action_is_shown(panel, window, state, error, chip, status, sentence) -> None:
    link = window.session.fleet.links[0]
    link.invocations["turn"] = Invocation("1", "turn", state, error=error, elapsed_s=1.4)
    panel.refresh()
    card = panel.cards["turn"]
    assert (card.result.text, card.result.status, card.error.text()) == (chip, status, sentence)
    assert card.try_button.text() == "Try"


def test_running_action_shows_progress_and_can_be_cancelled(panel, window) -> None:
    link = window.session.fleet.links[0]
    made = link.invocations["walk"] = Invocation("1", "walk", "running", {"progress": 0.4}, elapsed_s=0.6)
    panel.refresh()
    card = panel.cards["walk"]
    assert card.progress.isVisible()
    assert card.progress.fraction == pytest.approx(0.4)
    assert card.text_label.text() == "for 0.6 s"
    press(card.try_button)
    assert window.session.asked("Pepper") == [("cancel", "walk", None)]
    made.state = "canceled"
    panel.refresh()
    assert not card.progress.isVisible()
    assert card.text_label.text() == ""


def test_non_cancellable_action_disables_its_button_while_running(panel, window) -> None:
    window.session.fleet.links[0].invocations["light"] = Invocation("1", "light", "running")
    panel.refresh()
    assert not panel.cards["light"].try_button.isEnabled()


def test_feedback_is_labelled_by_the_robot_description() -> None:
    walk = next(action for action in ACTIONS if action.name == "walk")
    fields = DataField("to_go", "to go", "number", "m"), DataField("word", "word", "text")
    walk = replace(walk, feedback=fields)
    assert feedback_text(walk, {"to_go": 0.301, "progress": 0.5, "other": 1}) == "0.30 m to go"
    assert feedback_text(walk, {"word": "hello"}) == "“hello”"
    assert progress_of(walk, {"distance": 0.5}, {"progress": 0.25}) == 0.25
    assert progress_of(walk, {"distance": -0.5}, {"to_go": -0.2}) == pytest.approx(0.6)
    assert progress_of(walk, {}, {"to_go": 0.2}) is None
    assert progress_of(walk, {"distance": 0.5}, {}) is None


def test_only_the_try_button_of_the_focused_card_is_filled(qtbot, panel) -> None:
    kinds = {name: card.try_button.kind for name, card in panel.cards.items()}
    assert [name for name, kind in kinds.items() if kind == "primary"] == ["say"]
    panel.activateWindow()
    panel.cards["turn"].try_button.setFocus(Qt.FocusReason.TabFocusReason)
    qtbot.waitUntil(lambda: panel.cards["turn"].try_button.kind == "primary")
    assert panel.cards["say"].try_button.kind == "plain"


def test_search_shows_actions_of_a_category_and_reports_no_match(panel) -> None:
    QTest.keyClicks(panel.finder, "lights")  # the category of both actions
    assert [name for name, card in panel.cards.items() if card.isVisibleTo(panel)] == ["light", "emotion"]
    panel.finder.setText("fly")
    assert panel.no_match_label.isVisible()


def test_later_cards_are_collapsed_and_summarise_their_values(panel) -> None:
    card = panel.cards["emotion"]
    assert not card.form.isVisibleTo(card)
    assert card.summary.text() == "happy, for 2 s"
    press(card.collapse_button)
    assert card.form.isVisibleTo(card)


def test_stop_stops_the_selected_robot(panel, window) -> None:
    assert panel.stop.text() == "Stop Pepper"
    press(panel.stop)
    assert window.session.fleet.stopping_robots == ("Pepper",)


def test_only_the_selected_robot_is_watched(panel, window) -> None:
    link = window.session.join(pepper("Turtle"), virtual=False)
    link.invocations["walk"] = Invocation("1", "walk")
    panel.refresh()
    press(panel.items["Turtle"])
    assert panel.name.text() == "Turtle"
    assert window.session.looked_at == ["Turtle"]
    panel.refresh()
    assert panel.items["Turtle"].chip.text == "busy"
    panel.dispose()
    assert window.session.looked_at == []


def test_forms_keep_typed_input_when_other_robots_connect(panel, window) -> None:
    panel.cards["say"].form.set_input({"text": "half a sentence"})
    window.session.join(pepper("Turtle"))
    panel.refresh()
    assert panel.cards["say"].form.input()["text"] == "half a sentence"


def test_panel_without_a_robot_offers_the_virtual_robot(qtbot, qapp) -> None:
    window = Window(Session())
    panel = window.make(PANEL)
    qtbot.addWidget(panel)
    press(button(panel, "Use the virtual robot"))
    assert window.commands == ["robots.virtual"]


def remember(window, name: str, seen_s: float) -> None:
    known = window.session.fleet.known_robots.robots
    told = [{"name": one.name, "seen_s": one.seen_s} for one in known]
    window.session.settings.known_robots = [*told, {"name": name, "seen_s": seen_s}]


def test_robot_of_an_earlier_session_is_listed_as_disconnected_and_can_be_removed(qtbot, window) -> None:
    remember(window, "NAO", time.time() - 86_400 * 400)
    panel = window.make(PANEL, (1032, 800))
    qtbot.addWidget(panel)
    nao = panel.list.disconnected_items["NAO"]
    assert nao.chip.text == "not running"
    assert nao.location.startswith("seen ")
    menu = panel.list.menu_of(nao)
    assert [action.text() for action in menu.actions()] == ["Find the cause", "Remove NAO from the list"]
    menu.actions()[1].trigger()
    assert panel.list.disconnected_items == {}
    assert list(panel.items) == ["Pepper"]


def test_known_robots_are_listed_in_the_empty_state_if_none_is_connected(qtbot) -> None:
    window = Window(Session())
    remember(window, "NAO", 0.0)
    panel = window.make(PANEL, (1032, 800))
    qtbot.addWidget(panel)
    assert panel.pages.currentIndex() == 0
    assert panel.list.disconnected_items["NAO"].isVisible()


def test_disconnected_robot_shows_its_last_seen_time_and_can_be_removed(panel, window) -> None:
    fleet = window.session.fleet
    link = window.session.join(pepper("Rover"), virtual=False)
    fleet.known_robots.record([link.robot])
    link.is_connected = False
    fleet.revision += 1
    panel.refresh()
    assert panel.items["Rover"].location.startswith("seen today")
    panel.select_robot("Rover")
    panel.list.menu_of(panel.items["Rover"]).actions()[1].trigger()
    assert list(panel.items) == ["Pepper"]
    assert panel.name.text() == "Pepper"


def test_connected_robot_has_no_menu(panel) -> None:
    assert panel.list.menu_of(panel.items["Pepper"]) is None


@pytest.mark.parametrize(
    ("now", "words"),
    [
        ((2026, 11, 20, 22, 0), "seen today, 16:20"),
        ((2026, 11, 21, 9, 0), "seen yesterday, 16:20"),
        ((2026, 12, 1, 9, 0), "seen 20 November, 16:20"),
    ],
)
def test_last_seen_time_is_formatted_relative_to_today(now, words) -> None:
    seen = dt.datetime(2026, 11, 20, 16, 20, tzinfo=dt.timezone.utc)
    assert seen_text(seen.timestamp(), dt.datetime(*now, tzinfo=dt.timezone.utc)) == words


def test_narrow_header_shrinks_the_search_field_before_it_hides_the_description(panel) -> None:
    header, about, finder = panel.head, panel.about, panel.finder
    header.name.setText("Pepper in the laboratory")
    widths = []
    for width in range(1200, 619, -1):
        header.resize(width, header.height())
        if not about.isVisibleTo(header):
            break
        widths.append(finder.width())
        assert about.displayed_text() == "virtual, 6 actions"
    else:
        pytest.fail("the description is never hidden")
    assert (widths[0], widths[-1]) == (180, 110)
    assert finder.isVisibleTo(header)
    assert finder.width() > 110  # the search field takes the space of the description
