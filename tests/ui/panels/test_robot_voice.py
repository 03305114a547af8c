"""What robots say is heard where there is a voice, and ends at once with Stop; captions stay in any case."""

from __future__ import annotations

import pytest

from app.ui.panels.robot.panel import PANEL, SOUND, RobotPanel
from app.ui.panels.robot.voice import QtSpeaker, RobotVoices, Speaker
from app.ui.robot_drawing.state import RobotState
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, press


class FakeSpeaker:
    """Has a voice for English; notes what it is told."""

    def __init__(self) -> None:
        self.did: list[object] = []

    def say(self, words: str, language: str, volume: float) -> bool:
        if language != "en":
            return False
        self.did.append((words, volume))
        return True

    def stop(self) -> None:
        self.did.append("stop")


def speaking(words: str | None, spoken: float = 0.1, **more: object) -> dict[str, RobotState]:
    return {"Pepper": RobotState(speech=words, spoken=spoken, **more)}  # type: ignore[arg-type]


@pytest.mark.parametrize("make", [FakeSpeaker, QtSpeaker])
def test_every_speaker_takes_anything_and_may_be_stopped_at_any_time(qapp, make) -> None:
    speaker: Speaker = make()
    speaker.stop()
    assert speaker.say("Saluton", "xx", 0.5) is False
    speaker.stop()
    speaker.stop()


def test_each_speech_is_said_once() -> None:
    speaker = FakeSpeaker()
    voices = RobotVoices(speaker, lambda: True)
    for spoken in (0.0, 0.3, 0.95):
        voices.follow(speaking("Hello", spoken, volume=0.4))
    voices.follow(speaking(None))
    assert speaker.did == [("Hello", 0.4)]  # its voice may take a little longer than the bubble
    voices.follow(speaking("Hello"))
    voices.follow(speaking("Bye"))
    assert [said[0] for said in speaker.did] == ["Hello", "Hello", "Bye"]


@pytest.mark.parametrize("after", [speaking(None), {}], ids=["stopped", "gone"])
def test_a_speech_that_is_broken_off_is_silent_at_once(after) -> None:
    speaker = FakeSpeaker()
    voices = RobotVoices(speaker, lambda: True)
    voices.follow(speaking("A long story", 0.2))
    voices.follow(after)
    assert speaker.did[-1] == "stop"


def test_switched_off_it_ends_at_once_and_begins_with_the_next_speech() -> None:
    speaker, on = FakeSpeaker(), [True]
    voices = RobotVoices(speaker, lambda: on[0])
    voices.follow(speaking("A long story", 0.2))
    on[0] = False
    voices.follow(speaking("A long story", 0.3))
    assert speaker.did[-1] == "stop"
    voices.follow(speaking("More"))
    assert len(speaker.did) == 2
    on[0] = True
    voices.follow(speaking("The end"))
    assert speaker.did[-1] == ("The end", 0.6)


def test_a_language_without_a_voice_is_only_shown() -> None:
    speaker = FakeSpeaker()
    RobotVoices(speaker, lambda: True).follow(speaking("Bonjour", language="fr"))
    assert speaker.did == []


def test_the_button_is_kept(qtbot) -> None:
    window = Window(Session.full())
    panel = window.make(PANEL, (384, 320))
    qtbot.addWidget(panel)
    assert isinstance(panel, RobotPanel)
    assert panel.sound.accessibleName() == "Mute the robots"
    press(panel.sound)
    assert (window.session.settings.get(SOUND, True), panel.sound.accessibleName()) == (
        False,
        "Hear the robots",
    )
    press(panel.sound)
    assert window.session.settings.get(SOUND, False)
