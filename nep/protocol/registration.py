"""Registration: what programs may register with a master, and the proof that an id is their own.

A node has a *key*, which only it and its masters know, and its id comes from the key: nobody else can
register that id, whether the node is there, is unlisted or comes back to a master that was started again.
Ids of publishers and subscribers come from the key and a number. See docs/adr/0014-who-speaks-for-a-node.md.
"""

from __future__ import annotations

import re
from hashlib import sha256

from nep.errors import NepError, WireError
from nep.protocol.records import COUNT_MAX, NodeRecord, PublisherRecord, SubscriberRecord
from nep.protocol.requests import AddPublisher, AddSubscriber, Join, Request
from nep.protocol.wire import check_node_name, check_topic
from nep.text import control_in, escaped, shortened

__all__ = [
    "ALL_RECORDS_MAX",
    "ALWAYS_ROOM",
    "RECORDS_MAX",
    "check_record",
    "check_request",
    "id_from",
    "is_endpoint",
    "is_proven",
    "node_id_from",
    "records_of",
]

RECORDS_MAX = 5_000
"""So many publishers and subscribers one node may have,"""
ALL_RECORDS_MAX = 20_000
"""and all nodes together,"""
ALWAYS_ROOM = 100
"""but so many each of them in any case: nobody keeps others out."""
_ENDPOINTS_MAX = 32
_PID_MAX = 2**32 - 1
_NODE_ID = re.compile("[0-9a-f]{16}")
_ENDPOINT = re.compile(
    r"tcp://(?:[A-Za-z0-9._-]{1,253}|\[[0-9A-Fa-f:.]{2,45}(?:%[\w.-]{1,20})?\]):(\d{1,5})", re.ASCII
)


def node_id_from(key: str) -> str:
    """The id of the node that has this key: 16 hexadecimal digits."""
    return sha256(key.encode("utf-8", "replace")).hexdigest()[:16]


def id_from(key: str, number: int) -> int:
    """The id of the publisher or subscriber with this number (from 1) of the node that has this key."""
    digest = sha256(f"{key}/{number}".encode("utf-8", "replace")).digest()
    return int.from_bytes(digest[:8], "little") >> 1 or 1


def is_proven(node: NodeRecord, record: PublisherRecord | SubscriberRecord | None = None) -> bool:
    """Whether the node's id comes from its key; with a record, whether that one's id does, too."""
    if not node.key or node_id_from(node.key) != node.id:
        return False
    return record is None or (record.number > 0 and id_from(node.key, record.number) == record.id)


def is_endpoint(endpoint: str) -> bool:
    """Whether it is `tcp://HOST:PORT`: the only form in which a publisher says where it is to be reached."""
    found = _ENDPOINT.fullmatch(endpoint)
    return found is not None and 1 <= int(found.group(1)) <= 65535


def check_request(request: Request) -> None:
    """Raises `WireError` for what no program may register. Everything else is the graph's to decide."""
    if not isinstance(request, Join | AddPublisher | AddSubscriber):
        return
    _check_node(request.node)
    if isinstance(request, Join) and request.managed:
        raise WireError("only what is attached to the master manages nodes")
    for record in records_of(request):
        _check_foreign(record)


def records_of(
    request: Join | AddPublisher | AddSubscriber,
) -> tuple[PublisherRecord | SubscriberRecord, ...]:
    """All publishers and subscribers that a request registers."""
    if isinstance(request, Join):
        return (*request.publishers, *request.subscribers)
    return (request.publisher if isinstance(request, AddPublisher) else request.subscriber,)


def check_record(record: PublisherRecord | SubscriberRecord) -> None:
    """Raises `WireError` unless its topic can be one."""
    try:
        check_topic(record.topic)
    except NepError as error:
        raise WireError(str(error)) from error


def _check_node(node: NodeRecord) -> None:
    if not _NODE_ID.fullmatch(node.id):
        raise WireError(f"'{shortened(node.id, 40)}' is no id of a node; it has 16 hexadecimal digits")
    try:
        check_node_name(node.name)
    except NepError as error:
        raise WireError(str(error)) from error
    _check_word("host", node.host, 255)
    _check_word("language", node.language, 50)
    _check_word("generation", node.generation, 50)
    _check_word("key", node.key, 200)
    if node.pid is not None and not 0 <= node.pid <= _PID_MAX:
        raise WireError(f"{node.pid} is no number of a process")
    if not 0 <= node.since_ns <= COUNT_MAX:
        raise WireError(f"{node.since_ns} is no time at which a node began")


def _check_foreign(record: PublisherRecord | SubscriberRecord) -> None:
    check_record(record)
    if not 1 <= record.id <= COUNT_MAX:
        raise WireError(f"{record.id} is no id of a publisher or subscriber; it is from 1 to 2^63-1")
    _check_word("type", record.msg_type, 200)
    if isinstance(record, PublisherRecord):
        _check_word("codec", record.codec, 50)
        if len(record.endpoints) > _ENDPOINTS_MAX:
            raise WireError(
                f"a publisher has {len(record.endpoints)} endpoints; {_ENDPOINTS_MAX} are allowed"
            )
        for endpoint in record.endpoints:
            if not is_endpoint(endpoint):
                said = escaped(shortened(endpoint, 80))
                raise WireError(f"'{said}' is no endpoint of a publisher; it is written 'tcp://HOST:PORT'")


def _check_word(what: str, word: str, most: int) -> None:
    control = control_in(word)
    if len(word) > most or control:
        hint = f"the character '{control}' is not allowed in it" if control else f"use {most} letters at most"
        raise WireError(f"'{escaped(shortened(word, 40))}' cannot be its {what}; {hint}")
