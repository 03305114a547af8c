"""Replies of robots as values, independent of the dialect in which they were sent."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from app.robots.identity import is_may_move_error, safe_error_text
from nep.text import bounded_str

Payload = Mapping[str, object]

FINAL_STATES = frozenset({"succeeded", "failed", "canceled"})
REPLY_STATES = FINAL_STATES | {"accepted", "running"}
_NO_FIELDS: Payload = {}


@dataclass(frozen=True, slots=True)
class RobotReply:
    """Reply of a robot to a command, or its heartbeat.

    Attributes:
        op: Operation of the command: "invoke", "cancel", "stop", or "alive" for a heartbeat.
        id: Id of the command; "" in heartbeats.
        state: One of `REPLY_STATES`; "" if the robot sent another one.
        fields: All members of the message.
    """

    op: str
    id: str
    state: str
    fields: Payload = field(default_factory=dict)

    @property
    def is_final(self) -> bool:
        """True if the action of the command has ended."""
        return self.state in FINAL_STATES

    @property
    def output(self) -> Payload:
        """Result of the action; empty if the reply has none."""
        return _object(self.fields.get("output"))

    @property
    def feedback(self) -> Payload:
        """Progress of the action; empty if the reply has none."""
        return _object(self.fields.get("feedback"))

    @property
    def error(self) -> str:
        """Error as harmless text of limited length, or ""."""
        error = self.fields.get("error")
        return safe_error_text(error) if error else ""

    @property
    def waits_for(self) -> tuple[str, ...]:
        """Names of the actions that end before an accepted action starts."""
        return _names(self.fields.get("waits_for"))

    @property
    def replaces(self) -> tuple[str, ...]:
        """Names of the actions that an accepted action has replaced."""
        return _names(self.fields.get("replaces"))

    def ends_motion(self, robot: str) -> bool:
        """Return True if the robot says that an action has ended and doesn't say that it may still move.

        Args:
            robot: Name of the robot.
        """
        return self.op == "invoke" and self.is_final and not is_may_move_error(robot, self.error)


def parse_reply(payload: object) -> RobotReply | None:
    """Parse the payload of a ``robot/answer`` message; return None if it is not an object.

    A reply without ``op`` replies to an invoke.
    """
    if not isinstance(payload, dict):  # JSON objects are; a check for `Mapping` costs three calls per reply
        return None
    op, id, state = payload.get("op"), payload.get("id"), payload.get("state")
    return RobotReply(
        "invoke" if op is None else op if isinstance(op, str) else "",
        id if isinstance(id, str) else "",
        state if isinstance(state, str) and state in REPLY_STATES else "",
        payload,
    )


def _object(value: object) -> Payload:
    return value if isinstance(value, dict) else _NO_FIELDS


def _names(value: object) -> tuple[str, ...]:
    return tuple(map(bounded_str, value)) if isinstance(value, (list, tuple)) else ()
