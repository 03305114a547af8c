"""Viewing: the census as frozen values, with the alerts that follow from it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from nep.census import Census, Member, Publisher, Subscriber
from nep.views import Alert, GraphView, NodeInfo, PublisherInfo, SubscriberInfo, TopicInfo

__all__ = ["view_of"]


def view_of(census: Census, epoch: int) -> GraphView:
    """Everything that the census knows now."""
    nodes = {each.node.id: _node_info(each) for each in census.members.values()}
    topics = {name: _topic_info(census, name) for name in census.topics}
    return GraphView(epoch, census.revision, nodes, topics, tuple(_alerts(census)))


def _node_info(member: Member) -> NodeInfo:
    node = member.node
    return NodeInfo(
        node.id,
        node.name,
        node.host,
        node.pid,
        node.language,
        node.generation,
        node.since_ns,
        member.cpu_ratio,
    )


def _topic_info(census: Census, name: str) -> TopicInfo:
    publishers = census.publishing(name)
    subscribers = list(census.subscribers_of(name))
    first = publishers[0][1].record if publishers else None
    counted = _counted(publishers)
    rates = [rates for each in counted if (rates := each.meter.rates()) is not None]
    stamps = [each.last_stamp_ns for each in counted if each.last_stamp_ns is not None]
    lost, loss_ratio = _losses(each for _member, each in subscribers)
    return TopicInfo(
        name,
        first.msg_type if first else subscribers[0][1].record.msg_type,
        first.codec if first else "",
        tuple(_publisher_info(member, each) for member, each in publishers),
        tuple(
            SubscriberInfo(each.record.id, member.node.id, each.received, each.lost)
            for member, each in subscribers
        ),
        sum(rate for rate, _ in rates) if rates else None,
        sum(size for _, size in rates) if rates else None,
        max(stamps) if stamps else None,
        lost,
        loss_ratio,
    )


def _counted(publishers: Iterable[tuple[Member, Publisher]]) -> list[Publisher]:
    """Those whose messages are counted: the gateway's own publishers repeat what the originals sent."""
    known = list(publishers)
    has_originals = any(member.node.generation not in {"native", "gateway"} for member, _ in known)
    return [each for member, each in known if not (has_originals and member.node.generation == "gateway")]


def _losses(subscribers: Iterable[Subscriber]) -> tuple[int | None, float | None]:
    """(lost messages, their share); None where nobody counts."""
    counts = [(each.received or 0, each.lost) for each in subscribers if each.lost is not None]
    if not counts:
        return None, None
    lost = sum(lost for _, lost in counts)
    total = lost + sum(received for received, _ in counts)
    return lost, lost / total if total else 0.0


def _publisher_info(member: Member, publisher: Publisher) -> PublisherInfo:
    rates = publisher.meter.rates()
    return PublisherInfo(
        publisher.record.id,
        member.node.id,
        publisher.record.endpoints,
        publisher.record.latched,
        publisher.count,
        publisher.bytes,
        publisher.last_seq,
        publisher.last_stamp_ns,
        None if rates is None else rates[0],
        None if rates is None else rates[1],
    )


def _alerts(census: Census) -> Iterator[Alert]:
    yield from census.reported_alerts
    by_name: dict[str, int] = {}
    for member in census.members.values():
        by_name[member.node.name] = by_name.get(member.node.name, 0) + 1
    for name, count in sorted(by_name.items()):
        if count > 1:
            yield Alert(
                f"name:{name}",
                f"{count} programs call themselves “{name}”",
                "Give each program a name of its own; all of them go on working.",
            )
    for topic in census.topics:
        yield from _type_alert(census, topic)
        yield from _message_alert(census, topic)
    for member in census.members.values():
        if member.hung:
            yield Alert(
                f"missing:{member.node.id}",
                f"“{member.node.name}” does not answer {_names(member.hung)}",
                "It may be busy or stopped in a debugger. What is published meanwhile may not reach it.",
            )


def _type_alert(census: Census, topic: str) -> Iterator[Alert]:
    types: dict[str, list[str]] = {}
    for member, publisher in census.publishing(topic):
        if member.node.generation != "gateway":
            types.setdefault(publisher.record.msg_type, []).append(member.node.name)
    if len(types) > 1:
        said = " and ".join(f"{_names(names)} as “{kind}”" for kind, names in sorted(types.items()))
        yield Alert(
            f"type:{topic}",
            f"The topic “{topic}” has {len(types)} types: it is published by {said}",
            "Use the same type in all programs, or give one of the topics another name.",
        )


def _message_alert(census: Census, topic: str) -> Iterator[Alert]:
    for member, subscriber in census.subscribers_of(topic):
        if subscriber.problem:
            yield Alert(
                f"message:{topic}",
                f"“{member.node.name}” cannot read “{topic}”: {subscriber.problem}",
                "Look at the program that publishes it.",
            )
            return


def _names(names: Iterable[str]) -> str:
    return ", ".join(f"“{name}”" for name in sorted(names))
