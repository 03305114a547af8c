"""State of one robot as known to Studio, and the actions that the user invoked manually."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field

from app.core.network.watches import Watch
from app.core.robots.reported_count import ReportedCount
from app.robots.client.reply import Payload
from app.robots.client.task import RobotTask
from app.robots.description.description import Robot, RobotTopics
from app.robots.identity import Identity, is_may_move_error
from nep.i18n import _, lazy
from nep.nodes.publisher import Publisher

SENDER = "studio"
"""Sender id in manual commands."""
MAX_PAST_INVOCATIONS = 40
MAX_DISCONNECTED = 200
"""Maximum number of listed robots that are disconnected; all robots of a room may disconnect together."""
NOT_STOPPED = "not stopped"
CONNECTING = "connecting"
STOPPING = "stopping"
STATE_LABELS = {
    NOT_STOPPED: lazy("not stopped"),
    STOPPING: lazy("stopping"),
    "away": lazy("not running"),
    CONNECTING: lazy("connecting"),
    "silent": lazy("not responding"),
    "busy": lazy("busy"),
    "ready": lazy("ready"),
}
"""Display text for each value of `RobotLink.state`."""


@dataclass(eq=False)
class Invocation(RobotTask):
    """Manual invocation of an action.

    Attributes:
        timeout_s: Time limit in seconds, measured from the start of execution; None for no limit.
        sent_at_s: Time of sending in seconds since 1970.
    """

    clock: Callable[[], float] = time.monotonic
    input: Payload = field(default_factory=dict)
    timeout_s: float | None = None
    sent_at_s: float = 0.0

    @property
    def remaining_s(self) -> float | None:
        """Remaining seconds until the time limit; None without a limit or before execution has started."""
        if self.timeout_s is None or self.execution_start_s is None:
            return None
        return self.execution_start_s + self.timeout_s - self.clock()

    @property
    def elapsed_s(self) -> float:
        """Seconds since the command was sent; the total duration after the end."""
        return (self.ended_s if self.ended_s is not None else self.clock()) - self.started_s


@dataclass(slots=True, eq=False)
class RobotLink:
    """State of one robot as known to Studio. All times are in monotonic seconds.

    Attributes:
        values: Newest value of each sensor while the sensor is watched.
        past_invocations: Last manual invocations, newest last.
        is_unresponsive: True if the robot did not reply to a command.
        last_contact_s: Time of the last reply of the robot or of the last command to it, whichever is
            later.
        last_reply_s: Time of the last reply; None before the first reply.
        gone_s: Time of the disconnection; None while connected.
        last_stop: Result of the last Stop as a sentence, or None.
        stop_problem: Reason why the last Stop is not confirmed, such as "Arm may still move: the brake
            does not answer"; "" if it is confirmed.
        unended_actions: Message of the robot about actions that it could not end, or "".
        motion_warning: Reason why the robot may be moving although it doesn't reply (`MovedRobots`), or
            "".
        has_confirmed_stop: True if the robot's program has ever confirmed a Stop.
        pending_stop_start_s: Time of a Stop that the robot has not replied to, or None.
        is_stopping: True if such a Stop takes long enough to be shown.
        is_reachable: True if a Stop sent now would reach the robot.
        identity: Program of the robot; None for a robot of RIZE.
        earlier_topics: Topics of the robot's earlier descriptions.
        is_opening: True while the publishers are being opened.
        rejected_messages: Number of messages that the robot's driver rejected.
        driver_exceptions: Number of exceptions that the robot's driver caught.
        was_real: True if the robot's program has ever described the robot as real.
    """

    name: str
    robot: Robot
    is_connected: bool = True
    silence_reason: str | None = None
    values: dict[str, object] = field(default_factory=dict)
    drawing: Payload | None = None
    invocations: dict[str, Invocation] = field(default_factory=dict)
    past_invocations: deque[Invocation] = field(default_factory=lambda: deque(maxlen=MAX_PAST_INVOCATIONS))
    is_unresponsive: bool = False
    last_contact_s: float = 0.0
    last_reply_s: float | None = None
    gone_s: float | None = None
    last_stop: str | None = None
    last_stop_status: str = "error"
    stop_problem: str = ""
    unended_actions: str = ""
    motion_warning: str = ""
    has_confirmed_stop: bool = False
    pending_stop_start_s: float | None = None
    is_stopping: bool = False
    is_reachable: bool = True
    identity: Identity | None = None
    earlier_topics: tuple[RobotTopics, ...] = ()
    is_opening: bool = False
    rejected_messages: ReportedCount = field(default_factory=ReportedCount)
    driver_exceptions: ReportedCount = field(default_factory=ReportedCount)
    was_real: bool = False
    publisher: Publisher | None = None
    world_publisher: Publisher | None = None
    watch: Watch | None = None

    @property
    def is_virtual(self) -> bool:
        """True if the robot is simulated on this computer."""
        return self.robot.virtual

    @property
    def can_confirm_stop(self) -> bool:
        """True if the robot confirms that it has stopped. Robots of RIZE can't."""
        return self.robot.safe_stop.can_confirm

    @property
    def state(self) -> str:
        """State: "not stopped", "stopping", "away", "connecting", "silent", "busy" or "ready".

        "not stopped" means that the robot may still move: its last Stop is not confirmed, or it stopped
        replying after a command.
        """
        if self.stop_problem or self.motion_warning or (self.is_connected and self.unended_actions):
            return NOT_STOPPED
        if self.is_stopping:
            return STOPPING
        if not self.is_connected:
            return "away"
        if not self.is_reachable:
            return CONNECTING
        if self.silence_reason is not None or self.is_unresponsive:
            return "silent"
        return "busy" if self.running_invocations else "ready"

    @property
    def running_invocations(self) -> tuple[Invocation, ...]:
        """Invocations that have not ended."""
        invocations_by_id = {
            invocation.id: invocation for invocation in (*self.past_invocations, *self.invocations.values())
        }
        return tuple(invocation for invocation in invocations_by_id.values() if invocation.is_running)

    @property
    def state_label(self) -> str:
        """Display text of the state, such as "ready" or "may still move"."""
        state = self.state
        if self.is_connected and self.is_unresponsive and state == NOT_STOPPED and not self.stop_problem:
            return _("not responding")
        if state == NOT_STOPPED and (
            self.motion_warning
            or is_may_move_error(self.name, self.unended_actions)
            or is_may_move_error(self.name, self.stop_problem)
        ):
            return _("may still move")
        if self.is_connected and state == "silent":
            return (
                _("not responding") if self.is_unresponsive else self.silence_reason or _(STATE_LABELS[state])
            )
        return _(STATE_LABELS[state])

    @property
    def chip_text(self) -> str:
        """Text of the robot's chip, such as "virtual, ready"."""
        state = self.state_label
        return _("virtual, {state}").format(state=state) if self.is_virtual else state


def excess_disconnected(links: Iterable[RobotLink], in_use: Collection[str]) -> Sequence[RobotLink]:
    """Return the robots to remove from the list: disconnected robots beyond `MAX_DISCONNECTED`.

    The limit is needed because any program can invent new names. Robots that never replied are removed
    first, then the robots that have been disconnected for the longest time. Robots that are in use,
    that ever confirmed a Stop, or whose Stop is pending or failed are neither counted nor returned.

    Args:
        links: All robots in the list.
        in_use: Names of the robots that must not be removed.
    """
    disconnected = [
        link
        for link in links
        if not (link.is_connected or link.has_confirmed_stop or link.stop_problem or link.name in in_use)
        and link.pending_stop_start_s is None
    ]
    excess = max(0, len(disconnected) - MAX_DISCONNECTED)
    return sorted(disconnected, key=lambda link: (link.last_reply_s is not None, link.gone_s or 0.0))[:excess]


def topics_of(robot: Robot) -> list[str]:
    """Return the topics of a robot's sensors, events and state, except image topics."""
    topics = [sensor.topic for sensor in robot.sensors if sensor.topic and not sensor.is_image]
    topics += [event.topic for event in robot.events if event.topic]
    if robot.topics.state is not None:
        topics.append(robot.topics.state)
    return list(dict.fromkeys(topics))
