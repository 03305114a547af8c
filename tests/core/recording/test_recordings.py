"""Tests of a session's recordings: started and stopped by the user or an alarm, and settings kept."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path

import pytest

from app.core.alerts.alerts import Alerts
from app.core.recording.client import RecorderEvent, RecorderExited
from app.core.recording.recordings import (
    NO_FOLDER_ALERT,
    SessionRecordings,
    saved_file_name,
)
from app.core.recording.topic_choice import RecordingChoice, RingSettings
from app.core.storage.settings import Settings
from app.intents import ChooseRecordingsFolder
from nep.programs.alarms import AlarmAction, AlarmCondition, AlarmEvent, AlarmRule
from tests.core.recording.test_client import OrdersOnly, status

NOW = datetime(2026, 11, 26, 22, 1, 5, tzinfo=timezone.utc)


class Recorded:
    """Recordings of a session with fake recorder processes."""

    def __init__(self, home: Path) -> None:
        self.home, self.alerts, self.lines, self.now = home, Alerts(), list[OrdersOnly](), 100.0
        self.made: list[tuple[str, str]] = []
        self.recordings = self.again()

    def again(self) -> SessionRecordings:
        made = SessionRecordings(
            Settings(self.home), self.alerts, "here:1", print,
            start=self._start, clock=lambda: self.now, now=lambda: NOW,
        )  # fmt: skip
        made.on_created = lambda path, kind: self.made.append((path.name, kind))
        return made

    def _start(self, _number: int, _address: str, _post: Callable[[object], object]) -> OrdersOnly:
        self.lines.append(OrdersOnly())
        return self.lines[-1]

    def say(self, event: str, **content: object) -> None:
        self.recordings.on_event(RecorderEvent(len(self.lines), {"event": event, **content}))

    def orders(self) -> list[object]:
        return [order["op"] for line in self.lines for order in line.orders]


@pytest.fixture
def made(tmp_path, monkeypatch) -> Recorded:
    monkeypatch.setenv("NEP_STUDIO_HOME", str(tmp_path))
    return Recorded(tmp_path)


def test_recording_starts_with_last_choice_and_ends(made):
    recordings = made.recordings
    recordings.set_choice(RecordingChoice("pattern", patterns=("/arm/*",), excluded=("/arm/raw",)))
    assert recordings.record("../Aiko: greets", "second try") == ""
    (order,) = made.lines[0].orders
    assert order["path"] == str(made.home / "Recordings" / "Aiko greets.mcap")
    assert (order["topics"], order["left_out"], order["note"]) == (["/arm/*"], ["/arm/raw"], "second try")
    assert recordings.record() == "Already recording."
    made.say("recording")
    made.now += 42.5
    assert (recordings.is_recording, recordings.elapsed_s) == (True, 42.5)
    recordings.stop()
    assert made.made == []
    made.say("ended", status=status())
    assert made.made == [("Aiko greets.mcap", "recorded")]
    assert (recordings.is_recording, recordings.elapsed_s) == (False, 0.0)


def test_new_recording_includes_ongoing_events(made):
    recordings = made.recordings
    rule = AlarmRule("1", AlarmCondition("silent", "/camera", for_s=2.0))
    recordings.events.on_alarm(AlarmEvent("on", rule, 1000.0))
    recordings.record("a")
    made.say("recording")
    recordings.check()

    def said() -> list[tuple[str, str]]:
        orders = made.lines[0].orders
        return [(each["value"]["topic"], each["to"]) for each in orders if each["op"] == "say"]

    assert said() == [("/camera", "recording")]
    recordings.set_ring_settings(RingSettings(is_on=True))
    recordings.check()
    assert said() == [("/camera", "recording"), ("/camera", "ring")]


def test_one_time_recording_choice_is_not_saved(made):
    only = RecordingChoice("chosen", ("/odom",))
    assert made.recordings.record(choice=only) == ""
    assert made.recordings.active_choice == only
    assert made.recordings.choice == RecordingChoice()
    assert made.again().choice == RecordingChoice()


def test_invalid_recording_request_returns_reason_and_starts_nothing(made):
    made.recordings.set_choice(RecordingChoice("chosen"))
    assert made.recordings.record() == "No topic is selected."
    assert made.recordings.save_last() == "The flight recorder is off."
    assert made.lines == []


def test_existing_file_name_gets_a_numeric_suffix_and_nothing_is_overwritten(made):
    folder = made.home / "Recordings"
    folder.mkdir()
    (folder / "a.mcap").write_bytes(b"precious")
    made.recordings.record("a")
    assert made.lines[0].orders[0]["path"] == str(folder / "a 2.mcap")


def test_missing_selected_folder_is_reported_not_created(made):
    away = made.home / "stick" / "films"
    made.recordings.set_folder(away)
    assert made.again().folder == away
    assert made.recordings.record() == "The recordings folder is missing."
    (alert,) = made.alerts.active
    assert (alert.id, alert.intent) == (NO_FOLDER_ALERT, ChooseRecordingsFolder())
    assert not away.exists()
    assert made.lines == []
    away.mkdir(parents=True)
    assert made.recordings.record() == ""
    assert not made.alerts.active


def test_folder_creation_failure_is_reported(made):
    (made.home / "Recordings").write_bytes(b"a file in its place")
    assert made.recordings.record() == "The recordings folder is missing."
    assert made.alerts.has(NO_FOLDER_ALERT)


def test_flight_recorder_is_off_by_default_and_restored_at_next_start(made):
    made.recordings.start()
    assert made.lines == []
    made.recordings.set_ring_settings(RingSettings(is_on=True, seconds=30, size_gb=0.5))
    assert made.lines[0].orders[0]["seconds"] == 30.0
    assert made.lines[0].orders[0]["size_bytes"] == 500_000_000
    made.recordings.close()
    later = made.again()
    later.start()
    assert made.lines[1].orders[0]["op"] == "ring"
    later.set_ring_settings(replace(later.ring_settings, is_on=False))
    assert made.orders() == ["ring", "ring", "end_ring"]


def alarm() -> tuple[AlarmEvent, AlarmAction]:
    action = AlarmAction("keep", recording_s=20.0)
    rule = AlarmRule("r", AlarmCondition("silent", "/camera", for_s=2.0), (action,))
    return AlarmEvent("on", rule, 1000.0), action


def test_alarm_saves_last_seconds_and_is_notified_when_saved(made):
    told: list[tuple[bool, str]] = []
    made.recordings.set_ring_settings(RingSettings(is_on=True))
    made.say("ring")
    made.recordings.save_for_alarm(*alarm(), lambda well, words: told.append((well, words)))
    order = made.lines[0].orders[-1]
    assert (order["op"], order["seconds"]) == ("keep", 20.0)
    assert "/camera" in order["note"]
    assert told == []
    made.say("kept", path=order["path"])
    assert told == [(True, "saved alarm-2026-11-26-22-01-05.mcap")]
    assert saved_file_name(told[0][1]) == "alarm-2026-11-26-22-01-05.mcap"
    assert made.made == [("alarm-2026-11-26-22-01-05.mcap", "kept")]


def test_alarm_is_notified_of_the_reason_for_not_saving(made):
    told: list[tuple[bool, str]] = []

    def done(well: bool, words: str) -> None:
        told.append((well, words))

    made.recordings.save_for_alarm(*alarm(), done)
    assert told == [(False, "nothing saved: the flight recorder is off")]
    made.recordings.set_ring_settings(RingSettings(is_on=True))
    made.say("ring")
    for _each in range(3):  # three file names within one second
        made.recordings.save_for_alarm(*alarm(), done)
    paths = [order["path"] for order in made.lines[0].orders if order["op"] == "keep"]
    assert len(set(paths)) == 3
    made.say("problem", op="keep", path=paths[0], sentence="the disk is full")
    made.recordings.on_event(RecorderExited(len(made.lines), "killed"))
    assert told[1:] == [(False, "nothing saved: see the alerts")] * 3
    assert made.made == []
    assert made.alerts.has("recorder:keep")


@pytest.mark.parametrize("words", ["", "sound", "kept nothing", "mcap", ".mcapx"])
def test_text_without_a_file_name_returns_an_empty_name(words):
    assert saved_file_name(words) == ""
