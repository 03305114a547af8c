"""Publishers and subscribers of the tester, which send and record raw message parts."""

from __future__ import annotations

import secrets
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import zmq
from msgspec.structs import replace

from nep.errors import WireError
from nep.messages.codecs import codec_for
from nep.programs.conformance.ports import bind_again
from nep.protocol.batch import BATCH_FORM_FLAG, encode_batch, parse_parts
from nep.protocol.requests import NodeRecord, PublisherRecord, SubscriberRecord
from nep.protocol.wire import (
    BYE,
    HEADER_BYTES,
    Header,
    Hello,
    ParsedMessage,
    encode_form,
    hello_part,
    parse_hello,
    read_header,
    topic_part,
)


def new_node(name: str) -> NodeRecord:
    """Return the record of a new node of the tester."""
    return NodeRecord(secrets.token_hex(8), name, "tester", None, "tester")


@dataclass(frozen=True)
class FilterChange:
    """Change of a subscription filter, received by an XPUB socket.

    Attributes:
        at: Time of arrival (monotonic, s).
        is_added: True if the filter was added, False if it was removed.
        prefix: Bytes of the filter.
    """

    at: float
    is_added: bool
    prefix: bytes


@dataclass(frozen=True)
class Notice:
    """Echo, bye or message that a publisher sent with a hello as its first part.

    Attributes:
        at: Time of arrival (monotonic, s).
        hello: First part.
        header: Header of the notice.
        payload: Payload of a message; None for an echo or a bye.
    """

    at: float
    hello: bytes
    header: Header
    payload: bytes | None


class ScriptedPublisher:
    """Publisher that records all subscription filters and sends arbitrary parts.

    Args:
        context: ZeroMQ context.
        topic: Name of the topic.
        msg_type: Message type.
        should_echo: True to reply to hellos with echoes.
    """

    def __init__(self, context: zmq.Context[Any], topic: str, msg_type: str, *, should_echo: bool) -> None:
        self.topic, self.should_echo = topic, should_echo
        self._context = context
        self.socket = self._new_socket()
        port = self.socket.bind_to_random_port("tcp://127.0.0.1")
        self.codec = codec_for(msg_type)
        self.node = new_node("tester_publisher")
        self.record = PublisherRecord(
            secrets.randbits(62) | 1, topic, msg_type, self.codec.name, (f"tcp://127.0.0.1:{port}",)
        )
        self.seq = 0
        self.filters: list[FilterChange] = []
        self.hellos: dict[bytes, Hello] = {}
        """Current hellos for the publisher's topic, by filter."""
        self.echoed_at: float | None = None

    @property
    def id(self) -> int:
        """Id of the publisher."""
        return self.record.id

    def _new_socket(self) -> zmq.Socket[bytes]:
        socket: zmq.Socket[bytes] = self._context.socket(zmq.XPUB)
        socket.linger, socket.sndhwm = 0, 0
        socket.setsockopt(zmq.XPUB_VERBOSE, 1)
        return socket

    def bind_again(self) -> None:
        """Close all connections and bind to the same port again."""
        endpoint = self.record.endpoints[0]
        self._replace_socket()
        bind_again(self.socket, endpoint)

    def bind_other_port(self) -> None:
        """Close all connections and bind to another port."""
        self._replace_socket()
        port = self.socket.bind_to_random_port("tcp://127.0.0.1")
        self.record = replace(self.record, endpoints=(f"tcp://127.0.0.1:{port}",))

    def _replace_socket(self) -> None:
        self.socket.close(0)
        self.hellos.clear()
        self.socket = self._new_socket()

    def pump(self) -> None:
        """Process received filters, and reply to hellos if echoes are enabled."""
        while not self.socket.closed and self.socket.poll(0):
            event = self.socket.recv()
            now = time.monotonic()
            change = FilterChange(now, event[:1] == b"\1", event[1:])
            self.filters.append(change)
            hello = parse_hello(change.prefix)
            if hello is None or hello.topic != self.topic:
                continue
            if change.is_added:
                self.hellos[change.prefix] = hello
                if self.should_echo:
                    self.send_echo(change.prefix)
            else:
                self.hellos.pop(change.prefix, None)

    def send_echo(self, hello: bytes) -> None:
        """Reply to a hello with an echo that carries the sequence number of the last message."""
        self.send_notice(hello)
        self.echoed_at = time.monotonic()

    def send_notice(self, hello: bytes, flags: int = 0, seq: int | None = None) -> None:
        """Send a header without payload to the subscriber with this hello.

        Args:
            hello: First part.
            flags: Flags of the header.
            seq: Sequence number; None for the number of the last message.
        """
        self.socket.send_multipart([hello, self._header(flags, b"", seq)])

    def send_byes(self) -> None:
        """Send a bye to each subscriber."""
        for hello in self.hellos:
            self.send_notice(hello, BYE)

    def send(self, payload: bytes, form: str = "parts", *, seq: int | None = None, flags: int = 0) -> None:
        """Send the next message.

        Args:
            payload: Encoded payload.
            form: "parts" for three parts, "one" for one part, "alone" for a separate message to each
                subscriber, with its hello as first part.
            seq: Sequence number; None for the next one.
            flags: Flags of the header.
        """
        self.seq = self.seq + 1 if seq is None else seq
        header, topic = self._header(flags, payload), topic_part(self.topic)
        if form == "one":
            self.socket.send(topic + header + payload)
        elif form == "alone":
            for hello in self.hellos:
                self.socket.send_multipart([hello, header, payload])
        else:
            self.socket.send_multipart([topic, header, payload])

    def send_batch(self, payloads: Sequence[bytes]) -> None:
        """Send the next messages as one batch."""
        form = encode_form(self.codec.number, 0) & ~BATCH_FORM_FLAG
        stamps = [time.time_ns()] * len(payloads)
        part = encode_batch(topic_part(self.topic), form, self.seq + 1, self.id, stamps, payloads)
        self.seq += len(payloads)
        self.socket.send(part)

    def _header(self, flags: int, payload: bytes, seq: int | None = None) -> bytes:
        number = self.seq if seq is None else seq
        return Header(self.codec.number, flags, number, time.time_ns(), self.id, len(payload)).pack()


class ScriptedSubscriber:
    """Subscriber that records all received parts.

    Args:
        context: ZeroMQ context.
        topic: Name of the topic.
        msg_type: Message type.
        level: Hello level; None to send no hello.
    """

    def __init__(self, context: zmq.Context[Any], topic: str, msg_type: str, level: int | None) -> None:
        self.topic, self.level = topic, level
        self.node = new_node("tester_subscriber")
        self.record = SubscriberRecord(secrets.randbits(62) | 1, topic, msg_type)
        self.socket = context.socket(zmq.SUB)
        self.socket.linger, self.socket.sndhwm, self.socket.rcvhwm = 0, 0, 0
        self.socket.subscribe(topic_part(topic))
        self.hello = hello_part(
            self.record.id,
            topic,
            reads_one_part=level == 1,
            acknowledges_echoes=level == 2,
            reads_batches=level == 3,
        )
        if level is not None:
            self.socket.subscribe(self.hello)
        self.received: list[list[bytes]] = []
        self.arrival_times: list[float] = []
        self.endpoint = ""

    def connect(self, endpoint: str) -> None:
        """Connect to a publisher, unless already connected."""
        if not self.endpoint:
            self.endpoint = endpoint
            self.socket.connect(endpoint)

    def disconnect(self) -> None:
        """Disconnect from the publisher."""
        if self.endpoint and not self.socket.closed:
            self.socket.disconnect(self.endpoint)
            self.endpoint = ""

    def pump(self) -> None:
        """Receive all pending messages."""
        while not self.socket.closed and self.socket.poll(0):
            self.received.append(self.socket.recv_multipart())
            self.arrival_times.append(time.monotonic())

    @property
    def notices(self) -> list[Notice]:
        """Received echoes, byes and messages whose first part is the subscriber's hello.

        Malformed ones are omitted.
        """
        notices = []
        for received_at, parts in zip(self.arrival_times, self.received, strict=True):
            if parts[0] == self.hello and len(parts) >= 2 and len(parts[1]) == HEADER_BYTES:
                try:
                    header = read_header(parts[1])
                except WireError:
                    continue
                notices.append(Notice(received_at, parts[0], header, parts[2] if len(parts) > 2 else None))
        return notices

    @property
    def echoes(self) -> list[Notice]:
        """Received echoes."""
        return [each for each in self.notices if each.payload is None and not each.header.flags]

    @property
    def byes(self) -> list[Notice]:
        """Received byes."""
        return [each for each in self.notices if each.payload is None and each.header.flags == BYE]

    @property
    def raw_messages(self) -> list[list[bytes]]:
        """Parts of all received messages whose first part is not the hello."""
        return [parts for parts in self.received if parts[0] != self.hello]

    @property
    def messages(self) -> list[ParsedMessage]:
        """Received messages of the subscriber's topic, with batches split into their messages.

        Raises `WireError` for malformed parts.
        """
        return [each for parts in self.raw_messages for each in parse_parts(parts)]
