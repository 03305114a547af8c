"""Network interface of a running program, implemented by `app.blocks.runtime.network`."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

FINAL_STATES = ("succeeded", "failed", "canceled")
STATES = ("accepted", "running", *FINAL_STATES)


@dataclass
class RobotCall:
    """Command to a robot and its replies. Written by the network's thread, read by a script."""

    id: str
    robot: str
    action: str
    state: str = "sent"  # then accepted, running, succeeded, failed, canceled
    output: Mapping[str, object] = field(default_factory=dict)
    feedback: Mapping[str, object] = field(default_factory=dict)  # the newest non-empty one
    error: str = ""
    has_started: bool = False  # the robot has started it
    is_canceled_by_pause: bool = False  # canceled by a pause
    waits_for: tuple[str, ...] = ()  # actions that the robot finishes first
    last_reply_s: float = field(default_factory=time.monotonic)  # time of its robot's last answer

    @property
    def done(self) -> bool:
        """True after the robot's final reply."""
        return self.state in FINAL_STATES


class ProgramLink(Protocol):
    """Robots and topics as used by a program. Callbacks are called in the network's thread."""

    def set_callbacks(self, poke: Callable[[], None], stopped_outside: Callable[[str], None]) -> None:
        """Set the callbacks.

        ``poke`` is called for each reply and message, ``stopped_outside`` when another program stops a robot.
        """
        ...

    def invoke(self, robot: str, action: str, input: Mapping[str, object]) -> RobotCall:
        """Send a command."""
        ...

    def cancel(self, call: RobotCall) -> None:
        """Cancel a command."""
        ...

    def sensor(self, robot: str, name: str) -> object:
        """Return the newest value of a sensor; None until one is received."""
        ...

    def newest(self, topic: str) -> object:
        """Return the newest message of a topic; None until one is received."""
        ...

    def publish(self, topic: str, payload: object) -> None:
        """Publish a message."""
        ...

    def on_sensor(self, robot: str, name: str, callback: Callable[[object], None]) -> None:
        """Call `callback` with each value of a sensor."""
        ...

    def on_event(self, robot: str, name: str, callback: Callable[[object], None]) -> None:
        """Call ``callback`` with the data of each event with this name."""
        ...

    def on_message(self, topic: str, callback: Callable[[object], None]) -> None:
        """Call `callback` with each message of a topic."""
        ...
