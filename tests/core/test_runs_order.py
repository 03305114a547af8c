"""Run says when there is nothing to run; a stop reaches the robots at once, and again after the end."""

from __future__ import annotations

from typing import cast

import pytest

from app.core.runner import Runner
from app.core.session import Session
from app.core.settings import Settings
from app.core.stop_report import StopReport
from app.core.stopping import RobotStopper


class Steps:
    """Writes down in which order it is called; stands for a runner and for a stopper."""

    program_id = "p1"

    def __init__(self) -> None:
        self.done: list[tuple[str, str | None]] = []

    def send_stop(self, *_names: object, ends: str | None = None) -> None:
        self.done.append(("told", ends))

    def stop(self) -> None:
        self.done.append(("program ended", None))

    def stop_all(self, *_names: object, ends: str | None = None, **_more: object) -> StopReport:
        self.done.append(("asked", ends))
        return StopReport((), 1.0)


@pytest.fixture
def session(tmp_path) -> Session:
    """Never started: it has no threads and no sockets."""
    return Session(Settings(tmp_path), address="127.0.0.1:9", journal_folder=tmp_path, start_companions=False)


def test_robots_are_told_before_the_program_has_ended_and_asked_after(session: Session) -> None:
    steps = Steps()
    session.runs._stop_all(1, cast("Runner", steps), cast("RobotStopper", steps), (), "p1")
    assert steps.done == [("told", "p1"), ("program ended", None), ("asked", "p1")]


def test_with_nothing_to_run_the_bar_says_what_to_do_until_something_changes(session: Session) -> None:
    runs = session.runs
    assert runs.view().title == "Ready"
    runs.run()
    assert not runs.active
    assert (runs.view().state, runs.view().title) == ("ready", "Nothing to run yet")
    assert "when started" in runs.view().detail
    session.document.edited({"blocks": {"blocks": [{"type": "events_started", "id": "a"}]}})
    assert runs.view().title == "Ready"


def test_another_behaviour_takes_the_hint_away(session: Session) -> None:
    session.runs.step()
    assert session.runs.view().title == "Nothing to run yet"
    session.document.edited({"blocks": {"blocks": []}})
    session.documents.new()
    assert session.runs.view().title == "Ready"
