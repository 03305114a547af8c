"""Snapshots of the registry as immutable values, and the alerts derived from them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from nep.i18n import _, format_list
from nep.masters.registry import RegisteredNode, RegisteredPublisher, RegisteredSubscriber, Registry
from nep.protocol.graph_view import (
    Alert,
    ClientInfo,
    GraphView,
    NodeInfo,
    PatternInfo,
    PublisherInfo,
    ServerInfo,
    ServiceInfo,
    SubscriberInfo,
    TopicInfo,
)
from nep.protocol.requests import clamp_count
from nep.protocol.service_wire import SURVEY_PREFIX, service_of

_MAX_NAMES = 5
"""Maximum number of program names in an alert."""


class GraphSnapshotBuilder:
    """Factory of graph snapshots. Unchanged parts are the same objects as in the previous snapshot."""

    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        self._topics: dict[str, TopicInfo | None] = {}
        """Topics of the previous snapshot; None for names that occur only as patterns of subscribers."""
        self._patterns: dict[str, PatternInfo] = {}
        self._alerts: dict[str, tuple[Alert, ...]] = {}

    def view(self, epoch: int) -> GraphView:
        """Return a snapshot of the registry for the master's `epoch`."""
        registry, changed_topics = self._registry, self._registry.changed_topics
        names: list[str] = []
        service_topics: list[str] = []
        for name in registry.topics:
            (names if service_of(name) is None else service_topics).append(name)
        for name in changed_topics:
            self._topics.pop(name, None)
            self._patterns.pop(name, None)
            self._alerts.pop(name, None)
        changed_topics.clear()
        cached = self._topics
        if len(cached) > len(names) or not cached.keys() <= set(names):
            for removed_name in cached.keys() - set(names):
                del cached[removed_name]
                self._patterns.pop(removed_name, None)
                self._alerts.pop(removed_name, None)
        for name in names:
            if name not in cached:
                publishing, subscribing = registry.publishers_with_nodes(name), registry.subscribers_of(name)
                cached[name] = self._topic(name, publishing, subscribing)
                has_problem = any(each.problem for _member, each in subscribing)
                has_problem = has_problem or any(each.problem for _member, each in publishing)
                if len(publishing) > 1 or has_problem:
                    self._alerts[name] = tuple(_topic_alerts(name, publishing, subscribing))
        nodes = {each.node.id: _node_info(each) for each in registry.members.values()}
        topics = {name: topic for name in names if (topic := cached[name]) is not None}
        services = {each.name: each for each in (_service_info(name, registry) for name in service_topics)}
        alerts = (
            *self._all_alerts(),
            *_service_alerts(services, registry),
            *_original_client_alerts(services, registry),
        )
        patterns = {name: self._patterns[name] for name in sorted(self._patterns)}
        return GraphView(
            epoch, registry.revision, nodes, topics, alerts, services=services, patterns=patterns
        )

    def _topic(
        self,
        name: str,
        publishing: list[tuple[RegisteredNode, RegisteredPublisher]],
        subscribing: list[tuple[RegisteredNode, RegisteredSubscriber]],
    ) -> TopicInfo | None:
        # Separates subscribers whose pattern has this name; None if nothing else is left.
        if name in self._registry.patterns:
            pattern_subscribers = [each for each in subscribing if each[1].record.pattern]
            subscribing = [each for each in subscribing if not each[1].record.pattern]
            infos = tuple(_subscriber_info(*each) for each in pattern_subscribers)
            self._patterns[name] = PatternInfo(name, pattern_subscribers[0][1].record.msg_type, infos)
        return _topic_info(name, publishing, subscribing) if publishing or subscribing else None

    def _all_alerts(self) -> Iterator[Alert]:
        yield from self._registry.reported_alerts
        yield from _name_alerts(self._registry)
        for name in sorted(self._alerts):
            yield from self._alerts[name]
        yield from _unconnected_alerts(self._registry)


def _node_info(member: RegisteredNode) -> NodeInfo:
    node, clock = member.node, member.clock
    return NodeInfo(
        id=node.id,
        name=node.name,
        host=node.host,
        pid=node.pid,
        language=node.language,
        generation=node.generation,
        since_ns=node.since_ns,
        cpu_ratio=member.cpu_ratio,
        clock_offset_ns=None if clock is None else clock.offset_ns,
        clock_uncertainty_ns=None if clock is None else clock.uncertainty_ns,
    )


def _topic_info(
    name: str,
    publishing: list[tuple[RegisteredNode, RegisteredPublisher]],
    subscribing: list[tuple[RegisteredNode, RegisteredSubscriber]],
) -> TopicInfo:
    # Plain loops: this dominates the time of a snapshot with thousands of topics.
    first = publishing[0][1].record if publishing else None
    rate = bandwidth = None
    stamp_ns: int | None = None
    is_alone = len(publishing) < 2
    rated_publishers = publishing if is_alone else _publishers_for_rate(publishing)
    publishers, subscribers = [], []
    for entry in publishing:
        member, publisher = entry
        rates = publisher.meter.rates()
        publishers.append(_publisher_info(member, publisher, rates))
        if is_alone or entry in rated_publishers:
            if rates is not None:
                rate, bandwidth = (rate or 0.0) + rates[0], (bandwidth or 0.0) + rates[1]
            if publisher.last_stamp_ns is not None:
                stamp_ns = max(stamp_ns or 0, publisher.last_stamp_ns)
    lost: int | None = None
    received = 0
    for member, subscriber in subscribing:
        subscribers.append(_subscriber_info(member, subscriber))
        if subscriber.lost is not None:
            lost = clamp_count((lost or 0) + subscriber.lost)
            received += subscriber.received or 0
    return TopicInfo(
        name=name,
        msg_type=first.msg_type if first else subscribing[0][1].record.msg_type,
        codec=first.codec if first else "",
        publishers=tuple(publishers),
        subscribers=tuple(subscribers),
        rate_hz=rate,
        bandwidth_Bps=bandwidth,
        last_stamp_ns=stamp_ns,
        lost=lost,
        loss_ratio=None if lost is None else lost / (lost + received) if lost else 0.0,
    )


def _publishers_for_rate(
    publishing: list[tuple[RegisteredNode, RegisteredPublisher]],
) -> list[tuple[RegisteredNode, RegisteredPublisher]]:
    # Gateway publishers repeat messages of original programs, and would count them twice.
    has_originals = any(member.node.generation not in {"native", "gateway"} for member, _ in publishing)
    return [each for each in publishing if not (has_originals and each[0].node.generation == "gateway")]


def _publisher_info(
    member: RegisteredNode, publisher: RegisteredPublisher, rates: tuple[float, float] | None
) -> PublisherInfo:
    record = publisher.record
    return PublisherInfo(
        id=record.id,
        node_id=member.node.id,
        endpoints=record.endpoints,
        latched=record.latched,
        count=publisher.count,
        bytes=publisher.bytes,
        last_seq=publisher.last_seq,
        last_stamp_ns=publisher.last_stamp_ns,
        rate_hz=None if rates is None else rates[0],
        bandwidth_Bps=None if rates is None else rates[1],
    )


def _subscriber_info(member: RegisteredNode, subscriber: RegisteredSubscriber) -> SubscriberInfo:
    return SubscriberInfo(
        id=subscriber.record.id,
        node_id=member.node.id,
        received=subscriber.received,
        lost=subscriber.lost,
    )


def _service_info(topic: str, registry: Registry) -> ServiceInfo:
    publishing, subscribing = registry.publishers_with_nodes(topic), registry.subscribers_of(topic)
    servers = tuple(
        ServerInfo(each.record.id, member.node.id, each.record.endpoints, each.count, each.errors, each.bytes)
        for member, each in publishing
    )
    clients = tuple(
        ClientInfo(each.record.id, member.node.id, each.received, each.lost) for member, each in subscribing
    )
    types = [each.record.msg_type for _member, each in publishing]
    types = types or [each.record.msg_type for _member, each in subscribing]
    return ServiceInfo(
        service_of(topic) or topic,
        types[0],
        servers,
        clients,
        clamp_count(sum(each.calls for each in servers)),
        clamp_count(sum(each.errors for each in servers)),
    )


def _service_alerts(services: Mapping[str, ServiceInfo], registry: Registry) -> Iterator[Alert]:
    for name in sorted(services):
        servers = services[name].servers
        if len(servers) > 1 and not name.startswith(SURVEY_PREFIX):
            yield Alert(
                f"service:{name}",
                _("The service “{service}” has {count} servers: {nodes}").format(
                    service=name,
                    count=len(servers),
                    nodes=_format_names(registry.members[each.node_id].node.name for each in servers),
                ),
                _(
                    "Clients call the first server and use another one only when it stops. Rename one of the "
                    "services."
                ),
            )


def _original_client_alerts(services: Mapping[str, ServiceInfo], registry: Registry) -> Iterator[Alert]:
    # Original programs can only connect to the port that the gateway assigned to the service.
    for name, service in sorted(services.items()):
        clients = [each for each in service.clients if _is_original(each.node_id, registry)]
        servers = service.servers
        if clients and servers and not any(_is_original(each.node_id, registry) for each in servers):
            yield Alert(
                f"service:{name}:original",
                _("{clients} of the original NEP can't call the service “{service}” of {servers}").format(
                    clients=_format_names(registry.members[each.node_id].node.name for each in clients),
                    service=name,
                    servers=_format_names(registry.members[each.node_id].node.name for each in servers),
                ),
                _(
                    "Use a fixed address in both programs: nep.client(ip, port) in the client, "
                    "node.direct(ip, "
                    "port) in the server."
                ),
            )


def _is_original(node_id: str, registry: Registry) -> bool:
    member = registry.members.get(node_id)
    return member is not None and member.node.generation in {"A", "B"}


def _name_alerts(registry: Registry) -> Iterator[Alert]:
    counts_by_name: dict[str, int] = {}
    for member in registry.members.values():
        counts_by_name[member.node.name] = counts_by_name.get(member.node.name, 0) + 1
    for name, count in sorted(counts_by_name.items()):
        if count > 1:
            yield Alert(
                f"name:{name}",
                _("{count} programs are named “{name}”").format(count=count, name=name),
                _("Use a different name for each program. Until then, all of them keep working."),
            )


def _unconnected_alerts(registry: Registry) -> Iterator[Alert]:
    for member in registry.members.values():
        if member.unconnected_node_ids:
            yield Alert(
                f"missing:{member.node.id}",
                _("“{node}” doesn't respond to {others}").format(
                    node=member.node.name,
                    others=_format_names(_names_of(registry, member.unconnected_node_ids)),
                ),
                _("It may be busy or stopped in a debugger. Messages published in the meantime may be lost."),
            )


def _topic_alerts(
    topic: str,
    publishing: list[tuple[RegisteredNode, RegisteredPublisher]],
    subscribing: list[tuple[RegisteredNode, RegisteredSubscriber]],
) -> Iterator[Alert]:
    types: dict[str, list[str]] = {}
    for member, publisher in publishing:
        if member.node.generation != "gateway":
            types.setdefault(publisher.record.msg_type, []).append(member.node.name)
    if len(types) > 1:
        parts = [
            _("{nodes} as “{kind}”").format(nodes=_format_names(names), kind=kind)
            for kind, names in sorted(types.items())
        ]
        yield Alert(
            f"type:{topic}",
            _("The topic “{topic}” has {count} types. Publishers: {nodes}").format(
                topic=topic, count=len(types), nodes=format_list(parts)
            ),
            _("Use the same type in all programs, or rename one of the topics."),
        )
    for member, publisher in publishing:
        if publisher.problem:
            yield Alert(
                f"encode:{topic}",
                _("“{node}” can't publish on “{topic}”: {problem}").format(
                    node=member.node.name, topic=topic, problem=publisher.problem
                ),
                _("Fix the program: its messages aren't being sent."),
            )
            break
    for member, subscriber in subscribing:
        if subscriber.problem:
            yield Alert(
                f"message:{topic}",
                _("“{node}” can't read “{topic}”: {problem}").format(
                    node=member.node.name, topic=topic, problem=subscriber.problem
                ),
                _("Check the program that publishes this topic."),
            )
            return


def _names_of(registry: Registry, node_ids: Iterable[str]) -> set[str]:
    return {registry.members[each].node.name for each in node_ids if each in registry.members} or {
        _("programs")
    }


def _format_names(nodes: Iterable[str]) -> str:
    # Shortened list of names.
    unique = sorted(set(nodes))
    names = ", ".join(f"“{name}”" for name in unique[:_MAX_NAMES])
    if len(unique) <= _MAX_NAMES:
        return names
    return _("{names} and {count} more").format(names=names, count=len(unique) - _MAX_NAMES)
