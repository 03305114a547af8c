"""Robots on a real network whose replies a test controls: immediate, delayed, rejecting or none."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

import pytest

import nep
from app.robots.client import rize
from app.robots.description.description import Robot
from tests.blocks.samples import robot


@contextmanager
def usual_time_limits() -> Iterator[None]:
    """Shorten the time limits for replies of robots in this process, for a robot that doesn't reply.

    They are those of the product, except that other robots get three seconds to confirm a Stop.
    """
    usual = {"STOP_TIMEOUT_S": 3.0, "FIRST_REPLY_TIMEOUT_S": 3.0, "MIN_SILENCE_S": 2.0}
    with pytest.MonkeyPatch.context() as patched:
        for name, seconds in usual.items():
            patched.setattr(f"app.robots.client.limits.{name}", seconds)
        patched.setattr("app.core.robots.invocations.FIRST_REPLY_TIMEOUT_S", 3.0)
        yield


class WireRobot:
    """Robot with the description, command and reply topics of the protocol, and a log of commands."""

    def __init__(self, master: str, name: str = "Pepper") -> None:
        self.described: Robot = robot(name)
        self.commands: list[Mapping[str, object]] = []
        self.silent: set[str] = set()  # operations that get no reply
        self.slow: set[str] = set()  # actions that are accepted but never end
        self.refuses: dict[str, str] = {}
        self.changed = threading.Condition()
        self._node = nep.node(name, master=master)
        topics = self.described.topics
        self._answer = self._node.new_pub(topics.reply, "robot/answer")
        self._description = self._node.new_pub(topics.description, "robot/description", latched=True)
        self._description.publish(dict(self.described.source))
        self._sensors = {
            sensor.name: self._node.new_pub(sensor.topic)
            for sensor in (*self.described.sensors, *self.described.events)
        }
        self._node.new_sub(topics.command, "robot/command", sink=self._receive)

    def tell(self, name: str, value: object) -> None:
        """Publish a sensor value or an event."""
        self._sensors[name].publish(value)

    def heard(self, op: str) -> list[Mapping[str, object]]:
        """Return the commands of this operation; a Stop that is repeated until it is answered counts once."""
        found = [command for command in list(self.commands) if command["op"] == op]
        if op != "stop":
            return found
        return list({command["id"]: command for command in reversed(found)}.values())[::-1]

    def close(self) -> None:
        self._node.close()

    def _receive(self, messages: Sequence[nep.Message]) -> None:
        for message in messages:
            command = message.payload
            assert isinstance(command, dict)
            with self.changed:
                self.commands.append(command)
                self.changed.notify_all()
            if command["op"] in self.silent or command["op"] == "alive":
                continue
            if command["op"] == "stop":
                self._say(command, "succeeded")
            elif command["op"] == "invoke":
                self._invoke(command)

    def _invoke(self, command: Mapping[str, object]) -> None:
        self._say(command, "accepted")
        action = str(command["action"])
        if action in self.refuses:
            self._say(command, "failed", self.refuses[action])
        elif action not in self.slow:
            self._say(command, "succeeded")

    def _say(self, command: Mapping[str, object], state: str, error: str = "") -> None:
        answer = {"id": command["id"], "op": command["op"], "action": command.get("action"), "state": state}
        self._answer.publish(answer | {"output": {"word": "yes"}, "feedback": {}, "error": error})


class RizeRobot:
    """Driver of the RIZE protocol: executes commands for its name and replies with the same object."""

    def __init__(self, master: str, name: str = "Rosie") -> None:
        self.described = rize.robot(name)
        self.commands: list[dict[str, object]] = []
        self._node = nep.node(name, master=master)
        self._answer = self._node.new_pub("action_state")
        self._node.new_sub("robot_action", sink=self._receive)

    def close(self) -> None:
        self._node.close()

    def _receive(self, messages: Sequence[nep.Message]) -> None:
        for message in messages:
            command = message.payload
            assert isinstance(command, dict)
            if command.get("robots") != self.described.name:
                continue
            self.commands.append(command)
            if command["node"] == "action":
                self._answer.publish(command | {"state": "success"})
