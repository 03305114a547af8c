"""Tests of the speaker, which never blocks on audio and gives a reason when it is silent."""

from __future__ import annotations

import subprocess
import sys
import threading
from array import array
from collections.abc import Callable, Iterator
from itertools import pairwise

import pytest

from app.core.robots.voices import Notes
from app.ui.speaker import QtEngine, QtSpeaker, no_voice_message, passes_voice_test, samples, voice_text


class FakeEngine:
    """Fake engine with an English voice, whose start and end are controlled by the test."""

    def __init__(self) -> None:
        self.did: list[object] = []
        self.may_begin = threading.Event()
        self.may_begin.set()
        self.begins = threading.Event()
        self.end: Callable[[], None] | None = None
        self.threads: set[str] = set()

    def make(self) -> FakeEngine:
        self.begins.set()
        assert self.may_begin.wait(20)
        return self

    def speak(self, words: str, language: str, volume: float, ended: Callable[[], None]) -> str:
        self.threads.add(threading.current_thread().name)
        if language != "en":
            return no_voice_message(language)
        self.did.append((words, volume))
        self.end = ended
        return ""

    def play(self, notes: Notes, volume: float) -> str:
        self.did.append((notes, volume))
        return ""

    def stop_voice(self) -> None:
        self.did.append("stop voice")

    def stop_tones(self) -> None:
        self.did.append("stop tones")


@pytest.fixture
def engine() -> FakeEngine:
    return FakeEngine()


@pytest.fixture
def speaker(qapp, engine) -> Iterator[QtSpeaker]:
    made = QtSpeaker(engine.make)
    yield made
    engine.may_begin.set()
    made.close()
    assert "robots' voice" not in [thread.name for thread in threading.enumerate()]


def test_no_engine_is_created_before_the_first_speech(speaker, engine) -> None:
    speaker.stop()
    speaker.stop_voice()
    speaker.play((), 0.0)
    assert not engine.begins.is_set()
    assert "robots' voice" not in [thread.name for thread in threading.enumerate()]


def test_voice_is_busy_until_its_engine_has_finished(qtbot, speaker, engine) -> None:
    speaker.speak("Hello", "en", 0.5)
    assert speaker.is_busy
    qtbot.waitUntil(lambda: engine.end is not None)
    assert engine.did == [("Hello", 0.5)]
    assert speaker.is_busy
    assert engine.threads == {"robots' voice"}
    engine.end()
    qtbot.waitUntil(lambda: not speaker.is_busy)
    assert speaker.problem == ""


def test_slow_engine_does_not_block_the_caller_and_stop_cancels_pending_speech(
    qtbot, speaker, engine
) -> None:
    engine.may_begin.clear()
    speaker.speak("Hello", "en", 0.5)
    speaker.play(((440.0, 0.1),), 0.5)
    assert engine.begins.wait(20)  # the caller isn't blocked while the engine starts
    assert speaker.is_busy
    speaker.stop()
    assert not speaker.is_busy
    speaker.speak("Again", "en", 0.5)
    engine.may_begin.set()
    qtbot.waitUntil(lambda: engine.end is not None)
    assert [each for each in engine.did if isinstance(each, tuple)] == [("Again", 0.5)]


def test_late_end_of_a_stopped_speech_does_not_end_the_next_speech(qtbot, speaker, engine) -> None:
    speaker.speak("Hello", "en", 0.5)
    qtbot.waitUntil(lambda: engine.end is not None)
    first, engine.end = engine.end, None
    speaker.stop_voice()
    speaker.speak("Again", "en", 0.5)
    qtbot.waitUntil(lambda: engine.end is not None)
    first()
    speaker.speak("More", "fr", 0.5)
    qtbot.waitUntil(lambda: speaker.problem != "")
    assert [each for each in engine.did if isinstance(each, tuple)] == [("Hello", 0.5), ("Again", 0.5)]


def test_speech_in_a_language_without_a_voice_ends_immediately_with_a_reason(qtbot, speaker) -> None:
    speaker.speak("Bonjour", "fr", 0.5)
    qtbot.waitUntil(lambda: not speaker.is_busy)
    assert speaker.problem == "This computer has no voice for French."
    speaker.speak("Hello", "en", 0.5)
    qtbot.waitUntil(lambda: speaker.problem == "")


def test_failing_engine_leaves_the_speaker_silent_with_a_reason(qtbot, caplog) -> None:
    def broken() -> FakeEngine:
        raise RuntimeError("no sound server")

    speaker = QtSpeaker(broken)
    speaker.speak("Hello", "en", 0.5)
    qtbot.waitUntil(lambda: not speaker.is_busy)
    assert speaker.problem == "This computer can't play sound."
    speaker.close()
    assert "no sound server" in caplog.text


def test_speaker_without_audio_libraries_is_silent_with_a_reason(qtbot) -> None:
    speaker = QtSpeaker(QtEngine)
    speaker.speak("Hello", "en", 0.5)
    qtbot.waitUntil(lambda: not speaker.is_busy)
    assert speaker.problem == "This computer has no voice for English."
    speaker.play(((440.0, 0.1),), 0.5)
    qtbot.waitUntil(lambda: len(speaker._problems) == 2)
    assert speaker._problems["play"] == "This computer can't play sound."
    speaker.close()


def test_voice_engine_that_crashes_in_its_test_process_is_not_created(qtbot, monkeypatch, caplog) -> None:
    crash = [sys.executable, "-c", "import os; os.kill(os.getpid(), 11)"]
    assert not passes_voice_test(crash)
    assert "the test process exited with" in caplog.text
    assert not passes_voice_test([sys.executable + " is not there"])
    assert passes_voice_test([sys.executable, "-c", ""])
    monkeypatch.setattr("app.ui.speaker.has_voice_engine", lambda: True)
    monkeypatch.setattr("app.ui.speaker.module_command", lambda module: crash)
    assert QtEngine().speak("Hello", "en", 0.5, lambda: None) == no_voice_message("en")


def test_hanging_test_process_of_the_voice_engine_is_terminated(monkeypatch) -> None:
    monkeypatch.setattr("app.ui.speaker.TEST_TIMEOUT_S", 0.2)
    assert not passes_voice_test([sys.executable, "-c", "import threading; threading.Event().wait()"])
    hangs = "import threading; from app.ui import speaker; speaker.TEST_TIMEOUT_S = 0.2; "
    hangs += "speaker._run_voice_test = lambda: threading.Event().wait(); speaker.try_voice()"
    assert subprocess.run([sys.executable, "-c", hangs], check=False).returncode == 1


def test_tone_has_the_requested_pitch_duration_and_volume_without_clicks() -> None:
    made = array("h", samples(((441.0, 0.5), (0.0, 0.25)), 1.0))
    assert len(made) == round(44_100 * 0.75)
    rises = sum(1 for one, two in pairwise(made) if one < 0 <= two)
    assert abs(rises - 441 * 0.5) <= 1
    assert abs(made[0]) < 50
    assert set(made[-10_000:]) == {0}
    quiet = array("h", samples(((441.0, 0.5),), 0.5))
    assert abs(max(made) - 2 * max(quiet)) < 5
    assert samples((), 1.0) == b""


def test_message_about_a_missing_voice_names_the_packages_or_settings_to_install() -> None:
    assert voice_text("", has_engine=True) == "Robots speak with the voice of this computer."
    silent = voice_text("", has_engine=False, platform="linux")
    assert silent.startswith(
        "This computer has no voice, so what robots say is only shown as text. Install the packages"
    )
    assert "Windows" in voice_text("", has_engine=False, platform="win32")
    assert "System Settings" in voice_text("", has_engine=False, platform="darwin")
    french = voice_text(no_voice_message("fr"), has_engine=True, platform="freebsd")
    assert french.startswith("This computer has no voice for French. Install the packages")
