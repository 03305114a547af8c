"""Key expressions for messages, hellos and liveliness tokens of nep. Pure functions.

    nep/v1/data/TOPIC              messages: payload, with header and extension as attachment
    nep/v1/hello/TOPIC/PUBLISHER   a publisher replies with its history and the number of its last message
    nep/v1/call/NODE               a node replies to a request of `nep.protocol.requests`: records, statistics
    nep/v1/live/NODE/node/...      liveliness tokens of a node, its publishers and subscribers
    nep/v1/live/NODE/pub/...
    nep/v1/live/NODE/sub/...
    nep/v1/live/NODE/srv/...       token of a server, with its start time
    nep/v1/live/NODE/cli/...       token of a client
    nep/v1/serve/SERVICE/SINCE/ID  a server replies: payload, with the header of the call as attachment

Each name is one chunk, percent-encoded as in a URL; "" is encoded as "%".
"""

from __future__ import annotations

from typing import NamedTuple
from urllib.parse import quote, unquote

from nep.protocol.requests import NodeRecord, PublisherRecord, SubscriberRecord
from nep.protocol.service_wire import SERVICE_PREFIX, SERVICE_TYPE, service_of
from nep.protocol.service_wire import topic_of as topic_of_service

_ROOT = "nep/v1"
_LIVE_PREFIX = f"{_ROOT}/live/"
ALL_CALLS_KEY = f"{_ROOT}/call/*"
ALL_TOKENS_KEY = f"{_LIVE_PREFIX}**"
_WILDCARDS = frozenset({"*", "**"})
_TOPIC_INDEX, _SINCE_INDEX = 3, 4
_MAX_ID = 2**64 - 1
_NODE_CHUNKS, _PUBLISHER_CHUNKS, _SUBSCRIBER_CHUNKS = 7, 6, 4


class LiveToken(NamedTuple):
    """Parsed liveliness token: a record, and the id of the node that owns the token."""

    node_id: str
    record: NodeRecord | PublisherRecord | SubscriberRecord


def _encode_chunk(text: str) -> str:
    return quote(text, safe="", errors="replace") or "%"


def _decode_chunk(chunk: str) -> str:
    return "" if chunk == "%" else unquote(chunk)


def data_key(topic: str) -> str:
    """Return the key for messages of a topic."""
    return f"{_ROOT}/data/{_encode_chunk(topic)}"


def pattern_data_key(pattern: str) -> str:
    """Return the key expression for messages of all topics that match a pattern.

    The expression may match further topics, so received topics must be checked.
    """
    return f"{_ROOT}/data/{_pattern_chunk(pattern)}"


def hello_key(topic: str, publisher: int) -> str:
    """Return the key at which a publisher replies to the hellos of new subscribers."""
    return f"{_ROOT}/hello/{_encode_chunk(topic)}/{publisher:016x}"


def hellos_key(topic: str) -> str:
    """Return the key expression for hellos to all publishers of a topic."""
    return f"{_ROOT}/hello/{_encode_chunk(topic)}/*"


def pattern_hellos_key(pattern: str) -> str:
    """Return the key expression for hellos to the publishers of all topics that match a pattern.

    The expression may match further topics, as that of `pattern_data_key` does.
    """
    return f"{_ROOT}/hello/{_pattern_chunk(pattern)}/*"


def _pattern_chunk(pattern: str) -> str:
    # A topic is one chunk, whose levels zenoh doesn't distinguish. The expression therefore matches only the
    # parts before the first and after the last wildcard.
    levels = pattern.split("/")
    wildcard_indexes = [index for index, level in enumerate(levels) if level in _WILDCARDS]
    first, last = wildcard_indexes[0], wildcard_indexes[-1]
    prefix = "/".join(levels[:first]) + ("/" if first and levels[first] == "*" else "")
    suffix = ("/" if levels[last] == "*" and levels[last + 1 :] else "") + "/".join(levels[last + 1 :])
    return f"{quote(prefix, safe='')}$*{quote(suffix, safe='')}" if prefix or suffix else "*"


def topic_of(key: str) -> str:
    """Return the topic of a message, or of a reply to a hello, from its key.

    Returns "" if the key is too short to contain a topic.
    """
    return _decode_chunk(key.split("/")[_TOPIC_INDEX]) if key.count("/") >= _TOPIC_INDEX else ""


def call_key(node_id: str) -> str:
    """Return the key at which a node receives requests."""
    return f"{_ROOT}/call/{_encode_chunk(node_id)}"


def node_key(node: NodeRecord) -> str:
    """Return the key of a node's liveliness token."""
    chunks = (node.name, node.host, str(node.pid or 0), node.language, node.generation, str(node.since_ns))
    return "/".join((f"{_LIVE_PREFIX}{_encode_chunk(node.id)}/node", *map(_encode_chunk, chunks)))


def publisher_key(node_id: str, record: PublisherRecord) -> str:
    """Return the key of a publisher's liveliness token."""
    latched = "latched" if record.latched else "plain"
    chunks = (f"{record.id:016x}", record.topic, record.msg_type, record.codec, latched)
    return "/".join((f"{_LIVE_PREFIX}{_encode_chunk(node_id)}/pub", *map(_encode_chunk, chunks)))


def subscriber_key(node_id: str, record: SubscriberRecord) -> str:
    """Return the key of a subscriber's liveliness token."""
    chunks = (f"{record.id:016x}", record.topic, record.msg_type)
    return "/".join((f"{_LIVE_PREFIX}{_encode_chunk(node_id)}/sub", *map(_encode_chunk, chunks)))


def service_key(service: str, since_ns: int, server: int) -> str:
    """Return the key at which a server receives calls.

    The keys of a service sort by age. All clients call the first server in this order, which is the oldest.

    Args:
        service: Name of the service.
        since_ns: Start time of the server, in nanoseconds since the epoch.
        server: Id of the server.
    """
    return f"{_ROOT}/serve/{_encode_chunk(service)}/{since_ns:016x}/{server:016x}"


def server_key(node_id: str, record: PublisherRecord) -> str:
    """Return the key of a server's liveliness token."""
    since = record.endpoints[0].split("/")[_SINCE_INDEX]
    return "/".join(
        (
            f"{_LIVE_PREFIX}{_encode_chunk(node_id)}/srv",
            f"{record.id:016x}",
            _encode_chunk(service_of(record.topic) or ""),
            since,
        )
    )


def client_key(node_id: str, record: SubscriberRecord) -> str:
    """Return the key of a client's liveliness token."""
    return "/".join(
        (
            f"{_LIVE_PREFIX}{_encode_chunk(node_id)}/cli",
            f"{record.id:016x}",
            _encode_chunk(service_of(record.topic) or ""),
        )
    )


def parse_token(key: str) -> LiveToken | None:
    """Parse the key of a liveliness token; return None for other keys and invalid tokens."""
    if not key.startswith(_LIVE_PREFIX):
        return None
    node_id, *chunks = map(_decode_chunk, key[len(_LIVE_PREFIX) :].split("/"))
    try:
        if chunks[:1] == ["node"] and len(chunks) == _NODE_CHUNKS:
            _kind, name, host, pid, language, generation, since = chunks
            pid_number, since_ns = int(pid), int(since)
            if not (0 <= pid_number < 2**63 and 0 <= since_ns < 2**63):
                return None
            return LiveToken(
                node_id, NodeRecord(node_id, name, host, pid_number or None, language, generation, since_ns)
            )
        if chunks[:1] == ["pub"] and len(chunks) == _PUBLISHER_CHUNKS:
            _kind, id_, topic, msg_type, codec, latched = chunks
            if topic.startswith(SERVICE_PREFIX):  # a forged token could otherwise register a server
                return None
            record = PublisherRecord(
                _parse_id(id_), topic, msg_type, codec, (data_key(topic),), latched == "latched"
            )
            return LiveToken(node_id, record)
        if chunks[:1] == ["sub"] and len(chunks) == _SUBSCRIBER_CHUNKS:
            _kind, id_, topic, msg_type = chunks
            if topic.startswith(SERVICE_PREFIX):
                return None
            return LiveToken(node_id, SubscriberRecord(_parse_id(id_), topic, msg_type))
        return _parse_service(node_id, *chunks)
    except ValueError:
        return None


def _parse_service(node_id: str, kind: str = "", id_: str = "", *chunks: str) -> LiveToken | None:
    # Raises `ValueError`.
    if kind == "srv" and len(chunks) == 2 and chunks[0]:
        service, since = chunks
        endpoint = service_key(service, _parse_id(since), _parse_id(id_))
        record = PublisherRecord(
            _parse_id(id_), topic_of_service(service), SERVICE_TYPE, SERVICE_TYPE, (endpoint,)
        )
        return LiveToken(node_id, record)
    if kind == "cli" and len(chunks) == 1 and chunks[0]:
        return LiveToken(node_id, SubscriberRecord(_parse_id(id_), topic_of_service(chunks[0]), SERVICE_TYPE))
    return None


def _parse_id(chunk: str) -> int:
    # Raises `ValueError`.
    number = int(chunk, 16)
    if not 0 < number <= _MAX_ID:
        raise ValueError(chunk)
    return number
