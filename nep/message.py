"""Message: one datum on a topic. Bytes are the truth; the payload is decoded on first use."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from nep.codecs import codec as codec_named

__all__ = ["Message"]

_NOTHING: Mapping[str, object] = MappingProxyType({})
_UNDECODED = object()


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
    """

    __slots__ = (
        "_payload",
        "codec",
        "data",
        "extension",
        "is_latched",
        "msg_type",
        "publisher",
        "seq",
        "stamp_ns",
        "topic",
    )

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
        extension: Mapping[str, object] = _NOTHING,
    ) -> None:
        self.topic = topic
        view = memoryview(data)
        self.data = view if view.readonly else view.toreadonly()
        self.codec = codec
        self.msg_type = msg_type
        self.stamp_ns = stamp_ns
        self.seq = seq
        self.publisher = publisher
        self.extension = extension
        self.is_latched = False
        self._payload: object = _UNDECODED

    @property
    def payload(self) -> object:
        """The decoded payload, decoded once. Raises `DecodeError` when the bytes are none of the codec's."""
        if self._payload is _UNDECODED:
            self._payload = codec_named(self.codec).decode(self.data, self.extension)
        return self._payload

    @property
    def size_bytes(self) -> int:
        """Bytes of the encoded payload."""
        return self.data.nbytes

    def __repr__(self) -> str:
        return f"Message({self.topic!r}, seq={self.seq}, codec={self.codec!r}, size_bytes={self.size_bytes})"
