"""Network interface of a running program, implemented by `app.blocks.runtime.network`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from app.blocks.runtime.scheduler import ScriptGroup
from app.robots.client.task import RobotTask


@dataclass(eq=False)
class RobotCall(RobotTask):
    """Command to a robot and its replies. Written in the network's thread, read by a script.

    Attributes:
        is_canceled_by_pause: True if a pause cancelled the command.
        last_reply_s: Time of the robot's last reply to this program on the program's clock; before the first
            reply, the time at which the command was sent.
    """

    is_canceled_by_pause: bool = False
    last_reply_s: float = field(init=False)

    def __post_init__(self) -> None:
        self.last_reply_s = self.started_s

    @property
    def done(self) -> bool:
        """True after the robot's final reply."""
        return not self.is_running


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

    def hold_motions(self, group: ScriptGroup) -> None:
        """Stop the motions of a group's scripts (such as a speed) until `resume_motions`."""
        ...

    def resume_motions(self, group: ScriptGroup) -> None:
        """Resume the motions that `hold_motions` stopped."""
        ...

    def end_motions(self, group: ScriptGroup) -> None:
        """Stop and discard the motions of a group's scripts."""
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
