"""Manual invocations of actions. Each invocation has exactly one result."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

from app.core.robots.robot_link import SENDER, Invocation, RobotLink
from app.robots.client.dialects import dialect_of, new_id
from app.robots.client.limits import ACTION_MARGIN_S, FIRST_REPLY_TIMEOUT_S
from app.robots.client.reply import Payload, RobotReply
from app.robots.client.task import is_silent
from app.robots.description.description import Action
from nep.i18n import _, number


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
            new_id("form"),
            link.name,
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
        command = dialect_of(link.robot).invoke(link.robot, invocation.id, SENDER, action.name, input)
        if not self._send(link, command):
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

    def apply_reply(self, link: RobotLink, reply: RobotReply) -> None:
        """Apply a reply of the robot. A reply to another program only shows that the robot is responding."""
        now = link.last_contact_s = link.last_reply_s = self._clock()
        link.is_unresponsive = False
        for invocation in link.running_invocations:
            if invocation.apply(reply, now) and not link.running_invocations:
                self._on_idle(link.name)

    def check_timeouts(self, links: Iterable[RobotLink]) -> None:
        """Cancel invocations that exceed their time limit or whose robot doesn't respond.

        Their final state is "failed".
        """
        now = self._clock()
        for link in links:
            for invocation in link.running_invocations:
                self._check_invocation(link, invocation, now)

    def _check_invocation(self, link: RobotLink, invocation: Invocation, now: float) -> None:
        if dialect_of(link.robot).is_identified and invocation.state == "sent":
            if now - invocation.started_s > FIRST_REPLY_TIMEOUT_S:
                self._mark_unresponsive(
                    link,
                    invocation,
                    _("{robot} isn't responding. Check that it is switched on.").format(robot=link.name),
                )
            return
        if is_silent(link.robot, link.last_contact_s, now):
            error = _(
                "{robot} stopped responding. Check that it is switched on, or press Stop to stop it."
            ).format(robot=link.name)
            self._mark_unresponsive(link, invocation, error)
            return
        remaining_s = invocation.remaining_s
        if remaining_s is not None and remaining_s < -ACTION_MARGIN_S:
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

    def end_all(self, link: RobotLink, state: str, error: str = "") -> None:
        """End all invocations of a robot.

        Args:
            link: State of the robot.
            state: Final state of the invocations.
            error: Error message of the invocations, or "".
        """
        for invocation in link.running_invocations:
            self._end(link, invocation, state, error)

    def _end(self, link: RobotLink, invocation: Invocation, state: str, error: str) -> None:
        invocation.end(state, error, self._clock())
        if not link.running_invocations:
            self._on_idle(link.name)

    def _send_cancel(self, link: RobotLink, invocation: Invocation) -> None:
        command = dialect_of(link.robot).cancel(invocation.id, SENDER, invocation.action)
        if command is not None:
            self._send(link, command)
