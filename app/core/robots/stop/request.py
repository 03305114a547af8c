"""Pending Stop of one robot: the programs that must reply, and their replies. No sockets."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from app.core.robots.stop.lines import StopLine
from app.core.robots.stop.report import RobotStop
from app.robots.description.description import RobotTopics
from app.robots.held_messages import HeldMessages
from nep.errors import NepError
from nep.messages.message import Message

MAX_ANSWER_BYTES = 65_536
"""Maximum size of a reply to a Stop; longer messages are ignored."""
SHOWN_WAIT_MS = 20.0
"""Shorter waits for the connection are not reported."""


@dataclass
class StopRequest:
    """State of a Stop: the programs that serve a robot and their replies, by node.

    ``serving`` is empty until the programs are known. ``unknown`` has replies of publishers that the graph
    does not list yet, ``foreign`` those of programs that do not serve the robot; they are decoded only once
    their sender is known. ``delivered`` are the topics on which the command was sent while the robot was
    connected, the first at ``delivered_s``.
    """

    line: StopLine
    id: str
    sent_s: float
    late: Callable[[RobotStop], object] | None
    ends: str | None = None
    error: str = ""
    serving: dict[str, RobotStop | None] = field(default_factory=dict)
    programs: dict[str, str] = field(default_factory=dict)
    unknown: HeldMessages = field(default_factory=HeldMessages)
    foreign: dict[str, HeldMessages] = field(default_factory=dict)
    delivered: set[RobotTopics] = field(default_factory=set)
    delivered_s: float | None = None
    is_over: bool = False

    @property
    def is_settled(self) -> bool:
        """True if no reply is awaited."""
        return bool(self.error) or self.is_answered

    @property
    def is_answered(self) -> bool:
        """True if all programs have replied."""
        return bool(self.serving) and None not in self.serving.values()

    @property
    def is_proven(self) -> bool:
        """True if all programs have confirmed that the robot has stopped."""
        return bool(self.serving) and all(each and each.answered for each in self.serving.values())

    def sent(self, way: RobotTopics, now: float) -> None:
        """Record that the command was sent on a connected topic."""
        self.delivered.add(way)
        if self.delivered_s is None:
            self.delivered_s = now

    def news(self, told: set[tuple[str, str]]) -> list[tuple[str, RobotStop]]:
        """Return the replies that are not in ``told``, by node."""
        found, waits = self.serving.items(), None in self.serving.values()
        said = [(node, each) for node, each in found if each is not None and (self.id, node) not in told]
        return [(node, replace(each, waits=waits)) for node, each in said]

    def results(self) -> list[RobotStop]:
        """Return a result for each program; programs without a reply are unproven."""
        unconnected = self.line.unconnected
        silent = RobotStop(
            self.line.name, False, None, error=self.error or unconnected, is_pending=bool(unconnected)
        )
        if not self.serving:
            return [silent]
        return [
            each or replace(silent, program=self.programs.get(node, ""))
            for node, each in self.serving.items()
        ]

    def accept(self, node: str, message: Message, now: float, words: Callable[[object], str]) -> bool:
        """Apply a message of a program that must reply; return whether it changed the result.

        A refusal may be followed by a confirmation; nothing else is replaced. ``words`` formats the sentence
        of a refusal from the robot's error.
        """
        reply = answer_in(message)
        state = None if reply is None else reply.get("state")
        if reply is None or reply.get("id") != self.id or state not in ("succeeded", "failed"):
            return False
        before, is_still = self.serving[node], state == "succeeded"
        if before is not None and (before.answered or not is_still):
            return False
        waited_ms = 0.0 if self.delivered_s is None else (self.delivered_s - self.sent_s) * 1000
        self.serving[node] = RobotStop(
            self.line.name,
            is_still,
            (now - self.sent_s) * 1000,
            error="" if is_still else words(reply.get("error")),
            refused=not is_still,
            program=self.programs.get(node, ""),
            node=node,
            waited_ms=waited_ms if waited_ms > SHOWN_WAIT_MS else 0.0,
        )
        return True

    def impostors(self) -> list[str]:
        """Return the nodes that replied to this Stop without serving the robot."""
        return [
            node
            for node, held in self.foreign.items()
            if any(
                (told := answer_in(each)) is not None and told.get("id") == self.id for each in held.pop_all()
            )
        ]


def answer_in(message: Message) -> Mapping[str, object] | None:
    """Return the reply to a Stop in a message, or None if it has none."""
    if message.size_bytes > MAX_ANSWER_BYTES:
        return None
    try:
        payload = message.payload
    except (NepError, RecursionError):
        return None
    return payload if isinstance(payload, Mapping) and payload.get("op") == "stop" else None
