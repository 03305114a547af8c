"""Transport of the back end `zenoh`: one session per node and network address, without a master."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from nep.backends.base import HANDSHAKE_TIMEOUT_S, PublisherSpec, SubscriberSpec
from nep.backends.bases.inbox import Inboxes
from nep.backends.connection import Configuration, Direct
from nep.backends.services import ClientSpec, ServerSpec
from nep.backends.zenoh.keys import ALL_CALLS_KEY, call_key
from nep.backends.zenoh.library import load_zenoh
from nep.backends.zenoh.node_services import ZenohServices
from nep.backends.zenoh.publisher import ZenohPublisher
from nep.backends.zenoh.services import ZenohClient, ZenohServer
from nep.backends.zenoh.session import PendingQuery, ZenohSession
from nep.backends.zenoh.subscriber import ZenohSubscriber
from nep.errors import ClosedError, NepError
from nep.i18n import _
from nep.protocol.graph_view import GraphView
from nep.protocol.requests import ExpectedSubscriber, NodeRecord, RemovePublisher, SubscriberRecord
from nep.system.forks import call_in_child, close_in_child

_logger = logging.getLogger("nep")
_CLOSE_TIMEOUT_S = 0.3
_MAX_FLUSH_S = 60.0


@dataclass
class _PendingFlush:
    # Closing publisher, and its flush request to the nodes of its subscribers.
    session: ZenohSession
    query: PendingQuery
    expected: tuple[ExpectedSubscriber, ...]


class ZenohTransport:
    """Connection of one node over zenoh. Raises `BackendUnavailableError` if zenoh is not installed."""

    def __init__(self, node: NodeRecord) -> None:
        load_zenoh()
        self._node = node
        self._inboxes = Inboxes(node.name)
        self.wait = self._inboxes.wait
        self.wake = self._inboxes.wake
        self._lock = threading.Lock()
        self._open_lock = threading.Lock()
        self._sessions: dict[str, ZenohSession] = {}
        self._publishers: dict[ZenohPublisher, ZenohSession] = {}
        self._subscribers: dict[ZenohSubscriber, ZenohSession] = {}
        self._pending_flushes: dict[ZenohPublisher, _PendingFlush] = {}
        self._is_closed = False
        self._is_shut_down = False
        self._services = ZenohServices(self._session, node.name)
        call_in_child(self._give_up_in_child)

    # ---- publishers and subscribers

    def create_publisher(self, spec: PublisherSpec) -> ZenohPublisher:
        """Create a publisher. See `Transport.create_publisher`."""
        with self._translate_closed_errors():
            return self._create_publisher(spec)

    def _create_publisher(self, spec: PublisherSpec) -> ZenohPublisher:
        session = self._session(spec.configuration, spec.wait_s)

        def new_publisher(zenoh_session: Any) -> ZenohPublisher:  # noqa: ANN401 - zenoh is not typed
            return ZenohPublisher(
                zenoh_session, spec, session.roster.count_subscribers, self._close_publisher
            )

        session.join()
        publisher = session.create_publisher(new_publisher)
        try:
            session.check(publisher.record)
            self._add(self._publishers, publisher, session)
            session.add_publisher(publisher)
            replied_keys = session.sync_all(HANDSHAKE_TIMEOUT_S)
            expected = session.roster.subscribers_of(spec.topic)
            missing = [each for each in expected if call_key(each.node_id) not in replied_keys]
            publisher.missing = tuple(dict.fromkeys(each.node_name for each in missing))
            publisher.missing_ids = tuple(each.id for each in missing)
        except BaseException:  # also Ctrl+C: the caller has no object to close yet
            publisher.close(0.0)
            raise
        return publisher

    def create_subscriber(self, spec: SubscriberSpec) -> ZenohSubscriber:
        """Create a subscriber. See `Transport.create_subscriber`."""
        with self._translate_closed_errors():
            return self._create_subscriber(spec)

    def _create_subscriber(self, spec: SubscriberSpec) -> ZenohSubscriber:
        session = self._session(spec.configuration, spec.wait_s)
        session.check(SubscriberRecord(spec.id, spec.topic, spec.msg_type))
        session.join()
        subscriber = ZenohSubscriber(spec, self._inboxes, self._close_subscriber)
        self._add(self._subscribers, subscriber, session)
        try:
            session.add_subscriber(subscriber)
            session.sync_all(HANDSHAKE_TIMEOUT_S)
            session.perform_handshake(subscriber, HANDSHAKE_TIMEOUT_S)
            if spec.sink is not None:
                self._inboxes.add_sink(subscriber)
        except BaseException:
            subscriber.close()
            raise
        return subscriber

    def create_server(self, spec: ServerSpec) -> ZenohServer:
        """Create a server. See `ServiceTransport.create_server`."""
        with self._translate_closed_errors():
            return self._services.create_server(spec)

    def create_client(self, spec: ClientSpec) -> ZenohClient:
        """Create a client. See `ServiceTransport.create_client`."""
        with self._translate_closed_errors():
            return self._services.create_client(spec)

    def create_surveyor(self, spec: ClientSpec) -> ZenohClient:
        """Create a surveyor. See `ServiceTransport.create_surveyor`."""
        return self.create_client(spec)

    @contextmanager
    def _translate_closed_errors(self) -> Iterator[None]:
        # Converts errors of zenoh to `ClosedError` if the node was closed meanwhile.
        try:
            yield
        except load_zenoh().ZError as error:
            with self._lock:
                is_closed = self._is_closed
            if is_closed:
                raise ClosedError(f"node '{self._node.name}'") from error
            raise

    def _add(self, table: dict[Any, ZenohSession], owner: object, session: ZenohSession) -> None:
        with self._lock:
            self._check_open_locked()
            table[owner] = session

    def _check_open_locked(self) -> None:
        if self._is_closed:
            raise ClosedError(f"node '{self._node.name}'")

    def _session(self, configuration: Configuration, wait_s: float | None) -> ZenohSession:
        if isinstance(configuration, Direct):
            raise NepError(
                _(
                    "the back end 'zenoh' doesn't support direct connections; omit the configuration (no "
                    "master is needed), or use master='tcp/192.168.1.5:7447' to connect to a router on "
                    "another computer"
                )
            )
        with self._open_lock:  # open only one session per address
            with self._lock:
                self._check_open_locked()
                session = self._sessions.get(configuration.master)
            if session is None:
                session = ZenohSession(self._node, configuration.master, wait_s)
                with self._lock:
                    is_closed = self._is_closed
                    if not is_closed:
                        self._sessions[configuration.master] = session
                if is_closed:
                    session.close(0.0)
                    raise ClosedError(f"node '{self._node.name}'")
        return session

    # ---- closing

    def _close_subscriber(self, subscriber: ZenohSubscriber) -> None:
        with self._lock:
            session = self._subscribers.pop(subscriber, None)
        if session is not None:
            session.discard(subscriber)

    def _close_publisher(self, publisher: ZenohPublisher, timeout_s: float) -> None:
        self._send_bye(publisher)
        self._wait_for_flush(publisher, time.monotonic() + timeout_s)

    def _send_bye(self, publisher: ZenohPublisher) -> None:
        # Asks the subscribers' nodes to confirm that all messages have arrived; doesn't wait.
        with self._lock:
            session = self._publishers.get(publisher)
        if not publisher.mark_closed() or session is None:
            return
        expected = session.roster.subscribers_of(publisher.spec.topic)
        if expected and publisher.count:
            request = RemovePublisher(self._node.id, publisher.spec.id, publisher.count)
            query = session.send_query(ALL_CALLS_KEY, request, _MAX_FLUSH_S, is_last=True)
            with self._lock:
                self._pending_flushes[publisher] = _PendingFlush(session, query, expected)

    def _wait_for_flush(self, publisher: ZenohPublisher, deadline: float) -> None:
        # Waits for the confirmations until `deadline`; logs undelivered messages.
        with self._lock:
            pending_flush = self._pending_flushes.pop(publisher, None)
            session = self._publishers.pop(publisher, None)
        if pending_flush is not None:
            expected_keys = frozenset(call_key(each.node_id) for each in pending_flush.expected)
            silent_keys = pending_flush.query.wait(expected_keys, deadline)
            listed_ids = {
                each.id for each in pending_flush.session.roster.subscribers_of(publisher.spec.topic)
            }
            undelivered_count = sum(
                call_key(each.node_id) in silent_keys and each.id in listed_ids
                for each in pending_flush.expected
            )
            if undelivered_count:
                _logger.warning(
                    "'%s' was closed before %d subscriber(s) received everything: "
                    "up to %d messages not delivered",
                    publisher.spec.topic,
                    undelivered_count,
                    publisher.count,
                )
        publisher.release()
        if session is not None:
            session.discard(publisher)

    # ---- graph and closing

    def graph(self, configuration: Configuration, timeout_s: float) -> GraphView:
        """Return the current graph. See `Transport.graph`."""
        with self._translate_closed_errors():
            return self._session(configuration, timeout_s).query_graph(min(timeout_s, HANDSHAKE_TIMEOUT_S))

    def begin_close(self) -> None:
        """Notify all peers that the node is closing; doesn't wait. See `Transport.begin_close`."""
        with self._lock:
            if self._is_closed:
                return
            self._is_closed = True
            publishers = list(self._publishers)
        self._services.begin_close()
        for publisher in publishers:
            self._send_bye(publisher)

    def close(self, timeout_s: float) -> None:
        """Close all sockets, sessions and threads. See `Transport.close`."""
        deadline = time.monotonic() + timeout_s
        self.begin_close()
        with self._lock:
            if self._is_shut_down:
                return
            self._is_shut_down = True
            publishers, subscribers = list(self._publishers), list(self._subscribers)
        for subscriber in subscribers:
            subscriber.close()
        for publisher in publishers:
            self._wait_for_flush(publisher, deadline)
        self._services.close(max(_CLOSE_TIMEOUT_S, deadline - time.monotonic()))
        self._inboxes.close(max(_CLOSE_TIMEOUT_S, deadline - time.monotonic()))
        with self._open_lock:
            sessions = list(self._sessions.values())
        for session in sessions:
            session.close(min(_CLOSE_TIMEOUT_S, timeout_s))

    def _give_up_in_child(self) -> None:
        for session in self._sessions.values():
            close_in_child(*session.endpoints)
