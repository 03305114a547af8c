"""Network interface of a running program, implemented by `app.blocks.runtime.network`."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

FINAL_STATES = ("succeeded", "failed", "canceled")
REPLY_STATES = ("accepted", "running", *FINAL_STATES)


@dataclass
class RobotCall:
    """Command to a robot and its replies. Written in the network's thread, read by a script.

    Attributes:
        id: Unique id of the command.
        robot: Name of the robot.
        action: Name of the action.
        output: Result of the action.
        error: Message if the action failed, else "".
    """

    id: str
    robot: str
    action: str
    state: str = "sent"  # then accepted, running, succeeded, failed, canceled
    output: Mapping[str, object] = field(default_factory=dict)
    feedback: Mapping[str, object] = field(default_factory=dict)  # newest feedback that is not empty
    error: str = ""
    has_started: bool = False  # the robot has started the action
    is_canceled_by_pause: bool = False
    waits_for: tuple[str, ...] = ()  # actions that the robot finishes first
    last_reply_s: float = field(default_factory=time.monotonic)  # monotonic time of the robot's last reply

    @property
    def done(self) -> bool:
        """True after the robot's final reply."""
        return self.state in FINAL_STATES


class ProgramLink(Protocol):
    """Interface of a program to its robots and topics. Callbacks are called in the network's thread."""

    def set_callbacks(self, on_change: Callable[[], None], on_external_stop: Callable[[str], None]) -> None:
        """Set the callbacks.

        Args:
            on_change: Called after each reply and message.
            on_external_stop: Called with the name of a robot when another program stops the robot.
        """
        ...

    def invoke(self, robot: str, action: str, input: Mapping[str, object]) -> RobotCall:
        """Send a command to a robot; the returned call is updated as replies arrive.

        Args:
            robot: Name of the robot.
            action: Name of the action.
            input: Input of the action.
        """
        ...

    def cancel(self, call: RobotCall) -> None:
        """Cancel a command."""
        ...

    def sensor(self, robot: str, name: str) -> object:
        """Return the newest value of a sensor; None if no value has been received yet."""
        ...

    def newest(self, topic: str) -> object:
        """Return the payload of the newest message of a topic; None if no message has been received yet."""
        ...

    def publish(self, topic: str, payload: object) -> None:
        """Publish a message on a topic."""
        ...

    def on_sensor(self, robot: str, name: str, callback: Callable[[object], None]) -> None:
        """Call `callback` with each value of a sensor."""
        ...

    def on_event(self, robot: str, name: str, callback: Callable[[object], None]) -> None:
        """Call ``callback`` with the data of each event with this name."""
        ...

    def on_message(self, topic: str, callback: Callable[[object], None]) -> None:
        """Call `callback` with the payload of each message of a topic."""
        ...
