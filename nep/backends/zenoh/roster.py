"""Known nodes, publishers and subscribers, from their liveliness tokens. Performs no I/O. Thread-safe."""

from __future__ import annotations

import threading
from typing import TypeVar

from nep.backends.zenoh.keys import LiveToken
from nep.protocol.requests import (
    ExpectedSubscriber,
    NodeRecord,
    PublisherRecord,
    RemotePublisher,
    SubscriberRecord,
)
from nep.protocol.service_wire import service_of, topic_of
from nep.protocol.topic_pattern import is_pattern, matches

_Record = TypeVar("_Record", PublisherRecord, SubscriberRecord)
_MAX_TOKENS = 100_000
"""Maximum number of liveliness tokens, because any program in the network can create tokens."""


class Roster:
    """Known nodes, publishers and subscribers, including servers and clients. Thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._nodes: dict[str, NodeRecord] = {}
        self._publishers: dict[str, dict[int, tuple[str, PublisherRecord]]] = {}
        self._subscribers: dict[str, dict[int, tuple[str, SubscriberRecord]]] = {}
        self._patterns: set[str] = set()
        self._token_count = 0

    def update(self, token: LiveToken, *, is_present: bool) -> None:
        """Add or remove a node, publisher or subscriber. Idempotent.

        Args:
            token: Liveliness token.
            is_present: True to add the token, False to remove it.
        """
        with self._lock:
            if is_present and self._token_count >= _MAX_TOKENS:
                return
            node_id, record = token
            if isinstance(record, NodeRecord):
                before = len(self._nodes)
                self._nodes.pop(node_id, None)
                if is_present:
                    self._nodes[node_id] = record
                self._token_count += len(self._nodes) - before
            elif isinstance(record, PublisherRecord):
                self._token_count += _update_table(self._publishers, (node_id, record), is_present)
            else:
                self._token_count += _update_table(self._subscribers, (node_id, record), is_present)
                if is_pattern(record.topic):
                    self._patterns.discard(record.topic)
                    if record.topic in self._subscribers:
                        self._patterns.add(record.topic)

    def count_subscribers(self, topic: str) -> int:
        """Return the number of subscribers of a topic."""
        count = len(self._subscribers.get(topic, ()))
        if not self._patterns:
            return count
        with self._lock:
            return count + sum(len(self._subscribers[each]) for each in self._matching_patterns_locked(topic))

    def _matching_patterns_locked(self, topic: str) -> list[str]:
        # Returns the patterns that match `topic`, except `topic` itself.
        return [each for each in self._patterns if each != topic and matches(each, topic)]

    @property
    def published_topics(self) -> tuple[str, ...]:
        """Names of topics that have publishers."""
        with self._lock:
            return tuple(each for each in self._publishers if service_of(each) is None)

    @property
    def service_names(self) -> tuple[str, ...]:
        """Names of services that have servers."""
        with self._lock:
            return tuple(name for each in self._publishers if (name := service_of(each)) is not None)

    def servers_of(self, service: str) -> tuple[str, ...]:
        """Return the keys of a service's servers, oldest server first."""
        with self._lock:
            entries = self._publishers.get(topic_of(service), {}).values()
            return tuple(sorted(record.endpoints[0] for _node_id, record in entries if record.endpoints))

    def subscribers_of(self, topic: str) -> tuple[ExpectedSubscriber, ...]:
        """Return the subscribers of a topic."""
        with self._lock:
            entries = [
                entry
                for each in (topic, *self._matching_patterns_locked(topic))
                for entry in self._subscribers.get(each, {}).values()
            ]
            return tuple(
                ExpectedSubscriber(each.id, node_id, self._node_name(node_id)) for node_id, each in entries
            )

    def publishers_of(self, topic: str) -> tuple[RemotePublisher, ...]:
        """Return the publishers of a topic."""
        with self._lock:
            entries = self._publishers.get(topic, {}).values()
            return tuple(
                RemotePublisher(each, node_id, self._node_name(node_id)) for node_id, each in entries
            )

    def remote_publisher(self, node_id: str, record: PublisherRecord) -> RemotePublisher:
        """Return a publisher's record together with the id and name of its node."""
        with self._lock:
            return RemotePublisher(record, node_id, self._node_name(node_id))

    def members(
        self,
    ) -> list[tuple[NodeRecord, tuple[PublisherRecord, ...], tuple[SubscriberRecord, ...]]]:
        """Return all nodes, each with its publishers and subscribers."""
        with self._lock:
            publishers = _group_by_node(self._publishers)
            subscribers = _group_by_node(self._subscribers)
            return [
                (node, tuple(publishers.get(each, ())), tuple(subscribers.get(each, ())))
                for each, node in self._nodes.items()
            ]

    def _node_name(self, node_id: str) -> str:
        node = self._nodes.get(node_id)
        return "" if node is None else node.name


def _update_table(
    table: dict[str, dict[int, tuple[str, _Record]]], entry: tuple[str, _Record], is_present: bool
) -> int:
    # Returns the change of the number of entries.
    record = entry[1]
    entries = table.setdefault(record.topic, {})
    before = len(entries)
    entries.pop(record.id, None)
    if is_present:
        entries[record.id] = entry
    if not entries:
        del table[record.topic]
    return len(entries) - before


def _group_by_node(table: dict[str, dict[int, tuple[str, _Record]]]) -> dict[str, list[_Record]]:
    records_by_node: dict[str, list[_Record]] = {}
    for entries in table.values():
        for node_id, record in entries.values():
            records_by_node.setdefault(node_id, []).append(record)
    return records_by_node
