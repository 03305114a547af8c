"""Transport of the back end `ros`: nep publishers, subscribers and services over rospy."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Sequence
from typing import Any

from msgspec.structs import replace

from nep.backends.base import HANDSHAKE_TIMEOUT_S, PublisherSpec, SubscriberSpec, SubscriberTransport
from nep.backends.bases.inbox import Inboxes
from nep.backends.bases.open_services import OpenServices
from nep.backends.bases.publisher import BasePublisher
from nep.backends.bases.rejections import RejectionCounter
from nep.backends.connection import Configuration, Hybrid
from nep.backends.ros.graph import LocalRosNode, graph_view
from nep.backends.ros.library import get_rospy
from nep.backends.ros.master import RosMaster, RosMasterUnreachable
from nep.backends.ros.process import RosProcess, RosShutdownError, get_process
from nep.backends.ros.queue_room import QueueLimit
from nep.backends.ros.service_client import RosClient
from nep.backends.ros.service_server import RosServer
from nep.backends.ros.subscriber import RospySubscriber
from nep.backends.ros.type_mapping import installed_definition, ros_type_of, to_ros_body
from nep.backends.services import CallQueue, ClientSpec, ServerSpec
from nep.errors import ClosedError, NepError
from nep.i18n import _
from nep.messages.encoded import Encoded
from nep.protocol.graph_view import GraphView
from nep.protocol.requests import NodeRecord, PublisherCount, SubscriberCount

_logger = logging.getLogger("nep")
_DEFAULT_QUEUE_LENGTH = 10_000
"""Queue length per connection in messages. A full queue silently drops its oldest message."""


def _master_address(configuration: Configuration) -> str:
    if not isinstance(configuration, Hybrid):
        raise NepError(_("the back end 'ros' doesn't support direct connections; use 'zeromq'"))
    return configuration.master


class RospyPublisher(BasePublisher):
    """Publisher over rospy.

    `count` counts the messages of this publisher. seq in a ROS header counts all messages that the process
    publishes on the topic.
    """

    def __init__(self, transport: RospyTransport, process: RosProcess, spec: PublisherSpec) -> None:
        super().__init__(spec, threading.RLock())
        self.process = process
        self._transport = transport
        self._definition = installed_definition(ros_type_of(spec.msg_type))
        self.topic = process.resolve_name(spec.topic)
        self._is_closed = False
        self._queue_limit = QueueLimit()
        self._drops = RejectionCounter()
        queue_length = spec.codec.queue_length or _DEFAULT_QUEUE_LENGTH
        self._publisher: Any = process.advertise(
            self.topic, self._definition, is_latched=spec.is_latched, queue_length=queue_length
        )
        process.add_publisher(self.topic, spec.id, self._publisher)

    @property
    def ros_type(self) -> str:
        """ROS message type of the published messages."""
        return self._definition.name

    @property
    def subscribers(self) -> int:
        """Number of subscribers: one per connected ROS node, and each subscriber of this process."""
        connected_nodes = () if self._is_closed else self.process.connected_nodes(self._publisher)
        own_count = 0
        if self.process.name in connected_nodes:
            own_count = max(1, self.process.subscriber_counts[self.topic])
        return sum(each != self.process.name for each in connected_nodes) + own_count

    @property
    def has_subscribers(self) -> bool:
        """True if any node is connected.

        Also True after rospy was shut down, so that the next message is passed to `send`, which raises the
        error.
        """
        impl = self._publisher.impl
        return (impl is not None and bool(impl.connections)) or self.process.is_shut_down

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of nodes whose subscribers are registered but not connected."""
        try:
            registered_names = self.process.master.names(self.topic, HANDSHAKE_TIMEOUT_S)[1]
        except RosMasterUnreachable:
            return ()
        connected_nodes = self.process.connected_nodes(self._publisher)
        return tuple(each.lstrip("/") for each in registered_names if each not in connected_nodes)

    def send(self, encoded: Encoded) -> None:
        """Add a message to the queue of each connection. Full queues drop their oldest messages.

        Raises `ClosedError`, and the same errors as `to_ros_body`.
        """
        body = to_ros_body(self._definition.name, self.spec.codec.ros_carrier, encoded)
        with self._stats_lock:
            if self._is_closed:
                raise ClosedError(f"publisher '{self.spec.topic}'")
            if self.process.is_shut_down:
                raise RosShutdownError
            self._count_locked(len(body))
            dropped = self.process.send(
                self._publisher, self._definition, self.topic, body, self._queue_limit
            )
            if dropped:
                self._report_drops(dropped)

    def _report_drops(self, dropped: int) -> None:
        reason = _("subscribers are too slow; their oldest messages are dropped")
        for _each in range(dropped):
            if self._drops.add(reason):
                _logger.warning("'%s' has dropped %d message(s) so far: %s",
                    self.spec.topic, self._drops.count, reason)  # fmt: skip

    def counts(self) -> PublisherCount:
        """Return the statistics shown in the graph."""
        counts = super().counts()
        return replace(counts, problem=counts.problem or self._drops.recent_message())

    def close(self, timeout_s: float) -> None:
        """Wait up to `timeout_s` seconds until rospy has sent its queues, then unregister."""
        deadline = time.monotonic() + timeout_s
        with self._stats_lock:
            if self._is_closed:
                return
            self._is_closed = True
        self._transport.discard(self)
        self.process.remove_publisher(self.topic, self.spec.id)
        unsent_count = self.process.wait_until_sent(self._publisher, deadline)
        if unsent_count:
            _logger.warning(
                "'%s' was closed before %d subscriber(s) received everything", self.spec.topic, unsent_count
            )
        self.process.unadvertise(self.topic, self._publisher, deadline - time.monotonic())


class RospyTransport:
    """Connection of one node to a ROS network. Raises `BackendUnavailableError` if rospy is not installed."""

    def __init__(self, node: NodeRecord) -> None:
        get_rospy()
        self.node = node
        self._inboxes = Inboxes(node.name)
        self.wake = self._inboxes.wake
        self._publishers: tuple[RospyPublisher, ...] = ()
        self._subscribers: tuple[RospySubscriber, ...] = ()
        self._services: OpenServices[RosServer, RosClient] = OpenServices(node.name)
        self._lock = threading.RLock()
        self._is_closed = False
        _transports.add(self)

    def create_publisher(self, spec: PublisherSpec) -> RospyPublisher:
        """Create a publisher; wait up to `HANDSHAKE_TIMEOUT_S` for registered subscribers to connect."""
        process = get_process(_master_address(spec.configuration), self.node.name, spec.wait_s)
        publisher = RospyPublisher(self, process, spec)
        with self._lock:
            self._publishers = (*self._publishers, publisher)
        try:
            self._check_open()
            process.wait_for_subscribers(publisher._publisher, publisher.topic, HANDSHAKE_TIMEOUT_S)  # noqa: SLF001
        except BaseException:
            publisher.close(0.0)
            raise
        return publisher

    def create_subscriber(self, spec: SubscriberSpec) -> RospySubscriber:
        """Create a subscriber; wait up to `HANDSHAKE_TIMEOUT_S` for registered publishers to connect."""
        process = get_process(_master_address(spec.configuration), self.node.name, spec.wait_s)
        subscriber = RospySubscriber(process, spec, self._inboxes, self.discard)
        with self._lock:
            self._subscribers = (*self._subscribers, subscriber)
        try:
            subscriber.subscribe()
            self._check_open()
            process.wait_for_publishers(subscriber.topic, HANDSHAKE_TIMEOUT_S)
            if spec.sink is not None:
                self._inboxes.add_sink(subscriber)
        except BaseException:
            subscriber.close()
            raise
        return subscriber

    def _check_open(self) -> None:
        if self._is_closed:
            raise ClosedError(f"node '{self.node.name}'")

    def discard(self, closed: RospyPublisher | RospySubscriber) -> None:
        """Remove a closed publisher or subscriber."""
        with self._lock:
            self._publishers = tuple(each for each in self._publishers if each is not closed)
            self._subscribers = tuple(each for each in self._subscribers if each is not closed)

    # ---- services

    def create_server(self, spec: ServerSpec) -> RosServer:
        """Create a server.

        Raises the same errors as `create_publisher`, and `NepError` for a type that isn't installed.
        """
        process = get_process(_master_address(spec.configuration), self.node.name, spec.wait_s)
        server = RosServer(process, spec, self._services.discard)
        try:
            self._services.add_server(server)
        except ClosedError:
            server.close(0.0)
            raise
        return server

    def create_client(self, spec: ClientSpec) -> RosClient:
        """Create a client."""
        process = get_process(_master_address(spec.configuration), self.node.name, spec.wait_s)
        client = RosClient(process, spec, self._services.discard)
        try:
            self._services.add_client(client)
        except ClosedError:
            client.close(0.0)
            raise
        return client

    def wait(
        self,
        subscribers: Sequence[SubscriberTransport],
        timeout_s: float,
        calls: Sequence[CallQueue] = (),
    ) -> None:
        """Wait up to `timeout_s` seconds for a message in `subscribers`, a call in `calls`, or `wake`.

        Raises `RosShutdownError` if the node has servers and rospy was shut down.
        """
        self._inboxes.wait(subscribers, timeout_s, calls)
        if any(each.process.is_shut_down for each in self._services.servers):
            raise RosShutdownError

    def graph(self, configuration: Configuration, timeout_s: float) -> GraphView:
        """Return the graph of the ROS network.

        Raises:
            MasterUnreachable: The ROS master didn't reply in time.
            NepError: `configuration` is a direct connection.
        """
        address = _master_address(configuration)
        state = RosMaster(address).system_state(timeout_s)
        # of the same class
        local_nodes = [each.local_node(address) for each in list(_transports) if not each._is_closed]  # noqa: SLF001
        return graph_view(state, local_nodes)

    def local_node(self, address: str) -> LocalRosNode:
        """Return this node's publishers, subscribers and services at the ROS master at `address`."""
        publishers: list[RospyPublisher] = [
            each for each in self._publishers if each.process.master.address == address
        ]
        subscribers: list[RospySubscriber] = [
            each for each in self._subscribers if each.process.master.address == address
        ]
        servers = [each for each in self._services.servers if each.process.master.address == address]
        clients = [each for each in self._services.clients if each.process.master.address == address]
        names = [each.process.name for part in (publishers, subscribers, servers, clients) for each in part]
        return LocalRosNode(
            self.node,
            names[0] if names else "",
            tuple((each.topic, each.ros_type, each.spec.is_latched, each.counts()) for each in publishers),
            tuple(
                (
                    each.topic,
                    ros_type_of(each.spec.msg_type),
                    SubscriberCount(each.spec.id, each.received, each.lost, each.problem),
                )
                for each in subscribers
            ),
            tuple((each.service, each.counts()) for each in servers),
            tuple((each.service, each.counts()) for each in clients),
        )

    def begin_close(self) -> None:
        """Reject queued calls. `close` flushes the messages."""
        self._services.begin_close()

    def close(self, timeout_s: float) -> None:
        """Unregister everything and join the threads. The process's ROS node stays running."""
        deadline = time.monotonic() + timeout_s
        with self._lock:
            self._is_closed = True
        self._services.close(max(0.0, deadline - time.monotonic()))
        for subscriber in self._subscribers:
            subscriber.close(deadline - time.monotonic())
        for publisher in self._publishers:
            publisher.close(max(0.0, deadline - time.monotonic()))
        _transports.discard(self)
        self._inboxes.close(timeout_s)


_transports: set[RospyTransport] = set()
