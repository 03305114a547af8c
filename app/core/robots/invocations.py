"""Manual invocations of actions. Each invocation has exactly one result."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Iterable, Mapping

from app.core.robots.robot_link import FINAL_STATES, SENDER, Invocation, Payload, RobotLink
from app.robots import rize
from app.robots.description.description import Action, Robot
from app.robots.identity import safe_error_text
from nep.i18n import _, number
from nep.text import bounded_str

FIRST_REPLY_TIMEOUT_S = 3.0
"""Time limit in seconds for the first reply to a command."""
GRACE_S = 0.5
"""Time in seconds that a robot has to report the end of an action after its time limit.

After that, Studio ends the invocation.
"""
MAX_MISSED_HEARTBEATS = 4
MIN_SILENCE_S = 2.0


class ManualInvocations:
    """Manual invocations of actions. Not thread-safe; use it from the main thread."""

    def __init__(
        self,
        send: Callable[[RobotLink, Payload], bool],
        on_idle: Callable[[str], None],
        clock: Callable[[], float],
        wall_clock: Callable[[], float] = time.time,
    ) -> None:
        # `send` sends a command to a robot; `on_idle` is called with its name once it is idle.
        self._send, self._on_idle, self._clock, self._wall_clock = send, on_idle, clock, wall_clock

    def start(self, link: RobotLink, action: Action, input: Payload) -> Invocation:
        """Send an invocation and return its state.

        The invocation fails immediately if the robot can't be reached.
        """
        invocation = Invocation(
            uuid.uuid4().hex,
            action.name,
            started_s=self._clock(),
            clock=self._clock,
            input=dict(input),
            timeout_s=action.timeout_s,
            sent_at_s=self._wall_clock(),
        )
        link.invocations[action.name] = invocation
        link.past_invocations.append(invocation)
        link.last_contact_s = self._clock()
        if not self._send(link, create_command(link.robot, invocation, input)):
            self._end(
                link,
                invocation,
                "failed",
                _("{robot} can't be reached; check that it is switched on").format(robot=link.name),
            )
        return invocation

    def cancel(self, link: RobotLink, action: str) -> None:
        """Cancel the invocation of an action if it is still running. Robots of RIZE don't support this."""
        invocation = link.invocations.get(action)
        if invocation is not None and invocation.is_running:
            self._send_cancel(link, invocation)

    def apply_reply(self, link: RobotLink, reply: Payload) -> None:
        """Apply a reply of the robot. A reply to another program only shows that the robot is responding."""
        link.last_contact_s = link.last_reply_s = self._clock()
        link.is_unresponsive = False
        for invocation in link.running_invocations:
            if invocation.id != reply.get("id") or reply.get("op") not in (None, "invoke"):
                continue
            self._apply(link, invocation, reply)

    def _apply(self, link: RobotLink, invocation: Invocation, reply: Payload) -> None:
        state = reply.get("state")
        if not isinstance(state, str) or (state not in FINAL_STATES and state not in ("accepted", "running")):
            return
        # Most replies have feedback only, and a robot may flood Studio with them.
        if "feedback" in reply:
            invocation.feedback = _object(reply["feedback"]) or invocation.feedback
        if "output" in reply:
            invocation.output = _object(reply["output"]) or invocation.output
        if "waits_for" in reply:
            invocation.awaited_actions = _names(reply["waits_for"]) or invocation.awaited_actions
        if "replaces" in reply:
            invocation.replaced_actions = _names(reply["replaces"]) or invocation.replaced_actions
        error = reply.get("error")
        if state in FINAL_STATES:
            self._end(link, invocation, state, safe_error_text(error) if error else None)
            return
        invocation.state = state
        if state == "running" and invocation.execution_start_s is None:
            invocation.execution_start_s = self._clock()

    def check_timeouts(self, links: Iterable[RobotLink]) -> None:
        """Cancel invocations that exceed their time limit or whose robot doesn't respond.

        Their final state is "failed".
        """
        now = self._clock()
        for link in links:
            for invocation in link.running_invocations:
                self._check_invocation(link, invocation, now)

    def _check_invocation(self, link: RobotLink, invocation: Invocation, now: float) -> None:
        robot = link.robot
        if robot.dialect == "native" and invocation.state == "sent":
            if now - invocation.started_s > FIRST_REPLY_TIMEOUT_S:
                self._mark_unresponsive(
                    link,
                    invocation,
                    _("{robot} isn't responding. Check that it is switched on.").format(robot=link.name),
                )
            return
        max_silence_s = (
            max(MIN_SILENCE_S, MAX_MISSED_HEARTBEATS * robot.heartbeat_interval_s)
            if robot.heartbeat_interval_s
            else None
        )
        if max_silence_s is not None and now - link.last_contact_s > max_silence_s:
            error = _(
                "{robot} stopped responding. Check that it is switched on, or press Stop to stop it."
            ).format(robot=link.name)
            self._mark_unresponsive(link, invocation, error)
            return
        remaining_s = invocation.remaining_s
        if remaining_s is not None and remaining_s < -GRACE_S:
            link.is_unresponsive = True  # until it replies
            self._send_cancel(link, invocation)
            self._end(
                link,
                invocation,
                "failed",
                _("{action} took longer than {seconds} s").format(
                    action=invocation.action, seconds=number(invocation.timeout_s or 0.0)
                ),
            )

    def _mark_unresponsive(self, link: RobotLink, invocation: Invocation, error: str) -> None:
        link.is_unresponsive = True
        self._send_cancel(link, invocation)  # a robot that resumes must not continue
        self._end(link, invocation, "failed", error)

    def end_all(self, link: RobotLink, state: str, error: str | None = None) -> None:
        """End all invocations of a robot.

        Args:
            link: State of the robot.
            state: Final state of the invocations.
            error: Error message of the invocations, or None.
        """
        for invocation in link.running_invocations:
            self._end(link, invocation, state, error)

    def _end(self, link: RobotLink, invocation: Invocation, state: str, error: str | None) -> None:
        invocation.state, invocation.error, invocation.ended_s = state, error, self._clock()
        if not link.running_invocations:
            self._on_idle(link.name)

    def _send_cancel(self, link: RobotLink, invocation: Invocation) -> None:
        if link.robot.dialect == "native":
            self._send(
                link, {"id": invocation.id, "op": "cancel", "from": SENDER, "action": invocation.action}
            )


def create_command(robot: Robot, invocation: Invocation, input: Payload) -> Payload:
    """Return the message that invokes an action of a robot.

    Args:
        robot: Robot that receives the command.
        invocation: Invocation of the action.
        input: Input of the action.
    """
    if robot.dialect == "rize":
        return rize.to_command(robot, invocation.action, input, invocation.id)
    return {
        "id": invocation.id,
        "op": "invoke",
        "from": SENDER,
        "action": invocation.action,
        "input": dict(input),
    }


def _names(value: object) -> tuple[str, ...]:
    return tuple(map(bounded_str, value)) if isinstance(value, (list, tuple)) else ()


def _object(value: object) -> Payload | None:
    return value if isinstance(value, Mapping) else None
