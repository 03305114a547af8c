"""Tests of the events of runs and alarms that are sent to the recorder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import pytest

from app.blocks.runtime.trace import BlockBegan, BlockEnded
from app.core.recording import events as events_module
from app.core.recording.events import RecordedEvents
from app.core.run.run_record import RunRecord
from app.core.run.view import RunState
from app.core.session import Session
from app.core.storage.settings import Settings
from app.robots.client.stop_report import RobotStop, StopReport
from nep.programs.alarms import AlarmCondition, AlarmEvent, AlarmRule

RUNNING = RunState("running", "Greeting", is_started=False, started_s=1.0)


class Told:
    """Collected events; the clock advances by 10 ns each time it is read."""

    def __init__(self) -> None:
        self.now, self.said, self.to = 1000, list[tuple[str, dict[str, object]]](), set[str]()
        self.events = RecordedEvents(self._say, clock_ns=self._clock)

    def _clock(self) -> int:
        self.now += 10
        return self.now

    def _say(self, role: str, value: Mapping[str, object], to: str = "") -> None:
        self.said.append((role, dict(value)))
        self.to.add(to)

    def follow(self, run: RunRecord, *states: RunState) -> list[dict[str, object]]:
        """Return the events sent for these states of a run."""
        self.said.clear()
        for state in states:
            run.state = state
            self.events.update_run(run)
        assert {role for role, _value in self.said} <= {"runs"}
        return [value for _role, value in self.said]


@pytest.fixture
def told() -> Told:
    return Told()


def event(kind: str, name: str = "/camera", condition: str = "silent") -> AlarmEvent:
    rule = AlarmRule(f"id of {name}", AlarmCondition(condition, name, for_s=2.0))
    return AlarmEvent(kind, rule, 1.0, 4.0)


def test_run_is_recorded_at_start_and_end_and_again_with_its_confirmed_stop(told):
    begun = replace(RUNNING, is_started=True, started_s=1.2)
    stopping = replace(begun, state="stopping", description="x")
    report = StopReport((RobotStop("Pepper", True, 41.0),), 41.2)
    proven = replace(stopping, state="proven", report=report)
    run = RunRecord(RunState())
    first, *rest = told.follow(run, RunState(), RUNNING, begun, replace(begun, state="paused"), begun)
    assert (first["name"], first["since_ns"], first["until_ns"], rest) == ("Greeting", 1010, None, [])
    ended, answered = told.follow(run, stopping, proven, replace(proven, last_stop_text="still proven"))
    assert (ended["id"], ended["until_ns"], ended["result"], ended["words"]) == (
        first["id"], 1020, "stopped", "",
    )  # fmt: skip
    assert answered == {**ended, "words": "Stop, 41 ms"}


@pytest.mark.parametrize(
    ("changes", "result", "words"),
    [
        ({"is_finished": True}, "ended", ""),
        ({"errors": {"b": "wave failed"}}, "failed", "wave failed"),
        ({}, "stopped", ""),
    ],
)
def test_run_result_is_recorded(told, changes, result, words):
    *_begin, end = told.follow(RunRecord(RUNNING), RUNNING, replace(RUNNING, state="stopping", **changes))
    assert (end["result"], end["words"]) == (result, words)


def test_failure_is_read_from_the_trace(told):
    run = RunRecord(RUNNING)
    told.follow(run, RUNNING)
    run.blocks.apply([BlockBegan(0.0, 1, "b"), BlockEnded(1.0, 1, "b", "failed", "wave failed")])
    (end,) = told.follow(run, replace(RUNNING, state="stopping"))
    assert (end["result"], end["words"]) == ("failed", "wave failed")


def test_second_run_in_same_tick_is_a_separate_event(told):
    run = RunRecord(RUNNING)
    (first,) = told.follow(run, RUNNING)
    run.state = replace(RUNNING, state="proven", is_finished=True)
    tour = replace(RUNNING, name="Tour")
    over, second = told.follow(RunRecord(tour), tour)
    assert (over["id"], over["until_ns"], over["result"]) == (first["id"], 1020, "ended")
    assert (second["name"], second["until_ns"]) == ("Tour", None)
    assert second["id"] != first["id"]


def test_trial_of_stack_is_recorded_with_text_of_its_block(told):
    tried = replace(RUNNING, tried_label="wave")
    (said,) = told.follow(RunRecord(tried), tried)
    assert said["name"] == "wave"


def test_alarm_start_and_end_are_recorded_once_each(told):
    for kind in ("on", "still", "off", "off"):
        told.events.on_alarm(event(kind))
    (role, on), (_role, off) = told.said
    assert role == "alarms"
    assert (on["topic"], on["severity"], on["until_ns"]) == ("/camera", "error", None)
    assert "/camera" in on["name"]
    assert off == {**on, "until_ns": 1020}
    told.events.on_alarm(event("on"))
    assert told.said[-1][1]["id"] != on["id"]


def test_alarm_about_node_has_no_topic(told):
    told.events.on_alarm(event("on", "arm", "leaves"))
    assert told.said[0][1]["topic"] == ""


def test_only_ongoing_events_are_resent_to_the_flight_recorder(told):
    told.events.on_alarm(event("on", "/a"))
    told.events.on_alarm(event("on", "/b"))
    told.events.update_run(RunRecord(RUNNING))
    told.events.on_alarm(event("off", "/a"))
    assert told.to == {""}
    told.said.clear()
    told.events.resend("ring")
    assert told.to == {"", "ring"}
    assert [role for role, _value in told.said] == ["alarms", "runs"]
    assert all(value["until_ns"] is None for _role, value in told.said)


def test_many_alarms_are_recorded_once_each_and_active_alarms_are_limited(told, monkeypatch):
    monkeypatch.setattr(events_module, "MAX_ACTIVE_ALARMS", 3)
    for number in range(5):
        told.events.on_alarm(event("on", f"/{number}"))
    assert len(told.said) == 5
    told.said.clear()
    told.events.resend("recording")
    assert len(told.said) == 3
    told.events.on_alarm(event("off", "/4"))
    assert len(told.said) == 3  # not tracked above the limit, so its end isn't sent


def test_session_sends_events_to_its_recorder(tmp_path, monkeypatch):
    monkeypatch.setenv("NEP_STUDIO_HOME", str(tmp_path))
    session = Session(Settings(tmp_path), address="127.0.0.1:1", start_processes=False)  # never started
    said: list[tuple[str, object]] = []

    def say(role: str, told: Mapping[str, object], to: str = "") -> None:
        said.append((role, told.get("topic", told["name"])))

    monkeypatch.setattr(session.recordings.events, "_send_event", say)
    session.alarms.on_event(event("on", "/camera"))
    monkeypatch.setattr(session.runs, "_run", RUNNING)
    session.tick()
    assert said[:2] == [("alarms", "/camera"), ("runs", "Greeting")]
    session.close()
