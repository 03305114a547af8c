"""Alerts for writers and readers that DDS doesn't match because their types or QoS differ.

DDS itself reports such mismatches only in the program's log, if at all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from nep.backends.ros2.names import ros_type
from nep.backends.ros2.participant import DdsEndpoint
from nep.i18n import _
from nep.protocol.graph_view import Alert

_MAX_NAMES = 3
"""Maximum number of node names in an alert."""
_MAX_ENDPOINTS = 100
"""Maximum number of writers, and maximum number of readers, that are compared per topic."""


@dataclass(frozen=True)
class NodeEndpoint:
    """Writer or reader, with the name of its node."""

    node: str
    endpoint: DdsEndpoint


def mismatches(
    topic: str, writers: Sequence[NodeEndpoint], readers: Sequence[NodeEndpoint]
) -> Iterator[Alert]:
    """Yield an alert for each kind of mismatch between the writers and readers of a topic."""
    readers, writers = tuple(_merge_readers(readers[:_MAX_ENDPOINTS])), writers[:_MAX_ENDPOINTS]
    kinds: tuple[tuple[Callable[[DdsEndpoint, DdsEndpoint], bool], Callable[..., Alert]], ...] = (
        (lambda writer, reader: writer.type != reader.type, _type_alert),
        (_have_different_definitions, _definition_alert),
        (lambda writer, reader: reader.is_reliable and not writer.is_reliable, _reliability_alert),
        (lambda writer, reader: reader.is_latched and not writer.is_latched, _durability_alert),
    )
    for is_mismatch, create_alert in kinds:
        pairs = [
            (writer, reader)
            for writer in writers
            for reader in readers
            if is_mismatch(writer.endpoint, reader.endpoint)
        ]
        if pairs:
            yield create_alert(
                topic, [writer for writer, _reader in pairs], [reader for _writer, reader in pairs]
            )


def _merge_readers(readers: Iterable[NodeEndpoint]) -> Iterator[NodeEndpoint]:
    # A subscriber of nep may have two readers; merges them into one with the weaker requirements.
    merged: dict[str, NodeEndpoint] = {}
    for reader in readers:
        key = reader.endpoint.user_data.get("nepid") or reader.endpoint.gid.hex()
        existing = merged.get(key)
        is_latched = reader.endpoint.is_latched and (existing is None or existing.endpoint.is_latched)
        merged[key] = replace(reader, endpoint=replace(reader.endpoint, is_latched=is_latched))
    yield from merged.values()


def _have_different_definitions(writer: DdsEndpoint, reader: DdsEndpoint) -> bool:
    hashes = writer.user_data.get("typehash", ""), reader.user_data.get("typehash", "")
    return writer.type == reader.type and all(hashes) and hashes[0] != hashes[1]


def _node_names(endpoints: Iterable[NodeEndpoint]) -> str:
    unique_names = sorted({each.node for each in endpoints})
    names = ", ".join(f"“{name}”" for name in unique_names[:_MAX_NAMES])
    if len(unique_names) <= _MAX_NAMES:
        return names
    return _("{names} and {count} more").format(names=names, count=len(unique_names) - _MAX_NAMES)


def _type_of(endpoints: Sequence[NodeEndpoint]) -> str:
    return ros_type(endpoints[0].endpoint.type)


def _type_alert(topic: str, writers: Sequence[NodeEndpoint], readers: Sequence[NodeEndpoint]) -> Alert:
    return Alert(
        f"ros2-type:{topic}",
        _(
            "“{topic}” from {writers} doesn't reach {readers}: the subscriber requests “{wanted}”, but the "
            "publisher offers “{sent}”"
        ).format(
            readers=_node_names(readers),
            writers=_node_names(writers),
            topic=topic,
            wanted=_type_of(readers),
            sent=_type_of(writers),
        ),
        _("Use the same type in all programs, or rename one of the topics."),
    )


def _definition_alert(topic: str, writers: Sequence[NodeEndpoint], readers: Sequence[NodeEndpoint]) -> Alert:
    return Alert(
        f"ros2-definition:{topic}",
        _("{readers} and {writers} have different definitions of “{kind}” on “{topic}”").format(
            readers=_node_names(readers), writers=_node_names(writers), kind=_type_of(readers), topic=topic
        ),
        _(
            "Use the same .msg file and the same ROS_DISTRO for both programs; until then, received "
            "values are wrong."
        ),
    )


def _reliability_alert(topic: str, writers: Sequence[NodeEndpoint], readers: Sequence[NodeEndpoint]) -> Alert:
    return Alert(
        f"ros2-reliability:{topic}",
        _(
            "“{topic}” from {writers} doesn't reach {readers}: the subscriber requests “reliable”, but the "
            "publisher offers “best effort”"
        ).format(readers=_node_names(readers), writers=_node_names(writers), topic=topic),
        _("Subscribe with qos='sensor' or qos='best_effort', or publish with qos='reliable'."),
    )


def _durability_alert(topic: str, writers: Sequence[NodeEndpoint], readers: Sequence[NodeEndpoint]) -> Alert:
    return Alert(
        f"ros2-durability:{topic}",
        _(
            "“{topic}” from {writers} doesn't reach {readers}: the subscriber requests earlier messages "
            "(“transient local”), but the publisher doesn't keep them (“volatile”)"
        ).format(readers=_node_names(readers), writers=_node_names(writers), topic=topic),
        _("Publish with latched=True, or subscribe with the durability “volatile”."),
    )
