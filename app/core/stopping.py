"""Stop is proven: every robot is told to stop, and answers or is named.

The publishers exist before anything runs, because a connection that is made in the moment of need may be
late.
"""

from __future__ import annotations

import threading
import time
import uuid
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from app.robots import rize
from app.robots.description import Robot
from nep.errors import NepError
from nep.message import Message

RIZE = "rize"


@dataclass(frozen=True)
class RobotStop:
    """What became of one robot's stop.

    ``can_confirm`` is False for robots that never answer a stop (RIZE).
    """

    name: str
    answered: bool
    elapsed_ms: float | None
    can_confirm: bool = True
    error: str = ""

    @property
    def sentence(self) -> str:
        """In words: "Pepper stopped (41 ms)"."""
        if self.answered:
            return f"{self.name} stopped ({self.elapsed_ms or 0:.0f} ms)"
        if not self.can_confirm:
            return f"{self.name}: stop sent; this robot cannot confirm"
        return self.error or f"{self.name} did not answer. Switch it off by hand."


@dataclass(frozen=True)
class StopReport:
    """All robots' stops; ``elapsed_ms`` from the call to the last answer."""

    robots: tuple[RobotStop, ...]
    elapsed_ms: float

    @property
    def proven(self) -> bool:
        """Whether every robot that can confirm has."""
        return all(robot.answered or not robot.can_confirm for robot in self.robots)

    @property
    def silent(self) -> tuple[str, ...]:
        """The robots that should have answered and did not."""
        return tuple(robot.name for robot in self.robots if robot.can_confirm and not robot.answered)


class Publisher(Protocol):
    """What is needed of NEP's publisher."""

    def publish(self, payload: object) -> None:
        """Send one message."""
        ...

    def close(self) -> None:
        """Stop publishing."""
        ...


class Subscriber(Protocol):
    """What is needed of NEP's subscriber."""

    def close(self) -> None:
        """Stop subscribing."""
        ...


class Node(Protocol):
    """What is needed of NEP's node."""

    def new_pub(self, topic: str, msg_type: str = "json") -> Publisher:
        """A publisher."""
        ...

    def new_sub(
        self, topic: str, msg_type: str = "json", *, sink: Callable[[Sequence[Message]], None]
    ) -> Subscriber:
        """A subscriber whose messages go to `sink`, in the node's thread."""
        ...


@dataclass(frozen=True)
class _Line:
    """The way to one robot."""

    robot: Robot
    publisher: Publisher
    subscriber: Subscriber | None


@dataclass
class _Asked:
    """A stop that is under way."""

    line: _Line
    id: str
    sent_s: float
    result: RobotStop | None = None


class RobotStopper:
    """Keeps a way to each robot and stops them. Its methods may be called from any thread."""

    def __init__(self, node: Node, clock: Callable[[], float] = time.monotonic) -> None:
        """No robots yet: `set_robots`."""
        self._node = node
        self._clock = clock
        self._sender = f"stopper-{uuid.uuid4().hex[:8]}"
        self._changed = threading.Condition()
        self._lines: dict[str, _Line] = {}
        self._asked: dict[str, _Asked] = {}

    def set_robots(self, robots: Iterable[Robot]) -> None:
        """Keep a way to exactly these robots; connects to new ones, lets go of others."""
        wanted = {robot.name: robot for robot in robots}
        with self._changed:
            gone = [line for name, line in self._lines.items() if not _same(wanted.get(name), line.robot)]
            for line in gone:
                del self._lines[line.robot.name]
            new = [robot for name, robot in wanted.items() if name not in self._lines]
        for line in gone:
            _close(line)
        for robot in new:
            line = self._connect(robot)
            with self._changed:
                self._lines[robot.name] = line

    @property
    def robots(self) -> tuple[str, ...]:
        """The names of the robots that can be stopped."""
        with self._changed:
            return tuple(self._lines)

    def send_stop(self, names: Iterable[str] | None = None, ends: str | None = None) -> None:
        """Tell the robots to stop and do not wait.

        `ends` is the id of a program: robots refuse what it still sends. A robot that can't (RIZE) must be
        told again when the program is gone.
        """
        for line in self._chosen(names):
            self._tell(line, _id(), ends)

    def stop_all(
        self,
        names: Iterable[str] | None = None,
        timeout_s: float = 1.0,
        on_answer: Callable[[RobotStop], None] | None = None,
        ends: str | None = None,
    ) -> StopReport:
        """Tell the robots (`names`, or all) to stop and wait until each has answered, `timeout_s` at most.

        `on_answer` is called in this thread for each robot as it answers, and at the end for each that did
        not. `ends` as in `send_stop`.
        """
        began = self._clock()
        asked = [self._ask(line, ends) for line in self._chosen(names)]
        told: set[str] = set()
        until = began + timeout_s
        while True:
            with self._changed:
                self._changed.wait_for(lambda: _news(asked, told), max(0.0, until - self._clock()))
                finished = [each for each in asked if each.result is not None and each.id not in told]
            for each in finished:
                told.add(each.id)
                if on_answer is not None and each.result is not None:
                    on_answer(each.result)
            if len(told) == len(asked) or self._clock() >= until:
                break
        elapsed_ms = (self._clock() - began) * 1000
        return StopReport(tuple(self._outcome(each, told, on_answer) for each in asked), elapsed_ms)

    def close(self) -> None:
        """Let go of all robots; they are not told."""
        self.set_robots(())

    # ---- inside

    def _connect(self, robot: Robot) -> _Line:
        if robot.dialect == RIZE:
            return _Line(robot, self._node.new_pub(robot.topics.command, "json"), None)
        subscriber = self._node.new_sub(robot.topics.answer, "robot/answer", sink=self._answers)
        return _Line(robot, self._node.new_pub(robot.topics.command, "robot/command"), subscriber)

    def _chosen(self, names: Iterable[str] | None) -> list[_Line]:
        with self._changed:
            if names is None:
                return list(self._lines.values())
            return [self._lines[name] for name in dict.fromkeys(names) if name in self._lines]

    def _ask(self, line: _Line, ends: str | None) -> _Asked:
        asked = _Asked(line, _id(), self._clock())
        with self._changed:
            self._asked[asked.id] = asked
        error = self._tell(line, asked.id, ends)
        if line.robot.dialect == RIZE or error:
            asked.result = RobotStop(
                line.robot.name, False, None, can_confirm=line.robot.dialect != RIZE, error=error
            )
        return asked

    def _tell(self, line: _Line, id: str, ends: str | None) -> str:
        """Send a stop; the sentence about what went wrong, or nothing."""
        robot = line.robot
        stop = robot.safe_stop.action
        if robot.dialect == RIZE:
            command = rize.to_command(robot, stop, {}, id)
        else:
            command = {"id": id, "op": "stop", "from": self._sender, "action": stop, "input": {}}
            if ends is not None:
                command["ends"] = ends
        try:
            line.publisher.publish(command)
        except NepError as error:
            return f"{robot.name} can't be told: {error}."
        return ""

    def _answers(self, messages: Sequence[Message]) -> None:
        for message in messages:
            try:
                payload = message.payload
            except NepError:
                continue
            if isinstance(payload, Mapping) and payload.get("op") == "stop":
                self._answer(message.topic, payload)

    def _answer(self, topic: str, told: Mapping[str, object]) -> None:
        """Take a robot's own answer; one that answers for another proves nothing."""
        state = told.get("state")
        with self._changed:
            asked = self._asked.get(str(told.get("id")))
            if asked is None or asked.result is not None or state not in ("succeeded", "failed"):
                return
            if asked.line.robot.topics.answer != topic:
                return
            elapsed_ms = (self._clock() - asked.sent_s) * 1000
            name = asked.line.robot.name
            error = "" if state == "succeeded" else f"{name}: {told.get('error') or 'the stop failed'}."
            asked.result = RobotStop(name, state == "succeeded", elapsed_ms, error=error)
            self._changed.notify_all()

    def _outcome(
        self, asked: _Asked, told: set[str], on_answer: Callable[[RobotStop], None] | None
    ) -> RobotStop:
        with self._changed:
            self._asked.pop(asked.id, None)
            result = asked.result or RobotStop(asked.line.robot.name, False, None)
        if asked.id not in told and on_answer is not None:
            on_answer(result)
        return result


def _news(asked: Sequence[_Asked], told: set[str]) -> bool:
    return any(each.result is not None and each.id not in told for each in asked) or len(told) == len(asked)


def _same(wanted: Robot | None, known: Robot) -> bool:
    return wanted is not None and (wanted.topics, wanted.dialect) == (known.topics, known.dialect)


def _close(line: _Line) -> None:
    line.publisher.close()
    if line.subscriber is not None:
        line.subscriber.close()


def _id() -> str:
    return f"stop-{uuid.uuid4().hex[:12]}"
