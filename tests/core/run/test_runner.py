from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from typing import TypeVar

import psutil
import pytest

import nep
from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.runtime.events import (
    BlocksTraced,
    LinePrinted,
    ProgramEnded,
    ProgramFailed,
    ProgramPaused,
    ProgramReady,
    ProgramRunning,
    QuestionChanged,
    VariablesChanged,
)
from app.blocks.runtime.variables import VariableValue
from app.core.run import runner as runner_module
from app.core.run.runner import Runner, RunnerEvent, child_command
from app.errors import RunnerError
from tests.blocks.samples import block, get, list_of, number, say, started, text, workspace, write
from tests.blocks.wire_robot import WireRobot

Event = TypeVar("Event", bound=RunnerEvent)

LONG_S = 60.0
STOP_WITHIN_S = 45.0  # below the minute to which `stopping_s` raises every timeout

HANGS = (sys.executable, "-c", "import time, sys; print('{}'); sys.stdout.flush(); time.sleep(60)")
IGNORES_TEXT = """
import signal
signal.signal(signal.SIGTERM, signal.SIG_IGN)
print('{"is": "ready"}', flush=True)
while True:
    pass
"""
IGNORES = (sys.executable, "-c", IGNORES_TEXT)
CRASHES = (sys.executable, "-c", "import os; os.abort()")
FAILS = (sys.executable, "-c", "raise SystemExit('no room left')")
TALKS_TEXT = """
import sys
print('nonsense', '[1]', '{"is": "dance"}', 'x' * 3000000, sep='\\n', flush=True)
print('{"is": "ended", "is_ok": true, "elapsed_s": 1.5}', flush=True)
sys.stdin.read()
"""
TALKS = (sys.executable, "-c", TALKS_TEXT)


class Heard:
    """Recorded events of a runner, with a method that waits for one."""

    def __init__(self) -> None:
        self.events: list[RunnerEvent] = []
        self.changed = threading.Condition()

    def __call__(self, event: RunnerEvent) -> None:
        with self.changed:
            self.events.append(event)
            self.changed.notify_all()

    def until(self, kind: type[Event], **content: object) -> Event:
        def found() -> Event | None:
            for event in self.events:
                if isinstance(event, kind) and all(
                    getattr(event, name) == value for name, value in content.items()
                ):
                    return event
            return None

        with self.changed:
            assert self.changed.wait_for(lambda: found() is not None, LONG_S), self.events
        event = found()
        assert event is not None
        return event


@pytest.fixture
def heard():
    return Heard()


@pytest.fixture
def runner(heard):
    made: list[Runner] = []

    def make(command=None) -> Runner:
        made.append(Runner(heard, command=command))
        return made[-1]

    yield make
    for each in made:
        each.close()
        assert each.pid is None or not psutil.pid_exists(each.pid)


@pytest.fixture
def pepper(master):
    made = WireRobot(master.address)
    yield made
    made.close()


def stopping_s(begin: Callable[[], Runner]) -> float:
    """Return the seconds that Stop takes for the program that ``begin`` starts; check that it has ended.

    Every timeout of a stop is raised to a minute, so a stop that waits for one is detected on a busy
    computer too.
    """
    with pytest.MonkeyPatch.context() as slower:
        slower.setattr(runner_module, "EXIT_TIMEOUT_S", 60.0)
        slower.setattr(runner_module, "PIPE_TIMEOUT_S", 60.0)
        made = begin()
        began = time.monotonic()
        made.stop()
        took = time.monotonic() - began
    assert made.pid is not None
    assert not psutil.pid_exists(made.pid)
    return took


def test_stop_grace_period_is_below_100_ms():
    assert runner_module.STOP_GRACE_S < 0.1


def program(*blocks):
    return compile_behaviour(workspace(started(*blocks)), [])


def endless():
    """Return a program that computes in an endless loop."""
    change = block("variables_change", VAR={"id": "n"}, BY=number(1))
    return compile_behaviour(
        workspace(started(block("control_forever", "loop", BODY=[change])), variables=("n",)), []
    )


def test_program_runs_and_ends(runner, heard, master):
    made = runner()
    made.start(program(write(text("Hi"))), [], master.address)
    assert made.wait(LONG_S)
    assert [
        type(event) for event in heard.events if not isinstance(event, ProgramRunning | BlocksTraced)
    ] == [ProgramReady, LinePrinted, ProgramEnded]
    assert heard.events[-1].is_ok
    assert heard.until(LinePrinted).text == "Hi"
    assert made.state == "ended"
    assert {event.run for event in heard.events} == {made.run}


def test_program_continues_with_the_answer(runner, heard, master):
    made = runner()
    asks = block("asking_ask", QUESTION=text("Name? 👍"))
    made.start(program(asks, write(block("asking_answer"))), [], master.address)
    asked = heard.until(QuestionChanged)
    assert asked.text == "Name? 👍"
    made.answer(asked.question + 1, "nobody asked this")
    made.answer(asked.question, "Ada “x”")
    assert heard.until(QuestionChanged, question=0)
    assert heard.until(LinePrinted).text == "Ada “x”"
    assert heard.until(ProgramEnded).is_ok


def test_question_includes_its_choices(runner, heard, master):
    made = runner()
    asks = block("asking_choices", QUESTION=text("Play?"), CHOICES=list_of(text("yes"), number(2)))
    made.start(program(asks, write(block("asking_answer"))), [], master.address)
    asked = heard.until(QuestionChanged)
    assert asked.choices == ("yes", "2")
    made.answer(asked.question, "2")
    assert heard.until(QuestionChanged, question=0).choices == ()
    assert heard.until(LinePrinted).text == "2"


def test_program_can_be_paused_stepped_and_resumed(runner, heard, master):
    made = runner()
    first, second = write(text("1")) | {"id": "a"}, write(text("2")) | {"id": "b"}
    made.start(program(first, second), [], master.address, paused=True)
    assert heard.until(ProgramPaused).description == "write “1” to the console"
    assert made.state == "paused"
    made.step()
    assert heard.until(ProgramPaused, block="b")
    made.resume()
    assert heard.until(ProgramEnded).is_ok


def test_running_program_can_be_paused(runner, heard, master):
    made = runner()
    made.start(endless(), [], master.address)
    heard.until(ProgramRunning)
    made.pause()
    assert heard.until(ProgramPaused).block
    assert made.state == "paused"
    made.resume()
    assert made.state == "running"
    made.stop()
    assert heard.until(ProgramEnded).is_ok


def test_stop_ends_endless_program_at_once(runner, heard, master):
    made = runner()

    def begin() -> Runner:
        made.start(endless(), [], master.address)
        heard.until(ProgramRunning, run=made.run)
        return made

    assert stopping_s(begin) < STOP_WITHIN_S
    assert made.wait(LONG_S)
    kinds = [type(event) for event in heard.events if event.run == made.run]
    assert kinds[-1] is ProgramEnded
    assert kinds.count(ProgramEnded) == 1


def test_stop_interrupts_a_block_in_an_infinite_computation(runner, heard, master):
    power = number(9)
    for _ in range(3):
        power = block("values_arithmetic", A=number(9), SIGN="**", B=power)
    first = block("messages_publish", VALUE=text("now"), TOPIC="/begin")
    with nep.node("test", master=master.address) as node:
        subscriber = node.new_sub("/begin")

        def begin() -> Runner:
            made = runner()
            made.start(program(first, write(power)), [], master.address)
            # No further message can arrive: computing such a number blocks all threads of the child.
            assert subscriber.receive(LONG_S) is not None
            return made

        assert stopping_s(begin) < STOP_WITHIN_S
    assert heard.until(ProgramEnded).is_ok  # a stop is not an error


@pytest.mark.parametrize("command", [HANGS, IGNORES], ids=["hangs", "ignores everything"])
def test_hanging_child_is_killed(runner, heard, command):
    huge = program(*(write(text("x" * 500)) for _ in range(400)))  # far more than a pipe holds
    made = runner(command)

    def begin() -> Runner:
        made.start(huge, [], None)
        return made

    assert stopping_s(begin) < STOP_WITHIN_S
    assert made.wait(LONG_S)
    assert isinstance(heard.events[-1], ProgramEnded)


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_crashed_child_is_reported(runner, heard):
    made = runner(CRASHES)
    made.start(program(), [], None)
    ended = heard.until(ProgramEnded)
    assert not ended.is_ok
    assert ended.text == f"The program's process was killed (signal {signal.SIGABRT.value})."
    assert stopping_s(lambda: made) < STOP_WITHIN_S  # no timeout is waited for


def test_failed_child_is_reported_with_reason(runner, heard):
    runner(FAILS).start(program(), [], None)
    assert heard.until(ProgramEnded).text == "The program's process ended with exit code 1: no room left."


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_child_killed_from_outside_is_reported(runner, heard, master):
    made = runner()
    made.start(endless(), [], master.address)
    heard.until(ProgramRunning)
    os.kill(made.pid, signal.SIGKILL)
    assert (
        heard.until(ProgramEnded).text == f"The program's process was killed (signal {signal.SIGKILL.value})."
    )


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_child_ignores_ctrl_c_of_the_terminal(runner, heard, master):
    made = runner()
    made.start(endless(), [], master.address)
    heard.until(ProgramRunning)
    os.kill(made.pid, signal.SIGINT)
    made.pause()
    assert heard.until(ProgramPaused).block  # the child still responds
    made.stop()
    assert heard.until(ProgramEnded).is_ok


def test_invalid_events_of_the_program_are_skipped_and_their_size_is_reported(runner, heard):
    made = runner(TALKS)
    made.start(program(), [], None)
    assert heard.until(ProgramEnded).elapsed_s == 1.5
    assert heard.events == [
        LinePrinted(run=made.run, text="3.0 MB of unexpected output were discarded"),
        ProgramEnded(run=made.run, elapsed_s=1.5),
    ]


def test_program_that_cannot_be_started_raises(runner):
    with pytest.raises(RunnerError, match="can't start the program"):
        runner(("/there/is/no/such/program",)).start(program(), [], None)


def test_runner_can_be_started_only_once(runner, heard, master):
    made = runner()
    made.stop()
    made.start(program(), [], master.address)
    with pytest.raises(RunnerError, match="create a new one"):
        made.start(program(), [], master.address)
    heard.until(ProgramEnded)


def test_robot_is_stopped_when_the_window_process_dies(runner, heard, master, pepper):
    """The child detects the end of its parent by the end of its standard input."""
    pepper.slow = {"say"}
    made = runner()
    wanted = compile_behaviour(workspace(started(say("Hi"))), [pepper.described])
    made.start(wanted, [pepper.described.source], master.address)
    heard.until(ProgramRunning, description="Pepper says “Hi”")
    made._commands.put(None)  # as when the operating system closes the pipe of a dead parent
    assert heard.until(ProgramEnded).is_ok
    with pepper.changed:
        assert pepper.changed.wait_for(lambda: bool(pepper.heard("stop")), LONG_S)


def test_error_event_has_block_and_message(runner, heard, master):
    made = runner()
    half = block("values_arithmetic", "v", A=number(1), SIGN="/", B=number(0))
    made.start(program(write(half)), [], master.address)
    error = heard.until(ProgramFailed)
    assert (error.block, error.text) == ("v", "“÷” can't divide by 0.")
    assert not heard.until(ProgramEnded).is_ok


def test_packaged_studio_runs_its_own_executable_as_child(monkeypatch):
    monkeypatch.setattr(sys, "frozen", True, raising=False)
    assert child_command() == (sys.executable, "--child")


def test_variable_values_are_received_and_can_be_set(runner, heard, master):
    same = block("values_compare", A=get("n"), B=number(5), RELATION="==")
    saved = workspace(
        started(
            block("variables_set", VAR={"id": "n"}, VALUE=number(3)),
            block("control_wait_until", CONDITION=same),
        ),
        variables=("n",),
    )
    started_runner = runner()
    started_runner.start(compile_behaviour(saved, []), [], master.address)
    heard.until(VariablesChanged, values=(VariableValue("n", "number", "3"),))
    started_runner.set_variable("n", 5)
    assert heard.until(ProgramEnded).is_ok
    heard.until(VariablesChanged, values=(VariableValue("n", "number", "5"),))
