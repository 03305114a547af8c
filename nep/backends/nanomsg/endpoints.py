"""Endpoints `nanomsg://HOST:PORT/PORT` (ports for messages and hellos) and the message format.

The scheme prevents subscribers over ZeroMQ from connecting. A nanomsg message is the concatenation of a
native message's parts; the header states the size of the payload, and the extension follows.
"""

from __future__ import annotations

import re

from nep.protocol.wire import HEADER_BYTES, LATCHED, hello_part, read_header, split_frame

_ENDPOINT = re.compile(r"nanomsg://([\w.-]{1,253}):(\d{1,5})/(\d{1,5})", re.ASCII)


def format_endpoint(host: str, message_port: int, hello_port: int) -> str:
    """Return the endpoint of a publisher.

    Args:
        host: IP address or host name.
        message_port: Port for messages.
        hello_port: Port for hellos.
    """
    return f"nanomsg://{host}:{message_port}/{hello_port}"


def parse_endpoint(endpoint: str) -> tuple[str, str] | None:
    """Return the addresses (`HOST:PORT`) for messages and for hellos.

    Returns None for endpoints of other schemes and for invalid ones.
    """
    match = _ENDPOINT.fullmatch(endpoint)
    if match is None or not all(0 < int(port) < 65536 for port in match.groups()[1:]):
        return None
    host, message_port, hello_port = match.groups()
    return f"{host}:{message_port}", f"{host}:{hello_port}"


def subscriber_topic_part(subscriber: int, topic: str) -> bytes:
    """Return the topic prefix of messages that are addressed only to this subscriber."""
    return hello_part(subscriber, topic) + b"\0"


def split_message(message: bytes, prefix: bytes, *, is_alone: bool) -> list[bytes]:
    """Split a one-part message into the parts after its prefix.

    Args:
        message: Received message.
        prefix: Prefix of the message: the topic, or the hello of one subscriber.
        is_alone: True if the message is addressed to one subscriber, as notices are.

    Returns:
        Header, payload and, if the message has one, extension; for a notice only the header.

    Raises:
        WireError: The header is malformed or declares more bytes than follow.
    """
    tail = message[len(prefix) :]
    if is_alone and len(tail) == HEADER_BYTES and not read_header(tail).flags & LATCHED:
        return [tail]
    return split_frame(tail)
