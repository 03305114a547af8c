"""Tests of the background worker: only the newest job runs, failures are raised, the thread ends."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from app.core.storage.background_worker import BackgroundWorker
from tests.blocks.fakes import until


@pytest.fixture
def beside() -> Iterator[BackgroundWorker[str]]:
    made: BackgroundWorker[str] = BackgroundWorker("test beside")
    yield made
    made.close()


def test_result_of_background_job_is_returned_only_once(beside) -> None:
    found: list[str | None] = []
    beside.submit("a", lambda: threading.current_thread().name)
    until(lambda: bool(found.append(beside.pop_result("a")) or found[-1]))
    assert found[-1] == "test beside"
    assert beside.pop_result("a") is None


def test_only_newest_pending_job_runs(beside) -> None:
    go, did = threading.Event(), []

    def slow() -> str:
        go.wait(60)
        return "slow"

    beside.submit("a", slow)
    until(lambda: not beside._pending)
    for number in range(5):
        beside.submit("b", lambda number=number: did.append(number) or str(number))
    go.set()
    until(lambda: did == [4])
    until(lambda: beside.pop_result("b") == "4")
    assert beside.pop_result("a") == "slow"


def test_job_failure_is_raised_when_the_result_is_requested_and_next_job_runs(beside) -> None:
    def fail() -> str:
        raise ValueError("no such luck")

    beside.submit("a", fail)
    until(lambda: bool(beside._errors))
    with pytest.raises(ValueError, match="no such luck"):
        beside.pop_result("a")
    beside.submit("a", lambda: "well")
    until(lambda: beside.pop_result("a") == "well")


def test_close_ends_thread_and_later_jobs_are_not_run(beside) -> None:
    beside.submit("a", lambda: "x")
    until(lambda: beside.pop_result("a") == "x")
    beside.close()
    beside.submit("a", lambda: "y")
    assert beside.pop_result("a") is None
    assert not any(thread.name == "test beside" for thread in threading.enumerate())


def test_no_thread_is_started_without_jobs() -> None:
    beside: BackgroundWorker[str] = BackgroundWorker("never")
    beside.discard("a")
    beside.close()
    assert beside._thread is None


def test_finish_waits_for_pending_and_running_jobs_of_owner(beside, monkeypatch) -> None:
    go, did = threading.Event(), []
    beside.submit("a", lambda: (go.wait(60) and did.append("first")) or "first")
    until(lambda: beside._current_owner == "a")
    beside.submit("a", lambda: did.append("second") or "second")
    assert beside.finish("b"), "nothing of another is waited for"
    monkeypatch.setattr("app.core.storage.background_worker.JOIN_TIMEOUT_S", 0.01)
    assert not beside.finish("a"), "and not for ever"
    monkeypatch.setattr("app.core.storage.background_worker.JOIN_TIMEOUT_S", 60.0)
    go.set()
    assert beside.finish("a")
    assert did == ["first", "second"]
    assert beside.pop_result("a") == "second"


def test_failure_is_cleared_by_next_success(beside) -> None:
    def fail() -> str:
        raise ValueError("no such luck")

    beside.submit("a", fail)
    assert beside.finish("a")
    beside.submit("a", lambda: "well")
    assert beside.finish("a")
    assert beside.pop_result("a") == "well"
