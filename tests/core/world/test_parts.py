"""Tests of the parts of a session: their order, and that a part that raises doesn't stop the others."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

from app.core.session import Session
from app.core.storage.settings import Settings
from app.core.world.part import SessionPart

PHASES = ("start", "tick", "check", "close")


@pytest.fixture
def session(tmp_path: Path) -> Session:
    """Return a session that is never started and has no threads and no sockets."""
    return Session(
        Settings(tmp_path), address="127.0.0.1:1", journal_folder=tmp_path / "j", start_processes=False
    )


class RecordedPart(SessionPart):
    """Part that records its calls, and raises an exception in one of them."""

    def __init__(self, name: str, calls: list[str], failing_phase: str = "") -> None:
        self._name, self._calls, self._failing_phase = name, calls, failing_phase
        self.task = f"update {name}"

    @property
    def name(self) -> str:
        return self._name

    def start(self) -> None:
        self._record("start")

    def tick(self) -> None:
        self._record("tick")

    def check(self) -> None:
        self._record("check")

    def close(self) -> None:
        self._record("close")

    def _record(self, phase: str) -> None:
        self._calls.append(f"{phase} {self._name}")
        if phase == self._failing_phase:
            raise ValueError("no disk")


@pytest.mark.parametrize("phase", PHASES)
def test_part_that_raises_does_not_stop_the_other_parts(
    session: Session, phase: str, caplog: pytest.LogCaptureFixture
) -> None:
    calls: list[str] = []
    session.__dict__["_parts"] = (
        RecordedPart("first", calls),
        RecordedPart("second", calls, phase),
        RecordedPart("third", calls),
    )
    getattr(session, phase)()
    names = ("third", "second", "first") if phase == "close" else ("first", "second", "third")
    assert [call for call in calls if call.startswith(phase)] == [f"{phase} {name}" for name in names]
    assert [record.levelname for record in caplog.records] == ["ERROR"]
    if phase == "close":
        assert "close second" in caplog.records[0].getMessage()
    else:
        (alert,) = session.alerts.active
        assert alert.detail == "Studio can't update second: ValueError: no disk"


@pytest.mark.parametrize("phase", PHASES)
def test_each_part_runs_even_if_all_of_them_raise(
    session: Session, phase: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[SessionPart] = []

    def fail(part: SessionPart) -> None:
        calls.append(part)
        raise OSError

    for part in session._parts:
        monkeypatch.setattr(part, phase, partial(fail, part))
    getattr(session, phase)()
    assert calls == [*(reversed(session._parts) if phase == "close" else session._parts)]


def test_each_part_of_a_session_names_its_task_if_it_has_something_to_update(session: Session) -> None:
    for part in session._parts:
        does_nothing = all(
            getattr(type(part), phase) is getattr(SessionPart, phase) for phase in ("start", "tick", "check")
        )
        assert part.task or does_nothing, part.name


def test_program_is_closed_before_its_robots_and_the_recorder_before_the_network(session: Session) -> None:
    names = [part.name for part in reversed(session._parts)]
    for first, later in (
        ("CurrentRun", "StopConnections"),
        ("StopConnections", "ConnectedRobots"),
        ("ConnectedRobots", "LiveWorld"),
        ("SessionRecordings", "LiveWorld"),
        ("LiveWorld", "StartedPrograms"),
    ):
        assert names.index(first) < names.index(later)


def test_failing_run_does_not_prevent_the_second_stop_of_a_robot(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail() -> None:
        raise ValueError("no robot")

    stopped: list[str] = []
    monkeypatch.setattr(session.runs, "update_robots", fail)
    monkeypatch.setattr(session.runs, "stop_again", stopped.append)
    monkeypatch.setattr(session.fleet, "pop_settled_robots", lambda: ("turtle",))
    session.tick()
    assert stopped == ["turtle"]
