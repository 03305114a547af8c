"""Benchmark of Stop: the time until all of three moving robots, each in its own process, have replied.

``python bench/stop.py [--stops 60] [--robots 3]``: each round moves every robot, presses Stop as Studio
does (`app.core.robots.stop.stopper.RobotStopper`, one stop for all) and takes the time to the last
reply. A reply confirms that the robot stands still: its stop method has returned and all its functions
have ended. The row "sent and echoed" is the same path over the wire with a reply that takes no work, in
the same rounds.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import nep
from app.core.robots.stop.stopper import RobotStopper
from app.robots.description.description import Robot, parse

ROOT = Path(__file__).resolve().parents[1]
GOAL_MS = 50.0
READY_S, MOVE_S, STOP_S = 30.0, 5.0, 2.0
MODULES = ("app.robots.simulated", "app.robots.turtle")
MOVES: Mapping[str, tuple[str, Mapping[str, object]]] = {
    "pepper": ("turn", {"direction": "left", "angle": 360, "speed": 20}),
    "diffdrive": ("turn", {"angle": 360}),
}


class Watching:
    """Command publishers and reply subscribers of the robots."""

    def __init__(self, node: nep.Node, robots: Sequence[Robot]) -> None:
        self._changed = threading.Condition()
        self._states: dict[str, list[str]] = {}
        self._commands = {robot.name: node.new_pub(robot.topics.command, "robot/command") for robot in robots}
        for robot in robots:
            node.new_sub(robot.topics.reply, "robot/answer", sink=self._take)

    def _take(self, messages: Sequence[nep.Message]) -> None:
        with self._changed:
            for message in messages:
                answer = message.payload
                if isinstance(answer, Mapping):
                    self._states.setdefault(str(answer.get("id")), []).append(str(answer.get("state")))
            self._changed.notify_all()

    def send(self, robot: str, **command: object) -> None:
        """Send a command to a robot."""
        self._commands[robot].publish({"from": "bench", **command})

    def wait(self, ids: Sequence[str], states: Sequence[str], timeout_s: float) -> bool:
        """Wait until each command has a reply with one of these states; return False on timeout."""

        def so() -> bool:
            return all(set(states) & set(self._states.get(one, ())) for one in ids)

        with self._changed:
            return self._changed.wait_for(so, timeout_s)


def start_robots(address: str, count: int) -> list[subprocess.Popen[bytes]]:
    """Start `count` virtual robots, alternately Pepper and Turtle, each in its own process."""
    environment = {**os.environ, "NEP_MASTER": address, "PYTHONPATH": str(ROOT)}
    made = []
    for number in range(count):
        command = [sys.executable, "-m", MODULES[number % 2], "--name", f"Robot{number + 1}"]
        command += ["--owner-pid", str(os.getpid())]
        made.append(subprocess.Popen(command, cwd=ROOT, env=environment, stdout=subprocess.DEVNULL))
    return made


def described(node: nep.Node, count: int) -> list[Robot]:
    """Wait for the robots' descriptions and return them; exit if one is missing."""
    found = []
    for number in range(count):
        topic = f"/Robot{number + 1}/description"
        message = node.new_sub(topic, "robot/description").receive(READY_S)
        if message is None or not isinstance(message.payload, Mapping):
            raise SystemExit(f"{topic}: the robot has not come")
        found.append(parse(message.payload))
    return found


def one_round(
    number: int, robots: Sequence[Robot], watching: Watching, stopper: RobotStopper
) -> tuple[float, float]:
    """Move and stop all robots; return the milliseconds to the last reply of Stop and of an echo."""
    ids = []
    for robot in robots:
        action, given = MOVES[robot.model]
        ids.append(f"{robot.name}-{number}")
        watching.send(robot.name, id=ids[-1], op="invoke", action=action, input=dict(given))
    if not watching.wait(ids, ["running"], MOVE_S):
        raise SystemExit(f"round {number}: the robots did not begin to move")
    threading.Event().wait(0.15)  # lets the robots gain speed
    for robot in robots:
        watching.send(robot.name, id="", op="alive")
    echoed = _timed(lambda: _echo(number, robots, watching))
    report = stopper.stop_all(timeout_s=STOP_S)
    if not report.is_confirmed:
        raise SystemExit(f"round {number}: {', '.join(report.unconfirmed_names)} did not answer")
    watching.wait(ids, ["canceled"], MOVE_S)
    return report.elapsed_ms, echoed


def _echo(number: int, robots: Sequence[Robot], watching: Watching) -> None:
    """Cancel a task that doesn't exist: the robot rejects it at once, without any motion."""
    ids = [f"echo-{robot.name}-{number}" for robot in robots]
    for robot, wanted in zip(robots, ids, strict=True):
        watching.send(robot.name, id=wanted, op="cancel")
    watching.wait(ids, ["failed"], STOP_S)


def _timed(what: Callable[[], None]) -> float:
    began = time.perf_counter()
    what()
    return (time.perf_counter() - began) * 1000


def share(values: Sequence[float], part: float) -> float:
    """Return the quantile `part` (0 to 1) of the values."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, round(part * (len(ordered) - 1)))]


def table(rows: Mapping[str, Sequence[float]]) -> str:
    """Format the results in milliseconds as a table."""
    lines = [f"{'ms':<28}{'median':>9}{'p95':>9}{'most':>9}"]
    for name, values in rows.items():
        figures = (statistics.median(values), share(values, 0.95), max(values))
        lines.append(f"{name:<28}" + "".join(f"{figure:>9.1f}" for figure in figures))
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print; return 0 if the 95th percentile is within the goal."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--stops", type=int, default=60)
    parser.add_argument("--robots", type=int, default=3)
    chosen = parser.parse_args(arguments)
    with nep.Master("127.0.0.1:0") as master:
        robots = start_robots(master.address, chosen.robots)
        try:
            stops, echoes = measure(master.address, chosen.robots, chosen.stops)
        finally:
            for robot in robots:
                robot.terminate()
            for robot in robots:
                robot.wait(5)
    print(f"{chosen.stops} stops of {chosen.robots} robots that move, load {os.getloadavg()[0]:.1f}")
    print(table({"Stop to the last answer": stops, "sent and echoed": echoes}))
    p95 = share(stops, 0.95)
    print(f"p95 {p95:.1f} ms: {'within' if p95 <= GOAL_MS else 'ABOVE'} the goal of {GOAL_MS:.0f} ms")
    return 0 if p95 <= GOAL_MS else 1


def measure(address: str, count: int, stops: int) -> tuple[list[float], list[float]]:
    """Return the results of all rounds except an uncounted first one: stops and echoes, in ms."""
    with nep.node("bench", master=address) as node:
        robots = described(node, count)
        watching, stopper = Watching(node, robots), RobotStopper(node)
        stopper.set_robots(robots)
        rounds = [one_round(number, robots, watching, stopper) for number in range(stops + 1)]
        stopper.close()
    return [stop for stop, _ in rounds[1:]], [echo for _, echo in rounds[1:]]


if __name__ == "__main__":
    raise SystemExit(main())
