"""Endpoints `nanomsg://HOST:PORT` and the message format.

The scheme prevents subscribers over ZeroMQ from connecting. A nanomsg message is the concatenation of a
native message's parts; the header states the size of the payload, and the extension follows.
"""

from __future__ import annotations

from nep.protocol.wire import HEADER_BYTES, HELLO, LATCHED, hello_part, read_header, split_frame
from nep.system.addresses import is_endpoint

_SCHEME = "nanomsg://"


def format_endpoint(address: str) -> str:
    """Return the endpoint of a publisher that listens at `HOST:PORT`."""
    return f"{_SCHEME}{address}"


def parse_endpoint(endpoint: str) -> str:
    """Return the URL `tcp://HOST:PORT` that pynng dials; "" for invalid endpoints and other schemes."""
    url = f"tcp://{endpoint.removeprefix(_SCHEME)}"
    return url if endpoint.startswith(_SCHEME) and is_endpoint(url) else ""


def subscriber_topic_part(subscriber: int, topic: str) -> bytes:
    """Return the topic prefix of messages that are addressed only to this subscriber."""
    return hello_part(subscriber, topic) + b"\0"


def split_message(message: bytes, topic: bytes, own_topic: bytes) -> tuple[bytes, list[bytes]] | None:
    """Split a one-part message.

    Args:
        message: Received message.
        topic: Prefix of messages to all subscribers.
        own_topic: Prefix of messages to this subscriber, such as notices.

    Returns:
        The prefix, and the parts after it: header, payload and, if the message has one, extension; for a
        notice only the header. The prefix of a message with an unknown topic is empty. None for a message
        to another subscriber.

    Raises:
        WireError: The header is malformed or declares more bytes than follow.
    """
    if message.startswith(topic):
        return topic, split_frame(message[len(topic) :])
    if not message.startswith(own_topic):
        return None if message.startswith(HELLO) else (b"", [message])
    tail = message[len(own_topic) :]
    if len(tail) == HEADER_BYTES and not read_header(tail).flags & LATCHED:
        return own_topic, [tail]
    return own_topic, split_frame(tail)
