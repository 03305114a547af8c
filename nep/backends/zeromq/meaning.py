"""Meaning: what parts mean that are not just the next message of a publisher. No sockets."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from nep.backends.base import SubscriberSpec
from nep.backends.zeromq.loss import Sources
from nep.errors import WireError
from nep.messages.codecs import codec_numbered
from nep.messages.message import Message, arrived, kind_of
from nep.protocol.wire import (
    BYE,
    EXTENSION,
    LATCHED,
    Header,
    apart,
    check_size,
    form_of,
    read_extension,
    read_header,
    topic_part,
)

__all__ = ["NO_COPY_BYTES", "Meaning"]

NO_COPY_BYTES = 8_192
"""Larger ones libzmq receives into memory of their own: a kept view of one keeps nothing else alive."""

_Part = bytes | memoryview


class Meaning:
    """For the subscriber that says `hello`. Notes what it learns in `sources`.

    `leave(publisher)` ends a connection, `tell(publisher, seq)` answers an echo.
    """

    def __init__(
        self,
        spec: SubscriberSpec,
        hello: bytes,
        sources: Sources,
        leave: Callable[[int], None],
        tell: Callable[[int, int], None],
    ) -> None:
        self._name = spec.topic
        self._msg_type = spec.msg_type
        self._topic = topic_part(spec.topic)
        self._hello = hello
        self._sources = sources
        self._leave = leave
        self._tell = tell

    def of(self, first: bytes, rest: Sequence[_Part]) -> Message | None:
        """The message in these parts; None for a notice and for what was heard before. Raises `WireError`."""
        is_alone = first == self._hello
        if not rest and first.startswith(self._topic):
            first, *rest = apart(first)
        if not is_alone and first != self._topic:
            raise WireError("a message begins with something else than its topic")
        if not rest:
            raise WireError("a message has 3 or 4 parts, this one has 1")
        header = read_header(bytes(rest[0]))
        if is_alone and len(rest) == 1:
            self._notice(header)
            return None
        if len(rest) != (3 if header.flags & EXTENSION else 2):
            raise WireError(f"a message has 3 or 4 parts, this one has {len(rest) + 1}")
        check_size(header, len(rest[1]))
        return self._message(header, rest, is_alone=is_alone)

    def _notice(self, header: Header) -> None:
        """An echo, or the last word of a publisher that closes."""
        source = self._sources.get(header.publisher)
        last = source.last
        is_possible = self._sources.reached(header.publisher, header.seq)
        if header.flags & BYE:
            self._leave(header.publisher)
        elif source.has_echoed:
            self._tell(header.publisher, header.seq)
        else:
            source.has_echoed = True
        if not is_possible:
            raise WireError(f"its publisher's number leaps from {last} to {header.seq}")

    def _message(self, header: Header, rest: Sequence[_Part], *, is_alone: bool) -> Message | None:
        codec = codec_numbered(header.codec)
        if codec is None:
            raise WireError(
                f"its codec has the number {header.codec}, which this nep does not know; update nep"
            )
        extension = read_extension(rest[2]) if header.flags & EXTENSION else {}
        if not self._sources.arrived(header.publisher, header.seq, is_alone=is_alone):
            return None
        source = self._sources.get(header.publisher)
        msg_type = self._msg_type if source.remote is None else source.remote.publisher.msg_type
        source.kind = kind_of(self._name, codec.name, msg_type, is_latched=bool(header.flags & LATCHED))
        source.form = 0 if header.flags & EXTENSION else form_of(header.codec, header.flags)
        payload = rest[1]
        # A small view must not keep a large receive buffer alive.
        is_large = len(payload) >= NO_COPY_BYTES
        data = memoryview(payload).toreadonly() if is_large else bytes(payload)
        return arrived(source.kind, data, header.stamp_ns, header.seq, header.publisher, extension)
