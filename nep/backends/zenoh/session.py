"""Session of one node at one network address, with discovery, registrations and requests."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any, Protocol

from nep.backends.zenoh.addresses import open_session_at
from nep.backends.zenoh.keys import (
    ALL_CALLS_KEY,
    ALL_TOKENS_KEY,
    call_key,
    client_key,
    data_key,
    hello_key,
    hellos_key,
    node_key,
    parse_token,
    pattern_data_key,
    pattern_hellos_key,
    publisher_key,
    server_key,
    subscriber_key,
)
from nep.backends.zenoh.library import close_session, create_handler, load_zenoh
from nep.backends.zenoh.publisher import ZenohPublisher
from nep.backends.zenoh.roster import Roster
from nep.backends.zenoh.subscriber import ZenohSubscriber
from nep.errors import NepError, RequestRefusedError, WireError
from nep.i18n import _
from nep.masters.graph import Graph
from nep.masters.registry import check_record
from nep.messages.packing import pack_saturated, unpack_bounded
from nep.protocol import requests
from nep.protocol.encoding import decode_request, encode_request
from nep.protocol.graph_view import GraphView
from nep.protocol.requests import (
    NodeRecord,
    PublisherCount,
    PublisherRecord,
    RemotePublisher,
    Request,
    SubscriberCount,
    SubscriberRecord,
)
from nep.protocol.service_wire import service_of
from nep.system.cpu import CpuLoad
from nep.system.waits import wait_until

_logger = logging.getLogger("nep")
_TIMEOUT_GRACE_S = 1.0
"""Time in seconds that is added to a query's timeout here, because zenoh normally reports the timeout."""
_HANDSHAKE_TIMEOUT_S = 10.0
_MAX_REPLIES, _MAX_LIST_ITEMS = 100, 20_000


class ListedServer(Protocol):
    """Interface of a server to the session."""

    record: PublisherRecord

    def counts(self) -> PublisherCount:
        """Return the statistics shown in the graph."""


class ListedClient(Protocol):
    """Interface of a client to the session."""

    record: SubscriberRecord

    def counts(self) -> SubscriberCount:
        """Return the statistics shown in the graph."""

    def handle_servers_changed(self) -> None:
        """Handle a change of the service's servers. Called in a zenoh thread; must not block."""


class PendingQuery:
    """Query in progress. `replies` has the replies received so far by key."""

    def __init__(self, timeout_s: float, on_finished: Callable[[], None] | None = None) -> None:
        self._on_finished = on_finished
        self.replies: dict[str, bytes] = {}
        self._deadline = time.monotonic() + timeout_s + _TIMEOUT_GRACE_S
        self._is_finished = False
        self._changed = threading.Condition()

    def add_reply(self, reply: Any) -> None:  # noqa: ANN401 - zenoh is not typed
        """Store a reply. Called in a zenoh thread."""
        if reply.ok is not None:
            with self._changed:
                self.replies[str(reply.ok.key_expr)] = reply.ok.payload.to_bytes()
                self._changed.notify_all()

    def finish(self) -> None:
        """Finish the query, because all nodes have replied or the timeout has passed."""
        with self._changed:
            self._is_finished = True
            self._changed.notify_all()
        if self._on_finished is not None:
            self._on_finished()

    def wait(
        self, expected_keys: frozenset[str] | None = None, deadline: float | None = None
    ) -> frozenset[str]:
        """Wait for replies and return the expected keys without a reply.

        Args:
            expected_keys: Keys whose replies to wait for; None waits until the query is finished, and returns
                an empty set.
            deadline: Time (`time.monotonic`) at which to stop waiting; None for the query's timeout.
        """
        end_time = self._deadline if deadline is None else min(deadline, self._deadline)
        with self._changed:
            wait_until(
                self._changed,
                lambda: (
                    self._is_finished or (expected_keys is not None and expected_keys <= self.replies.keys())
                ),
                end_time - time.monotonic(),
            )
            return frozenset() if expected_keys is None else expected_keys - self.replies.keys()


class ZenohSession:
    """Session of a node at a network address.

    Args:
        node: Record of the node.
        address: Network address returned by `validate_address`.
        wait_s: Seconds to wait for a router; None waits forever.

    Raises:
        NepError: The session can't be opened.
    """

    def __init__(self, node: NodeRecord, address: str, wait_s: float | None) -> None:
        self.node = node
        self.roster = Roster()
        self._lock = threading.Lock()
        self._tokens: dict[object, Any] = {}
        self._publishers: tuple[ZenohPublisher, ...] = ()
        self._subscribers: tuple[ZenohSubscriber, ...] = ()
        self._servers: tuple[ListedServer, ...] = ()
        self._clients: tuple[ListedClient, ...] = ()
        self._zenoh_subscribers: dict[int, Any] = {}
        self._load = CpuLoad()
        self._graph = Graph(epoch=1, now=time.monotonic(), learn_s=0.0)
        self._session = open_session_at(address, wait_s)
        self.endpoints = self._session.endpoints
        self._zenoh: Any = self._session.session
        try:
            self._declarations = (
                self._zenoh.liveliness().declare_subscriber(
                    ALL_TOKENS_KEY, create_handler(self._handle_token), history=True
                ),
                self._zenoh.declare_queryable(call_key(node.id), create_handler(self._handle_query)),
            )
        except BaseException:
            self.close(0.0)
            raise

    # ---- requests

    def send_query(
        self,
        key: str,
        request: Request | None,
        timeout_s: float,
        *,
        on_reply: Callable[[Any], None] | None = None,
        on_finished: Callable[[], None] | None = None,
        is_last: bool = False,
    ) -> PendingQuery:
        """Send a query to all nodes that reply at a key, without waiting for the replies.

        Args:
            key: Key expression.
            request: Request in the payload, or None.
            timeout_s: Seconds until the query is finished.
            on_reply: Called with each reply, in a zenoh thread.
            on_finished: Called when the query is finished.
            is_last: True to send the query after all messages that were published before.

        Returns:
            The query, which can be waited for.
        """
        zenoh = load_zenoh()
        query = PendingQuery(timeout_s, on_finished)

        def handle_reply(reply: Any) -> None:  # noqa: ANN401 - zenoh is not typed
            if on_reply is not None and reply.ok is not None:
                on_reply(reply.ok)
            query.add_reply(reply)

        self._zenoh.get(
            key,
            create_handler(handle_reply, query.finish),
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=max(timeout_s, 0.001),
            congestion_control=zenoh.CongestionControl.BLOCK,
            priority=zenoh.Priority.BACKGROUND if is_last else zenoh.Priority.DATA,
            payload=None if request is None else encode_request(request, 0),
        )
        return query

    def sync_all(self, timeout_s: float) -> Mapping[str, bytes]:
        """Send a query to every node, wait up to `timeout_s` seconds, and return the replies by key.

        After a reply, this node knows all earlier declarations of the replying node, and vice versa.
        """
        if self._session.rendezvous is None:
            self._sync_routers(timeout_s)
        query = self.send_query(ALL_CALLS_KEY, requests.Ping(), timeout_s)
        query.wait()
        return query.replies

    def _sync_routers(self, timeout_s: float) -> None:
        # The reply of the routers follows the declarations of all reachable nodes.
        query = PendingQuery(timeout_s)
        self._zenoh.liveliness().get(
            node_key(self.node), create_handler(query.add_reply, query.finish), timeout=max(timeout_s, 0.001)
        )
        query.wait()

    def _handle_query(self, query: Any) -> None:  # noqa: ANN401 - zenoh is not typed
        # Runs in a zenoh thread.
        request = decode_request(b"" if query.payload is None else query.payload.to_bytes()).request
        reply = b""
        if isinstance(request, requests.QueryGraph):
            reply = pack_saturated([encode_request(each, 0) for each in self._own_requests()])
        elif isinstance(request, requests.RemovePublisher):
            for subscriber in self._subscribers:
                subscriber.handle_bye(request.id, request.last_seq)
        with query:
            query.reply(call_key(self.node.id), reply)

    def _own_requests(self) -> tuple[Request, ...]:
        # Returns this node's registration and statistics; empty if it has nothing registered.
        with self._lock:
            publishers, subscribers = self._publishers, self._subscribers
            servers, clients = self._servers, self._clients
            if self.node.id not in self._tokens:
                return ()
        join = requests.Join(
            self._own_record(),
            0,
            tuple(each.record for each in (*publishers, *servers)),
            (
                *(
                    SubscriberRecord(
                        each.spec.id, each.spec.topic, each.spec.msg_type, pattern=each.spec.is_pattern
                    )
                    for each in subscribers
                ),
                *(each.record for each in clients),
            ),
        )
        renewal = requests.Renew(
            self.node.id,
            1,
            0,
            (*(each.counts() for each in publishers), *(each.counts() for each in servers)),
            (*(each.counts() for each in subscribers), *(each.counts() for each in clients)),
            self._load.ratio(),
        )
        missing = (
            requests.ReportMissing(self.node.id, each.spec.id, each.missing_ids)
            for each in publishers
            if each.missing_ids
        )
        return (join, renewal, *missing)

    def _own_record(self) -> NodeRecord:
        # Without the node's key, which proves its id to masters and must stay secret.
        node = self.node
        return NodeRecord(
            node.id, node.name, node.host, node.pid, node.language, node.generation, node.since_ns
        )

    # ---- discovery

    def _handle_token(self, sample: Any) -> None:  # noqa: ANN401 - zenoh is not typed
        # Runs in a zenoh thread.
        token = parse_token(str(sample.key_expr))
        if token is None:
            return
        is_present = sample.kind == load_zenoh().SampleKind.PUT
        self.roster.update(token, is_present=is_present)
        record = token.record
        if not isinstance(record, PublisherRecord):
            return
        if service_of(record.topic) is not None:
            for client in self._clients:
                if client.record.topic == record.topic:
                    client.handle_servers_changed()
            return
        for subscriber in self._subscribers:
            if subscriber.matches_topic(record.topic):
                if is_present:
                    subscriber.add_publisher(self.roster.remote_publisher(token.node_id, record))
                    self._start_handshake(record, subscriber)
                else:
                    subscriber.mark_silent(record.id)

    def _start_handshake(self, record: PublisherRecord, subscriber: ZenohSubscriber) -> None:
        # Sends a hello to a publisher that was created after its subscriber.
        self.send_query(
            hello_key(record.topic, record.id),
            None,
            _HANDSHAKE_TIMEOUT_S,
            on_reply=subscriber.receive_reply,
            on_finished=lambda: subscriber.end_handshake((record.id,)),
        )

    def query_graph(self, timeout_s: float) -> GraphView:
        """Return the graph. Nodes that don't reply within `timeout_s` seconds have no statistics.

        Raises `NepError` while no router is connected.
        """
        if self._session.is_router_lost:
            raise NepError(
                _(
                    "no zenoh router replied at '{place}'; start the router, and this node will reconnect"
                ).format(place=",".join(self._session.routers))
            )
        query = self.send_query(ALL_CALLS_KEY, requests.QueryGraph(), timeout_s)
        query.wait()
        request_lists = [_parse_requests(key, reply) for key, reply in query.replies.items()]
        with self._lock:
            now = time.monotonic()
            replied_ids = {
                each.node.id
                for node_requests in request_lists
                for each in node_requests
                if isinstance(each, requests.Join)
            }
            members = [each for each in self.roster.members() if each[0].id not in replied_ids]
            alive_ids = replied_ids | {each[0].id for each in members}
            for departed_id in self._graph.members.keys() - alive_ids:
                self._graph.apply(requests.Leave(departed_id), 0, now, "")
            joins = [
                requests.Join(node, 0, publishers, subscribers) for node, publishers, subscribers in members
            ]
            for request in (*joins, *(each for node_requests in request_lists for each in node_requests)):
                self._graph.apply(request, 0, now, "")
            return self._graph.view()

    # ---- publishers and subscribers

    def check(self, record: PublisherRecord | SubscriberRecord) -> None:
        """Raise `RequestRefusedError` if a master would reject this record."""
        try:
            check_record(record)
        except WireError as error:
            raise RequestRefusedError(error.reason) from error

    def join(self) -> None:
        """Announce this node by declaring its liveliness token."""
        with self._lock:
            if self.node.id not in self._tokens:
                self._tokens[self.node.id] = self._declare_token(node_key(self.node))

    def _declare_token(self, key: str) -> Any:  # noqa: ANN401 - zenoh is not typed
        return self._zenoh.liveliness().declare_token(key)

    def add_publisher(self, publisher: ZenohPublisher) -> None:
        """Announce a publisher by declaring its liveliness token."""
        with self._lock:
            self._publishers = (*self._publishers, publisher)
            self._tokens[publisher] = self._declare_token(publisher_key(self.node.id, publisher.record))

    def add_subscriber(self, subscriber: ZenohSubscriber) -> None:
        """Subscribe to the messages and announce the subscriber by declaring its liveliness token."""
        spec = subscriber.spec
        record = SubscriberRecord(spec.id, spec.topic, spec.msg_type)
        for remote in self._publishers_for(subscriber):  # messages before the handshake are queued
            subscriber.add_publisher(remote)
        key = pattern_data_key(spec.topic) if spec.is_pattern else data_key(spec.topic)
        with self._lock:
            self._subscribers = (*self._subscribers, subscriber)
            self._zenoh_subscribers[spec.id] = self._zenoh.declare_subscriber(
                key, create_handler(subscriber.receive_message)
            )
            self._tokens[subscriber] = self._declare_token(subscriber_key(self.node.id, record))

    def perform_handshake(self, subscriber: ZenohSubscriber, timeout_s: float) -> None:
        """Send a hello to all publishers of a subscriber's topic and wait for the replies.

        Waits up to `timeout_s` seconds. A publisher replies with its history and the sequence number of its
        last message.
        """
        publishers = self._publishers_for(subscriber)
        for remote in publishers:
            subscriber.add_publisher(remote)
        spec = subscriber.spec
        key = pattern_hellos_key(spec.topic) if spec.is_pattern else hellos_key(spec.topic)
        self.send_query(key, None, timeout_s, on_reply=subscriber.receive_reply).wait()
        subscriber.end_handshake(each.publisher.id for each in publishers)

    def _publishers_for(self, subscriber: ZenohSubscriber) -> tuple[RemotePublisher, ...]:
        topics = self.roster.published_topics if subscriber.spec.is_pattern else (subscriber.spec.topic,)
        return tuple(
            remote
            for topic in topics
            if subscriber.matches_topic(topic)
            for remote in self.roster.publishers_of(topic)
        )

    def create_publisher(self, new_publisher: Callable[[Any], ZenohPublisher]) -> ZenohPublisher:
        """Create a publisher in this session.

        Args:
            new_publisher: Called with the zenoh session; returns the publisher.
        """
        return new_publisher(self._zenoh)

    def discard(self, closed: ZenohPublisher | ZenohSubscriber) -> None:
        """Remove a closed publisher or subscriber and undeclare its liveliness token."""
        with self._lock:
            self._publishers = tuple(entity for entity in self._publishers if entity is not closed)
            self._subscribers = tuple(entity for entity in self._subscribers if entity is not closed)
            entities = [self._tokens.pop(closed, None)]
            if isinstance(closed, ZenohSubscriber):
                entities.append(self._zenoh_subscribers.pop(closed.spec.id, None))
        for entity in entities:
            if entity is not None:
                with suppress(load_zenoh().ZError):  # closing the session has undeclared it
                    entity.undeclare()

    # ---- servers and clients

    def add_server(self, server: ListedServer) -> None:
        """Announce a server by declaring its liveliness token."""
        with self._lock:
            self._servers = (*self._servers, server)
            self._tokens[server] = self._declare_token(server_key(self.node.id, server.record))

    def add_client(self, client: ListedClient) -> None:
        """Announce a client by declaring its liveliness token."""
        with self._lock:
            self._clients = (*self._clients, client)
            self._tokens[client] = self._declare_token(client_key(self.node.id, client.record))

    def discard_service(self, closed: ListedServer | ListedClient) -> None:
        """Remove a closed server or client and undeclare its liveliness token. Idempotent."""
        with self._lock:
            self._servers = tuple(each for each in self._servers if each is not closed)
            self._clients = tuple(each for each in self._clients if each is not closed)
            token = self._tokens.pop(closed, None)
        if token is not None:
            with suppress(load_zenoh().ZError):  # closing the session has undeclared it
                token.undeclare()

    def declare_queryable(self, key: str, on_query: Callable[[Any], None]) -> Any:  # noqa: ANN401 - zenoh is not typed
        """Declare a queryable and return it.

        Args:
            key: Key expression of the queryable.
            on_query: Called with each query, in a zenoh thread.
        """
        return self._zenoh.declare_queryable(key, create_handler(on_query))

    def call(
        self,
        key: str,
        parts: Sequence[bytes | memoryview],
        timeout_s: float,
        on_reply: Callable[[Any], None],
        on_finished: Callable[[], None],
    ) -> None:
        """Send a call to a server, without waiting for the reply. Raises zenoh's `ZError`.

        Args:
            key: Key of the server.
            parts: Header and payload of the call.
            timeout_s: Seconds until zenoh finishes the query.
            on_reply: Called with each reply, in a zenoh thread.
            on_finished: Called when the query is finished.
        """
        zenoh = load_zenoh()
        header, data = (each if isinstance(each, bytes) else bytes(each) for each in parts)
        self._zenoh.get(
            key,
            create_handler(on_reply, on_finished),
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=timeout_s,
            congestion_control=zenoh.CongestionControl.BLOCK,
            payload=data,
            attachment=header,
        )

    # ---- closing

    def close(self, timeout_s: float) -> None:
        """Remove all tokens, wait until other nodes have noticed the removal, and close the session.

        Waits up to `timeout_s` seconds.
        """
        self._session.unregister()
        with self._lock:
            tokens = list(self._tokens.values())
            self._tokens.clear()
        for token in tokens:
            token.undeclare()
        if tokens and timeout_s > 0.0:
            self.sync_all(timeout_s)  # a graph queried after this doesn't contain this node any more
        close_session(self._zenoh)


def _parse_requests(key: str, reply: bytes) -> tuple[Request, ...]:
    # Ignores malformed requests and those about other nodes.
    try:
        bodies = unpack_bounded(reply, _MAX_REPLIES, _MAX_LIST_ITEMS) if reply else []
    except ValueError:
        return ()
    if not isinstance(bodies, list) or not all(isinstance(each, bytes) for each in bodies):
        return ()
    decoded = [decode_request(each).request for each in bodies]
    allowed_types = requests.Join | requests.Renew | requests.ReportMissing
    return tuple(
        each
        for each in decoded
        if isinstance(each, allowed_types) and key == call_key(requests.node_id_of(each) or "")
    )
