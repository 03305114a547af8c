"""Tasks: executions of an action, as the robot's replies report them."""

from __future__ import annotations

from dataclasses import dataclass, field

from app.robots.client.limits import max_silence_s
from app.robots.client.reply import FINAL_STATES, Payload, RobotReply
from app.robots.description.model import Robot


@dataclass(eq=False)
class RobotTask:
    """Execution of an action by a robot. Changed only by `apply` and `end`.

    Attributes:
        id: Unique id of the command.
        robot: Name of the robot.
        action: Name of the action.
        state: State in the robot's last reply; "sent" before the first reply.
        output: Result of the action.
        feedback: Newest feedback that is not empty.
        error: Error message if the action failed or was cancelled, else "".
        waits_for: Actions that must end before this one starts, while the state is "accepted".
        replaces: Actions that were cancelled by this one.
        has_started: True once the robot executes the action.
        started_s: Time at which the command was sent (monotonic seconds).
        execution_start_s: Time at which the execution started; None before it.
        ended_s: Time of the end; None before it.
    """

    id: str
    robot: str
    action: str
    state: str = "sent"
    output: Payload = field(default_factory=dict)
    feedback: Payload = field(default_factory=dict)
    error: str = ""
    waits_for: tuple[str, ...] = ()
    replaces: tuple[str, ...] = ()
    has_started: bool = False
    started_s: float = 0.0
    execution_start_s: float | None = None
    ended_s: float | None = None

    @property
    def is_running(self) -> bool:
        """True until the task has a final state: the robot reports the end, or the client gives up."""
        return self.state not in FINAL_STATES

    def apply(self, reply: RobotReply, now: float) -> bool:
        """Apply a reply of the robot's own program; return True if it ends the task.

        Replies to other commands, to a cancel of this command, and replies after the end are ignored.

        Args:
            reply: Reply.
            now: Time in monotonic seconds.
        """
        if reply.id != self.id or reply.op != "invoke" or not reply.state or not self.is_running:
            return False
        # Most replies have feedback only, and a robot may flood its client with them.
        self.feedback = reply.feedback or self.feedback
        if "output" in reply.fields:
            self.output = reply.output or self.output
        if "waits_for" in reply.fields:
            self.waits_for = reply.waits_for or self.waits_for
        if "replaces" in reply.fields:
            self.replaces = reply.replaces or self.replaces
        if reply.state in FINAL_STATES:
            self.end(reply.state, reply.error, now)
            return True
        if reply.state == "running" and not self.has_started:
            self.has_started, self.execution_start_s = True, now
        self.state = reply.state
        return False

    def end(self, state: str, error: str, now: float) -> None:
        """End the task.

        Args:
            state: Final state.
            error: Error message, or "".
            now: Time in monotonic seconds.
        """
        self.ended_s, self.error = now, error
        self.state = state  # last: another thread may wait for it


def is_silent(robot: Robot, last_contact_s: float, now: float) -> bool:
    """Return True if a robot with a running task has missed its heartbeats for too long.

    Args:
        robot: Description of the robot.
        last_contact_s: Time of its last reply or of the last command to it (monotonic seconds).
        now: Current time.
    """
    silence_s = max_silence_s(robot)
    return silence_s is not None and now - last_contact_s > silence_s
