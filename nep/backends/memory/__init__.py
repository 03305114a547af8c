"""Back end `memory`: nodes of one process, without sockets. Reference implementation for other back ends.

Nodes with the same master name are connected; there is no master process. A message is appended directly to
the inboxes of the subscribers, a call to the queue of its server.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from nep.backends.base import Backend, PublisherSpec, SubscriberSpec
from nep.backends.bases.inbox import Inboxes, InboxSubscriber
from nep.backends.bases.publisher import BasePublisher
from nep.backends.connection import Configuration, Hybrid
from nep.backends.memory.services import MemoryClient, MemoryServer, MemoryServices, ServiceHub
from nep.backends.services import ClientSpec, ServerSpec
from nep.errors import ClosedError, NepError
from nep.i18n import _
from nep.messages.clocks import OWN_CLOCK
from nep.messages.encoded import Encoded
from nep.messages.history import History
from nep.messages.message import Message, message_kind, received_message
from nep.protocol import requests
from nep.protocol.graph_view import GraphView
from nep.protocol.requests import (
    NodeRecord,
    PublisherRecord,
    SubscriberCount,
    SubscriberRecord,
)
from nep.protocol.topic_pattern import matches
from nep.protocol.wire import extension_part
from nep.system import forks
from nep.system.cpu import CpuLoad


class _Hub(ServiceHub):
    # Nodes of one master name. Its lock guards all state of the back end except inboxes.
    def __init__(self) -> None:
        super().__init__()
        self.transports: dict[str, MemoryTransport] = {}
        self.publishers: dict[str, list[MemoryPublisher]] = {}
        self.subscribers: dict[str, tuple[MemorySubscriber, ...]] = {}
        self.patterns: tuple[MemorySubscriber, ...] = ()
        """Subscribers to patterns."""

    def subscribers_of(self, topic: str) -> tuple[MemorySubscriber, ...]:
        subscribers = self.subscribers.get(topic, ())
        if not self.patterns:
            return subscribers
        return (*subscribers, *(each for each in self.patterns if matches(each.spec.topic, topic)))

    def remove_node(self, node_id: str) -> None:
        with self.lock:
            if self.transports.pop(node_id, None) is not None:
                self.apply(requests.Leave(node_id))

    def view(self) -> GraphView:
        # Collects the current statistics of all nodes first.
        with self.lock:
            for transport in self.transports.values():
                self.apply(transport.renewal(self))
            return self.graph.view()


_hubs: dict[str, _Hub] = {}
_hubs_lock = threading.Lock()


def _forked() -> None:
    # In a forked child the locks may be held by threads that don't exist there.
    global _hubs_lock  # noqa: PLW0603 - one per process
    _hubs_lock = threading.Lock()
    _hubs.clear()


forks.call_in_child(_forked)


def _get_hub(configuration: Configuration) -> _Hub:
    if not isinstance(configuration, Hybrid):
        raise NepError(_("the back end 'memory' doesn't support direct connections; use 'zeromq'"))
    with _hubs_lock:
        return _hubs.setdefault(configuration.master, _Hub())


class MemoryPublisher(BasePublisher):
    """Publisher that appends each message to the inboxes of the topic's subscribers."""

    def __init__(self, transport: MemoryTransport, hub: _Hub, spec: PublisherSpec) -> None:
        super().__init__(spec, hub.lock)
        self.missing: tuple[str, ...] = ()
        self._transport = transport
        self.hub = hub
        self._kind = message_kind(
            spec.topic, spec.codec.name, spec.msg_type, is_latched=spec.is_latched, clock=OWN_CLOCK
        )
        self.history: History[Message] = History(spec.history)
        self.is_closed = False

    @property
    def subscribers(self) -> int:
        """Number of subscribers of the topic."""
        return len(self.hub.subscribers_of(self.spec.topic))

    @property
    def has_subscribers(self) -> bool:
        """True if the topic has subscribers."""
        return self.subscribers > 0

    def send(self, encoded: Encoded) -> None:
        """Append a message to the inboxes. Mutable data is copied.

        Raises `WireError` for an extension that can't be encoded, as other back ends do.
        """
        if encoded.extension:
            extension_part(encoded.extension)
        data = encoded.data if isinstance(encoded.data, bytes) else bytes(encoded.data)
        with self.hub.lock:
            stamp_ns = self._count_locked(len(data))
            message = received_message(
                self._kind, data, stamp_ns, self.count, self.spec.id, encoded.extension or {}
            )
            self.history.add(message, len(data))
            for subscriber in self.hub.subscribers_of(self.spec.topic):
                subscriber.enqueue(message)

    def close(self, timeout_s: float) -> None:  # noqa: ARG002 - nothing to flush
        """Unregister. Nothing needs flushing, because messages are delivered when they are sent."""
        with self.hub.lock:
            if not self.is_closed:
                self.is_closed = True
                remaining = [each for each in self.hub.publishers[self.spec.topic] if each is not self]
                self.hub.publishers[self.spec.topic] = remaining
                if not remaining:
                    del self.hub.publishers[self.spec.topic]
                self._transport.discard(self)
                self.hub.apply(requests.RemovePublisher(self._transport.node.id, self.spec.id, self.count))


class MemorySubscriber(InboxSubscriber):
    """Subscriber to whose inbox publishers append their messages."""

    def __init__(self, transport: MemoryTransport, hub: _Hub, spec: SubscriberSpec, inboxes: Inboxes) -> None:
        super().__init__(spec, inboxes)
        self._transport = transport
        self.hub = hub
        self.received = self.lost = self.refused = 0

    def enqueue(self, message: Message) -> None:
        """Append a message to the inbox. Called by publishers."""
        with self._changed:
            if not self.is_closed:
                dropped = self._put_locked(message)
                self.received += 1 - dropped
                self.lost += dropped

    def counts(self) -> SubscriberCount:
        """Return the statistics that a renewal reports."""
        return SubscriberCount(self.spec.id, self.received, self.lost, self.problem)

    def close(self) -> None:
        """Unregister the subscriber and discard its unread messages."""
        if not self._close_inbox():
            return
        with self.hub.lock:
            self.hub.patterns = tuple(each for each in self.hub.patterns if each is not self)
            subscribers = self.hub.subscribers.pop(self.spec.topic, ())
            remaining = tuple(each for each in subscribers if each is not self)
            if remaining:
                self.hub.subscribers[self.spec.topic] = remaining
            self._transport.discard(self)
            self.hub.apply(requests.RemoveSubscriber(self._transport.node.id, self.spec.id))


class MemoryTransport:
    """Connection of one node to the other nodes of its process."""

    def __init__(self, node: NodeRecord) -> None:
        self.node = node
        self._inboxes = Inboxes(node.name)
        self.wait = self._inboxes.wait
        self.wake = self._inboxes.wake
        self._load = CpuLoad()
        self._publishers: tuple[MemoryPublisher, ...] = ()
        self._subscribers: tuple[MemorySubscriber, ...] = ()
        self._closing = threading.Event()
        self._services = MemoryServices(node, self._joined_hub)

    def create_publisher(self, spec: PublisherSpec) -> MemoryPublisher:
        """Create and register a publisher. See `Transport.create_publisher`."""
        with self._joined_hub(spec.configuration) as hub:
            record = PublisherRecord(
                spec.id,
                spec.topic,
                spec.msg_type,
                spec.codec.name,
                ("memory",),
                spec.is_latched,
                history=spec.history,
            )
            hub.apply(requests.AddPublisher(self.node, record))
            publisher = MemoryPublisher(self, hub, spec)
            hub.publishers.setdefault(spec.topic, []).append(publisher)
            self._publishers = (*self._publishers, publisher)
        return publisher

    def create_subscriber(self, spec: SubscriberSpec) -> MemorySubscriber:
        """Register a subscriber and deliver the histories of the topic's publishers to it."""
        with self._joined_hub(spec.configuration) as hub:
            record = SubscriberRecord(spec.id, spec.topic, spec.msg_type, pattern=spec.is_pattern)
            hub.apply(requests.AddSubscriber(self.node, record))
            subscriber = MemorySubscriber(self, hub, spec, self._inboxes)
            for topic, publishers in hub.publishers.items():
                if topic == spec.topic or (spec.is_pattern and matches(spec.topic, topic)):
                    for message in (each for publisher in publishers for each in publisher.history):
                        subscriber.enqueue(message)
            if spec.is_pattern:
                hub.patterns = (*hub.patterns, subscriber)
            else:
                hub.subscribers[spec.topic] = (*hub.subscribers.get(spec.topic, ()), subscriber)
            self._subscribers = (*self._subscribers, subscriber)
        if spec.sink is not None:
            self._inboxes.add_sink(subscriber)
        return subscriber

    def discard(self, closed: MemoryPublisher | MemorySubscriber) -> None:
        """Remove a closed publisher or subscriber. Call with the hub's lock held."""
        self._publishers = tuple(each for each in self._publishers if each is not closed)
        self._subscribers = tuple(each for each in self._subscribers if each is not closed)

    def create_server(self, spec: ServerSpec) -> MemoryServer:
        """Register a server."""
        return self._services.create_server(spec)

    def create_client(self, spec: ClientSpec) -> MemoryClient:
        """Register a client."""
        return self._services.create_client(spec)

    create_surveyor = create_client

    def graph(self, configuration: Configuration, timeout_s: float) -> GraphView:  # noqa: ARG002 - immediate
        """Return the current graph."""
        return _get_hub(configuration).view()

    def renewal(self, hub: _Hub) -> requests.Renew:
        """Return the renewal request with the statistics of this node's members at `hub`.

        The members are the node's publishers, subscribers, servers and clients.
        """
        publishers = [each for each in self._publishers if each.hub is hub and not each.is_closed]
        subscribers = [each for each in self._subscribers if each.hub is hub and not each.is_closed]
        return requests.Renew(
            self.node.id,
            hub.graph.epoch,
            hub.graph.revision,
            (*(each.counts() for each in publishers), *self._services.server_counts(hub)),
            (
                *(each.counts() for each in subscribers),
                *self._services.client_counts(hub),
            ),
            self._load.ratio(),
        )

    def begin_close(self) -> None:
        """Unregister the servers and reject their queued calls. Messages don't need flushing."""
        self._services.begin_close()

    def close(self, timeout_s: float) -> None:
        """Unregister everything and join the threads."""
        self._closing.set()
        self._services.close(timeout_s)
        for subscriber in self._subscribers:
            subscriber.close()
        for publisher in self._publishers:
            publisher.close(timeout_s)
        with _hubs_lock:
            hubs = tuple(_hubs.values())
        for hub in hubs:
            hub.remove_node(self.node.id)
        self._inboxes.close(timeout_s)

    @contextmanager
    def _joined_hub(self, configuration: Configuration) -> Iterator[_Hub]:
        # Yields the hub with its lock held, after adding this node. Raises `ClosedError`.
        hub = _get_hub(configuration)
        with hub.lock:  # closing the node acquires the lock again after setting `_closing`
            if self._closing.is_set():
                raise ClosedError(f"node '{self.node.name}'")
            hub.transports[self.node.id] = self
            yield hub


def _master_name(master: str | None) -> str:
    # Any name is valid because no master process runs.
    return master or "memory"


BACKEND = Backend(
    "memory", MemoryTransport, master=_master_name, has_history=True, has_patterns=True, is_in_process=True
)
