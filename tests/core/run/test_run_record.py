"""Tests of the record of a run, which is read from the trace of its program."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import pytest

from app.blocks.runtime.events import BlocksTraced, ProgramFailed
from app.blocks.runtime.trace import BlockBegan, BlockEnded, RecordsLost
from app.core.run.run_record import RunRecord
from app.core.run.runner import Runner
from app.core.run.view import RunState
from app.core.session import Session

RUN = 7
FAILED = (BlockBegan(0.0, 1, "a"), BlockEnded(0.5, 1, "a", "failed", "no robot", "v"))


class FakeRunner:
    """Fake runner of a program that runs."""

    run = RUN

    def stop(self) -> None: ...


@pytest.fixture
def session(session: Session) -> Session:
    """Session in which a program runs."""
    session.runs._runner = cast("Runner", FakeRunner())
    session.runs._run = RunState("running", "Greeting")
    return session


def test_first_failed_block_of_the_trace_is_the_failure_of_the_run() -> None:
    record = RunRecord(RunState("running", "Greeting"))
    assert record.failure == ""
    record.blocks.apply(
        [BlockBegan(0.0, 1, "a"), BlockEnded(0.1, 1, "a", "stopped"), RecordsLost(0.2, 1, {})]
    )
    assert record.failure == ""
    record.blocks.apply([*FAILED, BlockEnded(0.6, 2, "b", "failed", "later")])
    assert record.failure == "no robot"


def test_program_that_fails_before_its_first_block_has_a_failure() -> None:
    assert RunRecord(RunState("stopping", errors={"b": "no value"})).failure == "no value"


def test_tried_block_names_the_run() -> None:
    assert RunRecord(RunState(name="Greeting")).name == "Greeting"
    assert RunRecord(RunState(name="Greeting", tried_label="wave")).name == "wave"


def test_failed_block_is_marked_when_its_trace_arrives(session: Session) -> None:
    runs = session.runs
    runs.on_runner_event(BlocksTraced(run=RUN, records=FAILED))
    assert runs.block_errors == {"v": "no robot"}
    assert runs.running_blocks == ("a",)
    assert runs.ran_blocks == {"a"}
    runs.on_runner_event(ProgramFailed(run=RUN, block="v", text="no robot"))
    assert runs.block_errors == {"v": "no robot"}
    assert runs.record.failure == "no robot"


def test_failed_block_whose_record_was_lost_is_marked_when_the_program_fails(session: Session) -> None:
    runs = session.runs
    runs.on_runner_event(BlocksTraced(run=RUN, records=(RecordsLost(0.5, 9, {1: "a"}),)))
    assert runs.block_errors == {}
    runs.on_runner_event(ProgramFailed(run=RUN, block="a", text="no robot"))
    assert runs.block_errors == {"a": "no robot"}
    assert runs.record.failure == "no robot"


def test_blocks_interrupted_by_stop_do_not_fail(session: Session) -> None:
    runs = session.runs
    runs._run = replace(runs.state, state="stopping")
    runs.on_runner_event(BlocksTraced(run=RUN, records=FAILED))
    assert runs.record.failure == ""
    assert runs.block_errors == {}


def test_new_run_has_a_new_record_and_earlier_blocks_are_remembered(session: Session) -> None:
    runs = session.runs
    runs.on_runner_event(BlocksTraced(run=RUN, records=FAILED))
    first = runs.record
    runs._show_start("Tour", "")
    assert runs.record is not first
    assert (runs.record.name, runs.record.is_active, first.failure) == ("Tour", True, "no robot")
    assert runs.ran_blocks == {"a"}
