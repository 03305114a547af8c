"""`GraphRegistrar`: registers original programs in the master's graph, with message counts.

The nodes have the generation "A" or "B".
"""

from __future__ import annotations

import socket
import time
from collections.abc import Callable
from dataclasses import dataclass
from hashlib import blake2b

from nep.errors import BadTopicError
from nep.programs.gateway.processes import cpu_load_of
from nep.programs.gateway.programs import OriginalProgram, TopicLink
from nep.programs.gateway.relay import Key
from nep.programs.gateway.requests import LOOPBACK
from nep.protocol.requests import (
    Join,
    Leave,
    NodeRecord,
    PublisherCount,
    PublisherRecord,
    Renew,
    Reply,
    Request,
    SubscriberCount,
    SubscriberRecord,
)
from nep.protocol.service_wire import ORIGINAL_CODEC, SERVICE_TYPE, check_service, topic_of
from nep.protocol.wire import check_topic
from nep.system.cpu import CpuLoad
from nep.text import escaped, shortened

_LANGUAGES = {
    "python": "Python",
    "javascript": "JavaScript",
    "csharp": "C#",
    "java": "Java",
    "matlab": "MATLAB",
}
_MAX_NAME_LENGTH = 100


@dataclass
class _TopicCount:
    """Number and total size of the messages that original programs have published on a topic."""

    messages: int = 0
    bytes: int = 0
    last_ns: int | None = None


class GraphRegistrar:
    """Registrar of original programs in the master's graph.

    If several original programs publish on a topic, the publisher of a message is unknown; then the
    statistics of the topic are reported for the first of these programs.

    Args:
        submit: Executes a request in the master.
        epoch: Epoch of the master.
        load_of: Returns the CPU load meter of a process, given its id.
    """

    def __init__(
        self,
        submit: Callable[[Request], Reply | None],
        epoch: int,
        load_of: Callable[[int], CpuLoad] = cpu_load_of,
    ) -> None:
        self._submit = submit
        self._epoch = epoch
        self._load_of = load_of
        self._loads: dict[str, CpuLoad] = {}
        self._joins: dict[str, Join] = {}
        self._first_seen_ns: dict[str, int] = {}
        self._counts: dict[Key, _TopicCount] = {}
        self._stat_keys: dict[int, Key] = {}

    def count(self, key: Key, size_bytes: int) -> None:
        """Count a message of an original program.

        Args:
            key: Topic and codec.
            size_bytes: Size of the message.
        """
        topic_count = self._counts.setdefault(key, _TopicCount())
        topic_count.messages += 1
        topic_count.bytes += size_bytes
        topic_count.last_ns = time.time_ns()

    def set_programs(self, programs: tuple[OriginalProgram, ...]) -> None:
        """Register these programs, and unregister all others."""
        joins = {program.node_id: self._join_request(program) for program in programs}
        for node_id in [known_id for known_id in self._joins if known_id not in joins]:
            del self._joins[node_id]
            self._first_seen_ns.pop(node_id, None)
            self._loads.pop(node_id, None)
            self._submit(Leave(node_id))
        for node_id, join in joins.items():
            if self._joins.get(node_id) != join:
                self._joins[node_id] = join
                self._submit(join)
        self._assign_stats(programs)

    def renew(self) -> None:
        """Renew the leases of the programs and send their statistics to the master."""
        for node_id, join in self._joins.items():
            publishers = tuple(self._publisher_count(record) for record in join.publishers)
            subscribers = tuple(SubscriberCount(record.id, None, None) for record in join.subscribers)
            load = self._cpu_load(node_id, join.node.pid)
            self._submit(Renew(node_id, self._epoch, 0, publishers, subscribers, load))

    def close(self) -> None:
        """Remove all programs from the graph."""
        self.set_programs(())

    def _cpu_load(self, node_id: str, pid: int | None) -> float | None:
        if pid is None:
            return None
        if node_id not in self._loads:
            self._loads[node_id] = self._load_of(pid)
        return self._loads[node_id].ratio()

    def _join_request(self, program: OriginalProgram) -> Join:
        first_seen_ns = self._first_seen_ns.setdefault(program.node_id, time.time_ns())
        language = program.language or ""
        node = NodeRecord(
            program.node_id,
            shortened(
                escaped(program.name), _MAX_NAME_LENGTH
            ),  # escaped: names of original programs aren't validated
            socket.gethostname(),
            program.pid,
            _LANGUAGES.get(language, escaped(language)),
            program.generation,
            first_seen_ns,
        )
        links = [link for link in program.links if _is_valid_link(link)]
        return Join(
            node,
            self._epoch,
            tuple(
                _publisher_record(_stable_id(program, link), link)
                for link in links
                if link.role in {"publisher", "server"}
            ),
            tuple(
                _subscriber_record(_stable_id(program, link), link)
                for link in links
                if link.role in {"subscriber", "client"}
            ),
            managed=True,
        )

    def _assign_stats(self, programs: tuple[OriginalProgram, ...]) -> None:
        id_by_key: dict[Key, int] = {}
        for program in programs:
            for link in program.links:
                if link.role == "publisher":
                    id_by_key.setdefault((link.topic, link.codec), _stable_id(program, link))
        self._stat_keys = {publisher_id: key for key, publisher_id in id_by_key.items()}
        self._counts = {key: topic_count for key, topic_count in self._counts.items() if key in id_by_key}

    def _publisher_count(self, record: PublisherRecord) -> PublisherCount:
        key = self._stat_keys.get(record.id)
        topic_count = self._counts.get(key, _TopicCount()) if key is not None else _TopicCount()
        return PublisherCount(
            record.id, topic_count.messages, topic_count.bytes, topic_count.messages, topic_count.last_ns
        )


def _publisher_record(id: int, link: TopicLink) -> PublisherRecord:
    if link.role == "server":
        endpoint = f"tcp://{LOOPBACK}:{link.port}"
        return PublisherRecord(id, topic_of(link.topic), SERVICE_TYPE, ORIGINAL_CODEC, (endpoint,))
    return PublisherRecord(id, link.topic, _type(link), link.codec)


def _subscriber_record(id: int, link: TopicLink) -> SubscriberRecord:
    if link.role == "client":
        return SubscriberRecord(id, topic_of(link.topic), SERVICE_TYPE)
    return SubscriberRecord(id, link.topic, _type(link))


def _type(link: TopicLink) -> str:
    return link.codec


def _stable_id(program: OriginalProgram, link: TopicLink) -> int:
    # Stable id for a publisher or subscriber that has none.
    text = f"{program.node_id}\0{link.role}\0{link.topic}\0{link.codec}"
    digest = blake2b(text.encode("utf-8", "surrogatepass"), digest_size=8).digest()
    return int.from_bytes(digest, "big") >> 1 or 1


def _is_valid_link(link: TopicLink) -> bool:
    if link.role == "server" and link.port is None:
        return False
    try:
        (check_service if link.role in {"server", "client"} else check_topic)(link.topic)
    except BadTopicError:
        return False
    return True
