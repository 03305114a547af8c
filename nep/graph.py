"""Graph: the master's brain. It knows who is there; it has no sockets and no clock.

    apply(request, call, now, sender) -> what to send, in this order (pushes first, then the reply)
    tick(now)                         -> what to send because time has passed (leases, the end of learning)
    drop(node ids)                    -> what to send because these nodes' connections are gone
    view()                            -> GraphView

A master that has just started is *learning*: for `learn_s` seconds it lets nodes that another master knew
come back, and keeps new publishers and subscribers waiting, so that these learn of everybody. `now` is in
seconds of any clock that does not jump.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from nep.census import Census, Member
from nep.errors import WireError
from nep.leases import LEASE_S, Leases
from nep.outgoing import Outgoing
from nep.records import Expected, NodeRecord, PublisherRecord, SubscriberRecord
from nep.renewals import RenewalSaid, same_ids, take_over
from nep.requests import (
    Added,
    AddPublisher,
    AddSubscriber,
    Done,
    Found,
    Join,
    Leave,
    Listen,
    Look,
    Ping,
    Probe,
    PublisherCame,
    PublisherGone,
    Push,
    Refused,
    RemovePublisher,
    RemoveSubscriber,
    Renew,
    Renewed,
    Reply,
    ReportAlerts,
    ReportMissing,
    Request,
    Seen,
    TopicPublishers,
)
from nep.viewing import Viewer
from nep.views import Alert, GraphView, NodeInfo, PublisherInfo, SubscriberInfo, TopicInfo
from nep.wire import check_topic

__all__ = [
    "LEASE_S",
    "Alert",
    "Graph",
    "GraphView",
    "NodeInfo",
    "Outgoing",
    "PublisherInfo",
    "SubscriberInfo",
    "TopicInfo",
]


class Graph:
    """See the module. Not thread-safe: it belongs to the master's thread."""

    def __init__(self, epoch: int, now: float, learn_s: float = 1.0, lease_s: float = LEASE_S) -> None:
        self.epoch = epoch
        self._census = Census()
        self._viewer = Viewer(self._census)
        self._leases = Leases(self._census, lease_s)
        self._learnt_at = now + learn_s
        self._waiting: list[tuple[AddPublisher | AddSubscriber, int, str]] = []

    # ---- what the master calls

    @property
    def revision(self) -> int:
        """Grows with every change of who is there."""
        return self._census.revision

    @property
    def members(self) -> Mapping[str, Member]:
        """All nodes that are registered now, by their ids."""
        return self._census.members

    @property
    def nodes(self) -> tuple[NodeRecord, ...]:
        """All nodes that are registered now."""
        return tuple(member.node for member in self._census.members.values())

    def apply(self, request: Request, call: int, now: float, sender: str) -> tuple[Outgoing, ...]:
        """Carry out a request of `sender`. What is wrong with it becomes a `Refused`, never an exception."""
        if isinstance(request, AddPublisher | AddSubscriber) and now < self._learnt_at:
            self._waiting.append((request, call, sender))
            return ()
        out: list[Outgoing] = []
        try:
            reply = self._carry_out(request, now, out)
        except WireError as error:
            reply = Refused(self.epoch, self.revision, error.reason)
        out.append(Outgoing(sender, reply, call))
        return tuple(out)

    def tick(self, now: float) -> tuple[Outgoing, ...]:
        """End learning and lapsed leases; see how often nodes shall renew."""
        out: list[Outgoing] = []
        if self._waiting and now >= self._learnt_at:
            waiting, self._waiting = self._waiting, []
            for request, call, sender in waiting:
                out.extend(self.apply(request, call, now, sender))
        out.extend(self.drop(self._leases.lapsed(now)))
        self._leases.set_pace(now)
        return tuple(out)

    @property
    def learning_end(self) -> float | None:
        """When `tick` has to be called for those who wait, None when nobody waits."""
        return self._learnt_at if self._waiting else None

    def silent(self, now: float) -> tuple[Outgoing, ...]:
        """Probes for nodes that missed a renewal: one that cannot be sent proves that its node is dead."""
        return self.probes(self._leases.late(now))

    def probes(self, node_ids: Iterable[str]) -> tuple[Outgoing, ...]:
        """Probes for those of these nodes that are registered."""
        probe = Probe(self.epoch, self.revision)
        return tuple(Outgoing(node_id, probe) for node_id in node_ids if node_id in self._census.members)

    def drop(self, node_ids: Iterable[str]) -> tuple[Outgoing, ...]:
        """Unlist nodes that are dead or silent."""
        out: list[Outgoing] = []
        for node_id in node_ids:
            member = self._census.members.get(node_id)
            if member is not None:
                self._forget(member, out, is_closed=False)
        return tuple(out)

    def view(self) -> GraphView:
        """The whole graph as a value."""
        return self._viewer.view(self.epoch)

    def renew_quickly(self, said: RenewalSaid, now: float) -> dict[int, int] | None:
        """Take over a usual renewal; the newest messages of those that the node hears.

        None when it has to be applied as a request; it may have been taken over in part.
        """
        member = self._census.members.get(said.node_id)
        if member is None or said.epoch != self.epoch or said.revision < self._census.publishers_revision:
            return None
        if not take_over(self._census, member, said, now):
            return None
        self._leases.renew(member, now)
        return self._census.last_seqs(member)

    # ---- requests

    def _carry_out(self, request: Request, now: float, out: list[Outgoing]) -> Reply:
        if isinstance(request, AddPublisher):
            return self._add_publisher(request, now, out)
        if isinstance(request, AddSubscriber):
            return self._add_subscriber(request, now, out)
        if isinstance(request, Join):
            return self._join(request, now, out)
        if isinstance(request, Renew):
            return self._renew(request, now)
        if isinstance(request, Look):
            return Seen(self.epoch, self.revision, self.view())
        if isinstance(request, ReportAlerts):
            self._census.report_alerts(request.source, request.alerts)
        elif not isinstance(request, Ping | Listen):
            self._note(request, out)
        return Done(self.epoch, self.revision)

    def _note(
        self,
        request: RemovePublisher | RemoveSubscriber | Leave | ReportMissing,
        out: list[Outgoing],
    ) -> None:
        if isinstance(request, RemovePublisher):
            self._remove_publisher(request, out)
        elif isinstance(request, RemoveSubscriber):
            self._census.remove_subscriber(request.node_id, request.id)
        elif isinstance(request, ReportMissing):
            self._census.report_missing(request.node_id, request.publisher_id, request.subscriber_ids)
        else:
            member = self._census.members.get(request.node_id)
            if member is not None:
                self._forget(member, out, is_closed=True)

    def _add_publisher(self, request: AddPublisher, now: float, out: list[Outgoing]) -> Reply:
        _check(request.publisher)
        member = self._census.meet(request.node, now)
        self._place(member, request.publisher, out)
        expected: list[Expected] = []
        hung: list[Expected] = []
        for other, subscriber in self._census.subscribers_of(request.publisher.topic):
            if not other.is_managed:
                entry = Expected(subscriber.record.id, other.node.id, other.node.name)
                (hung if other.hung else expected).append(entry)
        return Added(self.epoch, self.revision, tuple(expected), tuple(hung))

    def _add_subscriber(self, request: AddSubscriber, now: float, out: list[Outgoing]) -> Reply:
        _check(request.subscriber)
        member = self._census.meet(request.node, now)
        self._census.add_subscriber(member, request.subscriber)
        found = self._census.publishers_of(request.subscriber.topic)
        # A probe that cannot be sent takes a dead publisher out of the reply: nobody waits for its echo.
        out.extend(self.probes(sorted({remote.node_id for remote in found} - {member.node.id})))
        return Found(self.epoch, self.revision, found)

    def _join(self, request: Join, now: float, out: list[Outgoing]) -> Reply:
        records: tuple[PublisherRecord | SubscriberRecord, ...] = (*request.publishers, *request.subscribers)
        for record in records:
            _check(record)
        member = self._census.meet(request.node, now, is_managed=request.managed)
        kept = {record.id for record in request.publishers}
        for gone in [known for known in member.publishers if known not in kept]:
            self._census.remove_publisher(member.node.id, gone)
        kept = {record.id for record in request.subscribers}
        for gone in [known for known in member.subscribers if known not in kept]:
            self._census.remove_subscriber(member.node.id, gone)
        for subscriber in request.subscribers:
            self._census.add_subscriber(member, subscriber)
        for publisher in request.publishers:
            self._place(member, publisher, out)
        topics = {record.topic for record in request.subscribers}
        found = [remote for topic in sorted(topics) for remote in self._census.publishers_of(topic)]
        return Found(self.epoch, self.revision, tuple(found))

    def _renew(self, request: Renew, now: float) -> Reply:
        member = self._census.members.get(request.node_id)
        if member is None or request.epoch != self.epoch or not same_ids(member, request):
            if member is not None:
                member.renewed_at = now
            return Renewed(self.epoch, self.revision, again=True)
        self._census.renew(member, request.publishers, request.subscribers, now, request.cpu_ratio)
        topics: Iterable[str] = ()
        if self._census.publishers_revision > request.revision:
            topics = sorted({subscriber.record.topic for subscriber in member.subscribers.values()})
        changed = tuple(
            TopicPublishers(topic, self._census.publishers_of(topic))
            for topic in topics
            if self._census.topic_revision(topic) > request.revision
        )
        last_seqs, next_s = self._census.last_seqs(member), self._leases.renew(member, now)
        return Renewed(self.epoch, self.revision, False, changed, last_seqs, next_s=next_s)

    def _remove_publisher(self, request: RemovePublisher, out: list[Outgoing]) -> None:
        record = self._census.remove_publisher(request.node_id, request.id)
        if record is not None:
            gone = PublisherGone(
                self.epoch, self.revision, record.id, record.topic, is_closed=True, last_seq=request.last_seq
            )
            self._tell(record, gone, out)

    # ---- telling subscribers

    def _place(self, member: Member, record: PublisherRecord, out: list[Outgoing]) -> None:
        if self._census.add_publisher(member, record) and record.endpoints:
            remote = self._census.remote(member, record)
            self._tell(record, PublisherCame(self.epoch, self.revision, remote), out)

    def _forget(self, member: Member, out: list[Outgoing], *, is_closed: bool) -> None:
        publishers = list(member.publishers.values())
        self._census.forget(member.node.id)
        for publisher in publishers:
            gone = PublisherGone(
                self.epoch,
                self.revision,
                publisher.record.id,
                publisher.record.topic,
                is_closed=is_closed,
                last_seq=publisher.last_seq,
            )
            self._tell(publisher.record, gone, out)

    def _tell(self, record: PublisherRecord, push: Push, out: list[Outgoing]) -> None:
        told: set[str] = set()
        for member, _subscriber in self._census.subscribers_of(record.topic):
            if not member.is_managed and member.node.id not in told:
                told.add(member.node.id)
                out.append(Outgoing(member.node.id, push))


def _check(record: PublisherRecord | SubscriberRecord) -> None:
    try:
        check_topic(record.topic)
    except ValueError as error:
        raise WireError(str(error)) from error
