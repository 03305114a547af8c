"""Roster: who is there, by the liveliness tokens that were heard. No network; it has its own lock."""

from __future__ import annotations

import threading
from typing import TypeVar

from nep.backends.zenoh.keys import Alive
from nep.protocol.requests import Expected, NodeRecord, PublisherRecord, RemotePublisher, SubscriberRecord
from nep.protocol.service_wire import service_of, topic_of
from nep.protocol.topic_pattern import is_pattern, matches

__all__ = ["Roster"]

_Record = TypeVar("_Record", PublisherRecord, SubscriberRecord)
_MOST = 100_000
"""So many tokens are noted: whoever reaches a network of zenoh can make any number."""


class Roster:
    """Nodes, publishers and subscribers. Only `note` changes it; may be asked from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._nodes: dict[str, NodeRecord] = {}
        self._publishers: dict[str, dict[int, tuple[str, PublisherRecord]]] = {}
        self._subscribers: dict[str, dict[int, tuple[str, SubscriberRecord]]] = {}
        self._patterns: set[str] = set()
        self._count = 0

    def note(self, alive: Alive, *, is_there: bool) -> None:
        """A token came or went. A second one of the same id is the same."""
        with self._lock:
            if is_there and self._count >= _MOST:
                return
            node_id, record = alive
            if isinstance(record, NodeRecord):
                before = len(self._nodes)
                self._nodes.pop(node_id, None)
                if is_there:
                    self._nodes[node_id] = record
                self._count += len(self._nodes) - before
            elif isinstance(record, PublisherRecord):
                self._count += _note(self._publishers, (node_id, record), is_there)
            else:
                self._count += _note(self._subscribers, (node_id, record), is_there)
                if is_pattern(record.topic):
                    self._patterns.discard(record.topic)
                    if record.topic in self._subscribers:
                        self._patterns.add(record.topic)

    def count_subscribers(self, topic: str) -> int:
        """How many hear a topic."""
        found = len(self._subscribers.get(topic, ()))
        if not self._patterns:
            return found
        with self._lock:
            return found + sum(len(self._subscribers[each]) for each in self._matching(topic))

    def _matching(self, topic: str) -> list[str]:
        """The other topics of subscribers that match this one. With the lock held."""
        return [each for each in self._patterns if each != topic and matches(each, topic)]

    @property
    def published(self) -> tuple[str, ...]:
        """The topics that have publishers."""
        with self._lock:
            return tuple(each for each in self._publishers if service_of(each) is None)

    @property
    def served(self) -> tuple[str, ...]:
        """The services that have servers."""
        with self._lock:
            return tuple(name for each in self._publishers if (name := service_of(each)) is not None)

    def servers_of(self, service: str) -> tuple[str, ...]:
        """Where the servers of a service answer, those that are there for longest first."""
        with self._lock:
            there = self._publishers.get(topic_of(service), {}).values()
            return tuple(sorted(record.endpoints[0] for _node_id, record in there if record.endpoints))

    def subscribers_of(self, topic: str) -> tuple[Expected, ...]:
        """Those that hear a topic."""
        with self._lock:
            there = [
                found
                for each in (topic, *self._matching(topic))
                for found in self._subscribers.get(each, {}).values()
            ]
            return tuple(Expected(each.id, node_id, self._name(node_id)) for node_id, each in there)

    def publishers_of(self, topic: str) -> tuple[RemotePublisher, ...]:
        """Those on a topic."""
        with self._lock:
            there = self._publishers.get(topic, {}).values()
            return tuple(RemotePublisher(each, node_id, self._name(node_id)) for node_id, each in there)

    def remote(self, node_id: str, record: PublisherRecord) -> RemotePublisher:
        """A publisher with its node's name."""
        with self._lock:
            return RemotePublisher(record, node_id, self._name(node_id))

    def members(
        self,
    ) -> list[tuple[NodeRecord, tuple[PublisherRecord, ...], tuple[SubscriberRecord, ...]]]:
        """All nodes with what they have."""
        with self._lock:
            publishers = _by_node(self._publishers)
            subscribers = _by_node(self._subscribers)
            return [
                (node, tuple(publishers.get(each, ())), tuple(subscribers.get(each, ())))
                for each, node in self._nodes.items()
            ]

    def _name(self, node_id: str) -> str:
        node = self._nodes.get(node_id)
        return "" if node is None else node.name


def _note(
    table: dict[str, dict[int, tuple[str, _Record]]], alive: tuple[str, _Record], is_there: bool
) -> int:
    """Put it in or take it out; how many more there are."""
    record = alive[1]
    there = table.setdefault(record.topic, {})
    before = len(there)
    there.pop(record.id, None)
    if is_there:
        there[record.id] = alive
    if not there:
        del table[record.topic]
    return len(there) - before


def _by_node(table: dict[str, dict[int, tuple[str, _Record]]]) -> dict[str, list[_Record]]:
    found: dict[str, list[_Record]] = {}
    for there in table.values():
        for node_id, record in there.values():
            found.setdefault(node_id, []).append(record)
    return found
