"""Transport of the back end `ros2`: publishers, subscribers, services and the sink thread of one node."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from nep.backends.base import PublisherSpec, SubscriberSpec
from nep.backends.bases.inbox import Inboxes
from nep.backends.bases.open_services import OpenServices
from nep.backends.connection import Configuration, Hybrid
from nep.backends.ros2.graph import current_graph
from nep.backends.ros2.library import has_forked, load_dds, load_typesys
from nep.backends.ros2.participant import Participant, join_domain, leave_domain
from nep.backends.ros2.publisher import Ros2Publisher
from nep.backends.ros2.services.client import Ros2Client
from nep.backends.ros2.services.server import Ros2Server
from nep.backends.ros2.subscriber import Ros2Subscriber
from nep.backends.services import ClientSpec, ServerSpec
from nep.errors import ClosedError, NepError
from nep.i18n import _
from nep.protocol.graph_view import GraphView
from nep.protocol.requests import NodeRecord
from nep.system.cpu import CpuLoad

_logger = logging.getLogger("nep")


class Ros2Transport:
    """Connection of one node to a DDS domain.

    The constructor raises `BackendUnavailableError` if the required packages are not installed.
    """

    def __init__(self, node: NodeRecord) -> None:
        load_dds()
        load_typesys()
        self.node = node
        self._inboxes = Inboxes(node.name)
        self.wait = self._inboxes.wait
        self.wake = self._inboxes.wake
        self._load = CpuLoad()
        self._participant: Participant | None = None
        self._lock = threading.RLock()
        self._publishers: tuple[Ros2Publisher, ...] = ()
        self._subscribers: tuple[Ros2Subscriber, ...] = ()
        self._services: OpenServices[Ros2Server, Ros2Client] = OpenServices(node.name)
        self._closing = threading.Event()

    def _join_domain(self, configuration: Configuration) -> Participant:
        if not isinstance(configuration, Hybrid):
            raise NepError(
                _(
                    "'ros2' doesn't support direct connections: its nodes find each other in a domain; omit "
                    "the configuration, or choose the domain with master='5'"
                )
            )
        with self._lock:
            self._check_open()
            if self._participant is None:
                self._participant = join_domain(self, int(configuration.master))
            participant = self._participant
        if participant.number != int(configuration.master):
            raise NepError(
                _(
                    "'{name}' is in ROS 2 domain {domain}; create another node for domain {other} with "
                    "master='{other}'"
                ).format(name=self.node.name, domain=participant.number, other=configuration.master)
            )
        participant.wait_for_discovery()
        return participant

    def _check_open(self) -> None:
        if self._closing.is_set():
            raise ClosedError(f"node '{self.node.name}'")

    @contextmanager
    def _translate_closed_errors(self) -> Iterator[None]:
        # Converts errors of Cyclone DDS to `ClosedError` if the node was closed meanwhile.
        try:
            yield
        except load_dds().core.DDSException:
            self._check_open()
            raise

    def handle_endpoints_changed(self) -> None:
        """Handle added or removed endpoints. Called in the participant's thread with its lock held."""
        for subscriber in self._subscribers:
            subscriber.update_latched_reader()

    def create_publisher(self, spec: PublisherSpec) -> Ros2Publisher:
        """Create a publisher; wait up to `HANDSHAKE_TIMEOUT_S` for matches with the discovered readers."""
        with self._translate_closed_errors():
            participant = self._join_domain(spec.configuration)
            publisher = Ros2Publisher(participant, self.node.id, spec, self._close_publisher)
        with self._lock:
            if not self._closing.is_set():
                self._publishers = (*self._publishers, publisher)
                return publisher
        publisher.close(0.0)
        raise ClosedError(f"node '{self.node.name}'")

    def create_subscriber(self, spec: SubscriberSpec) -> Ros2Subscriber:
        """Create a subscriber; wait up to `HANDSHAKE_TIMEOUT_S` for matches with the discovered writers."""
        with self._translate_closed_errors():
            participant = self._join_domain(spec.configuration)
            subscriber = Ros2Subscriber(
                participant, self.node.id, spec, self._inboxes, self._discard_subscriber
            )
        with self._lock:
            if not self._closing.is_set():
                self._subscribers = (*self._subscribers, subscriber)
                if spec.sink is not None:
                    self._inboxes.add_sink(subscriber)
                return subscriber
        subscriber.close()
        raise ClosedError(f"node '{self.node.name}'")

    def create_server(self, spec: ServerSpec) -> Ros2Server:
        """Create a server; wait up to `HANDSHAKE_TIMEOUT_S` for matches with the discovered clients."""
        with self._translate_closed_errors():
            participant = self._join_domain(spec.configuration)
            server = Ros2Server(participant, self.node.id, spec, self._services.discard)
        try:
            self._services.add_server(server)
        except ClosedError:
            server.close(0.0)
            raise
        return server

    def create_client(self, spec: ClientSpec) -> Ros2Client:
        """Create a client; wait up to `HANDSHAKE_TIMEOUT_S` for matches with the discovered servers."""
        with self._translate_closed_errors():
            participant = self._join_domain(spec.configuration)
            client = Ros2Client(
                participant, self.node.id, spec, self._services.deadlines, self._services.discard
            )
        try:
            self._services.add_client(client)
            self._services.deadlines.add_client(client)
        except ClosedError:
            client.close()
            raise
        return client

    def _close_publisher(self, publisher: Ros2Publisher, timeout_s: float) -> None:
        publisher.finish(timeout_s)
        with self._lock:
            self._publishers = tuple(each for each in self._publishers if each is not publisher)

    def _discard_subscriber(self, subscriber: Ros2Subscriber) -> None:
        with self._lock:
            self._subscribers = tuple(each for each in self._subscribers if each is not subscriber)

    def graph(self, configuration: Configuration, timeout_s: float) -> GraphView:  # noqa: ARG002 - immediate
        """Return the graph of the domain, built from discovered endpoints."""
        with self._translate_closed_errors():
            return current_graph(self._join_domain(configuration))

    @property
    def publishers(self) -> tuple[Ros2Publisher, ...]:
        """Open publishers."""
        return self._publishers

    @property
    def subscribers(self) -> tuple[Ros2Subscriber, ...]:
        """Open subscribers."""
        return self._subscribers

    @property
    def servers(self) -> tuple[Ros2Server, ...]:
        """Open servers."""
        return self._services.servers

    @property
    def clients(self) -> tuple[Ros2Client, ...]:
        """Open clients."""
        return self._services.clients

    def load(self) -> float | None:
        """Return the CPU load of the process as a share of one core; None if not measured yet."""
        return self._load.ratio()

    def begin_close(self) -> None:
        """Reject queued and new calls. `close` waits until messages are acknowledged."""
        self._services.begin_close()

    def close(self, timeout_s: float) -> None:
        """Close all writers and readers, leave the domain and join the threads."""
        if has_forked():
            return
        with self._lock:
            self._closing.set()
        deadline = time.monotonic() + timeout_s
        try:
            for subscriber in self._subscribers:
                subscriber.close()
            for publisher in self._publishers:
                publisher.close(max(0.0, deadline - time.monotonic()))
            self._services.close(max(0.0, deadline - time.monotonic()))
        finally:
            with self._lock:
                participant, self._participant = self._participant, None
            if participant is not None:
                leave_domain(participant, self.node.id)
        self._inboxes.close(timeout_s)
