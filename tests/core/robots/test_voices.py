"""Tests of robot speech: one robot at a time, without a visible panel, silenced at once by Stop."""

from __future__ import annotations

import pytest

from app.core.robots.voices import (
    MAX_NOTES_S,
    MAX_QUEUED,
    Notes,
    RobotSound,
    RobotVoices,
    Speaker,
)
from app.robots.client.stop_report import StopReport
from app.robots.description.description import parse, thing_description
from app.robots.simulated import ROBOT as PEPPER
from tests.ui.fakes import Session

STATE = "/{}/state"


class FakeSpeaker:
    """Fake speaker that records its calls and is busy until the test ends the utterance."""

    def __init__(self) -> None:
        self.did: list[object] = []
        self.is_busy = False
        self.problem = ""

    def speak(self, words: str, language: str, volume: float) -> None:
        self.did.append((words, language, volume))
        self.is_busy = True

    def play(self, notes: Notes, volume: float) -> None:
        self.did.append((tuple(notes), volume))

    def stop_voice(self) -> None:
        self.did.append("stop voice")
        self.is_busy = False

    def stop(self) -> None:
        self.did.append("stop")
        self.is_busy = False


class Case:
    """Session with virtual robots that publish what they speak."""

    def __init__(self, *names: str) -> None:
        self.session = Session()
        for name in names:
            self.session.join(parse(thing_description(PEPPER.thing_model, name)))
        self.speaker = FakeSpeaker()
        speaker: Speaker = self.speaker
        self.session.voices.speaker = speaker
        self.session.tick()

    def tell(self, name: str, words: str | None, spoken: float = 0.1, **more: object) -> None:
        told = {"speech": words, "spoken": spoken, "language": "en", "volume": 40, **more}
        link = self.session.fleet.link(name)
        assert link is not None
        link.drawing = told
        self.session.tick()

    @property
    def said(self) -> list[object]:
        return [each[0] for each in self.speaker.did if isinstance(each, tuple)]


@pytest.fixture
def case() -> Case:
    return Case("Pepper", "Ginger")


def test_each_utterance_is_spoken_once_without_a_visible_panel(case) -> None:
    for spoken in (0.0, 0.3, 0.95):
        case.tell("Pepper", "Hello", spoken)
    case.tell("Pepper", None)
    assert case.speaker.did == [("Hello", "en", 0.4)]  # speech may take a little longer than its bubble
    case.speaker.is_busy = False
    case.tell("Pepper", "Hello", 0.0)
    case.tell("Pepper", "Hello", 0.9)
    case.speaker.is_busy = False
    case.tell("Pepper", "Hello", 0.0)  # the same text again at once
    assert case.said == ["Hello", "Hello", "Hello"]


def test_robot_state_is_not_watched_when_sound_is_off(case) -> None:
    assert {STATE.format("Pepper"), STATE.format("Ginger")} <= case.session.live.source.wanted
    case.session.settings.is_robot_sound_on = False
    case.session.tick()
    assert STATE.format("Pepper") not in case.session.live.source.wanted
    case.session.settings.is_robot_sound_on = True
    case.session.tick()
    assert STATE.format("Pepper") in case.session.live.source.wanted


def test_two_robots_speak_in_turn_and_caption_names_the_speaker(case) -> None:
    case.tell("Pepper", "A long story")
    case.tell("Ginger", "And I say")
    assert case.said == ["A long story"]
    case.tell("Ginger", "And I say", 0.95)
    case.tell("Ginger", None)
    case.speaker.is_busy = False
    case.session.tick()
    assert case.said == ["A long story", "And I say"]
    said = case.session.voices.current
    assert said is not None
    assert (said.robot, said.text) == ("Ginger", "And I say")
    case.speaker.is_busy = False
    case.session.tick()
    assert case.session.voices.current is None


def test_queue_of_waiting_utterances_is_bounded_and_drops_are_logged(case) -> None:
    case.tell("Pepper", "A long story")
    for count in range(MAX_QUEUED + 1):
        case.tell("Ginger", f"word {count}", 0.95)
    lines = [line.text for line in case.session.console.records if line.origin == "Ginger"]
    assert lines == ["“word 0” was shown but not spoken: too many texts were waiting"]
    heard = []
    for _turn in range(MAX_QUEUED + 2):
        case.speaker.is_busy = False
        case.session.tick()
        heard = case.said
    assert heard == ["A long story", *(f"word {count}" for count in range(1, MAX_QUEUED + 1))]


def test_voice_that_never_ends_times_out(case) -> None:
    case.tell("Pepper", "Hello", 0.95)
    case.tell("Ginger", "Hi", 0.95)
    case.session.clock.now += 60.0
    case.session.tick()
    assert case.speaker.did[-2:] == ["stop voice", ("Hi", "en", 0.4)]


@pytest.mark.parametrize("how", ["broken off", "gone"])
def test_interrupted_utterance_is_silenced_at_once(case, how) -> None:
    case.tell("Pepper", "A long story", 0.2)
    case.tell("Ginger", "Me, too", 0.95)
    if how == "gone":
        case.session.fleet.link("Pepper").is_connected = False
        case.session.tick()
    else:
        case.tell("Pepper", None)
    assert case.speaker.did[-2:] == ["stop voice", ("Me, too", "en", 0.4)]


def test_stop_silences_all_speech_including_queued(case) -> None:
    case.tell("Pepper", "A long story", 0.2)
    case.tell("Ginger", "Me, too", 0.95)
    case.session.fleet.mark_stopping(["Pepper", "Ginger"])
    words = {"Pepper": ("answered", "ok"), "Ginger": ("answered", "ok")}
    case.session.fleet.apply_stop(words, StopReport((), 0.0))
    case.tell("Pepper", "A long story", 0.3)  # the state contains the speech for one more moment
    assert case.speaker.did[-1] == "stop"
    case.speaker.is_busy = False
    case.session.tick()
    assert case.said == ["A long story"]


def test_disabling_sound_silences_at_once_and_enabling_waits_for_next_utterance(case) -> None:
    case.tell("Pepper", "A long story", 0.2)
    case.session.settings.is_robot_sound_on = False
    assert case.speaker.did[-1] == "stop"
    assert not case.session.voices.is_on
    case.session.settings.is_robot_sound_on = True
    case.session.tick()
    case.tell("Pepper", "The end")
    assert case.said[-1] == "The end"


def test_tones_play_alongside_speech_and_end_when_interrupted(case) -> None:
    case.tell("Pepper", "Hello")
    bell = {"number": 1, "title": "bell", "played": 0.1, "notes": [[880, 0.3], [0, 0.1]]}
    case.tell("Ginger", None, sound=None)
    case.tell("Ginger", None, sound=bell)
    case.tell("Ginger", None, sound={**bell, "played": 0.4})
    assert case.speaker.did == [("Hello", "en", 0.4), (((880.0, 0.3), (0.0, 0.1)), 0.4)]
    case.tell("Ginger", None, sound={**bell, "number": 2})
    case.tell("Ginger", None, sound=None)
    assert case.speaker.did[2:] == [(((880.0, 0.3), (0.0, 0.1)), 0.4), ((), 0.0)]


@pytest.mark.parametrize(
    "wrong",
    [
        "bell",
        {"notes": 3},
        {"notes": [[440]]},
        {"notes": [["a", 1]]},
        {"notes": [[5, 1]]},
        {"notes": [[440, 99]]},
    ],
)
def test_invalid_sound_is_silent(wrong) -> None:
    assert RobotSound.parse({"sound": wrong, "speech": 3, "spoken": "x", "volume": True}) == RobotSound()


def test_sound_duration_is_limited() -> None:
    notes = RobotSound.parse({"sound": {"number": 1, "notes": [[440, 0.9]] * 40}}).notes
    assert sum(seconds for _hz, seconds in notes) <= MAX_NOTES_S


def test_robot_state_is_not_watched_without_a_speaker() -> None:
    session = Session()
    session.join(parse(thing_description(PEPPER.thing_model, "Pepper")))
    voices: RobotVoices = session.voices
    voices.tick()
    voices.silence()
    assert STATE.format("Pepper") not in session.live.source.wanted
