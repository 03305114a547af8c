"""Tests of the program's process.

Tests send it commands as the runner does. Where possible it runs in a thread of this process.
"""

from __future__ import annotations

import io
import json
import queue
import threading
from dataclasses import replace
from typing import TypeVar

import msgspec
import pytest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.runtime import child
from app.blocks.runtime.events import (
    AnyEvent,
    LinePrinted,
    ProgramEnded,
    ProgramFailed,
    ProgramPaused,
    ProgramReady,
    ProgramRunning,
    RunnerEvent,
    VariablesChanged,
)
from tests.blocks.samples import block, get, number, say, stack, started, text, workspace, write
from tests.blocks.wire_robot import WireRobot, usual_time_limits

Event = TypeVar("Event", bound=RunnerEvent)

LONG_S = 60.0
pytestmark = pytest.mark.usefixtures("patient", "patient_robots")


class Pipe(io.TextIOBase):
    """Pipe of lines between two threads; closing it ends the reading."""

    def __init__(self) -> None:
        self._lines: queue.Queue[str] = queue.Queue()

    def write(self, text: str) -> int:
        self._lines.put(text)
        return len(text)

    def __next__(self) -> str:
        line = self._lines.get(timeout=LONG_S)
        if not line:
            raise StopIteration
        return line

    def __iter__(self):
        return self

    def end(self) -> None:
        self._lines.put("")


class Child:
    """Program process that runs in a thread, and the reports it has sent."""

    def __init__(self, capsys_disabled) -> None:
        self.stdin, self.stdout = Pipe(), Pipe()
        self.said: list[RunnerEvent] = []
        self.code: list[int] = []
        self.thread = threading.Thread(target=self._main)
        self.thread.start()

    def _main(self) -> None:
        self.code.append(child.main(self.stdin, self.stdout))

    def order(self, **order: object) -> None:
        self.stdin.write(json.dumps(order) + "\n")

    def start(self, saved, robots=(), master=None, **more: object) -> None:
        program = compile_behaviour(saved, list(robots), name="Test")
        sources = [each.source for each in robots]
        self.order(do="start", program=program.to_json(), robots=sources, master=master, **more)

    def until(self, kind: type[Event], **content: object) -> Event:
        """Wait for an event of this kind with this content and return it."""
        while True:
            said = msgspec.json.decode(next(self.stdout), type=AnyEvent)
            self.said.append(said)
            if isinstance(said, kind) and all(
                getattr(said, name) == value for name, value in content.items()
            ):
                return said

    def end(self) -> int:
        self.thread.join(LONG_S)
        assert not self.thread.is_alive()
        return self.code[0]


@pytest.fixture
def running(capsys):
    import sys

    stdout = sys.stdout
    made = Child(capsys)
    yield made
    made.stdin.end()
    made.end()
    sys.stdout = stdout


@pytest.fixture
def pepper(master):
    made = WireRobot(master.address)
    yield made
    made.close()


def test_program_runs_to_end_and_stops_its_robot(running, pepper, master):
    running.until(ProgramReady)
    running.start(workspace(started(say("Hi"), write(text("done")))), [pepper.described], master.address)
    ended = running.until(ProgramEnded)
    assert running.end() == 0
    assert (ended.is_ok, ended.unresponsive_robots) == (True, ())
    assert LinePrinted(text="done") in running.said
    assert [command["action"] for command in pepper.heard("invoke")] == ["say"]
    assert len(pepper.heard("stop")) == 1


def test_running_block_is_reported_with_its_text(running, pepper, master):
    pepper.slow = {"say"}
    running.start(workspace(started(say("Touch my head.") | {"id": "s"})), [pepper.described], master.address)
    assert running.until(ProgramRunning, description="Pepper says “Touch my head.”")
    running.order(do="stop")
    assert running.until(ProgramEnded).is_ok is True


def test_error_names_its_block(running, pepper, master):
    pepper.refuses = {"say": "no voice"}
    running.start(workspace(started(say("Hi") | {"id": "s"})), [pepper.described], master.address)
    assert running.until(ProgramFailed) == ProgramFailed(block="s", text="Pepper: no voice.")
    assert running.until(ProgramEnded).is_ok is False
    assert running.end() == 1
    assert len(pepper.heard("stop")) == 1


def test_program_can_be_paused_stepped_and_resumed(running, master):
    first, second = write(text("1")) | {"id": "a"}, write(text("2")) | {"id": "b"}
    running.start(workspace(started(first, second)), master=master.address, paused=True)
    paused = running.until(ProgramPaused)
    assert (paused.block, paused.description) == ("a", "write “1” to the console")
    running.order(do="step")
    assert running.until(ProgramPaused, block="b")
    assert LinePrinted(text="1") in running.said
    running.order(do="go")
    assert running.until(ProgramEnded).is_ok is True


def test_breakpoint_pauses_before_its_block_and_resume_runs_the_block(running, master):
    marked = write(text("two")) | {"id": "two", "data": '{"pause": true}'}
    saved = workspace(started(write(text("one")), marked, write(text("three"))))
    running.start(saved, master=master.address)
    assert running.until(ProgramPaused).block == "two"
    assert LinePrinted(text="one") in running.said
    assert LinePrinted(text="two") not in running.said
    running.order(do="go")
    assert running.until(ProgramEnded).is_ok is True
    assert LinePrinted(text="three") in running.said
    assert len([each for each in running.said if isinstance(each, ProgramPaused)]) == 1


@pytest.mark.parametrize(
    ("shown", "written"),
    [(block("values_compare", A=number(2), B=number(1)), "no"), (text("true"), "true"), (number(2), "2")],
)
def test_trial_value_is_formatted_for_display(running, master, shown, written):
    saved = workspace(started(write(shown)))
    program = replace(compile_behaviour(saved, []), shows_value=True)
    running.order(do="start", program=program.to_json(), robots=[], master=master.address)
    assert running.until(LinePrinted).text == written
    running.until(ProgramEnded)


def test_breakpoint_changed_during_run_takes_effect_at_once(running, master):
    wait, rest = (
        block("control_wait", "one", SECONDS=number(0.01)),
        block("control_wait", "rest", SECONDS=number(0.01)),
    )
    running.start(workspace(started(block("control_forever", BODY=[wait, rest]))), master=master.address)
    running.until(ProgramRunning)
    running.order(do="breakpoints", blocks=["one"])
    assert running.until(ProgramPaused).block == "one"
    running.order(do="breakpoints", blocks=["rest"])
    running.order(do="go")
    assert running.until(ProgramPaused).block == "rest"
    assert [each.block for each in running.said if isinstance(each, ProgramPaused)] == ["one", "rest"]
    running.order(do="breakpoints", blocks="no list")
    running.order(do="stop")
    running.until(ProgramEnded)


@pytest.mark.parametrize("data", ['{"pause": false}', '{"pause": true', "[]", '["pause"]', "pause", 7, None])
def test_invalid_or_unrelated_block_data_is_not_a_breakpoint(data):
    made = compile_behaviour(workspace(started(write(text("one")) | {"data": data})), [])
    assert made.breakpoints == ()
    assert not made.problems


def test_heartbeat_continues_while_paused(running, pepper, master):
    saved = workspace(started(say("Hi")))
    running.start(saved, [pepper.described], master.address, paused=True)
    running.until(ProgramPaused)
    before = len(pepper.heard("alive"))
    with pepper.changed:
        assert pepper.changed.wait_for(lambda: len(pepper.heard("alive")) >= before + 3, LONG_S)
    assert pepper.heard("invoke") == []


def test_program_ends_and_stops_robot_when_its_stdin_closes(running, pepper, master):
    hat = block("robot_pepper_when_touched", ROBOT="Pepper", PLACE="head")
    running.start(workspace(stack(hat, say("ouch"))), [pepper.described], master.address)
    with pepper.changed:
        assert pepper.changed.wait_for(lambda: bool(pepper.heard("alive")), LONG_S)
    running.stdin.end()
    assert running.until(ProgramEnded).is_ok is True
    assert running.end() == 0
    with pepper.changed:
        assert pepper.changed.wait_for(lambda: bool(pepper.heard("stop")), LONG_S)


def test_robot_that_does_not_confirm_final_stop_is_named(running, pepper, master):
    pepper.silent = {"stop"}
    with usual_time_limits():
        running.start(workspace(started(say("Hi"))), [pepper.described], master.address)
        assert running.until(ProgramEnded).unresponsive_robots == ("Pepper",)


def test_robot_event_starts_its_script(running, pepper, master):
    hat = block("robot_pepper_when_touched", ROBOT="Pepper", PLACE="head")
    running.start(
        workspace(stack(hat, write(text("ouch")), block("control_stop_program"))),
        [pepper.described],
        master.address,
    )
    with pepper.changed:
        assert pepper.changed.wait_for(lambda: bool(pepper.heard("alive")), LONG_S)
    pepper.tell("touched", {"place": "head", "down": True})
    assert running.until(ProgramEnded).is_ok is True
    assert LinePrinted(text="ouch") in running.said


def test_printed_output_of_a_program_is_bounded_in_lines_and_line_length(running, master, monkeypatch):
    monkeypatch.setattr(child, "SAMPLE_INTERVAL_S", LONG_S)  # the lines of one sample, at the end
    flood = block("control_repeat", TIMES=number(1500), BODY=[write(text("x" * 3000))])
    running.start(workspace(started(flood)), master=master.address)
    running.until(ProgramEnded)
    lines = [said.text for said in running.said if isinstance(said, LinePrinted)]
    assert len(lines) == child.LINES_PER_SAMPLE + 1
    assert lines[-1] == f"{1500 - child.LINES_PER_SAMPLE} lines were dropped: too many at once"
    assert max(map(len, lines)) <= child.MAX_LINE_LENGTH


@pytest.mark.parametrize(
    "order",
    [
        {"do": "start"},
        {"do": "start", "program": {}, "robots": []},
        {"do": "start", "program": 1, "robots": 2},
    ],
)
def test_invalid_start_request_is_rejected_with_explanation(running, order):
    running.stdin.write("no json\n")
    running.order(do="pause")
    running.order(**order)
    assert "can't be loaded" in running.until(ProgramFailed).text
    assert running.until(ProgramEnded).is_ok is False
    assert running.end() == 1


def test_missing_master_is_reported(running):
    running.start(
        workspace(started(block("messages_publish", VALUE=text("x"), TOPIC="/x"))), master="127.0.0.1:1"
    )
    assert "The program can't start" in running.until(ProgramFailed).text
    assert running.end() == 1


def set_score(value, id=None):
    return block("variables_set", id, VAR={"id": "score"}, VALUE=value)


def values_of(said):
    """Return the reported variable values as pairs of ID and text, in the order of the reports."""
    lines = [event.values for event in said if isinstance(event, VariablesChanged)]
    return [(value.id, value.text) for values in lines for value in values]


def test_final_variable_value_is_reported(running, master):
    saved = workspace(started(set_score(number(7)), set_score(number(8))), variables=("score",))
    running.start(saved, master=master.address)
    running.until(ProgramEnded)
    assert values_of(running.said)[-1] == ("score", "8")


def test_user_can_set_variable_of_running_program(running, master):
    saved = workspace(
        started(
            set_score(number(7)),
            block(
                "control_wait_until",
                CONDITION=block("values_compare", A=get("score"), B=text("go"), RELATION="=="),
            ),
            write(text("gone on")),
        ),
        variables=("score",),
    )
    running.start(saved, master=master.address)
    while ("score", "7") not in values_of(running.said):
        running.until(VariablesChanged)
    running.order(do="variable", python="score", value="go")
    running.until(ProgramEnded, is_ok=True)
    assert LinePrinted(text="gone on") in running.said
