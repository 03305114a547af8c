"""Contract tests that every driver must pass; they run for each robot of Studio and each example.

With ``--driver FILE`` they run for the robots declared in that file instead; with
``--driver-command COMMAND`` for the robot of a program in any language (`driver_program`).
"""

from __future__ import annotations

import importlib.util
import json
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import pytest

import nep
from app import resources
from app.clock import VirtualClock
from app.robots import simulated, turtle
from app.robots.description.description import Action, Parameter, Robot, parse, validate
from app.robots.driver.driver import Driver
from app.robots.identity import program_of
from app.robots.kit import Kind
from nep.masters.master import Master
from tests import hostile
from tests.robots.conftest import Ears, eventually
from tests.robots.driver.driver_program import ProgramDriver, ProgramKind, program_kind, running_driver

EXAMPLES = Path(__file__).parents[3] / "examples"
MAX_HOSTILE_BYTES = 60_000  # larger messages use shared memory, which outlives the test
FINAL = {"succeeded", "failed", "canceled"}
PATIENCE_S = 10.0  # for loaded machines; bench/stop.py measures each stop against its `within`
BRAKING_STEP_S = 0.005


def kinds_in(path: Path) -> list[Kind]:
    """Return the robots that a file declares; its directory is on `sys.path` while it is imported."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None, f"{path} is no file of Python"
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module  # dataclasses and type hints resolve names through sys.modules
    sys.path.insert(0, str(path.parent))
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(path.parent))
    found = [each for each in vars(module).values() if isinstance(each, Kind)]
    assert found, f"{path} declares no robot; write ROBOT = Kind(...)"
    return found


def kinds(drivers: Sequence[str], commands: Sequence[str]) -> Iterator[Kind | ProgramKind]:
    """Yield the robots of these files and commands; by default those of Studio and of examples/."""
    if drivers or commands:
        for driver in drivers:
            yield from kinds_in(Path(driver).resolve())
        yield from map(program_kind, commands)
        return
    yield simulated.ROBOT
    yield turtle.ROBOT
    for path in sorted(EXAMPLES.glob("*.py")):
        if "app.robots.kit" in path.read_text(encoding="utf-8"):
            yield from kinds_in(path)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Parametrize the tests with one robot each."""
    if "kind" in metafunc.fixturenames:
        option = metafunc.config.getoption
        found = list(kinds(option("--driver"), option("--driver-command")))
        metafunc.parametrize("kind", found, ids=[each.model for each in found], scope="module")


class ControlledClock(Protocol):
    """Clock that a test advances."""

    def advance(self, seconds: float) -> None: ...


@dataclass
class Bench:
    """Driver with a controlled clock, and a listener on its topics."""

    kind: Kind | ProgramKind
    driver: Driver | ProgramDriver
    ears: Ears
    clock: ControlledClock
    count: int = 0
    times: dict[str, bool] = field(default_factory=dict)

    @property
    def robot(self) -> Robot:
        return self.driver.robot

    def new_id(self) -> str:
        self.count += 1
        return f"{self.kind.model}-{self.count}"

    def actions(self) -> list[Action]:
        stop = self.robot.safe_stop.action
        return [action for action in self.robot.actions if action.name != stop]

    def long(self) -> list[Action]:
        """Return the cancellable actions; while the clock stands still, those that take time don't end."""
        return [action for action in self.actions() if action.cancellable]

    def invoke(self, action: Action, program: str | None = None) -> str:
        wanted = self.new_id()
        self.ears.invoke(wanted, action.name, program, **required(action))
        return wanted

    def any_action(self, *, long: bool = False) -> Action:
        """Return an action; with `long` one that runs until it is ended. Skip the test if there is none."""
        found = [action for action in self.long() if takes_time(self, action)] if long else self.actions()
        if not found:
            pytest.skip("this robot has no such action")
        return found[0]

    def begun(self, program: str | None = None) -> str:
        """Start an action that runs until it is ended, wait until it runs and return its id."""
        wanted = self.invoke(self.any_action(long=True), program)
        self.running(wanted)
        return wanted

    def running(self, wanted: str) -> None:
        eventually(lambda: "running" in self.ears.states(wanted))

    def stop(self, **more: object) -> dict[str, object]:
        wanted = self.new_id()
        self.ears.command(id=wanted, op="stop", **more)
        return self.final(wanted, "stop", PATIENCE_S + self.robot.safe_stop.within_s)

    def final(self, wanted: str, op: str = "invoke", timeout_s: float = 30.0) -> dict[str, object]:
        """Advance the clock while a robot in motion brakes, and return the final reply to a command."""

        def is_ended() -> bool:
            answers = self.ears.answers(wanted)
            return any(each["state"] in FINAL and each["op"] == op for each in answers)

        eventually(lambda: is_ended() or self.clock.advance(BRAKING_STEP_S), timeout_s)
        return self.ears.final(wanted, op)

    def finals(self, wanted: str) -> list[dict[str, object]]:
        answers = self.ears.answers(wanted)
        return [answer for answer in answers if answer["state"] in FINAL and answer["op"] == "invoke"]


def required(action: Action) -> dict[str, object]:
    """Return an input with the required parameters only."""
    return {p.name: good_for(p) for p in action.parameters if p.is_required}


def good_for(parameter: Parameter) -> object:
    """Return a valid value for a parameter."""
    if parameter.default is not None:
        return parameter.default
    if parameter.choices:
        return parameter.choices[0].value
    if parameter.kind in {"number", "integer", "angle"}:
        low, high = parameter.minimum, parameter.maximum
        return low if low is not None and low > 0 else min(0, 0 if high is None else high)
    if parameter.kind == "list":
        held = parameter.item or Parameter("value", "value", "text")
        return [good_for(each) for each in parameter.prefix_items] or [good_for(held)] * parameter.min_length
    if parameter.kind == "object":
        return {each.name: good_for(each) for each in parameter.fields if each.is_required}
    return {"boolean": False, "colour": "#20c0e0"}.get(parameter.kind, "x" * max(1, parameter.min_length))


def takes_time(bench: Bench, action: Action) -> bool:
    """Return whether an action, started in the current state of the room, runs until it is ended.

    The check is repeated three times: a busy computer may cancel a short action before it ends.
    """
    if action.name not in bench.times:
        bench.times[action.name] = all(_goes_on(bench, action) for _ in range(3))
    return bench.times[action.name]


def _goes_on(bench: Bench, action: Action) -> bool:
    wanted = bench.invoke(action)
    bench.running(wanted)
    bench.ears.command(id=wanted, op="cancel")
    ended = bench.ears.final(wanted)["state"]
    bench.stop()
    return ended == "canceled"


def wrong_for(kind: str) -> object:
    """Return a value that is invalid for every parameter of a kind."""
    return "many" if kind in {"number", "integer", "angle", "object"} else {"x": 1}


@contextmanager
def at_its_start(kind: Kind | ProgramKind, name: str, *, real_clock: bool = False) -> Iterator[Bench]:
    """Yield a bench with a new driver and a new room, in the state in which the robot starts."""
    with ExitStack() as opened:
        if isinstance(kind, ProgramKind):
            master = opened.enter_context(Master("127.0.0.1:0", learn_s=0.0)).address
            other = opened.enter_context(nep.node("listener", master=master))
            ears = Ears(other, name.replace(" ", "_"))
            program, its_clock = opened.enter_context(
                running_driver(kind, name, master, ears, real_clock=real_clock)
            )
            yield Bench(kind, program, ears, its_clock)
            return
        clock, alone = (
            VirtualClock(advances_alone=False),
            f"only {name}",
        )  # separate networks, because robots avoid other robots
        node = opened.enter_context(nep.node("contract", "memory", master=alone))
        other = opened.enter_context(nep.node("listener", "memory", master=alone))
        ears = Ears(other, name.replace(" ", "_"))
        with Driver(kind, name, node, clock=None if real_clock else clock) as driver:
            yield Bench(kind, driver, ears, clock)


@pytest.fixture(scope="module")
def shared(kind: Kind | ProgramKind) -> Iterator[Bench]:
    with at_its_start(kind, f"The {kind.model}") as bench:
        bench.stop()  # starts the event loop of an async robot, which runs until the robot closes
        yield bench


@pytest.fixture
def bench(shared: Bench) -> Iterator[Bench]:
    yield shared
    shared.stop()  # ends actions that a test left running


# ---- description -----------------------------------------------------------------------------------


def test_description_is_valid_and_every_declared_action_has_a_function(bench, request) -> None:
    option = request.config.getoption
    ours = not option("--driver") and not option(
        "--driver-command"
    )  # requirements for our own robots only, such as icons
    described = json.loads(json.dumps(bench.driver.description))
    assert validate(described) == ()
    assert parse(described) == bench.robot
    for action in bench.robot.actions:
        assert isinstance(bench.driver, ProgramDriver) or callable(getattr(bench.driver.body, action.name))
        assert not (action.risk and not action.uses), f"{action.name} moves something, so it uses it"
        if not ours:
            continue
        assert f"\n{action.icon}\t" in resources.path("icons", "lucide.txt").read_text("utf-8")
    assert bench.robot.heartbeat_interval_s is not None
    assert bench.robot.safe_stop.can_confirm
    assert bench.robot.safe_stop.watchdog_s is not None


# ---- stop ------------------------------------------------------------------------------------------


def test_stop_while_idle_succeeds(bench) -> None:
    assert bench.stop()["state"] == "succeeded"
    assert bench.stop()["state"] == "succeeded"


def test_stop_ends_running_and_queued_actions(bench) -> None:
    ended = []
    for action in bench.long():
        first = bench.invoke(action)
        bench.running(first)
        second = bench.invoke(action)
        eventually(lambda second=second: bench.ears.states(second))
        assert bench.stop()["state"] == "succeeded", action.name
        for wanted in (first, second):
            (final,) = bench.finals(wanted)  # an action with nothing to do may finish before the stop
            ended.append(final["state"])
    assert "canceled" in ended or not any(takes_time(bench, action) for action in bench.long())
    assert set(ended) <= FINAL


def test_concurrent_stops_all_succeed(bench) -> None:
    bench.begun()
    ids = [bench.new_id() for _ in range(5)]
    for wanted in ids:
        bench.ears.command(id=wanted, op="stop")
    assert {bench.ears.final(wanted, "stop")["state"] for wanted in ids} == {"succeeded"}


def test_stop_action_stops_the_robot(bench) -> None:
    started = bench.begun()
    wanted = bench.new_id()
    bench.ears.invoke(wanted, bench.robot.safe_stop.action)
    assert bench.ears.final(wanted)["state"] == "succeeded"
    assert bench.ears.final(started)["state"] == "canceled"


def test_stop_that_ends_a_program_cancels_its_later_commands(bench) -> None:
    bench.ears.command(id=bench.new_id(), op="stop", ends="the key of a program")
    late = bench.invoke(bench.any_action(), program_of("the key of a program"))
    assert bench.ears.final(late)["state"] == "canceled"
    assert "running" not in bench.ears.states(late)


def test_stop_with_only_the_name_of_a_program_does_not_block_its_later_commands(bench) -> None:
    """The name of a program is public: a stop that only contains the name must not block the program."""
    assert bench.stop(ends="studio")["state"] == "succeeded"
    asked = bench.invoke(bench.any_action(), "studio")
    bench.running(asked)


# ---- actions ---------------------------------------------------------------------------------------


def test_each_action_has_exactly_one_final_reply_and_cancellable_ones_can_be_canceled(shared) -> None:
    canceled = []
    for action in shared.actions():
        # A new robot for each action: one that has turned away no longer sees a face.
        with at_its_start(shared.kind, f"Another {shared.kind.model}") as bench:
            wanted = bench.invoke(action)
            if action.cancellable:
                bench.running(wanted)
                bench.ears.command(id=wanted, op="cancel")
            ended = bench.ears.final(wanted)["state"]
            bench.stop()  # all replies have been sent by now
            assert len(bench.finals(wanted)) == 1
            assert bench.ears.states(wanted)[:2] == ["accepted", "running"]
            # an action with nothing to do (standing up while standing) may finish before its cancel,
            # and an action with a made-up value may reject it
            made_up = any(p.is_required and p.default is None for p in action.parameters)
            allowed = ["succeeded", *["canceled"] * action.cancellable, *["failed"] * made_up]
            assert ended in allowed, (action.name, bench.finals(wanted))
            canceled += [action.name] * (ended == "canceled")
    assert canceled or not any(takes_time(shared, action) for action in shared.long())


def test_cancel_of_an_unknown_task_fails(bench) -> None:
    wanted = bench.new_id()
    bench.ears.command(id=wanted, op="cancel")
    answer = bench.ears.final(wanted, "cancel")
    assert (answer["state"], answer["error"]) == ("failed", "no running task has this id")


def test_action_that_exceeds_its_timeout_fails_with_the_limit(shared) -> None:
    late = []
    for action in (each for each in shared.long() if each.timeout_s):
        # A robot that moved would no longer see the face in the next action.
        with at_its_start(shared.kind, f"Late {shared.kind.model}") as bench:
            wanted = bench.invoke(action)
            bench.running(wanted)
            bench.clock.advance(action.timeout_s + 0.1)
            ended = bench.final(wanted)
            bench.stop()  # a closing driver doesn't advance the clock
        if ended["state"] == "succeeded":
            continue  # the action finished in that moment
        assert ended["state"] == "failed"
        assert ended["error"] == f"{action.name} took longer than {action.timeout_s:g} s"
        late.append(action.name)
    assert late or not any(takes_time(shared, action) for action in shared.long() if action.timeout_s)


def test_busy_robot_queues_replaces_or_rejects_actions_as_declared(shared) -> None:
    for action in (each for each in shared.long() if each.uses):
        with at_its_start(shared.kind, f"Busy {shared.kind.model}") as bench:
            first = bench.invoke(action)
            bench.running(first)
            second = bench.invoke(action)
            eventually(lambda bench=bench, second=second: bench.ears.states(second))
            if bench.finals(first) and bench.finals(first)[0]["state"] != "canceled":
                continue  # the action had nothing to do
            told = bench.ears.answers(second)[0]
            if action.on_busy == "queue":
                assert told["waits_for"] == [action.name]
                bench.ears.command(id=first, op="cancel")
            elif action.on_busy == "replace":
                if bench.ears.final(first)["state"] != "canceled":  # finished before the second arrived
                    continue
                assert told["replaces"] == [action.name]
            else:
                assert (told["state"], "is busy with" in str(told["error"])) == ("failed", True)
                continue
            assert bench.ears.final(first)["state"] == "canceled"
            bench.running(second)


def test_missing_heartbeat_of_the_program_cancels_its_running_action(bench) -> None:
    wanted = bench.begun("silent")
    bench.clock.advance((bench.robot.safe_stop.watchdog_s or 0) + 0.05)
    ended = bench.final(wanted)
    assert ended["state"] == "canceled"
    assert "hasn't responded" in str(ended["error"])


def test_robot_sends_heartbeats_while_active(bench) -> None:
    def beats() -> int:
        return sum(1 for answer in list(bench.ears.heard["answer"]) if answer["op"] == "alive")

    bench.begun()
    told = beats()
    bench.clock.advance((bench.robot.heartbeat_interval_s or 0) + 0.01)
    eventually(lambda: beats() > told)


# ---- invalid input ---------------------------------------------------------------------------------


def test_invalid_inputs_are_rejected_with_a_message_and_no_action_runs(bench) -> None:
    for action in bench.actions():
        inputs: list[object] = [{"no such thing": 1}, "text", [1, 2]]
        inputs += [{**required(action), p.name: wrong_for(p.kind)} for p in action.parameters]
        inputs += [{**required(action), p.name: None} for p in action.parameters if not p.is_nullable]
        limited = [p for p in action.parameters if p.maximum is not None]
        inputs += [{**required(action), p.name: (p.maximum or 0) + 1} for p in limited]
        for given in inputs:
            wanted = bench.new_id()
            bench.ears.command(id=wanted, op="invoke", action=action.name, input=given)
            answer = bench.ears.final(wanted)
            assert answer["state"] == "failed", (action.name, given)
            assert str(answer["error"]).startswith(f"{action.name}: ")
            assert bench.ears.states(wanted) == ["failed"]


def test_unknown_action_is_rejected(bench) -> None:
    wanted = bench.new_id()
    bench.ears.invoke(wanted, "fly to the moon")
    assert "can't “fly to the moon”" in str(bench.ears.final(wanted)["error"])


@pytest.mark.parametrize(
    "message",
    [None, 7, "stop", [], {}, {"op": "invoke"}, {"id": 7, "op": "stop"}, {"id": "x" * 500, "op": "stop"},
     {"id": "", "op": "invoke"}, {"id": None, "op": None}],
    ids=repr,
)  # fmt: skip
def test_messages_that_are_not_commands_are_ignored(bench, message) -> None:
    before = len(bench.ears.heard["answer"])
    bench.ears._command.publish(message)
    wanted = bench.new_id()
    bench.ears.command(id=wanted, op="dance")
    answer = bench.ears.final(wanted, "dance")
    assert "use invoke, cancel, stop or alive" in str(answer["error"])
    assert [a["id"] for a in bench.ears.heard["answer"][before:] if a["op"] != "alive"] == [wanted]


def test_robot_stops_and_accepts_an_action_after_hostile_messages(bench) -> None:
    command = {"id": "h", "op": "invoke", "action": bench.any_action().name, "from": "p", "input": {}}
    small = [payload for payload in hostile.payloads(command) if len(payload) <= MAX_HOSTILE_BYTES]
    for number, payload in enumerate(small):
        bench.ears._command.publish_bytes(payload)
        if number % 20 == 0:
            assert bench.stop()["state"] == "succeeded", payload[:200]
    assert bench.stop()["state"] == "succeeded"
    wanted = bench.invoke(bench.any_action())
    eventually(lambda: "accepted" in bench.ears.states(wanted))


def test_duplicate_command_runs_once(bench) -> None:
    action = bench.any_action(long=True)
    wanted = bench.invoke(action)
    bench.running(wanted)
    bench.ears.invoke(wanted, action.name, **required(action))
    bench.ears.command(id=wanted, op="cancel")
    bench.ears.final(wanted)
    bench.stop()
    assert bench.ears.states(wanted).count("accepted") == 1
    assert len(bench.finals(wanted)) == 1


# ---- close and real clock --------------------------------------------------------------------------


def test_close_cancels_the_running_action_and_leaves_no_thread(kind) -> None:
    name = f"Closing {kind.model}"
    with at_its_start(kind, name) as bench:  # the context closes it again
        ears = bench.ears
        long = bench.any_action(long=True)
        ears.invoke("1", long.name, **required(long))
        eventually(lambda: "running" in ears.states("1"))
        bench.driver.close()
        assert ears.final("1")["state"] == "canceled"
        ears.invoke("2", long.name)
        assert ears.answers("2") == []
    assert [t.name for t in threading.enumerate() if t.name.startswith(name)] == []


def test_actions_that_use_different_parts_succeed_concurrently_with_the_real_clock(kind) -> None:
    """Actions that use different parts of the robot run at the same time."""
    with at_its_start(kind, f"Real_{kind.model}", real_clock=True) as bench:
        robot, ears = bench.robot, bench.ears
        taken: set[str] = set()
        asked: dict[str, Mapping[str, object]] = {}
        for action in robot.actions:
            made_up = any(p.is_required and p.default is None for p in action.parameters)
            if taken & set(action.uses) or action.name == robot.safe_stop.action or made_up:
                continue
            taken |= set(action.uses)
            asked[action.name] = required(action)
            ears.invoke(action.name, action.name, **required(action))
        for wanted in asked:
            assert ears.final(wanted)["state"] == "succeeded", wanted
            assert all("waits_for" not in reply for reply in ears.answers(wanted)), wanted
