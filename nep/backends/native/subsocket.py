"""SubSocket: a SUB socket with its publishers: reads parts, tells messages from notices, counts losses.

It has no lock: it lives under its inlet's.
"""

from __future__ import annotations

import errno

import zmq

from nep.backends.base import SubscriberSpec
from nep.backends.native.sockets import Socket, receive_mark, wait_shortly
from nep.backends.native.sources import Source, Sources
from nep.codecs import codec_for, codec_numbered
from nep.errors import WireError
from nep.message import Message
from nep.records import RemotePublisher
from nep.wire import (
    BYE,
    EXTENSION,
    HEADER_BYTES,
    LATCHED,
    VERSION,
    Header,
    hello_part,
    read_extension,
    read_header,
    topic_part,
    unpack_header,
)

__all__ = ["SubSocket"]

_NO_COPY_BYTES = 65_536
_DONTWAIT = int(zmq.DONTWAIT)  # plain numbers: pyzmq's enumerations cost as much as what they ask for
_EVENTS = int(zmq.EVENTS)
_POLLIN = int(zmq.POLLIN)


class SubSocket:
    """Sets the filters at once, before anything is connected or bound: the hello must follow the topic."""

    def __init__(self, socket: Socket, spec: SubscriberSpec) -> None:
        self.sources = Sources()
        self.problem = ""
        self.fd = int(socket.getsockopt(zmq.FD))
        self._socket = socket
        self._recv = socket.recv
        self._topic_name = spec.topic
        self._msg_type = spec.msg_type
        self._codec = codec_for(spec.msg_type)
        self._topic = topic_part(spec.topic)
        self._hello = hello_part(spec.id, spec.topic)
        wait_shortly(socket)
        socket.setsockopt(zmq.RCVHWM, receive_mark(self._codec.name))
        socket.setsockopt(zmq.SNDHWM, 0)  # libzmq silently drops filters beyond 1000 otherwise
        socket.setsockopt(zmq.SUBSCRIBE, self._topic)
        socket.setsockopt(zmq.SUBSCRIBE, self._hello)

    @property
    def received(self) -> int:
        """Messages that arrived."""
        return self.sources.received

    @property
    def lost(self) -> int:
        """Messages that did not."""
        return self.sources.lost

    @property
    def has_input(self) -> bool:
        """Whether something can be read. Also takes note of connections that came and went."""
        return bool(int(self._socket.getsockopt(_EVENTS)) & _POLLIN)

    def connect(self, remote: RemotePublisher) -> None:
        """Connect to a publisher; twice is once. Silent ones that it replaces are left."""
        for old in self.sources.replaced_by(remote):
            self.leave(old)
        source = self.sources.get(remote.publisher.id)
        source.remote = remote
        source.is_lapsed = False
        source.ends_at = None
        if not source.endpoint and remote.publisher.endpoints:
            source.endpoint = remote.publisher.endpoints[0]
            self._socket.connect(source.endpoint)

    def leave(self, publisher: int) -> None:
        """Disconnect from a publisher and forget it."""
        source = self.sources.pop(publisher)
        if source is not None and source.endpoint:
            try:
                self._socket.disconnect(source.endpoint)
            except zmq.ZMQError as error:
                if error.errno != errno.ENOENT:  # it was not connected any more
                    raise

    def read(self, *, may_wait: bool = False) -> Message | None:
        """The next message; None when there is nothing more. Notices are dealt with on the way."""
        recv = self._recv
        flags = 0 if may_wait else _DONTWAIT
        while True:
            try:
                frame = recv(flags, False)
            except zmq.Again:
                return None
            first = frame.bytes
            rest: list[zmq.Frame] = []
            if frame.more:  # all parts of a message are there when its first is
                head = recv(_DONTWAIT, False)
                if not head.more:
                    rest = [head]
                else:
                    body = recv(_DONTWAIT, False)
                    if not body.more and first == self._topic:
                        message = self._usual(head.bytes, body)
                        if message is not None:
                            return message
                    rest = self._read_rest(head, body)
            is_resent = first == self._hello
            if not is_resent and first != self._topic:
                continue  # whoever had this port before, or a topic that begins with this one's bytes
            try:
                message = self._understand(rest, is_resent=is_resent)
            except WireError as error:
                self.problem = error.reason
                continue
            if message is not None:
                return message

    def _read_rest(self, head: zmq.Frame, body: zmq.Frame) -> list[zmq.Frame]:
        rest = [head, body]
        while rest[-1].more:
            rest.append(self._recv(_DONTWAIT, False))
        return rest

    def dropped(self, count: int) -> None:
        """So many messages that had been received were dropped for lack of room."""
        self.sources.dropped(count)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close(0)

    def _usual(self, head: bytes, body: zmq.Frame) -> Message | None:
        """The message in most parts that come, which is just the next one, quickly; None for all others."""
        if len(head) != HEADER_BYTES:
            return None
        version, codec, flags, _reserved, seq, stamp_ns, publisher = unpack_header(head)
        if version != VERSION or flags or codec != self._codec.number:
            return None
        source = self.sources.next_of(publisher, seq)
        if source is None:
            return None
        message = self._make(source, body, self._codec.name)
        message.stamp_ns, message.seq, message.publisher = stamp_ns, seq, publisher
        return message

    def _understand(self, rest: list[zmq.Frame], *, is_resent: bool) -> Message | None:
        if not rest:
            raise WireError("a message has 3 or 4 parts, this one has 1")
        header = read_header(rest[0].bytes)
        if is_resent and len(rest) == 1:
            self._notice(header)
            return None
        if len(rest) != (3 if header.flags & EXTENSION else 2):
            raise WireError(f"a message has 3 or 4 parts, this one has {len(rest) + 1}")
        return self._message(header, rest, is_resent=is_resent)

    def _notice(self, header: Header) -> None:
        """An echo, or the last word of a publisher that closes."""
        self.sources.reached(header.publisher, header.seq)
        if header.flags & BYE:
            self.leave(header.publisher)
        else:
            self.sources.get(header.publisher).has_echoed = True

    def _message(self, header: Header, rest: list[zmq.Frame], *, is_resent: bool) -> Message | None:
        codec = codec_numbered(header.codec)
        if codec is None:
            raise WireError(
                f"its codec has the number {header.codec}, which this nep does not know; update nep"
            )
        extension = read_extension(rest[2].buffer) if header.flags & EXTENSION else None
        if not self.sources.arrived(header.publisher, header.seq, is_resent=is_resent):
            return None
        source = self.sources.get(header.publisher)
        self._codec = codec  # the next one probably has it too
        message = self._make(source, rest[1], codec.name)
        message.stamp_ns, message.seq, message.publisher = header.stamp_ns, header.seq, header.publisher
        message.is_latched = bool(header.flags & LATCHED)
        if extension:
            message.extension = extension
        return message

    def _make(self, source: Source, payload: zmq.Frame, codec: str) -> Message:
        self.problem = ""
        remote = source.remote
        return Message(
            self._topic_name,
            # A small view must not keep a large receive buffer alive.
            payload.buffer if len(payload) >= _NO_COPY_BYTES else payload.bytes,
            codec,
            self._msg_type if remote is None else remote.publisher.msg_type,
        )
