"""Tests of the spans of runs and alarms in a recording, also from damaged entries."""

from __future__ import annotations

import pytest

from app.core.recording.replay import spans as spans_module
from app.core.recording.replay.spans import RecordedSpan, spans_of
from nep.recordings.reader import Recording
from nep.recordings.writer import RecordingWriter
from tests.nep.recordings.messages import START_NS, STEP_NS, TestClock, json_message, limits

LAST_NS = START_NS + 9 * STEP_NS


def at(step: int) -> int:
    return START_NS + step * STEP_NS


@pytest.fixture
def found(tmp_path):
    """Function that records ten messages and the given entries, and returns the spans of the recording."""

    def make(*said: tuple[int, str, object]):
        path = tmp_path / "a.mcap"
        path.unlink(missing_ok=True)
        with RecordingWriter(path, clock=TestClock(), limits=limits(stats_interval_s=1e6)) as writer:
            for number in range(10):
                for after, role, value in said:
                    if after == number:
                        writer.write_entry(role, value)
                        assert writer.flush()
                writer.post([json_message(number)])
                assert writer.flush()
        with Recording(path) as recording:
            ends.extend((recording.start_ns, recording.end_ns))
            return spans_of(recording)

    ends: list[int] = []
    make.ends = ends
    return make


def run(**changed: object) -> dict[str, object]:
    return {"id": "run-1", "name": "Greeting", "since_ns": None, "until_ns": None, **changed}


def test_run_spans_from_start_to_end_with_its_latest_text(found):
    made = found(
        (2, "runs", run(since_ns=at(1))),
        (5, "runs", run(since_ns=at(1), until_ns=at(4), result="stopped")),
        (6, "runs", run(since_ns=at(1), until_ns=at(4), result="stopped", words="Stop, 41 ms")),
    )
    assert made.runs == (RecordedSpan(at(1), at(4), "Greeting", True, "stopped", "Stop, 41 ms"),)
    assert (made.alarms, made.omitted_count, made.starts()) == ((), 0, [at(1)])


def test_ongoing_event_from_before_the_start_spans_the_whole_recording(found):
    made = found((2, "alarms", run(since_ns=5, severity="error", topic="/camera")))
    first, last = found.ends
    assert made.alarms == (RecordedSpan(first, last, "Greeting", is_error=True, topic="/camera"),)


def test_graph_alert_spans_until_the_first_list_without_that_alert(found):
    alert = {"id": "type:/camera", "sentence": "two types on /camera", "hint": ""}
    made = found(
        (2, "alerts", {"alerts": [alert]}),
        (4, "alerts", {"alerts": [alert, {"id": "clock", "sentence": "clocks differ"}]}),
        (6, "alerts", {"alerts": []}),
        (8, "alerts", {"alerts": [alert]}),
    )
    assert [(each.name, each.has_ended, each.topic) for each in made.alarms] == [
        ("two types on /camera", True, "/camera"),
        ("clocks differ", True, ""),
        ("two types on /camera", False, "/camera"),
    ]
    first, second, third = made.alarms
    assert first.start_ns < second.start_ns < first.end_ns == second.end_ns < third.start_ns
    assert third.end_ns == found.ends[1]


@pytest.mark.parametrize(
    "value",
    [7, [], {}, {"id": 3}, {"alerts": 3}, {"alerts": [3, {}, {"id": 7}]}, run(since_ns=True, until_ns="x"),
     run(since_ns=-(2**63), until_ns=2**64 - 1), run(since_ns=2**64 - 1, until_ns=0),
     run(name=3, result=[], words={})],
)  # fmt: skip
@pytest.mark.parametrize("role", ["runs", "alarms", "alerts"])
def test_spans_of_invalid_entries_stay_within_the_recording(found, role, value):
    made = found((3, role, value))
    first, last = found.ends
    for span in (*made.runs, *made.alarms):
        assert first <= span.start_ns <= span.end_ns <= last
        assert span.result == ""


def test_number_of_spans_is_limited_and_excess_is_counted(found, monkeypatch):
    monkeypatch.setattr(spans_module, "MAX_SPANS", 4)
    said = [(1, "runs", run(id=f"run-{number}")) for number in range(7)]
    made = found(*said, *said)
    assert (len(made.runs), made.omitted_count) == (4, 3)
