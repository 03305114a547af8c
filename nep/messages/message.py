"""Message received from a topic, whose payload is decoded at the first access."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial
from types import MappingProxyType
from typing import NamedTuple

from nep.messages.clocks import UNKNOWN_CLOCK, PublisherClock
from nep.messages.codecs import CODECS, content_of
from nep.messages.codecs import codec as codec_named

NO_EXTENSION: Mapping[str, object] = MappingProxyType({})
UNDECODED = object()
new_message = object.__new__
"""Fast constructor that skips `__init__`, for creating messages at high rates. See `received_message`."""


class MessageKind(NamedTuple):
    """Properties shared by all messages of one publisher. Created by `message_kind`."""

    topic: str
    codec: str
    msg_type: str
    is_latched: bool
    decode: Callable[[bytes | memoryview, Mapping[str, object]], object]
    clock: PublisherClock = UNKNOWN_CLOCK


def message_kind(
    topic: str,
    codec: str,
    msg_type: str,
    *,
    is_latched: bool = False,
    clock: PublisherClock = UNKNOWN_CLOCK,
) -> MessageKind:
    """Return the properties shared by all messages of a publisher.

    An unknown codec is accepted; an exception is raised only when a payload is decoded.
    """
    known_codec = CODECS.get(codec)
    decode = partial(_raise_unknown_codec, codec) if known_codec is None else known_codec.decode
    return MessageKind(topic, codec, msg_type, is_latched, decode, clock)


def _raise_unknown_codec(name: str, data: bytes | memoryview, extension: Mapping[str, object]) -> object:
    return codec_named(name).decode(data, extension)


class Message:
    """Message received from a topic. Treat it as immutable: it is shared between threads.

        for message in subscriber:
            print(message.topic, message.seq, message.payload)

    Attributes:
        topic: Name of the topic.
        data: Encoded payload, a read-only memoryview.
        codec: Name of the codec ("json", "string", "bytes", "msgpack", "image").
        msg_type: Message type in the graph ("json", "robot/description", ...).
        payload: Decoded payload.
        stamp_ns: Time of publication by the publisher's clock, in nanoseconds since 1970; None on the
            original wire.
        seq: Sequence number, counted from 1 by the publisher; None on the original wire.
        publisher: Id of the publisher; None on the original wire.
        extension: Additional header fields, such as the shape and encoding of an image.
        is_latched: True if the topic is latched.
        latency_s: Time from publication to the first access of this property, in seconds.
        latency_uncertainty_s: Uncertainty of `latency_s` (±) in seconds.
    """

    # few slots, and lazy values: created at rates of 100,000 per second and more
    __slots__ = ("decoded", "extension", "kind", "publisher", "raw", "seen_ns", "seq", "stamp_ns")

    raw: bytes | memoryview
    kind: MessageKind
    decoded: object
    extension: Mapping[str, object]
    publisher: int | None
    seen_ns: int
    """Time of the first access to `latency_s`, by this computer's clock; unset before."""
    seq: int | None
    stamp_ns: int | None

    def __init__(
        self,
        topic: str,
        data: bytes | memoryview,
        codec: str,
        msg_type: str,
        *,
        stamp_ns: int | None = None,
        seq: int | None = None,
        publisher: int | None = None,
        extension: Mapping[str, object] = NO_EXTENSION,
    ) -> None:
        self.kind = message_kind(topic, codec, msg_type)
        self.raw = data if isinstance(data, bytes) else memoryview(data).toreadonly()
        self.stamp_ns = stamp_ns
        self.seq = seq
        self.publisher = publisher
        self.extension = extension
        self.decoded = UNDECODED

    @property
    def topic(self) -> str:
        """Name of the topic."""
        return self.kind.topic

    @property
    def data(self) -> memoryview:
        """Encoded payload; read-only."""
        return memoryview(self.raw)

    @property
    def codec(self) -> str:
        """Name of the codec."""
        return self.kind.codec

    @property
    def msg_type(self) -> str:
        """Message type in the graph."""
        return self.kind.msg_type

    @property
    def is_latched(self) -> bool:
        """True if the publisher keeps its newest message for later subscribers."""
        return self.kind.is_latched

    @property
    def payload(self) -> object:
        """Decoded payload; cached. Raises `DecodeError` if the data is invalid for its codec."""
        payload = self.decoded
        if payload is UNDECODED:
            payload = self.decoded = self.kind.decode(self.raw, self.extension)
        return payload

    @property
    def payload_or_extension(self) -> object:
        """Payload for filters and tables; of an image the extension, because pixels have no fields.

        Raises `DecodeError` if the message is malformed.
        """
        return dict(self.extension) if content_of(self.kind.codec) == "image" else self.payload

    @property
    def latency_s(self) -> float | None:
        """Seconds from publication to the first access of this property; None without a time stamp.

        Read it as soon as a message is received. Between computers the clock offset is corrected as far as it
        is known (`latency_uncertainty_s`), so the value may be slightly negative.
        """
        if self.stamp_ns is None:
            return None
        try:
            seen_ns = self.seen_ns
        except AttributeError:
            seen_ns = self.seen_ns = time.time_ns()
        clock_difference = self.kind.clock.difference
        return (
            seen_ns - self.stamp_ns - (0 if clock_difference is None else clock_difference.offset_ns)
        ) / 1e9

    @property
    def latency_uncertainty_s(self) -> float | None:
        """Uncertainty of `latency_s` (±) in seconds, caused by the clocks of different computers.

        0.0 on one computer. None if the two clocks have not been compared (yet); `latency_s` is not corrected
        then, and may be wrong by any amount.
        """
        difference_s = self.kind.clock.difference_s()
        return None if self.stamp_ns is None or difference_s is None else difference_s[1]

    @property
    def size_bytes(self) -> int:
        """Size of the encoded payload in bytes."""
        return len(self.raw) if isinstance(self.raw, bytes) else self.raw.nbytes

    def __repr__(self) -> str:
        return f"Message({self.topic!r}, seq={self.seq}, codec={self.codec!r}, size_bytes={self.size_bytes})"


def received_message(
    kind: MessageKind,
    data: bytes | memoryview,
    stamp_ns: int | None,
    seq: int,
    publisher: int,
    extension: Mapping[str, object] = NO_EXTENSION,
) -> Message:
    """Create a received message; called by back ends.

    Args:
        kind: Properties of the publisher's messages; use the same object for all messages of a
            publisher.
        data: Encoded payload. The bytes must never change.
        stamp_ns: Time of publication by the publisher's clock, in nanoseconds since 1970, or None.
        seq: Sequence number.
        publisher: Id of the publisher.
        extension: Additional header fields.
    """
    message = new_message(Message)
    message.kind = kind
    message.raw = data
    message.stamp_ns = stamp_ns
    message.seq = seq
    message.publisher = publisher
    message.extension = extension
    message.decoded = UNDECODED
    return message
