"""Simulated network: nodes, topics, a master's graph, and links that delay, drop and connect late."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from nep.messages.codecs import codec_for
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView, NodeInfo, PublisherInfo, SubscriberInfo, TopicInfo

Sink = Callable[[Sequence[Message]], None]
LEASE_S = 1.5
"""Time in seconds after its last renewal at which the master removes a node."""


class Sent(NamedTuple):
    """Published message, and the IDs of the nodes that will receive it."""

    publisher: SimulatedPublisher
    message: Message
    reached: tuple[str, ...]


class Delivery(NamedTuple):
    """Message in flight to one subscriber."""

    publisher: SimulatedPublisher
    subscriber: SimulatedSubscriber
    message: Message


class SimulatedNetwork:
    """Simulated network that delivers messages in publishing order when a test calls `deliver`."""

    def __init__(self, now: Callable[[], float]) -> None:
        self.now = now
        self.nodes: dict[str, SimulatedNode] = {}
        self.queue: deque[Delivery] = deque()
        self.sent: list[Sent] = []
        self.delivered: list[Delivery] = []
        self._ids = itertools.count(1)
        self._wiring: object = None
        self.revision = 0

    def node(self, name: str, *, host: str = "lab", pid: int | None = None) -> SimulatedNode:
        made = SimulatedNode(self, f"{next(self._ids):016x}", name, host, pid or next(self._ids) + 10_000)
        self.nodes[made.id] = made
        self.revision += 1
        return made

    def next_id(self) -> int:
        return next(self._ids)

    def view(self) -> GraphView:
        """Return the master's graph: nodes with a valid lease, including dead and frozen ones."""
        for node in list(self.nodes.values()):
            if not node.is_running and self.now() - node.halted_s >= LEASE_S and not node.is_unlisted:
                node.unlist()
        there = [node for node in self.nodes.values() if not node.is_unlisted]
        infos = {
            node.id: NodeInfo(node.id, node.name, node.host, node.pid, "python", "native", 0)
            for node in there
        }
        topics: dict[str, TopicInfo] = {}
        publishers = [each for node in there for each in node.publishers]
        subscribers = [each for node in there for each in node.subscribers]
        for name in dict.fromkeys(each.topic for each in (*publishers, *subscribers)):
            of_topic = sorted((each for each in publishers if each.topic == name), key=lambda each: each.id)
            hearing = [each for each in subscribers if each.topic == name]
            msg_type = of_topic[0].msg_type if of_topic else hearing[0].msg_type
            topics[name] = TopicInfo(
                name,
                msg_type,
                "json",
                tuple(
                    PublisherInfo(each.id, each.node.id, (), each.latched, each.count, 0, 0, None, None, None)
                    for each in of_topic
                ),
                tuple(SubscriberInfo(each.id, each.node.id, 0, 0) for each in hearing),
            )
        return GraphView(1, self.revision, infos, topics)

    def connect(self) -> None:
        """Connect every subscriber of a running node to every publisher that the master announced to it."""
        wiring = (
            self.revision,
            [
                (node.is_running, node.is_isolated, node.is_connecting, node.is_subscribing)
                for node in self.nodes.values()
            ],
        )
        if wiring == self._wiring:
            return
        self._wiring = wiring
        for subscriber in [each for node in self.nodes.values() for each in node.subscribers]:
            for publisher in [each for node in self.nodes.values() for each in node.publishers]:
                self.join(publisher, subscriber)

    def join(self, publisher: SimulatedPublisher, subscriber: SimulatedSubscriber) -> None:
        if publisher.topic != subscriber.topic or subscriber in publisher.connected:
            return
        if not (publisher.node.is_running and subscriber.node.is_running):
            return
        if any(each.is_isolated or each.is_connecting for each in (publisher.node, subscriber.node)):
            return
        if subscriber.node.is_subscribing:
            return
        publisher.connected.append(subscriber)
        if publisher.latched and publisher.kept is not None:
            self.queue.append(Delivery(publisher, subscriber, publisher.kept))

    def deliver(self) -> bool:
        """Deliver queued messages and return whether there were any.

        Messages to frozen nodes, and to or from held ones, stay in the queue.
        """
        held: list[Delivery] = []
        was_busy = False
        for _turn in range(len(self.queue)):
            delivery = self.queue.popleft()
            publisher, subscriber, message = delivery
            if subscriber.node.is_dead or subscriber.is_closed:
                continue
            if not subscriber.node.is_running or subscriber.node.is_held or publisher.node.is_held:
                held.append(delivery)
                continue
            was_busy = True
            self.delivered.append(delivery)
            subscriber.sink([message])
        self.queue.extendleft(reversed(held))
        return was_busy


class SimulatedNode:
    """Fake of the parts of `nep.Node` that robots, Studio's fleet and its stopper use."""

    def __init__(self, network: SimulatedNetwork, id: str, name: str, host: str, pid: int) -> None:
        self.network, self.id, self.name, self.host, self.pid = network, id, name, host, pid
        self.publishers: list[SimulatedPublisher] = []
        self.subscribers: list[SimulatedSubscriber] = []
        self.is_frozen = self.is_dead = self.is_unlisted = False
        self.is_connecting = False
        """Its connections are not up yet; what is published meanwhile does not arrive."""
        self.is_subscribing = False
        """Its publishers are connected, its subscribers are not yet."""
        self.is_held = False
        """Messages to and from it wait."""
        self.is_isolated = False
        """Messages to and from it are lost."""
        self.halted_s = 0.0

    @property
    def is_running(self) -> bool:
        return not (self.is_frozen or self.is_dead)

    def new_pub(
        self, topic: str, msg_type: str = "json", *, latched: bool = False, **_options: Any
    ) -> SimulatedPublisher:
        made = SimulatedPublisher(self, topic, msg_type, latched)
        self.publishers.append(made)
        self.network.revision += 1
        return made

    def new_sub(
        self, topic: str, msg_type: str = "json", *, sink: Sink, **_options: Any
    ) -> SimulatedSubscriber:
        made = SimulatedSubscriber(self, topic, msg_type, sink)
        self.subscribers.append(made)
        self.network.revision += 1
        return made

    def graph(self, timeout_s: float = 2.0) -> GraphView:
        return self.network.view()

    def halt(self, *, is_dead: bool) -> None:
        """Freeze (SIGSTOP) or kill (SIGKILL) the node's process."""
        self.is_frozen, self.is_dead = not is_dead, is_dead
        self.halted_s = self.network.now()
        if is_dead:
            self.disconnect()

    def disconnect(self) -> None:
        """Close the connections of its subscribers, as the operating system does for an ended process."""
        for node in self.network.nodes.values():
            for publisher in node.publishers:
                publisher.connected = [each for each in publisher.connected if each.node is not self]

    def unlist(self) -> None:
        """Expire the node's lease at the master; its connections stay open."""
        self.is_unlisted = True
        self.network.revision += 1

    def register(self) -> None:
        """Register at the master again after its lease has ended."""
        self.is_unlisted = False
        self.network.revision += 1

    def close(self) -> None:
        """Leave the network in order: the master removes the node immediately."""
        self.is_dead = True
        self.disconnect()
        self.unlist()


class SimulatedPublisher:
    def __init__(self, node: SimulatedNode, topic: str, msg_type: str, latched: bool) -> None:
        self.node, self.topic, self.msg_type, self.latched = node, topic, msg_type, latched
        self.id = node.network.next_id()
        self.connected: list[SimulatedSubscriber] = []
        self.kept: Message | None = None
        self._codec = codec_for(msg_type)
        self._seq = 0

    @property
    def count(self) -> int:
        return self._seq

    @property
    def subscribers(self) -> int:
        return len(self.connected)

    @property
    def subscriber_ids(self) -> frozenset[int]:
        return frozenset(each.id for each in self.connected)

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of the subscribed nodes that are not connected."""
        everybody = [each for node in self.node.network.nodes.values() for each in node.subscribers]
        waited_for = [each for each in everybody if each.topic == self.topic and each not in self.connected]
        return tuple(each.node.name for each in waited_for if not each.node.is_unlisted)

    def publish(self, payload: object) -> None:
        self.send(bytes(self._codec.encode(payload).data))

    def send(self, data: bytes, publisher: int | None = None) -> None:
        """Publish encoded bytes; `publisher` replaces the ID in the header by a forged one."""
        self._seq += 1
        message = Message(
            self.topic,
            data,
            self._codec.name,
            self.msg_type,
            seq=self._seq,
            publisher=self.id if publisher is None else publisher,
        )
        self.kept = message
        network = self.node.network
        is_lost = self.node.is_isolated or self.node.is_dead
        reached = [] if is_lost else [each for each in self.connected if not each.node.is_isolated]
        network.queue.extend(Delivery(self, subscriber, message) for subscriber in reached)
        network.sent.append(Sent(self, message, tuple(each.node.id for each in reached)))

    def close(self) -> None:
        if self in self.node.publishers:
            self.node.publishers.remove(self)
            self.node.network.revision += 1


class SimulatedSubscriber:
    def __init__(self, node: SimulatedNode, topic: str, msg_type: str, sink: Sink) -> None:
        self.node, self.topic, self.msg_type, self.sink = node, topic, msg_type, sink
        self.id = node.network.next_id()
        self.is_closed = False

    def close(self) -> None:
        self.is_closed = True
        if self in self.node.subscribers:
            self.node.subscribers.remove(self)
            self.node.network.revision += 1


class SimulatedSource:
    """Fake of `app.core.network.source.Source` on a simulated network; it runs jobs immediately."""

    def __init__(
        self,
        address: str,
        sinks: Sequence[Callable[[str, Sequence[Message]], None]],
        post: Callable[[object], None],
    ) -> None:
        self.address, self.sinks, self.post = address, tuple(sinks), post
        self.node: SimulatedNode | None = None
        self.watched: dict[str, SimulatedSubscriber] = {}

    def start(self) -> None:
        pass

    def watch(self, topic: str) -> None:
        def hand_over(messages: Sequence[Message]) -> None:
            for sink in self.sinks:
                sink(topic, messages)

        if self.node is not None and topic not in self.watched:
            self.watched[topic] = self.node.new_sub(topic, sink=hand_over)

    def unwatch(self, topic: str) -> None:
        known = self.watched.pop(topic, None)
        if known is not None:
            known.close()

    def submit(self, _what: str, job: Callable[[Any], None]) -> None:
        job(self.node)

    def lost_counts(self) -> Mapping[str, int]:
        return {}

    def close(self) -> None:
        pass
