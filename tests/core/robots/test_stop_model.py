"""Stateful tests of Stop: a confirmed stop is correct whatever robots, links and foreign programs do.

Studio's session, its stopper and the robots' driver kit are the real code; time, network, bodies and
people are simulated (`tests.core.robots.stop_model`). ``NEP_STOP_HISTORIES=100000`` searches that many
random histories instead of the fixed ones, of which ``--long`` runs more.
"""

from __future__ import annotations

import os
import tempfile
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from app.core.faults import ALERT_ID
from nep.messages.message import Message
from tests.core.robots.stop_model.lab import SimulatedLab
from tests.core.robots.stop_model.robots import SimulatedRobot
from tests.core.robots.stop_model.studio import GRAPH_POLL_S, SimulatedBridge

HISTORIES = int(os.environ.get("NEP_STOP_HISTORIES", "0"))
FIXED_HISTORIES, LONG_FIXED_HISTORIES = 80, 2000
STEPS = 10
NAMES = ("Arm", "Base")
REACT_S = 0.5
"""Seconds between a press of Stop and the standstill of a robot that receives it."""
FINAL = {"succeeded", "failed", "canceled"}

names = st.sampled_from(NAMES)
picks = st.integers(0, 3)
waits = st.sampled_from([0.0, 0.05, 0.6, 1.7])


class StopModel(RuleBasedStateMachine):
    """State machine of one history.

    `told` and `answered` are read from the simulated network, not from Studio.
    """

    def __init__(self) -> None:
        super().__init__()
        self.folder = tempfile.TemporaryDirectory(prefix="nep-stop-")
        self.lab = lab = SimulatedLab(Path(self.folder.name))
        self.clock, self.network, self.studio = lab.clock, lab.network, lab.studio
        self.stranger, self.robots = lab.stranger, lab.robots
        self.bridge = SimulatedBridge(self.network)
        self.told: dict[
            SimulatedRobot, dict[str, int]
        ] = {}  # ids of motion commands -> index in network.sent
        self.press = self.press_of_all = 0  # the newest Stop, and the newest Stop for all robots
        self.pressed_at = 0  # number of messages sent before that Stop
        self.stops: dict[str, tuple[int, int]] = {}  # id of a stop -> its press, index in network.sent
        self.answered: dict[int, set[str]] = defaultdict(set)  # press -> robots whose reply reached Studio
        self.pressed_s = 0.0
        self.undisturbed: set[str] = set()  # robots that were reachable ever since Stop was pressed
        self._read_sent = self._read_delivered = 0
        self._seen_report: object = None
        lab.before_delivery, lab.after_step = self._follow_network, self._check

    # -- network traffic

    def _follow_network(self) -> None:
        """Read from the network which robots received commands and stops and which replies were delivered."""
        network = self.network
        for place, (publisher, message, reached) in enumerate(
            network.sent[self._read_sent :], self._read_sent
        ):
            value = self._value(publisher.node.id, message, "command")
            if value.get("op") == "stop":
                self.stops.setdefault(str(value["id"]), (self.press, place))
            elif value.get("op") == "invoke":
                robots = [each for each in self.robots if each.id in reached]
                for robot in robots:
                    self.told.setdefault(robot, {})[str(value["id"])] = place
                self.undisturbed -= {each.id for each in robots}
        self._read_sent = len(network.sent)
        for publisher, subscriber, message in network.delivered[self._read_delivered :]:
            value = self._value(publisher.node.id, message, "answer")
            robot = next((each for each in self.robots if each.id == publisher.node.id), None)
            if robot is not None and subscriber.node is self.studio.node and value:
                self._hear(robot, value)
        self._read_delivered = len(network.delivered)

    def _value(self, node_id: str, message: Message, leaf: str) -> dict[str, object]:
        is_hostile = node_id == self.stranger.node.id
        value = message.payload if message.topic.endswith(f"/{leaf}") and not is_hostile else None
        return value if isinstance(value, dict) else {}

    def _hear(self, robot: SimulatedRobot, answer: dict[str, object]) -> None:
        """Record a reply that Studio received from a robot."""
        told, id, state = self.told.get(robot, {}), str(answer["id"]), answer["state"]
        if answer["op"] == "stop" and state == "succeeded" and id in self.stops:
            press, asked = self.stops[id]
            self.answered[press].add(robot.id)
            for command in [each for each, place in told.items() if place < asked]:
                del told[command]
        elif (
            answer["op"] == "invoke"
            and answer["action"] == "turn"
            and state in FINAL
            and not robot.body.is_turning
        ):
            told.pop(id, None)

    # -- robots start, freeze, die and return

    @initialize(both=st.booleans())
    def start(self, both: bool) -> None:
        for name in NAMES[: 1 + both]:
            self.lab.start_robot(name)
        self.lab.settle()
        self.lab.advance(GRAPH_POLL_S)

    @rule(name=names, late=st.booleans())
    def start_robot(self, name: str, late: bool) -> None:
        if len([each for each in self.robots if each.name == name]) < 3:
            self.lab.start_robot(name, connects_late=late)
            self.lab.settle()

    def _pick(self, pick: int, robots: Sequence[SimulatedRobot]) -> SimulatedRobot:
        return robots[pick % len(robots)]

    @precondition(lambda self: any(each.node.is_connecting for each in self.robots))
    @rule()
    def connect(self) -> None:
        for robot in self.robots:
            robot.node.is_connecting = False
        self.lab.settle()

    @precondition(lambda self: any(each.node.is_running for each in self.robots))
    @rule(pick=picks, is_killed=st.booleans(), wait_s=waits)
    def halt(self, pick: int, is_killed: bool, wait_s: float) -> None:
        """Freeze a robot's process, or kill it."""
        robot = self._pick(pick, [each for each in self.robots if each.node.is_running])
        robot.node.halt(is_dead=is_killed)
        self.undisturbed.discard(robot.id)
        self.lab.advance(wait_s)

    @precondition(lambda self: any(each.node.is_frozen for each in self.robots))
    @rule(pick=picks)
    def thaw(self, pick: int) -> None:
        self._pick(pick, [each for each in self.robots if each.node.is_frozen]).thaw()
        self.lab.settle()

    @precondition(lambda self: self.robots)
    @rule(pick=picks, how=st.sampled_from(["up", "held", "lost"]))
    def change_link(self, pick: int, how: str) -> None:
        robot = self._pick(pick, self.robots)
        robot.node.is_held, robot.node.is_isolated = how == "held", how == "lost"
        if how != "up":
            self.undisturbed.discard(robot.id)
        self.lab.settle()

    @precondition(lambda self: self.robots)
    @rule(pick=picks, fails=st.booleans())
    def break_brake(self, pick: int, fails: bool) -> None:
        robot = self._pick(pick, self.robots)
        robot.body.brake_fails = fails
        if fails:
            self.undisturbed.discard(robot.id)

    # -- motion commands from users and programs

    @rule(name=names, action=st.sampled_from(["drive", "turn"]), wait_s=waits)
    def move_by_form(self, name: str, action: str, wait_s: float) -> None:
        self.studio.move(name, action)
        self.lab.settle()
        self.lab.advance(wait_s)

    @rule(robots=st.sets(names, min_size=1), wait_s=waits)
    def move_by_behaviour(self, robots: set[str], wait_s: float) -> None:
        there = {link.name for link in self.studio.session.fleet.connected}
        self.studio.run(sorted(robots & there))
        self.lab.settle()
        self.lab.advance(wait_s)

    @rule(name=names, way=st.sampled_from(["shelf", "alarm", "replay", "bridge"]), wait_s=waits)
    def move_by_message(self, name: str, way: str, wait_s: float) -> None:
        if self.studio.session.fleet.link(name) is None:
            return  # Studio doesn't know a robot of this name yet
        match way:
            case "shelf":
                self.studio.send_from_shelf(name)
            case "alarm":
                self.studio.send_from_alarm(name)
            case "replay":
                self.studio.replay(name)
            case _:
                self.bridge.carry(name)
                self.lab.settle()
                self.studio.see()  # as after the bridge renewed its lease with its counts
        self.lab.settle()
        self.lab.advance(wait_s)

    # -- foreign programs

    @rule(name=names, times=st.sampled_from([1, 40]))
    def forge_answers(self, name: str, times: int) -> None:
        self.stranger.answer(name, list(self.stops)[-4:], times=times)
        self.lab.settle()

    @rule(
        name=names,
        leaf=st.sampled_from(["command", "answer", "description"]),
        depth=st.sampled_from([60, 1000]),
    )
    def send_deep_value(self, name: str, leaf: str, depth: int) -> None:
        self.stranger.send_deep(f"/{name}/{leaf}", depth)
        self.lab.settle()

    @rule(name=names)
    def send_many_keys(self, name: str) -> None:
        self.stranger.send_many_keys(f"/{name}/command", 300)
        self.lab.settle()

    # -- Stop

    @rule(wait_s=waits)
    def press_stop(self, wait_s: float) -> None:
        self.press += 1
        self.press_of_all, self.pressed_at = self.press, len(self.network.sent)
        self.pressed_s = self.clock.now()
        self._undisturbed_now()
        self.studio.session.runs.stop()
        self.lab.settle()
        self.lab.advance(wait_s)

    @rule(name=names, wait_s=waits)
    def stop_one_robot(self, name: str, wait_s: float) -> None:
        self.press += 1
        self.studio.session.runs.stop_robot(name)
        self.lab.settle()
        self.lab.advance(wait_s)

    def _undisturbed_now(self) -> None:
        links = {
            link.identity.node_id for link in self.studio.session.fleet.connected if link.identity is not None
        }
        self.undisturbed = {
            each.id
            for each in self.robots
            if each.node.is_running
            and not (each.node.is_held or each.node.is_isolated or each.node.is_connecting)
            and not each.body.brake_fails
            and each.id in links
        }

    @precondition(lambda self: self.studio.session.runs.state.state == "unanswered")
    @rule()
    def confirm_standing_still(self) -> None:
        report = self.studio.session.runs.state.report
        assert report is not None
        for robot in [each for each in self.told if each.name in report.unconfirmed_names]:
            del self.told[robot]
        self.studio.session.runs.confirm_stopped()
        self.lab.settle()

    @rule(seconds=waits)
    def let_time_pass(self, seconds: float) -> None:
        self.lab.advance(seconds)

    # -- invariants

    @invariant()
    def check(self) -> None:
        self._check()

    def _check(self) -> None:
        self._check_report()
        self._check_reaction()
        self._check_alive()

    def _check_report(self) -> None:
        run = self.studio.session.runs.state
        if run.report is self._seen_report or run.report is None:
            return
        self._seen_report = report = run.report
        if run.state == "proven":
            assert report.robots, "an empty report proves nothing"
        answered = self.answered[self.press_of_all]
        for robot, commands in self.told.items():
            if robot.id not in answered and any(place < self.pressed_at for place in commands.values()):
                assert not report.is_confirmed, f"{robot} is called stopped and did not answer"
                assert robot.name in report.unconfirmed_names, (
                    f"{robot} was told to move, did not answer and is not named"
                )

    def _check_reaction(self) -> None:
        if not self.press or self.clock.now() < self.pressed_s + REACT_S:
            return
        if self.studio.session.runs.active:
            self.undisturbed.clear()
        for robot in self.robots:
            if robot.id in self.undisturbed and robot.body.is_moving:
                raise AssertionError(f"{robot} was reached by Stop and goes on")
        self.undisturbed.clear()

    def _check_alive(self) -> None:
        ended = [each for each in self.robots if each.node.is_running and not each.is_deciding]
        assert not ended, f"{ended} decides nothing any more"
        wrong = [each for each in self.studio.session.alerts.active if each.id == ALERT_ID]
        assert not wrong, wrong

    def teardown(self) -> None:
        self.lab.close()
        self.folder.cleanup()


Step = tuple[str, dict[str, object]]
BROKEN_HISTORIES: dict[str, list[Step]] = {
    "nothing to stop is not proven": [("press_stop", {"wait_s": 0.0})],
    "a robot froze while a form moved it": [
        ("move_by_form", {"name": "Arm", "action": "turn", "wait_s": 0.05}),
        ("halt", {"is_killed": False, "pick": 0, "wait_s": 1.7}),
        ("press_stop", {"wait_s": 1.7}),
    ],
    "a second program of the name came right before Stop": [
        ("start_robot", {"name": "Arm", "late": False}),
        ("change_link", {"how": "held", "pick": 2}),
        ("move_by_behaviour", {"robots": {"Arm"}, "wait_s": 0.0}),
        ("press_stop", {"wait_s": 0.0}),
    ],
    "a second program ended the motion that the frozen one still has to do": [
        ("halt", {"is_killed": False, "pick": 1, "wait_s": 0.6}),
        ("start_robot", {"name": "Base", "late": False}),
        ("move_by_form", {"name": "Base", "action": "turn", "wait_s": 1.7}),
        ("press_stop", {"wait_s": 0.0}),
    ],
    "the program that hangs without a lease hears what is sent to its twin": [
        ("start_robot", {"name": "Arm", "late": False}),
        ("halt", {"is_killed": False, "pick": 0, "wait_s": 1.7}),
        ("move_by_form", {"name": "Arm", "action": "drive", "wait_s": 0.0}),
        ("press_stop", {"wait_s": 0.0}),
    ],
    "a second program was stopped while the frozen one still drives": [
        ("start_robot", {"name": "Arm", "late": False}),
        ("move_by_form", {"name": "Arm", "action": "drive", "wait_s": 0.0}),
        ("halt", {"is_killed": False, "pick": 2, "wait_s": 1.7}),
        ("press_stop", {"wait_s": 0.0}),
    ],
}


@pytest.mark.parametrize("history", BROKEN_HISTORIES.values(), ids=BROKEN_HISTORIES)
def test_regression_histories_keep_confirmed_stops_correct(history: list[Step]) -> None:
    model = StopModel()
    try:
        model.start(both=True)
        for name, arguments in history:
            getattr(model, name)(**arguments)
            model.check()
    finally:
        model.teardown()


@pytest.mark.timeout(600 + HISTORIES)
def test_confirmed_stop_is_correct_in_random_histories(pytestconfig: pytest.Config) -> None:
    is_long = pytestconfig.getoption("--long")
    count = HISTORIES or (LONG_FIXED_HISTORIES if is_long else FIXED_HISTORIES)
    run_state_machine_as_test(
        StopModel,
        settings=settings(
            max_examples=count,
            stateful_step_count=STEPS,
            deadline=None,
            derandomize=not HISTORIES,
            database=None,
            phases=[Phase.generate, Phase.shrink],
            suppress_health_check=list(HealthCheck),
        ),
    )


def test_killed_program_does_not_prevent_stop_confirmation_by_its_namesake() -> None:
    model = StopModel()
    try:
        model.start(both=False)
        model.start_robot(name="Arm", late=False)
        model.halt(pick=0, is_killed=True, wait_s=1.7)
        model.move_by_form(name="Arm", action="drive", wait_s=0.0)
        model.press_stop(wait_s=1.7)
        model.check()
        assert model.studio.session.runs.state.state == "proven"
    finally:
        model.teardown()
