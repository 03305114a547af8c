"""Filter that accepts messages about a robot only from the robot's own program."""

from __future__ import annotations

from collections.abc import Mapping

from app.core.network.mailbox import Batch
from app.core.robots.robot_link import RobotLink, topics_of
from app.robots.client.dialects import dialect_of
from app.robots.client.inbox import Senders
from app.robots.client.reply import Payload
from app.robots.description.description import Robot
from app.robots.identity import Identity, identity_of, publisher_nodes, subscriber_nodes
from nep.errors import NepError
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView


class OwnMessageFilter:
    """Filter that drops messages not sent by the robot's own program.

    Not thread-safe; use it from the main thread.
    """

    def __init__(self, senders: Senders, links: Mapping[str, RobotLink]) -> None:
        # `senders` map publishers to nodes; `links` are the robots by name.
        self._senders, self._links = senders, links
        self.view = GraphView(0, 0)
        """Newest graph."""
        self._suspended_programs: dict[str, dict[int, Identity]] = {}
        """Programs that left the graph but are still connected, by robot and subscriber id."""

    def update(self, view: GraphView) -> None:
        """Apply a new graph.

        Programs that left the graph are remembered while they are still connected, because they may
        only be suspended.
        """
        previous, self.view = self.view, view
        for link in self._links.values() if previous.nodes.keys() - view.nodes.keys() else ():
            topic, serving_nodes = (
                previous.topics.get(link.robot.topics.command),
                self._serving_nodes(link, previous),
            )
            for subscriber in (
                topic.subscribers if topic is not None and dialect_of(link.robot).is_identified else ()
            ):
                if subscriber.node_id in serving_nodes and subscriber.node_id not in view.nodes:
                    self._suspended_programs.setdefault(link.name, {})[subscriber.id] = identity_of(
                        previous, subscriber.node_id
                    )
        for name, programs in list(self._suspended_programs.items()):
            ended_ids = programs.keys() - self._connected_ids(self._links.get(name))
            for id in ended_ids | {
                id for id, subscriber in programs.items() if subscriber.node_id in view.nodes
            }:
                del programs[id]
            if not programs:
                del self._suspended_programs[name]

    @staticmethod
    def _connected_ids(link: RobotLink | None) -> frozenset[int]:
        return frozenset() if link is None or link.publisher is None else link.publisher.subscriber_ids

    @staticmethod
    def topics(robot: Robot) -> set[str]:
        """Return the robot's topics on which messages of other programs are ignored.

        This applies if the robot's own program publishes on the topic.
        """
        return {robot.topics.reply, *topics_of(robot)}

    def other_programs(self, name: str) -> list[Identity]:
        """Return other programs that receive the robot's commands and publish replies.

        Suspended programs are included while they are connected, because they process pending commands
        when they resume.
        """
        link = self._links.get(name)
        if link is None or not dialect_of(link.robot).is_identified:
            return []
        own_node = link.identity.node_id if link.identity is not None else ""
        programs = [
            identity_of(self.view, node) for node in self._serving_nodes(link, self.view) if node != own_node
        ]
        connected_ids = self._connected_ids(link)
        return programs + [
            each for id, each in self._suspended_programs.get(name, {}).items() if id in connected_ids
        ]

    def new_programs(self, link: RobotLink, previous: GraphView) -> list[Identity]:
        """Return the programs that serve the robot now but did not in the graph ``previous``.

        A program serves a robot if it receives the robot's commands and publishes replies.
        """
        if not dialect_of(link.robot).is_identified:
            return []
        earlier_nodes = self._serving_nodes(link, previous)
        return [
            identity_of(self.view, node)
            for node in self._serving_nodes(link, self.view)
            if node not in earlier_nodes
        ]

    @staticmethod
    def _serving_nodes(link: RobotLink, view: GraphView) -> list[str]:
        replying_nodes = publisher_nodes(view, link.robot.topics.reply)
        return [node for node in subscriber_nodes(view, link.robot.topics.command) if node in replying_nodes]

    def is_from_robot(self, link: RobotLink, node: str | None) -> bool | None:
        """Return True if a node is the robot's own program; None while it is unknown.

        As long as the program of a robot that announces itself is unknown, the result is True.

        Args:
            link: State of the robot.
            node: Id of the node that sent a message, or None.
        """
        dialect = dialect_of(link.robot)
        if link.identity is None and dialect.is_identified:
            return True
        own_node = link.identity.node_id if link.identity is not None else None
        return dialect.is_own(link.robot, own_node, node, self.view)

    def newest_payload(self, link: RobotLink, batch: Batch | None, topic: str) -> Payload | None:
        """Return the payload of the newest message; None if there is none or it isn't a valid mapping.

        If the robot's own program publishes the topic, messages of other programs are ignored.

        Args:
            link: State of the robot.
            batch: New messages of the topic, or None.
            topic: Name of the topic.
        """
        if batch is None or not batch.messages:
            return None
        own_node = link.identity.node_id if link.identity is not None else ""
        if own_node not in publisher_nodes(self.view, topic):
            return decode_mapping(batch.messages[-1])
        own_messages = (
            message for message in reversed(batch.messages) if self._senders.node_of(message) == own_node
        )
        newest = next(own_messages, None)
        return None if newest is None else decode_mapping(newest)


def decode_mapping(message: Message) -> Payload | None:
    """Return the payload of a message; None if it can't be decoded or is not a mapping."""
    try:
        value = message.payload
    except NepError:
        return None
    return value if isinstance(value, Mapping) else None
