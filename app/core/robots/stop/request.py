"""Pending Stop of one robot: the programs that must reply, and their replies. Performs no I/O."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from app.core.robots.stop.channels import StopLine
from app.core.robots.stop.report import RobotStop
from app.robots.description.description import RobotTopics
from app.robots.message_buffer import PendingMessages
from nep.errors import NepError
from nep.messages.message import Message

MAX_REPLY_BYTES = 65_536
"""Maximum size in bytes of a reply to a Stop; larger messages are ignored."""
MIN_DISPLAYED_WAIT_MS = 20.0
"""Minimum time until the robot was connected that is mentioned in the result, in milliseconds."""


@dataclass
class StopRequest:
    """State of the Stop of one robot.

    Attributes:
        on_late: Called with each reply after the timeout, or None.
        program_key: Key of a program whose further commands the robot rejects, or None.
        error: Reason why the Stop could not be sent, or "".
        replies: Reply of each program that serves the robot, by node; None while pending. Empty until
            the programs are known.
        unknown_replies: Undecoded replies of publishers that the graph does not list yet.
        foreign_replies: Undecoded replies of programs that do not serve the robot.
        delivered_topics: Topics on which the command was sent while the robot was connected.
        delivered_s: Time of the first of these messages (monotonic seconds).
        is_over: True after the report; later replies are late.
    """

    line: StopLine
    id: str
    sent_s: float
    on_late: Callable[[RobotStop], object] | None
    program_key: str | None = None
    error: str = ""
    replies: dict[str, RobotStop | None] = field(default_factory=dict)
    program_names: dict[str, str] = field(default_factory=dict)
    unknown_replies: PendingMessages = field(default_factory=PendingMessages)
    foreign_replies: dict[str, PendingMessages] = field(default_factory=dict)
    delivered_topics: set[RobotTopics] = field(default_factory=set)
    delivered_s: float | None = None
    is_over: bool = False

    @property
    def is_settled(self) -> bool:
        """True if no further reply is awaited."""
        return bool(self.error) or self.has_all_replies

    @property
    def has_all_replies(self) -> bool:
        """True if all programs have replied."""
        return bool(self.replies) and None not in self.replies.values()

    @property
    def is_confirmed(self) -> bool:
        """True if all programs have confirmed that the robot has stopped."""
        return bool(self.replies) and all(each and each.is_confirmed for each in self.replies.values())

    def record_sent(self, topics: RobotTopics, now: float) -> None:
        """Record that the robot was connected when the command was sent on its command topic.

        Args:
            topics: Topics of the robot.
            now: Current time in seconds.
        """
        self.delivered_topics.add(topics)
        if self.delivered_s is None:
            self.delivered_s = now

    def new_replies(self, reported: set[tuple[str, str]]) -> list[tuple[str, RobotStop]]:
        """Return new replies as pairs of node and result.

        Args:
            reported: Pairs of Stop id and node whose replies have already been reported.
        """
        replies, is_waiting = self.replies.items(), None in self.replies.values()
        unreported = [
            (node, each) for node, each in replies if each is not None and (self.id, node) not in reported
        ]
        return [(node, replace(each, is_waiting=is_waiting)) for node, each in unreported]

    def results(self) -> list[RobotStop]:
        """Return the result of each program. Programs without a reply are unproven."""
        problem = self.line.connection_problem
        no_reply = RobotStop(
            self.line.name, False, None, error=self.error or problem, is_pending=bool(problem)
        )
        if not self.replies:
            return [no_reply]
        return [
            each or replace(no_reply, program=self.program_names.get(node, ""))
            for node, each in self.replies.items()
        ]

    def accept(self, node: str, message: Message, now: float, format_error: Callable[[object], str]) -> bool:
        """Handle a reply of a program that serves the robot; return True if its result has changed.

        A refusal may be followed by a confirmation; any other reply is final.

        Args:
            node: Id of the node that sent the message.
            message: Message on a reply topic.
            now: Monotonic seconds.
            format_error: Formats the robot's error as a sentence.
        """
        reply = parse_reply(message)
        state = None if reply is None else reply.get("state")
        if reply is None or reply.get("id") != self.id or state not in ("succeeded", "failed"):
            return False
        previous, has_stopped = self.replies[node], state == "succeeded"
        if previous is not None and (previous.is_confirmed or not has_stopped):
            return False
        waited_ms = 0.0 if self.delivered_s is None else (self.delivered_s - self.sent_s) * 1000
        self.replies[node] = RobotStop(
            self.line.name,
            has_stopped,
            (now - self.sent_s) * 1000,
            error="" if has_stopped else format_error(reply.get("error")),
            has_failed=not has_stopped,
            program=self.program_names.get(node, ""),
            node=node,
            waited_ms=waited_ms if waited_ms > MIN_DISPLAYED_WAIT_MS else 0.0,
        )
        return True

    def impostors(self) -> list[str]:
        """Return the nodes that replied to this Stop although they do not serve the robot.

        Clears the `foreign_replies`.
        """
        return [
            node
            for node, pending in self.foreign_replies.items()
            if any(
                (reply := parse_reply(each)) is not None and reply.get("id") == self.id
                for each in pending.pop_all()
            )
        ]


def parse_reply(message: Message) -> Mapping[str, object] | None:
    """Return the content of a message that is a reply to a Stop; None for other messages."""
    if message.size_bytes > MAX_REPLY_BYTES:
        return None
    try:
        payload = message.payload
    except (NepError, RecursionError):
        return None
    return payload if isinstance(payload, Mapping) and payload.get("op") == "stop" else None
