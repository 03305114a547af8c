"""State of the master as a graph of nodes. Performs no I/O and reads no clock.

    apply(request, call, now, sender) -> messages to send, in this order (pushes first, then the reply)
    tick(now)                         -> messages to send after expired leases and the end of learning
    unregister_nodes(node_ids)        -> messages to send because nodes are dead or don't respond
    view()                            -> GraphView

A master that has just started is *learning*: for `learn_s` seconds, nodes of a previous master rejoin,
and requests of new publishers and subscribers wait, so that their replies are complete. `now` is a
monotonic time in seconds.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from msgspec.structs import replace

from nep.errors import WireError
from nep.i18n import _
from nep.masters.clocks import Clocks
from nep.masters.leases import LEASE_DURATION_S, Leases
from nep.masters.pattern_index import MAX_PATTERNS, MAX_PATTERNS_PER_NODE
from nep.masters.registry import (
    GUARANTEED_RECORDS,
    MAX_RECORDS,
    MAX_RECORDS_PER_NODE,
    RegisteredNode,
    Registry,
    check_record,
    check_request,
    records_of,
)
from nep.masters.snapshot import GraphSnapshotBuilder
from nep.protocol.graph_view import GraphView
from nep.protocol.requests import (
    AddedReply,
    AddPublisher,
    AddSubscriber,
    DoneReply,
    ExpectedSubscriber,
    FoundReply,
    GraphReply,
    Join,
    Leave,
    Listen,
    NodeRecord,
    Ping,
    Probe,
    PublisherAdded,
    PublisherRecord,
    PublisherRemoved,
    Push,
    QueryGraph,
    RejectedReply,
    RemovePublisher,
    RemoveSubscriber,
    Renew,
    RenewedReply,
    Reply,
    ReportAlerts,
    ReportMissing,
    Request,
    SubscriberRecord,
    TopicPublishers,
    is_proven,
    node_id_of,
)

_MAX_WAITING_REQUESTS = 10_000
"""Maximum number of requests that wait while the master is learning."""


class OutgoingMessage(NamedTuple):
    """Message to send: a push to a node, or the reply to a request.

    Attributes:
        to: Id of the node for a push; connection of the request for a reply.
        body: Content of the message.
        call: Id of the request, or None for a push.
    """

    to: str
    body: Reply | Push
    call: int | None = None


def without_nodes(reply: Reply | Push, node_ids: frozenset[str]) -> Reply | Push:
    """Return a copy of `reply` without the given nodes, which have turned out to be dead.

    Pushes, and replies other than `FoundReply` and `AddedReply`, are returned unchanged.
    """
    if isinstance(reply, FoundReply) and node_ids:
        return replace(
            reply, publishers=tuple(each for each in reply.publishers if each.node_id not in node_ids)
        )
    if isinstance(reply, AddedReply) and node_ids:
        return replace(
            reply,
            expected=tuple(each for each in reply.expected if each.node_id not in node_ids),
            hung=tuple(each for each in reply.hung if each.node_id not in node_ids),
        )
    return reply


def with_hosts(reply: Reply | Push, hosts: tuple[str, ...]) -> Reply | Push:
    """Return a copy of `reply` with the addresses at which the master serves other computers.

    Pushes, and replies without a field for the addresses, are returned unchanged; so is every message
    if `hosts` is empty.
    """
    if not hosts:
        return reply
    if isinstance(reply, AddedReply | FoundReply | RenewedReply):
        return replace(reply, hosts=hosts)
    if isinstance(reply, GraphReply):
        return replace(reply, view=replace(reply.view, listens=hosts))
    return reply


class Graph:
    """State of a master. See the module docstring. Not thread-safe: used only by the master's thread."""

    def __init__(
        self,
        epoch: int,
        now: float,
        learn_s: float = 1.0,
        lease_s: float = LEASE_DURATION_S,
        computer: str = "",
    ) -> None:
        self.epoch = epoch
        self._registry = Registry()
        self.clocks = Clocks(self._registry, computer)
        """Clocks of the nodes."""
        self._snapshot_builder = GraphSnapshotBuilder(self._registry)
        self._leases = Leases(self._registry, lease_s)
        self._learning_until = now + learn_s
        self._waiting_requests: list[tuple[AddPublisher | AddSubscriber, int, str, bool]] = []

    # ---- called by the server

    @property
    def revision(self) -> int:
        """Number that increases with every change of registrations."""
        return self._registry.revision

    @property
    def members(self) -> Mapping[str, RegisteredNode]:
        """Registered nodes by id."""
        return self._registry.members

    @property
    def nodes(self) -> tuple[NodeRecord, ...]:
        """Records of all registered nodes."""
        return tuple(member.node for member in self._registry.members.values())

    def apply(
        self, request: Request, call: int, now: float, sender: str, *, is_foreign: bool = False
    ) -> tuple[OutgoingMessage, ...]:
        """Execute a request and return the messages to send. Errors become a `RejectedReply` reply.

        Args:
            request: The request.
            call: Id of the request.
            now: Current time.
            sender: Connection of the request.
            is_foreign: True if another program sent the request; such a program may only change its own
                node. See `nep.masters.registry`.
        """
        out: list[OutgoingMessage] = []
        try:
            if is_foreign:
                self._authorize(request, sender, out)
            if isinstance(request, AddPublisher | AddSubscriber) and now < self._learning_until:
                if len(self._waiting_requests) >= _MAX_WAITING_REQUESTS:
                    reason = _("too many programs are registering while the master starts; try again")
                    raise WireError(reason, code="busy")
                self._waiting_requests.append((request, call, sender, is_foreign))
                return tuple(out)
            reply = self._execute(request, now, sender, out)
        except WireError as error:
            reply = RejectedReply(self.epoch, self.revision, error.reason, error.code)
        out.append(OutgoingMessage(sender, reply, call))
        return tuple(out)

    def tick(self, now: float) -> tuple[OutgoingMessage, ...]:
        """Finish learning, expire leases, and adapt the renewal interval; return the messages to send."""
        out: list[OutgoingMessage] = []
        if self._waiting_requests and now >= self._learning_until:
            waiting_requests, self._waiting_requests = self._waiting_requests, []
            for request, call, sender, is_foreign in waiting_requests:
                out.extend(self.apply(request, call, now, sender, is_foreign=is_foreign))
        out.extend(self.unregister_nodes(self._leases.expired_node_ids(now)))
        self._registry.departed.tick(now)
        self._leases.update_renew_interval(now)
        return tuple(out)

    @property
    def learning_end(self) -> float | None:
        """Time at which `tick` must be called to execute waiting requests, or None if no request waits."""
        return self._learning_until if self._waiting_requests else None

    def probes_for_overdue(self, now: float) -> tuple[OutgoingMessage, ...]:
        """Return probe messages for nodes that have missed a renewal.

        A node to which its probe can't be sent is dead.
        """
        return self.probes_for(self._leases.overdue_node_ids(now))

    def probes_for(self, node_ids: Iterable[str]) -> tuple[OutgoingMessage, ...]:
        """Return probe messages for the given nodes; unregistered ones are ignored."""
        probe = Probe(self.epoch, self.revision)
        return tuple(
            OutgoingMessage(node_id, probe) for node_id in node_ids if node_id in self._registry.members
        )

    def unregister_nodes(self, node_ids: Iterable[str]) -> tuple[OutgoingMessage, ...]:
        """Unregister nodes that are dead or don't respond; return the messages to send."""
        out: list[OutgoingMessage] = []
        for node_id in node_ids:
            member = self._registry.members.get(node_id)
            if member is not None:
                self._unregister_node(member, out, is_closed=False)
        return tuple(out)

    def view(self) -> GraphView:
        """Return a snapshot of the graph."""
        return self._snapshot_builder.view(self.epoch)

    def node_at(self, route: str) -> RegisteredNode | None:
        """Return the node that registered over the connection `route`, or None."""
        return self._registry.members_by_route.get(route)

    # ---- authorization

    def _authorize(self, request: Request, sender: str, out: list[OutgoingMessage]) -> None:
        # Raises `WireError`. A proven owner of an id evicts an unproven one.
        check_request(request)
        if isinstance(request, Join | AddPublisher | AddSubscriber):
            self._authorize_node(request.node, sender, out)
            records = records_of(request)
            for record in records:
                self._authorize_record(request.node, record, out)
            self._check_limits(request, len(records))
            return
        node_id = node_id_of(request)
        member = None if node_id is None else self._registry.members.get(node_id)
        if member is not None and member.route != sender and not isinstance(request, Renew):
            raise WireError(_("a node can only send requests for itself"), code="speaker")

    def _authorize_node(self, node: NodeRecord, sender: str, out: list[OutgoingMessage]) -> None:
        if node.key and not is_proven(node):
            reason = _("the node id '{id}' doesn't match the node's key").format(id=node.id)
            raise WireError(reason, code="node-key")
        if not node.key and sender != node.id:
            raise WireError(
                _("a node must have a key that proves its id, or use its id as routing id; update nep"),
                code="node-unproven",
            )
        other = self._registry.members_by_route.get(sender)
        if other is not None and other.node.id != node.id:
            reason = _("this connection already belongs to the node '{id}'").format(id=other.node.id)
            raise WireError(reason, code="connection")
        member = self._registry.members.get(node.id)
        if member is None or member.route == sender:
            return
        if not node.key:
            reason = _("the id '{id}' belongs to a node of another program").format(id=node.id)
            raise WireError(reason, code="node-taken")
        if not is_proven(member.node):
            self._unregister_node(member, out, is_closed=False)

    def _authorize_record(
        self, node: NodeRecord, record: PublisherRecord | SubscriberRecord, out: list[OutgoingMessage]
    ) -> None:
        if record.number and not is_proven(node, record):
            raise WireError(
                _("the id {id} doesn't match the node's key and the number {number}").format(
                    id=record.id, number=record.number
                ),
                code="record-key",
            )
        is_publisher = isinstance(record, PublisherRecord)
        owners = self._registry.publisher_owners if is_publisher else self._registry.subscriber_owners
        owner = owners.get(record.id)
        if owner is None or owner.node.id == node.id:
            return
        existing = (owner.publishers if is_publisher else owner.subscribers)[record.id].record
        if not is_proven(node, record) or is_proven(owner.node, existing):
            raise WireError(
                _("the id {id} belongs to a publisher or subscriber of another program").format(id=record.id),
                code="record-taken",
            )
        if is_publisher:
            self._unregister_publisher(owner, record.id, out)
        else:
            self._registry.remove_subscriber(owner.node.id, record.id)

    def _check_limits(self, request: Join | AddPublisher | AddSubscriber, count: int) -> None:
        registry = self._registry
        member = registry.members.get(request.node.id)
        registered_count = 0 if member is None else len(member.publishers) + len(member.subscribers)
        needed = count if isinstance(request, Join) else registered_count + 1
        if needed > max(registered_count, MAX_RECORDS_PER_NODE):
            raise WireError(
                _("a node can have at most {RECORDS_MAX} publishers and subscribers").format(
                    RECORDS_MAX=MAX_RECORDS_PER_NODE
                ),
                code="limit",
            )
        self._check_pattern_limits(request)
        total = len(registry.publisher_owners) + len(registry.subscriber_owners)
        if (
            needed > max(registered_count, GUARANTEED_RECORDS)
            and total + needed - registered_count > MAX_RECORDS
        ):
            raise WireError(
                _("the graph already has {ALL_RECORDS_MAX} publishers and subscribers, the maximum").format(
                    ALL_RECORDS_MAX=MAX_RECORDS
                ),
                code="limit",
            )

    def _check_pattern_limits(self, request: Join | AddPublisher | AddSubscriber) -> None:
        new = {each.id for each in records_of(request) if isinstance(each, SubscriberRecord) and each.pattern}
        if not new:
            return
        member = self._registry.members.get(request.node.id)
        subscribers = () if member is None else member.subscribers.values()
        registered = {each.record.id for each in subscribers if each.record.pattern}
        needed = new if isinstance(request, Join) else registered | new
        total = len(self._registry.patterns) - len(registered) + len(needed)
        limit = max(len(self._registry.patterns), MAX_PATTERNS)
        if len(needed) > max(len(registered), MAX_PATTERNS_PER_NODE) or total > limit:
            raise WireError(
                _(
                    "a node can have at most {PATTERNS_MAX} subscribers with wildcards, and all nodes "
                    "together "
                    "at most {ALL_PATTERNS_MAX}"
                ).format(PATTERNS_MAX=MAX_PATTERNS_PER_NODE, ALL_PATTERNS_MAX=MAX_PATTERNS),
                code="limit",
            )

    # ---- requests

    def _execute(self, request: Request, now: float, sender: str, out: list[OutgoingMessage]) -> Reply:
        if isinstance(request, AddPublisher):
            return self._add_publisher(request, now, sender, out)
        if isinstance(request, AddSubscriber):
            return self._add_subscriber(request, now, sender, out)
        if isinstance(request, Join):
            return self._join(request, now, sender, out)
        if isinstance(request, Renew):
            return self._renew(request, now, sender)
        if isinstance(request, QueryGraph):
            return GraphReply(self.epoch, self.revision, self.view())
        if isinstance(request, ReportAlerts):
            self._registry.report_alerts(request.source, request.alerts)
        elif not isinstance(request, Ping | Listen):
            self._update(request, out)
        return DoneReply(self.epoch, self.revision)

    def _update(
        self,
        request: RemovePublisher | RemoveSubscriber | Leave | ReportMissing,
        out: list[OutgoingMessage],
    ) -> None:
        if isinstance(request, RemovePublisher):
            self._remove_publisher(request, out)
        elif isinstance(request, RemoveSubscriber):
            self._registry.remove_subscriber(request.node_id, request.id)
        elif isinstance(request, ReportMissing):
            self._registry.report_missing(request.node_id, request.publisher_id, request.subscriber_ids)
        else:
            member = self._registry.members.get(request.node_id)
            if member is not None:
                self._unregister_node(member, out, is_closed=True)

    def _register_node(
        self, node: NodeRecord, now: float, sender: str, *, is_managed: bool | None = None
    ) -> RegisteredNode:
        member = self._registry.add_node(node, now, is_managed=is_managed)
        self._registry.bind_route(member, sender)
        return member

    def _add_publisher(
        self, request: AddPublisher, now: float, sender: str, out: list[OutgoingMessage]
    ) -> Reply:
        check_record(request.publisher)
        member = self._register_node(request.node, now, sender)
        id = request.publisher.id
        # a publisher unlisted for its silence may report new endpoints before it rejoins
        is_new = id not in member.publishers and id not in self._registry.departed
        self._register_publisher(member, request.publisher, out, is_new=is_new)
        expected: list[ExpectedSubscriber] = []
        hung: list[ExpectedSubscriber] = []
        for other, subscriber in self._registry.receivers_of(request.publisher.topic):
            if not other.is_managed:
                entry = ExpectedSubscriber(subscriber.record.id, other.node.id, other.node.name)
                # A subscriber that doesn't respond to this node isn't waited for. One that doesn't respond to
                # another node is waited for, unless its renewal is late.
                is_hung = member.node.id in other.unconnected_node_ids or (
                    other.unconnected_node_ids and self._leases.is_late(other, now)
                )
                (hung if is_hung else expected).append(entry)
        return AddedReply(self.epoch, self.revision, tuple(expected), tuple(hung))

    def _add_subscriber(
        self, request: AddSubscriber, now: float, sender: str, out: list[OutgoingMessage]
    ) -> Reply:
        check_record(request.subscriber)
        member = self._register_node(request.node, now, sender)
        self._registry.add_subscriber(member, request.subscriber)
        remotes = tuple(
            remote
            for topic in sorted(self._registry.topics_of(request.subscriber))
            for remote in self._registry.publishers_of(topic)
        )
        # if a probe can't be sent, the dead publisher is removed from the reply
        out.extend(self.probes_for(sorted({remote.node_id for remote in remotes} - {member.node.id})))
        return FoundReply(self.epoch, self.revision, remotes, pattern=request.subscriber.pattern)

    def _join(self, request: Join, now: float, sender: str, out: list[OutgoingMessage]) -> Reply:
        records: tuple[PublisherRecord | SubscriberRecord, ...] = (*request.publishers, *request.subscribers)
        for record in records:
            check_record(record)
        member = self._register_node(request.node, now, sender, is_managed=request.managed)
        registered = {record.id for record in request.publishers}
        for removed_id in [record_id for record_id in member.publishers if record_id not in registered]:
            self._registry.remove_publisher(member.node.id, removed_id)
        registered = {record.id for record in request.subscribers}
        for removed_id in [record_id for record_id in member.subscribers if record_id not in registered]:
            self._registry.remove_subscriber(member.node.id, removed_id)
        for subscriber in request.subscribers:
            self._registry.add_subscriber(member, subscriber)
        for publisher in request.publishers:
            self._register_publisher(member, publisher, out, is_new=False)
        topics = self._registry.topics_received_by(member)
        remotes = [remote for topic in sorted(topics) for remote in self._registry.publishers_of(topic)]
        return FoundReply(self.epoch, self.revision, tuple(remotes))

    def _renew_member(self, request: Renew, now: float, sender: str) -> RegisteredNode | None:
        # None: the node must join again.
        member = self._member_at(request.node_id, sender)
        if member is None or request.epoch != self.epoch or not self._registry.renew(member, request, now):
            return None
        self.clocks.store(member, request.clock, now)
        return member

    def _member_at(self, node_id: str, sender: str) -> RegisteredNode | None:
        # None unless the connection speaks for the node.
        member = self._registry.members.get(node_id)
        return member if member is not None and member.route == sender else None

    def _renew(self, request: Renew, now: float, sender: str) -> Reply:
        member = self._renew_member(request, now, sender)
        if member is None:
            rejoining_member = self._member_at(request.node_id, sender)
            if rejoining_member is not None:
                rejoining_member.renewed_at = now
            return RenewedReply(self.epoch, self.revision, again=True)
        topics: Iterable[str] = ()
        if self._registry.publishers_revision > request.revision:
            topics = sorted(self._registry.topics_received_by(member))
        changed_topics = tuple(
            TopicPublishers(topic, self._registry.publishers_of(topic))
            for topic in topics
            if self._registry.topic_revision(topic) > request.revision
        )
        last_seqs, next_s = self._registry.last_seqs(member), self._leases.renew(member, now)
        clocks = self.clocks.differences(member, now)
        return RenewedReply(
            self.epoch, self.revision, False, changed_topics, last_seqs, next_s=next_s, clocks=clocks
        )

    def _unregister_publisher(
        self, member: RegisteredNode, publisher: int, out: list[OutgoingMessage]
    ) -> None:
        # For a publisher that did not unregister itself.
        last_seq = member.publishers[publisher].last_seq
        record = self._registry.remove_publisher(member.node.id, publisher)
        if record is not None:
            removal = PublisherRemoved(self.epoch, self.revision, record.id, record.topic, False, last_seq)
            self._notify_subscribers(record, removal, out)

    def _remove_publisher(self, request: RemovePublisher, out: list[OutgoingMessage]) -> None:
        member = self._registry.members.get(request.node_id)
        publisher = member.publishers.get(request.id) if member is not None else None
        if publisher is not None:
            self._registry.update_last_message(publisher, request.last_seq, publisher.last_stamp_ns)
        record = self._registry.remove_publisher(request.node_id, request.id)
        if record is not None:
            removal = PublisherRemoved(
                self.epoch, self.revision, record.id, record.topic, is_closed=True, last_seq=request.last_seq
            )
            self._notify_subscribers(record, removal, out)

    # ---- notifying subscribers

    def _register_publisher(
        self, member: RegisteredNode, record: PublisherRecord, out: list[OutgoingMessage], *, is_new: bool
    ) -> None:
        if self._registry.add_publisher(member, record) and record.endpoints:
            remote = self._registry.remote_publisher(member, record)
            self._notify_subscribers(record, PublisherAdded(self.epoch, self.revision, remote, is_new), out)

    def _unregister_node(
        self, member: RegisteredNode, out: list[OutgoingMessage], *, is_closed: bool
    ) -> None:
        publishers = list(member.publishers.values())
        self._registry.remove_node(member.node.id)
        for publisher in publishers:
            removal = PublisherRemoved(
                self.epoch,
                self.revision,
                publisher.record.id,
                publisher.record.topic,
                is_closed=is_closed,
                last_seq=publisher.last_seq,
            )
            self._notify_subscribers(publisher.record, removal, out)

    def _notify_subscribers(self, record: PublisherRecord, push: Push, out: list[OutgoingMessage]) -> None:
        notified: set[str] = set()
        for member, _subscriber in self._registry.receivers_of(record.topic):
            if not member.is_managed and member.node.id not in notified:
                notified.add(member.node.id)
                out.append(OutgoingMessage(member.node.id, push))
