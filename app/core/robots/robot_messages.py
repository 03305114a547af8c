"""Processing of messages that robots publish: replies, heartbeats and sensor values."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from app.core.network.mailbox import Batch
from app.core.robots.invocations import ManualInvocations
from app.core.robots.own_messages import OwnMessageFilter, decode_mapping
from app.core.robots.robot_link import FINAL_STATES, Payload, RobotLink
from app.core.robots.stop.moved_robots import MovedRobots
from app.robots import rize
from app.robots.identity import is_may_move_error, safe_error_text, stop_error_text
from app.robots.message_buffer import PendingMessages
from nep.i18n import _
from nep.messages.message import Message

MAX_HELD_MESSAGES = 64
"""Maximum number of replies stored for each publisher that the graph does not list yet."""


class RobotMessages:
    """Processor of the messages that robots' own programs publish.

    Not thread-safe; use it from the main thread. Replies of publishers that the graph does not list yet
    are stored until the next graph.
    """

    def __init__(
        self,
        own_filter: OwnMessageFilter,
        invocations: ManualInvocations,
        moved_robots: MovedRobots,
        clock: Callable[[], float],
    ) -> None:
        self._own_filter, self._invocations, self._moved_robots, self._clock = (
            own_filter,
            invocations,
            moved_robots,
            clock,
        )
        self._pending_messages: dict[str, PendingMessages] = {}
        self._settled_robots: dict[str, None] = {}

    def read(self, link: RobotLink, batches: Mapping[str, Batch]) -> None:
        """Apply the replies, the newest sensor values and the newest drawing of a robot.

        Args:
            link: State of the robot.
            batches: New messages, by topic.
        """
        replies = batches.get(link.robot.topics.reply)
        for message in replies.messages if replies is not None else ():
            is_own = self._own_filter.is_from_robot(link, message)
            if is_own:
                self._apply_reply(link, message)
            elif is_own is None:
                self._pending_messages.setdefault(
                    link.name, PendingMessages(per_publisher=MAX_HELD_MESSAGES)
                ).add(message)
        for sensor in link.robot.sensors:
            if sensor.is_image:
                continue
            value = self._own_filter.newest_payload(link, batches.get(sensor.topic), sensor.topic)
            if value is not None:
                link.values[sensor.name] = value.get("value", value)
        topic = link.robot.topics.state or ""
        link.drawing = self._own_filter.newest_payload(link, batches.get(topic), topic) or link.drawing

    def apply_held_replies(self, links: Mapping[str, RobotLink]) -> None:
        """Apply the stored replies whose publishers the new graph lists; discard all others."""
        pending, self._pending_messages = self._pending_messages, {}
        for name, messages in pending.items():
            link = links.get(name)
            for message in messages.pop_all() if link is not None else ():
                if link is not None and self._own_filter.is_from_robot(link, message):
                    self._apply_reply(link, message)

    def discard(self, name: str) -> None:
        """Discard the stored replies of a robot."""
        self._pending_messages.pop(name, None)

    def pop_settled_robots(self) -> tuple[str, ...]:
        """Return and clear the robots that have reported the end of all actions after an unconfirmed Stop."""
        settled_robots, self._settled_robots = tuple(self._settled_robots), {}
        return settled_robots

    def _apply_reply(self, link: RobotLink, message: Message) -> None:
        reply = decode_mapping(message)
        if reply is not None and link.robot.dialect == "rize":
            reply = rize.from_reply(reply)
        if reply is not None:
            self._invocations.apply_reply(link, reply)
            if reply.get("op") == "alive":
                self._apply_heartbeat(link, reply)
            else:
                self._apply_final_reply(link, reply)

    def _apply_final_reply(self, link: RobotLink, reply: Payload) -> None:
        # A final reply ends the motion, unless its error reports that the robot may still move.
        state = reply.get("state")
        if not isinstance(state, str) or state not in FINAL_STATES:
            return
        if reply.get("op") not in (None, "invoke"):
            return
        id, error = reply.get("id"), reply.get("error")
        if isinstance(id, str) and not is_may_move_error(link.name, safe_error_text(error) if error else ""):
            self._moved_robots.end_motion(link.name, id, link.identity)

    def _apply_heartbeat(self, link: RobotLink, reply: Payload) -> None:
        # Drivers omit counts that are zero.
        now_s = self._clock()
        link.rejected_messages.update(reply.get("rejected", 0), now_s)
        link.driver_exceptions.update(reply.get("errors", 0), now_s)
        if "not_ended" not in reply:
            return
        previous_text, link.unended_actions = link.unended_actions, ""
        if reply["not_ended"]:
            link.unended_actions = stop_error_text(
                link.name, reply.get("error") or _("an action is still running")
            )
        elif previous_text and link.stop_problem:
            self._settled_robots[link.name] = None
