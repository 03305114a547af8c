"""Tests of the order of a stop, of errors during it and of runs of empty behaviours."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import cast

import pytest

from app.core.robots.stop.report import RobotStopped, StopCompleted
from app.core.robots.stop.stopper import RobotStopper
from app.core.run.runner import Runner
from app.core.run.stop_job import stop_program, stop_robot
from app.core.session import Session
from app.core.storage.settings import Settings
from app.robots.client.stop_report import StopReport
from tests.blocks.fakes import until


class Steps:
    """Runner and stopper that record the order of their calls."""

    program_key = "p1"

    def __init__(self) -> None:
        self.done: list[tuple[str, str | None]] = []

    def send_stop(self, *_names: object, program_key: str | None = None) -> None:
        self.done.append(("stop sent", program_key))

    def stop(self) -> None:
        self.done.append(("program ended", None))

    def stop_all(self, *_names: object, program_key: str | None = None, **_more: object) -> StopReport:
        self.done.append(("robots awaited", program_key))
        return StopReport((), 1.0)


def failing(*_given: object, **_named: object) -> object:
    raise OSError("out of order")


@pytest.fixture
def session(tmp_path) -> Iterator[Session]:
    """Session that is never started and has no sockets."""
    made = Session(Settings(tmp_path), address="127.0.0.1:9", journal_folder=tmp_path, start_processes=False)
    yield made
    made.close()


def stop(steps: Steps, post: Callable[[object], object], number: int, *names: str) -> None:
    runner, stopper = cast("Runner", steps), cast("RobotStopper", steps)
    stop_program(post, number, runner, stopper, names, "p1", is_for_all=False)


def test_robots_are_stopped_before_the_program_ends_and_awaited_afterwards() -> None:
    steps = Steps()
    stop(steps, list[object]().append, 1)
    assert steps.done == [("stop sent", "p1"), ("program ended", None), ("robots awaited", "p1")]


def test_stop_is_unconfirmed_when_stopper_and_runner_raise(monkeypatch: pytest.MonkeyPatch) -> None:
    steps, posted = Steps(), list[object]()
    monkeypatch.setattr(Steps, "stop", failing)
    monkeypatch.setattr(Steps, "send_stop", failing)
    stop(steps, posted.append, 1)
    assert steps.done == [("robots awaited", "p1")]
    monkeypatch.setattr(Steps, "stop_all", failing)
    stop(steps, posted.append, 2, "Arm")
    (_, done) = posted
    assert isinstance(done, StopCompleted)
    assert (done.number, done.report.unconfirmed_names) == (2, ("Arm",))
    assert done.report.robots[0].problem == "Stop wasn't sent to Arm: OSError: out of order"


def test_stop_of_one_robot_is_unconfirmed_when_the_stopper_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Steps, "stop_all", failing)
    posted = list[object]()
    stop_robot(posted.append, cast("RobotStopper", Steps()), "Arm", 3)
    (stopped,) = posted
    assert isinstance(stopped, RobotStopped)
    assert (stopped.report.unconfirmed_names, stopped.mark) == (("Arm",), 3)


@pytest.mark.parametrize(
    "place", ["control.result_text", "stop_reports.stop_text", "stop_reports.unconfirmed_texts"]
)
def test_error_in_stop_message_does_not_leave_run_stopping(
    session: Session, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    runs = session.runs
    runs._stop(("Arm",))
    monkeypatch.setattr(f"app.core.run.{place}", failing)
    with pytest.raises(OSError, match="out of order"):
        runs.on_stop(StopCompleted(runs._stop_number, StopReport((), 1.0).with_unreached(["Arm"])))
    assert (runs._run.state, session.fleet.moved.names) == ("unanswered", ("Arm",))


def test_stop_starts_even_if_withdrawing_the_question_fails(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session.fleet.permission, "withdraw", failing)
    with pytest.raises(OSError, match="out of order"):
        session.runs.stop()
    assert session.runs._stop_thread is not None


def title_at_next_tick(session: Session) -> str:
    session.runs.tick()
    return session.runs.view().title


def test_empty_behaviour_shows_run_hint_until_an_edit(session: Session) -> None:
    runs = session.runs
    assert runs.view().title == "Ready"
    runs.run()
    assert not runs.active
    assert (runs.view().state, runs.view().title) == ("ready", "Nothing to run yet")
    assert "when started" in runs.view().detail
    session.document.apply_edit({"blocks": {"blocks": [{"type": "events_started", "id": "a"}]}})
    until(lambda: title_at_next_tick(session) == "Ready")  # compiled in the background on a busy computer


def test_new_behaviour_clears_run_hint(session: Session) -> None:
    session.runs.step()
    assert session.runs.view().title == "Nothing to run yet"
    session.document.apply_edit({"blocks": {"blocks": []}})
    session.documents.new()
    until(lambda: title_at_next_tick(session) == "Ready")


def test_run_with_a_problem_shows_reason_until_fixed(session: Session) -> None:
    wait = {"type": "control_wait", "id": "wait"}
    hat = {"type": "events_started", "id": "hat", "next": {"block": wait}}
    session.document.apply_edit({"blocks": {"blocks": [hat]}})
    session.runs.run()
    assert not session.runs.active
    view = session.runs.view()
    assert (view.state, view.title) == ("ready", "Not started")
    assert "needs a number" in view.detail
    assert session.runs.block_errors == {"wait": view.detail}
    session.document.apply_edit({"blocks": {"blocks": [{"type": "events_started", "id": "hat"}]}})
    until(lambda: title_at_next_tick(session) == "Ready")


def test_run_view_is_cached_per_tick_and_updated_after_actions(session: Session) -> None:
    runs = session.runs
    before = runs.view()
    assert runs.view() is before
    runs.set_pace(0.5)
    assert runs.view().is_slow
    runs.run()
    assert runs.view().title == "Nothing to run yet"
    now = runs.view()
    runs.tick()
    assert runs.view() is not now
