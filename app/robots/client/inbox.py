"""Senders of messages: the node of each publisher, and replies whose publishers are not listed yet."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Iterable

from app.robots.client.limits import MAX_PENDING_PER_PUBLISHER, MAX_PENDING_PUBLISHERS
from app.robots.identity import publisher_nodes
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView

MAX_SENDERS = 20_000


class Senders:
    """Table of the nodes by publisher id, as reported by the master. Thread-safe.

    The table is limited to the newest 20 000 entries. A node that uses the publisher id of another node is
    ignored while the other node is in the graph.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._nodes: dict[int, str] = {}

    def update(self, view: GraphView, topics: Iterable[str]) -> None:
        """Add the publishers of topics.

        Args:
            view: Graph of the network.
            topics: Names of the topics.
        """
        with self._lock:
            for topic in topics:
                info = view.topics.get(topic)
                for publisher in info.publishers if info is not None else ():
                    if self._nodes.get(publisher.id) not in view.nodes:
                        self._nodes[publisher.id] = publisher.node_id
            while len(self._nodes) > MAX_SENDERS:
                del self._nodes[next(iter(self._nodes))]

    def node_of(self, message: Message) -> str | None:
        """Return the id of the node that sent a message; None if its publisher is unknown."""
        with self._lock:
            return None if message.publisher is None else self._nodes.get(message.publisher)

    def is_own(self, view: GraphView, message: Message, own_node: str | None) -> bool | None:
        """Return True if a sensor value or event counts as a robot's own; None while its sender is unknown.

        If the robot's own program publishes the topic, only its messages count. Otherwise every message
        counts, because a camera may be another program.

        Args:
            view: Newest graph.
            message: Message on a topic of the robot.
            own_node: Id of the node of the robot's own program, if it is known.
        """
        if own_node is None or own_node not in publisher_nodes(view, message.topic):
            return True
        node = self.node_of(message)
        return None if node is None else node == own_node


class ReplyInbox:
    """Replies of robots with the nodes that sent them. Not thread-safe.

    A robot creates its reply topic when it sends the first reply, so the reply may arrive before the graph
    lists its publisher. Such replies are held until `pop_listed`, and all later ones of the same publisher
    too, so that their order remains.

    Args:
        senders: Table of the publishers, which the owner updates.
    """

    def __init__(self, senders: Senders) -> None:
        self._senders = senders
        self._pending: dict[str, PendingMessages] = {}

    def __bool__(self) -> bool:
        return bool(self._pending)

    def sender_of(self, message: Message) -> str | None:
        """Return the id of the node that sent a message; hold the message and return None if unknown."""
        pending = self._pending.get(message.topic)
        node = self._senders.node_of(message)
        if node is not None and (pending is None or not pending.has_messages_of(message.publisher)):
            return node
        self.hold(message)
        return None

    def hold(self, message: Message) -> None:
        """Hold a message until `pop_listed`."""
        self._pending.setdefault(message.topic, PendingMessages()).add(message)

    def pop_listed(self) -> list[tuple[str, Message]]:
        """Remove all held messages, and return those whose publishers are listed now with their nodes.

        Messages of publishers that are still unknown are discarded: the publisher has not registered, or
        there is no master, and then nothing is proven.
        """
        held, self._pending = [each for pending in self._pending.values() for each in pending.pop_all()], {}
        nodes = ((self._senders.node_of(message), message) for message in held)
        return [(node, message) for node, message in nodes if node is not None]

    def discard(self, topic: str) -> None:
        """Discard the held messages of a topic."""
        self._pending.pop(topic, None)


class PendingMessages:
    """Bounded buffer of messages of unknown publishers.

    If a publisher sends too many messages, its own oldest message is evicted. If there are too many
    publishers, messages of new publishers are dropped.

    Args:
        per_publisher: Maximum number of messages of one publisher.
        publishers: Maximum number of publishers.
    """

    def __init__(
        self, *, per_publisher: int = MAX_PENDING_PER_PUBLISHER, publishers: int = MAX_PENDING_PUBLISHERS
    ) -> None:
        self._per_publisher, self._publishers = per_publisher, publishers
        self._messages: dict[int | None, deque[Message]] = {}

    def __bool__(self) -> bool:
        return bool(self._messages)

    def has_messages_of(self, publisher: int | None) -> bool:
        """Return True if messages of this publisher are stored."""
        return publisher in self._messages

    def add(self, message: Message) -> None:
        """Store a message; see the class for the limits."""
        messages = self._messages.get(message.publisher)
        if messages is None:
            if len(self._messages) >= self._publishers:
                return
            messages = self._messages[message.publisher] = deque(maxlen=self._per_publisher)
        messages.append(message)

    def pop_all(self) -> list[Message]:
        """Remove and return all messages; messages of one publisher are in order of arrival."""
        pending = [message for messages in self._messages.values() for message in messages]
        self._messages.clear()
        return pending
