"""What a running program needs of the network; `app.blocks.runtime.network` is the real one."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

LAST_STATES = ("succeeded", "failed", "canceled")
STATES = ("accepted", "running", *LAST_STATES)


@dataclass
class RobotCall:
    """One command to a robot and what it answered; written by the network's thread, read by a script."""

    id: str
    robot: str
    action: str
    state: str = "sent"  # then accepted, running, succeeded, failed, canceled
    output: Mapping[str, object] = field(default_factory=dict)
    feedback: Mapping[str, object] = field(default_factory=dict)  # the newest that said anything
    error: str = ""
    began: bool = False  # the robot has begun to do it
    held: bool = False  # a pause has taken it back
    waits_for: tuple[str, ...] = ()  # the actions that the robot does first
    heard_s: float = field(default_factory=time.monotonic)  # when its robot last said anything

    @property
    def done(self) -> bool:
        """Whether the robot has given its last answer."""
        return self.state in LAST_STATES


class ProgramLink(Protocol):
    """Robots and topics, as a program sees them. Callbacks come from the network's thread."""

    def listen(self, poke: Callable[[], None], stopped_outside: Callable[[str], None]) -> None:
        """Call `poke` for each answer and message, `stopped_outside` when somebody else stops a robot."""
        ...

    def invoke(self, robot: str, action: str, input: Mapping[str, object]) -> RobotCall:
        """Send a command."""
        ...

    def cancel(self, call: RobotCall) -> None:
        """Take a command back."""
        ...

    def sensor(self, robot: str, name: str) -> object:
        """A sensor's newest value; None until it is known."""
        ...

    def newest(self, topic: str) -> object:
        """The newest message of a topic; None until there is one."""
        ...

    def publish(self, topic: str, payload: object) -> None:
        """Send a message."""
        ...

    def on_sensor(self, robot: str, name: str, told: Callable[[object], None]) -> None:
        """Call `told` with each value of a sensor."""
        ...

    def on_event(self, robot: str, name: str, told: Callable[[object], None]) -> None:
        """Call `told` with the data of each such event."""
        ...

    def on_message(self, topic: str, told: Callable[[object], None]) -> None:
        """Call `told` with each message of a topic."""
        ...
