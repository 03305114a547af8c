"""Back end over a message broker: the example that docs/write-a-backend.md explains.

All nodes connect to one broker. Each publisher has a subject below the prefix of its topic. Each node
publishes its part of the graph as retained messages, which the broker removes when the node disconnects.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from broker import BrokerConnection

from nep.backends.base import Backend, PublisherSpec, SubscriberSpec
from nep.backends.bases.inbox import Inboxes
from nep.backends.bases.message_parser import MessageParser
from nep.backends.bases.open_services import OpenServices
from nep.backends.bases.parsing_subscriber import ParsingSubscriber
from nep.backends.bases.pending_calls import OutcomeCallback, PendingCall, PendingCalls
from nep.backends.bases.publisher import BasePublisher
from nep.backends.bases.server import BaseServer
from nep.backends.connection import Configuration, Hybrid
from nep.backends.services import ClientSpec, OpenCall, ServerSpec
from nep.errors import ClosedError, MasterUnreachable, NepError, WireError
from nep.masters.graph import Graph
from nep.messages.encoded import Encoded
from nep.protocol import service_wire, wire
from nep.protocol.encoding import decode_request, encode_request
from nep.protocol.graph_view import GraphView
from nep.protocol.requests import Join, Leave, NodeRecord, PublisherRecord, Renew, Request, SubscriberRecord
from nep.protocol.service_wire import NATIVE, SERVICE_TYPE, Reply, topic_of

RENEW_S = 0.5  # interval at which a node publishes its statistics
_EPOCH = 1
_Remote = tuple[str, int]  # id of a node, and of its publisher or server


class NodeLink:
    """Connection of one node to the broker, and the graph of all nodes.

    Args:
        address: Address of the broker.
        wait_s: Seconds to wait for the broker; None waits forever.
        transport: Connection that describes the node and handles changes of other nodes.
    """

    def __init__(self, address: str, wait_s: float | None, transport: BrokerTransport) -> None:
        self._prefix = f"graph\n{transport.node.id}\n"
        self._transport = transport
        self._graph = Graph(_EPOCH, now=0.0, learn_s=0.0)
        self._lock = threading.Lock()
        try:
            self.broker = BrokerConnection(address, wait_s, RENEW_S, self.publish_counts)
        except OSError as error:
            raise MasterUnreachable(address, wait_s or 0.0) from error
        self.broker.subscribe("graph\n", self._handle_record)

    def publish_records(self) -> None:
        """Publish the node's records, and wait until the broker and this node know them."""
        join, _counts = self._transport.describe()
        self.broker.publish(f"{self._prefix}records", encode_request(join, 0), is_retained=True)
        self.broker.sync()

    def publish_counts(self) -> None:
        """Publish the node's statistics."""
        _records, renew = self._transport.describe()
        self.broker.publish(f"{self._prefix}counts", encode_request(renew, 0), is_retained=True)

    def _handle_record(self, subject: str, data: bytes) -> None:
        _graph, node_id, kind = subject.split("\n")
        request: Request | WireError = decode_request(data).request if data else Leave(node_id)
        if not isinstance(request, WireError):
            with self._lock:
                self._graph.apply(request, 0, time.monotonic(), "")
        if kind == "records":
            for client in self._transport.services.clients:
                client.handle_node_changed(node_id, has_left=not data)

    def view(self) -> GraphView:
        """Return the current graph."""
        self.publish_counts()
        self.broker.sync()
        with self._lock:
            return self._graph.view()

    def publishers_of(self, topic: str) -> list[_Remote]:
        """Return node id and id of a topic's publishers, or of a service's servers, the oldest first."""
        with self._lock:
            members = self._graph.members.values()
            found = [(node.node.id, each.record) for node in members for each in node.publishers.values()]
        return [(node_id, record.id) for node_id, record in found if record.topic == topic]

    def close(self, timeout_s: float) -> None:
        """Leave the graph and disconnect."""
        self.broker.publish(f"{self._prefix}records", b"", is_retained=True)
        self.broker.close(timeout_s)


class BrokerPublisher(BasePublisher):
    """Publisher with a subject of its own."""

    is_listed = True
    has_subscribers = True  # a broker doesn't tell its publishers, so each message is sent

    def __init__(self, spec: PublisherSpec, transport: BrokerTransport) -> None:
        super().__init__(spec, threading.Lock())
        codec, is_latched = spec.codec.name, spec.is_latched
        self.record = PublisherRecord(spec.id, spec.topic, spec.msg_type, codec, ("broker",), is_latched)
        self._transport = transport
        self._broker = transport.link.broker
        self._subject = f"topic\n{spec.topic}\n{spec.id}"

    @property
    def subscribers(self) -> int:
        """Number of registered subscribers."""
        topic = self._transport.link.view().topics.get(self.spec.topic)
        return 0 if topic is None else len(topic.subscribers)

    def send(self, encoded: Encoded) -> None:
        """Publish a message: header, payload and extension in one frame."""
        extension = wire.extension_part(encoded.extension) if encoded.extension else b""
        data = bytes(encoded.data)
        with self._stats_lock:  # messages are sent in the order of their numbers
            header = self._next_header_locked(len(data), has_extension=bool(extension))
            frame = b"".join((header.pack(), data, extension))
            self._broker.publish(self._subject, frame, is_retained=self.spec.is_latched)
            if self.spec.is_latched:
                self._broker.sync()  # later subscribers receive this message, and no older one

    def close(self, timeout_s: float) -> None:  # noqa: ARG002 - the link sends what is queued
        """Unregister the publisher and remove its latched message."""
        if self.spec.is_latched:
            self._broker.publish(self._subject, b"", is_retained=True)
        self._transport.discard(self)


class BrokerSubscriber(ParsingSubscriber):
    """Subscriber to the prefix of a topic."""

    def __init__(self, spec: SubscriberSpec, transport: BrokerTransport) -> None:
        super().__init__(spec, transport.inboxes)
        self.record = SubscriberRecord(spec.id, spec.topic, spec.msg_type)
        self._transport = transport
        self._topic = wire.topic_part(spec.topic)
        own_part = wire.hello_part(spec.id, spec.topic)
        self._parser = MessageParser(spec, own_part, self._sources, lambda _id: None, lambda _id, _seq: None)
        self._number = transport.link.broker.subscribe(f"topic\n{spec.topic}\n", self._handle_frame)

    def _handle_frame(self, _subject: str, frame: bytes) -> None:
        if not frame:
            return  # a latched message was removed
        with self._changed:
            try:
                message = self._parser.parse(self._topic, wire.split_frame(frame))
                if not self.is_closed:
                    self._enqueue_locked(message)
            except WireError as error:
                self._count_malformed(error)

    def close(self) -> None:
        """Unregister the subscriber and discard its unread messages."""
        if self._close_inbox():
            self._transport.link.broker.unsubscribe(self._number)
            self._transport.discard(self)


class BrokerServer(BaseServer):
    """Server with a subject for its calls."""

    endpoints = ("broker",)
    is_listed = True

    def __init__(self, spec: ServerSpec, transport: BrokerTransport) -> None:
        super().__init__(spec)
        topic = topic_of(spec.service)
        self.record = PublisherRecord(spec.id, topic, SERVICE_TYPE, SERVICE_TYPE, self.endpoints)
        self._transport = transport
        self._broker = transport.link.broker
        self._number = self._broker.subscribe(f"call\n{spec.id}\n", self._handle_call)

    def _handle_call(self, subject: str, frame: bytes) -> None:
        client = subject.rpartition("\n")[2]
        call = self._read_call(NATIVE, service_wire.split_frame(frame), partial(self._reply, client))
        if call is not None:
            self._enqueue(call)

    def _reply(self, client: str, number: int, reply: Reply) -> bool:
        parts = NATIVE.encode_reply(number, self._count_reply(reply))
        self._broker.publish(f"reply\n{client}\n", b"".join(parts))
        return True

    def begin_close(self) -> None:
        """Leave the graph; reject queued and new calls."""
        if self.is_listed:
            self.is_listed = False
            self._transport.link.publish_records()
        super().begin_close()

    def close(self, timeout_s: float) -> None:  # noqa: ARG002 - the link sends what is queued
        """Close the server; calls that it hasn't answered fail with `ServerGoneError`."""
        self.begin_close()
        if not self.is_closed:
            self.is_closed = True
            self._broker.unsubscribe(self._number)
            self._broker.publish(f"gone\n{self.record.topic}\n{self.spec.id}", b"")
            self._transport.discard(self)


@dataclass(eq=False)
class _Call(PendingCall):
    node_id: str = ""
    server: int = 0  # 0 while the service has no server


class BrokerClient(PendingCalls[_Call]):
    """Client, and surveyor, with a subject for its replies."""

    def __init__(self, spec: ClientSpec, transport: BrokerTransport) -> None:
        super().__init__(spec, _Call, threading.RLock())
        self.record = SubscriberRecord(spec.id, topic_of(spec.service), SERVICE_TYPE)
        self._transport = transport
        self._link = transport.link
        self._subscriptions = (
            self._link.broker.subscribe(f"reply\n{spec.id}\n", self._handle_reply),
            self._link.broker.subscribe(f"gone\n{self.record.topic}\n", self._handle_server_closed),
        )

    def _servers(self) -> list[_Remote]:
        return self._link.publishers_of(self.record.topic)

    @property
    def respondents(self) -> int:
        """Number of servers of the service."""
        return len(self._servers())

    @property
    def is_connected(self) -> bool:
        """True if the service has a server."""
        return not self.is_closed and self.respondents > 0

    def start_call(
        self,
        data: bytes | memoryview,
        timeout_s: float | None,
        callback: OutcomeCallback,
        server: _Remote | None = None,
    ) -> OpenCall:
        """Send a call to a server, by default to the oldest as soon as there is one."""
        with self._lock:
            call = self._add_locked(bytes(data), timeout_s, callback)
            server = server or next(iter(self._servers()), None)
            if server is not None:
                self._send_locked(call, *server)
        self._transport.services.deadlines.add(call.deadline)
        return call

    def start_survey(
        self, data: bytes | memoryview, timeout_s: float | None, callback: OutcomeCallback
    ) -> Sequence[OpenCall]:
        """Send a call to each server."""
        return [self.start_call(data, timeout_s, callback, each) for each in self._servers()]

    def _send_locked(self, call: _Call, node_id: str, server: int) -> None:
        call.node_id, call.server, call.is_sent = node_id, server, True
        parts = NATIVE.encode_call(call.number, self.spec.codec.number, call.remaining_s, call.data)
        self._link.broker.publish(f"call\n{server}\n{self.spec.id}", b"".join(parts))

    def _handle_reply(self, _subject: str, frame: bytes) -> None:
        with contextlib.suppress(WireError):
            number, reply = NATIVE.read_reply(service_wire.split_frame(frame))
            call = self._calls.get(number or 0)
            if call is None or not self._finish(call, reply):
                self.late += 1

    def handle_node_changed(self, node_id: str, *, has_left: bool) -> None:
        """Send the waiting calls if there is a server; fail the calls of a node that has left."""
        with self._lock:
            for server in self._servers()[:1]:
                for call in [each for each in self._calls.values() if not each.server]:
                    self._send_locked(call, *server)
        if has_left:
            self._fail_orphaned(lambda call: call.node_id == node_id)

    def _handle_server_closed(self, subject: str, _data: bytes) -> None:
        self._fail_orphaned(lambda call: subject.endswith(f"\n{call.server}"))

    def service_names(self, timeout_s: float) -> tuple[str, ...]:  # noqa: ARG002 - immediate
        """Return the names of services that have a server."""
        return tuple(sorted(name for name, each in self._link.view().services.items() if each.servers))

    def close(self) -> None:
        """Unregister the client; calls in flight fail with `ClosedError`."""
        if (in_flight := self._begin_close()) is not None:
            for number in self._subscriptions:
                self._link.broker.unsubscribe(number)
            self._transport.services.deadlines.remove_client(self)
            self._transport.discard(self)
            self._fail_closed(in_flight)


class BrokerTransport:
    """Connection of one node to the other nodes."""

    link: NodeLink

    def __init__(self, node: NodeRecord) -> None:
        self.node = node
        self.inboxes = Inboxes(node.name)
        self.wait, self.wake = self.inboxes.wait, self.inboxes.wake
        self.services = OpenServices[BrokerServer, BrokerClient](node.name)
        self._lock = threading.RLock()
        self._members: tuple[BrokerPublisher | BrokerSubscriber, ...] = ()
        self._is_closed = False

    @contextlib.contextmanager
    def _joined(self, configuration: Configuration, wait_s: float | None) -> Iterator[None]:
        # Connects, holds the lock, which closing takes, too, and publishes the new records at the end.
        if not isinstance(configuration, Hybrid):
            raise NepError("the back end 'broker' has no direct connections; use 'zeromq'")
        with self._lock:
            if self._is_closed:
                raise ClosedError(f"node '{self.node.name}'")
            if not hasattr(self, "link"):
                self.link = NodeLink(configuration.master, wait_s, self)
            yield
            self.link.publish_records()

    def create_publisher(self, spec: PublisherSpec) -> BrokerPublisher:
        """Create and register a publisher."""
        with self._joined(spec.configuration, spec.wait_s):
            self._members = (*self._members, publisher := BrokerPublisher(spec, self))
        return publisher

    def create_subscriber(self, spec: SubscriberSpec) -> BrokerSubscriber:
        """Create and register a subscriber."""
        with self._joined(spec.configuration, spec.wait_s):
            self._members = (*self._members, subscriber := BrokerSubscriber(spec, self))
            if spec.sink is not None:
                self.inboxes.add_sink(subscriber)
        return subscriber

    def create_server(self, spec: ServerSpec) -> BrokerServer:
        """Create and register a server."""
        with self._joined(spec.configuration, spec.wait_s):
            self.services.add_server(server := BrokerServer(spec, self))
        return server

    def create_client(self, spec: ClientSpec) -> BrokerClient:
        """Create and register a client or surveyor."""
        with self._joined(spec.configuration, spec.wait_s):
            self.services.add_client(client := BrokerClient(spec, self))
            self.services.deadlines.add_client(client)
        return client

    create_surveyor = create_client

    def graph(self, configuration: Configuration, timeout_s: float) -> GraphView:
        """Return the current graph."""
        with self._joined(configuration, timeout_s):
            return self.link.view()

    def describe(self) -> tuple[Join, Renew]:
        """Return the node's records, and its statistics."""
        members = (*self._members, *self.services.servers, *self.services.clients)
        senders = [e for e in members if isinstance(e, BrokerPublisher | BrokerServer) and e.is_listed]
        receivers = [e for e in members if isinstance(e, BrokerSubscriber | BrokerClient)]
        join = Join(self.node, 0, tuple(e.record for e in senders), tuple(e.record for e in receivers))
        sent, received = tuple(e.counts() for e in senders), tuple(e.counts() for e in receivers)
        return join, Renew(self.node.id, _EPOCH, 0, sent, received)

    def discard(self, closed: BrokerPublisher | BrokerSubscriber | BrokerServer | BrokerClient) -> None:
        """Unregister something that was closed."""
        with self._lock:
            self._members = tuple(each for each in self._members if each is not closed)
            if isinstance(closed, BrokerServer | BrokerClient):
                self.services.discard(closed)
        self.link.publish_records()

    def begin_close(self) -> None:
        """Reject new members and calls."""
        with self._lock:
            self._is_closed = True
        self.services.begin_close()

    def close(self, timeout_s: float) -> None:
        """Close everything, and leave the graph."""
        self.begin_close()
        self.services.close(timeout_s)
        for member in self._members:
            member.close() if isinstance(member, BrokerSubscriber) else member.close(timeout_s)
        if hasattr(self, "link"):
            self.link.close(timeout_s)
        self.inboxes.close(timeout_s)


BACKEND = Backend("broker", BrokerTransport)
