"""Tests of the mute button, the reason for a missing voice, and the display of played sounds."""

from __future__ import annotations

import pytest

from app.core.robots.voices import Utterance
from app.robots.virtual.body import Body
from app.robots.virtual.simulation import drawing_state
from app.ui.panels.robots.robot.panel import PANEL, RobotPanel
from app.ui.robot_drawing.state import RobotState
from tests.core.robots.test_voices import FakeSpeaker
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, press


@pytest.fixture
def window(qapp) -> Window:
    return Window(Session.full())


@pytest.fixture
def panel(qtbot, window) -> RobotPanel:
    made = window.make(PANEL, (384, 320))
    qtbot.addWidget(made)
    assert isinstance(made, RobotPanel)
    return made


def test_mute_setting_is_saved(panel, window) -> None:
    assert panel.sound_button.accessibleName() == "Mute the robots"
    press(panel.sound_button)
    heard = window.session.settings.is_robot_sound_on
    assert (heard, panel.sound_button.accessibleName()) == (False, "Unmute the robots")
    press(panel.sound_button)
    assert window.session.settings.is_robot_sound_on


def test_mute_button_shows_the_reason_for_a_missing_voice(panel, window) -> None:
    speaker = window.session.voices.speaker = FakeSpeaker()
    panel.refresh()
    assert "no voice" not in panel.sound_button.toolTip()
    speaker.problem = "This computer has no voice for English."
    panel.refresh()
    assert "This computer has no voice for English." in panel.sound_button.toolTip()
    assert panel.sound_button.accessibleDescription() == "This computer has no voice for English."
    press(panel.sound_button)  # while muted, the missing voice doesn't matter
    assert "no voice" not in panel.sound_button.toolTip()


def test_sound_is_shown_in_the_caption_as_a_note_with_its_name() -> None:
    played = {"title": "bell", "number": 1, "notes": [[880, 0.3]], "played": 0.1}
    assert RobotState.parse({"sound": played}).caption == "♪\N{NO-BREAK SPACE}bell"
    assert RobotState.parse({"speech": "Hi", "sound": played}).caption == "Hi ♪\N{NO-BREAK SPACE}bell"
    assert RobotState.parse({"speech": "Hi", "sound": 3}).caption == "Hi"


def test_sound_bubble_is_painted(panel, window) -> None:
    body = Body()
    link = window.session.fleet.links[0]
    link.drawing = drawing_state(body)
    panel.refresh()
    silent = panel.view.grab().toImage()
    body.play("bell", ((880, 0.3),))
    link.drawing = drawing_state(body)
    panel.refresh()
    assert panel.view.grab().toImage() != silent
    assert panel.view.accessibleDescription() == "♪\N{NO-BREAK SPACE}bell"


def test_speaker_is_named_in_the_caption_while_speaking(panel, window) -> None:
    panel.refresh()
    before = panel.view.grab().toImage()
    window.session.voices._current = Utterance("Ginger", "And I say", "en", 0.5)
    panel.refresh()
    assert panel.view.caption == "Ginger: And I say"
    assert panel.view.grab().toImage() != before
    window.session.voices._current = None
    panel.refresh()
    assert panel.view.caption == ""
