"""Message: one datum on a topic. Bytes are the truth; the payload is decoded on first use."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial
from types import MappingProxyType
from typing import NamedTuple

from nep.messages.clocks import NOT_COMPARED, PublisherClock
from nep.messages.codecs import CODECS
from nep.messages.codecs import codec as codec_named

__all__ = ["NOTHING", "UNDECODED", "Message", "MessageKind", "arrived", "kind_of", "new_message"]

NOTHING: Mapping[str, object] = MappingProxyType({})
UNDECODED = object()
new_message = object.__new__
"""For whoever makes hundreds of thousands a second and sets their fields itself: `arrived` shows how."""


class MessageKind(NamedTuple):
    """What the messages of one publisher have in common. Made by `kind_of`."""

    topic: str
    codec: str
    msg_type: str
    is_latched: bool
    decode: Callable[[bytes | memoryview, Mapping[str, object]], object]
    clock: PublisherClock = NOT_COMPARED


def kind_of(
    topic: str,
    codec: str,
    msg_type: str,
    *,
    is_latched: bool = False,
    clock: PublisherClock = NOT_COMPARED,
) -> MessageKind:
    """The `MessageKind` with these. The codec may be one that there is not: then decoding says so."""
    known = CODECS.get(codec)
    decode = partial(_no_codec, codec) if known is None else known.decode
    return MessageKind(topic, codec, msg_type, is_latched, decode, clock)


def _no_codec(name: str, data: bytes | memoryview, extension: Mapping[str, object]) -> object:
    return codec_named(name).decode(data, extension)


class Message:
    """One message, as it came from the wire. Treat it as immutable: it is handed from thread to thread.

    `topic`      the topic's name
    `data`       the encoded payload, a read-only memoryview
    `codec`      the codec's name ("json", "string", "bytes", "msgpack", "image")
    `msg_type`   the type's name in the graph ("json", "robot/description", ...)
    `stamp_ns`   the publisher's clock when it was published, in nanoseconds since 1970; None from the
                 original wire
    `seq`        counts the publisher's messages from 1; None from the original wire
    `publisher`  the publisher's id; None from the original wire
    `extension`  what travels beside the payload (an image's shape and encoding), else empty
    `is_latched` True when the publisher kept it for subscribers that come late
    `latency_s`  how long after its publication this program looked at it (s)
    `latency_uncertainty_s`  how surely that is known (s)
    """

    # Few, and what can wait is made on first use: hundreds of thousands are made a second.
    __slots__ = ("decoded", "extension", "kind", "publisher", "raw", "seen_ns", "seq", "stamp_ns")

    raw: bytes | memoryview
    kind: MessageKind
    decoded: object
    extension: Mapping[str, object]
    publisher: int | None
    seen_ns: int
    """When `latency_s` was asked for first, by this computer's clock; not set before."""
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
        extension: Mapping[str, object] = NOTHING,
    ) -> None:
        self.kind = kind_of(topic, codec, msg_type)
        self.raw = data if isinstance(data, bytes) else memoryview(data).toreadonly()
        self.stamp_ns = stamp_ns
        self.seq = seq
        self.publisher = publisher
        self.extension = extension
        self.decoded = UNDECODED

    @property
    def topic(self) -> str:
        """The topic's name."""
        return self.kind.topic

    @property
    def data(self) -> memoryview:
        """The encoded payload; read-only."""
        return memoryview(self.raw)

    @property
    def codec(self) -> str:
        """The codec's name."""
        return self.kind.codec

    @property
    def msg_type(self) -> str:
        """The type's name in the graph."""
        return self.kind.msg_type

    @property
    def is_latched(self) -> bool:
        """Whether the publisher kept it for subscribers that come late."""
        return self.kind.is_latched

    @property
    def payload(self) -> object:
        """The decoded payload, decoded once. Raises `DecodeError` when the bytes are none of the codec's."""
        payload = self.decoded
        if payload is UNDECODED:
            payload = self.decoded = self.kind.decode(self.raw, self.extension)
        return payload

    @property
    def latency_s(self) -> float | None:
        """Seconds from its publication until this was asked for first; None when it has no time.

        Ask as soon as a message comes. Between two computers it is corrected by how their clocks differ, as
        far as that is known: `latency_uncertainty_s` tells. So it may be a little below 0.
        """
        if self.stamp_ns is None:
            return None
        try:
            seen_ns = self.seen_ns
        except AttributeError:
            seen_ns = self.seen_ns = time.time_ns()
        known = self.kind.clock.difference
        return (seen_ns - self.stamp_ns - (0 if known is None else known.add_ns)) / 1e9

    @property
    def latency_uncertainty_s(self) -> float | None:
        """By how many seconds `latency_s` may be wrong, to both sides, because clocks of computers differ.

        0.0 on one computer, where there is one clock. None when nobody has compared the two clocks (yet):
        then `latency_s` is not corrected, and may be wrong by any time.
        """
        known = self.kind.clock.seconds()
        return None if self.stamp_ns is None or known is None else known[1]

    @property
    def size_bytes(self) -> int:
        """Bytes of the encoded payload."""
        return len(self.raw) if isinstance(self.raw, bytes) else self.raw.nbytes

    def __repr__(self) -> str:
        return f"Message({self.topic!r}, seq={self.seq}, codec={self.codec!r}, size_bytes={self.size_bytes})"


def arrived(
    kind: MessageKind,
    data: bytes | memoryview,
    stamp_ns: int | None,
    seq: int,
    publisher: int,
    extension: Mapping[str, object] = NOTHING,
) -> Message:
    """A message as a back end makes it: `data` never changes, and `kind` is made once for many."""
    message = new_message(Message)
    message.kind = kind
    message.raw = data
    message.stamp_ns = stamp_ns
    message.seq = seq
    message.publisher = publisher
    message.extension = extension
    message.decoded = UNDECODED
    return message
