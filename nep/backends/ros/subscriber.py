"""Subscriber over rospy. Messages are queued as received and decoded when they are read."""

from __future__ import annotations

import io
import logging
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from nep.backends.base import SubscriberSpec
from nep.backends.bases.inbox import Inboxes, InboxSubscriber
from nep.backends.bases.rejections import RejectionCounter
from nep.backends.ros.graph import publisher_id
from nep.backends.ros.process import RosProcess, RosShutdownError
from nep.backends.ros.type_mapping import STAMP, Unpacker, installed_definition, is_ros_type, unpacker_for
from nep.errors import DecodeError, NepError, WireError
from nep.i18n import _
from nep.messages.message import NO_EXTENSION, Message, MessageKind, received_message
from nep.text import escaped, shortened

_logger = logging.getLogger("nep")
_BUFFER_BYTES = 2**18
"""Receive buffer size in bytes; rospy's default of 64 KiB is slow for images."""
_MAX_SOURCES = 1_000


@dataclass
class _Source:
    # Publisher, as described by its connection. `seq` is that of its newest header. `publisher` is its id;
    # None if unknown, and for a publisher of this process (`is_local`).
    unpacker: Unpacker | None
    kind: MessageKind | None
    problem: str = ""
    seq: int = 0
    last_message: object = None
    publisher: int | None = None
    is_local: bool = False


def _bytes_of(message: Any) -> bytes:  # noqa: ANN401 - rospy is not typed
    # An AnyMsg contains the bytes. If the program itself has subscribed to the topic before, rospy passes
    # decoded messages instead, which are serialized again.
    data = getattr(message, "_buff", None)
    if isinstance(data, bytes):
        return data
    stream = io.BytesIO()
    message.serialize(stream)
    return stream.getvalue()


class RospySubscriber(InboxSubscriber):
    """Subscriber that accepts messages of any ROS type, so that it can report a wrong type.

    Args:
        process: ROS node of this process.
        spec: Settings of the subscriber.
        inboxes: Shared state of the node's inboxes.
        on_close: Removes the closed subscriber from its transport.
    """

    def __init__(
        self,
        process: RosProcess,
        spec: SubscriberSpec,
        inboxes: Inboxes,
        on_close: Callable[[RospySubscriber], None],
    ) -> None:
        if is_ros_type(spec.msg_type):
            installed_definition(spec.msg_type)
        super().__init__(spec, inboxes)
        self.process = process
        self.topic = process.resolve_name(spec.topic)
        self.received = 0
        self.lost: int | None = None
        self.rejections = RejectionCounter()
        self._on_close = on_close
        self._sources: dict[tuple[str, ...], _Source] = {}
        self._subscriber: Any = None

    def subscribe(self) -> None:
        """Subscribe at the ROS master."""
        with self._changed:
            self.process.subscriber_counts[self.topic] += 1
        self.process.shutdown_callbacks.add(self._on_rospy_shutdown)
        self._subscriber = self.process.rospy.Subscriber(
            self.topic, self.process.rospy.AnyMsg, self._receive, buff_size=_BUFFER_BYTES, tcp_nodelay=True
        )

    @property
    def refused(self) -> int:
        """Number of messages rejected as malformed or of a wrong type."""
        return self.rejections.count

    @property
    def problem(self) -> str:
        """Reason why messages can't be decoded or were rejected in the last seconds; "" if there is none."""
        return super().problem or self.rejections.recent_message()

    # ---- callbacks of rospy, in a thread per connection

    def _receive(self, raw: Any) -> None:  # noqa: ANN401 - rospy is not typed
        header: Mapping[str, str] = raw._connection_header  # noqa: SLF001 - rospy documents it
        body = memoryview(_bytes_of(raw))
        with self._changed:
            if self.is_closed:
                return
            source = self._source_of(header)
            if source.last_message is raw:
                return  # latched: rospy may deliver a connection's last message twice
            source.last_message = raw if header.get("latching") == "1" else None
            try:
                message = self._read(source, body)
            except (WireError, struct.error) as error:
                self._reject(error.reason if isinstance(error, WireError) else _("the data is truncated"))
                return
            dropped = self._put_locked(message)
            self.received += 1 - dropped
            if dropped:
                self.lost = (self.lost or 0) + dropped

    def _on_rospy_shutdown(self) -> None:
        # `poll` raises from now on.
        with self._changed:
            self.notify_waiting()
        self._inboxes.wake()

    def _source_of(self, header: Mapping[str, str]) -> _Source:
        key = tuple(header.get(each, "") for each in ("callerid", "type", "md5sum", "latching"))
        source = self._sources.get(key)
        if source is None:
            if len(self._sources) >= _MAX_SOURCES:
                self._sources.clear()
            source = self._sources[key] = self._new_source(header)
        return source

    def _new_source(self, header: Mapping[str, str]) -> _Source:
        ros_type = header.get("type", "")
        text, md5sum = header.get("message_definition", ""), header.get("md5sum", "*")
        try:
            unpacker = unpacker_for(self.spec.msg_type, ros_type, text, md5sum)
        except NepError as error:
            node_name = escaped(shortened(header.get("callerid", "").lstrip("/"), 100))
            problem = _("messages from '{name}' can't be read: {why}").format(name=node_name, why=str(error))
            return _Source(None, None, problem)
        is_latched = header.get("latching") == "1"
        codec = unpacker.codec
        kind = MessageKind(self.spec.topic, codec.name, unpacker.msg_type, is_latched, codec.decode)
        name = header.get("callerid", "")
        is_own = name == self.process.name
        publisher = publisher_id(name, self.topic) if name and not is_own else None
        return _Source(unpacker, kind, publisher=publisher, is_local=is_own)

    def _read(self, source: _Source, body: memoryview) -> Message:
        if source.unpacker is None or source.kind is None:
            raise WireError(source.problem, len(body))
        try:
            data, extension = source.unpacker.unpack(body)
        except DecodeError as error:
            raise WireError(error.reason, len(body)) from error
        message = received_message(source.kind, data, None, 0, 0, extension or NO_EXTENSION)
        message.seq = None
        message.publisher = source.publisher
        if source.is_local:
            message.publisher = self.process.local_publisher_id(self.topic)
        if source.unpacker.has_header:
            seq, secs, nsecs = STAMP.unpack_from(body, 0)
            message.stamp_ns = secs * 1_000_000_000 + nsecs
            message.seq = seq
            self._count_losses(source, seq)
        return message

    def _count_losses(self, source: _Source, seq: int) -> None:
        # A gap counts as lost messages; a smaller number means that the publisher has restarted.
        gap = seq - source.seq - 1
        if source.seq and gap >= 0:
            self.lost = (self.lost or 0) + gap
        elif seq and self.lost is None:
            self.lost = 0
        source.seq = seq

    def _reject(self, reason: str) -> None:
        if self.rejections.add(reason):
            _logger.warning("malformed message on '%s': %s", self.spec.topic, reason)

    # ---- reading

    @property
    def has_input(self) -> bool:
        """True if input is available or the subscriber is closed."""
        return super().has_input or self.process.is_shut_down

    def poll(self) -> Message | None:
        """Return the next message, or None if there is none.

        Raises `RosShutdownError` after rospy was shut down.
        """
        message = super().poll()
        if message is None and self.process.is_shut_down and not self.is_closed:
            raise RosShutdownError
        return message

    def close(self, timeout_s: float = 2.0) -> None:
        """Unregister within `timeout_s` seconds and discard unread messages."""
        if not self._close_inbox():
            return
        with self._changed:
            self.process.subscriber_counts[self.topic] -= 1
        self.process.shutdown_callbacks.discard(self._on_rospy_shutdown)
        self._on_close(self)
        if self._subscriber is not None:
            self.process.unsubscribe(self._subscriber, timeout_s)
