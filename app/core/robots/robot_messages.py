"""Processing of messages that robots publish: replies, heartbeats and sensor values."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from app.core.network.mailbox import Batch
from app.core.robots.invocations import ManualInvocations
from app.core.robots.own_messages import OwnMessageFilter, decode_mapping
from app.core.robots.robot_link import RobotLink
from app.core.robots.stop.moved_robots import MovedRobots
from app.robots.client.dialects import ClientDialect, dialect_of
from app.robots.client.inbox import ReplyInbox, Senders
from app.robots.client.reply import RobotReply
from app.robots.identity import stop_error_text
from nep.i18n import _
from nep.messages.message import Message


class RobotMessages:
    """Processor of the messages that robots' own programs publish.

    Not thread-safe; use it from the main thread. Replies of publishers that the graph does not list yet
    are stored until the next graph.
    """

    def __init__(
        self,
        senders: Senders,
        own_filter: OwnMessageFilter,
        invocations: ManualInvocations,
        moved_robots: MovedRobots,
        clock: Callable[[], float],
    ) -> None:
        self._senders, self._own_filter, self._invocations, self._moved_robots, self._clock = (
            senders,
            own_filter,
            invocations,
            moved_robots,
            clock,
        )
        self._inbox = ReplyInbox(senders)
        self._settled_robots: dict[str, None] = {}

    def read(self, link: RobotLink, batches: Mapping[str, Batch]) -> None:
        """Apply the replies, the newest sensor values and the newest drawing of a robot.

        Args:
            link: State of the robot.
            batches: New messages, by topic.
        """
        replies, dialect = batches.get(link.robot.topics.reply), dialect_of(link.robot)
        for message in replies.messages if replies is not None else ():
            is_own = self._own_filter.is_from_robot(link, self._senders.node_of(message))
            if is_own:
                self._apply_reply(link, dialect, message)
            elif is_own is None:
                self._inbox.hold(message)
        for sensor in link.robot.sensors:
            if sensor.is_image:
                continue
            value = self._own_filter.newest_payload(link, batches.get(sensor.topic), sensor.topic)
            if value is not None:
                link.values[sensor.name] = value.get("value", value)
        topic = link.robot.topics.state or ""
        link.drawing = self._own_filter.newest_payload(link, batches.get(topic), topic) or link.drawing

    def apply_held_replies(self, links: Iterable[RobotLink]) -> None:
        """Apply the stored replies whose publishers the new graph lists; discard all others."""
        for node, message in self._inbox.pop_listed():
            for link in links:
                if link.robot.topics.reply == message.topic and self._own_filter.is_from_robot(link, node):
                    self._apply_reply(link, dialect_of(link.robot), message)

    def discard(self, link: RobotLink) -> None:
        """Discard the stored replies of a robot."""
        self._inbox.discard(link.robot.topics.reply)

    def pop_settled_robots(self) -> tuple[str, ...]:
        """Return and clear the robots that have reported the end of all actions after an unconfirmed Stop."""
        settled_robots, self._settled_robots = tuple(self._settled_robots), {}
        return settled_robots

    def _apply_reply(self, link: RobotLink, dialect: ClientDialect, message: Message) -> None:
        reply = dialect.read(decode_mapping(message))
        if reply is None:
            return
        self._invocations.apply_reply(link, reply)
        if reply.op == "alive":
            self._apply_heartbeat(link, reply)
        elif reply.ends_motion(link.name):
            self._moved_robots.end_motion(link.name, reply.id, link.identity)

    def _apply_heartbeat(self, link: RobotLink, reply: RobotReply) -> None:
        # Drivers omit counts that are zero.
        now_s, fields = self._clock(), reply.fields
        link.rejected_messages.update(fields.get("rejected", 0), now_s)
        link.driver_exceptions.update(fields.get("errors", 0), now_s)
        if "not_ended" not in fields:
            return
        previous_text, link.unended_actions = link.unended_actions, ""
        if fields["not_ended"]:
            link.unended_actions = stop_error_text(
                link.name, fields.get("error") or _("an action is still running")
            )
        elif previous_text and link.stop_problem:
            self._settled_robots[link.name] = None
