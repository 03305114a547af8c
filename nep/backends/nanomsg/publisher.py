"""Publisher that subscribers find through the master.

A PUB socket doesn't report its subscribers. Subscribers therefore send a hello to a second port, with
the local address of their connection. Once the hello and the connection have both arrived, the
publisher sends the history and an echo, as on the native wire. Messages are sent in the publishing
thread; hellos are read in the I/O thread.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

from nep.backends.base import PublisherSpec
from nep.backends.bases.publisher import BasePublisher
from nep.backends.bases.rejections import RejectionCounter
from nep.backends.nanomsg.endpoints import format_endpoint, subscriber_topic_part
from nep.backends.nanomsg.library import bound_port, listen, load_pynng, new_socket, queue_length
from nep.backends.zeromq.io_thread import Pollable, PollState
from nep.backends.zeromq.publisher import HandshakePublisher
from nep.errors import ClosedError
from nep.messages.encoded import Encoded
from nep.messages.history import History
from nep.protocol.wire import (
    BYE,
    MAX_SUBSCRIPTION_BYTES,
    Header,
    extension_part,
    parse_hello,
    topic_part,
)
from nep.system.addresses import LOOPBACK
from nep.system.waits import wait_until

_logger = logging.getLogger("nep")
_MAX_HELLOS = 10_000
_HELLO_QUEUE_LENGTH = 1000
_BYE_RETRY_S = 0.05


class NanomsgPublisher(HandshakePublisher, BasePublisher):
    """Publisher with a PUB socket for messages and a PULL socket for hellos.

    Never close pynng objects with the lock held: closing waits for callbacks in other threads, which
    acquire the lock.
    """

    def __init__(
        self,
        spec: PublisherSpec,
        on_close: Callable[[NanomsgPublisher, float], None],
        serve_soon: Callable[[Pollable], None],
    ) -> None:
        nng = load_pynng()
        self._try_again_error = nng.TryAgain
        self.is_local = False
        self._on_close = on_close
        self._serve_soon = serve_soon
        # the history is sent in one burst
        send_queue_length = max(queue_length(spec.codec), 2 * spec.history)
        self._message_socket: Any = new_socket("Pub0", send_buffer_size=send_queue_length)
        self._hello_socket: Any = new_socket(
            "Pull0", recv_buffer_size=_HELLO_QUEUE_LENGTH, recv_max_size=MAX_SUBSCRIPTION_BYTES
        )
        self.fd = int(self._hello_socket.recv_fd)
        self._endpoint = ""
        self._history: History[bytes] = History(spec.history)
        self._topic = topic_part(spec.topic)
        self._is_closed = False
        self._is_released = False
        self._pipes: dict[int, str] = {}
        """Remote address of each connection, by its id."""
        self._hellos: dict[str, int] = {}
        """Subscriber id by the address of its connection, which may not be established yet."""
        self._events: deque[tuple[int, str]] = deque()
        self._rejections = RejectionCounter()
        changed = threading.Condition(threading.Lock())
        BasePublisher.__init__(self, spec, changed)
        HandshakePublisher.__init__(self, changed, {})
        self._message_socket.add_post_pipe_connect_cb(self._handle_pipe_added)
        self._message_socket.add_post_pipe_remove_cb(self._handle_pipe_removed)

    # ---- subscribers

    @property
    def subscribers(self) -> int:
        """Number of subscribers that have sent a hello and are still connected."""
        return len(self._counts_at_hello)

    @property
    def has_subscribers(self) -> bool:
        """True if any subscriber is connected, with or without a hello."""
        return bool(self._pipes)

    def move(self, hosts: Sequence[str]) -> tuple[str, ...]:  # noqa: ARG002 - loopback only
        """Listen on the loopback interface on the first call, and return the endpoint.

        `hosts` is ignored, because this back end connects only nodes of one computer. Raises
        `AddressInUseError` and `TooManyFilesError`.
        """
        if not self._endpoint:
            owner = f"a publisher of '{self.spec.topic}'"
            message_listener, hello_listener = (
                listen(each, f"{LOOPBACK}:0", owner) for each in (self._message_socket, self._hello_socket)
            )
            self._endpoint = format_endpoint(
                LOOPBACK, bound_port(message_listener), bound_port(hello_listener)
            )
        return (self._endpoint,)

    def unbind_local(self) -> None:
        """Do nothing, because this back end has no Unix sockets."""

    # ---- sending

    def send(self, encoded: Encoded) -> None:
        """Publish one message.

        Raises `ClosedError`, and `WireError` for an extension that can't be encoded.
        """
        data, extension_fields = encoded
        extension = extension_part(extension_fields) if extension_fields else b""
        size = len(data) if isinstance(data, bytes) else data.nbytes
        with self._changed:
            if self._is_closed:
                raise ClosedError(f"publisher '{self.spec.topic}'")
            header = self._next_header_locked(size, has_extension=bool(extension))
            tail = b"".join((header.pack(), data, extension))
            self._history.add(tail, size)
            self._message_socket.send(self._topic + tail, block=False)

    # ---- subscribers, in the I/O thread

    def serve(self, now: float) -> PollState:  # noqa: ARG002 - nothing to schedule
        """Process hellos, connections and disconnections."""
        with self._changed:
            while self._events:
                self._update_connection_locked(*self._events.popleft())
            while not self._is_released:
                try:
                    frame = self._hello_socket.recv(block=False)
                except self._try_again_error:
                    break
                self._process_hello_locked(frame)
        return PollState()

    def _handle_pipe_added(self, pipe: Any) -> None:  # noqa: ANN401 - pynng is not typed
        self._events.append((pipe.id, str(pipe.remote_address)))
        self._serve_soon(self)

    def _handle_pipe_removed(self, pipe: Any) -> None:  # noqa: ANN401 - pynng is not typed
        self._events.append((pipe.id, ""))
        self._serve_soon(self)

    def _update_connection_locked(self, pipe: int, address: str) -> None:
        # `address` is "" for a closed connection. Call with the lock held.
        if address:
            self._pipes[pipe] = address
            self._complete_handshake_locked(address)
            return
        subscriber = self._hellos.pop(self._pipes.pop(pipe, ""), None)
        if subscriber is not None and subscriber not in self._hellos.values():  # otherwise it has reconnected
            self._counts_at_hello.pop(subscriber, None)
            self._changed.notify_all()

    def _process_hello_locked(self, frame: bytes) -> None:
        address, _space, part = frame.partition(b" ")
        hello = parse_hello(part)
        if hello is not None and len(self._hellos) >= _MAX_HELLOS:
            self._discard_unconnected_hellos_locked()
        if hello is None or hello.topic != self.spec.topic or len(self._hellos) >= _MAX_HELLOS:
            if self._rejections.add(f"an invalid hello of {len(frame)} bytes"):
                _logger.info("'%s' received %s", self.spec.topic, self._rejections.recent_message())
            return
        remote = address.decode("ascii", "replace")
        self._hellos[remote] = hello.subscriber
        if remote in self._pipes.values():
            self._complete_handshake_locked(remote)

    def _discard_unconnected_hellos_locked(self) -> None:
        # Discards hellos whose connection was never established or is closed. Call with the lock held.
        connected_addresses = set(self._pipes.values())
        self._hellos = {
            address: subscriber
            for address, subscriber in self._hellos.items()
            if address in connected_addresses
        }

    def _complete_handshake_locked(self, address: str) -> None:
        # Sends the history, then the echo, after which the subscriber counts losses. Call with the lock held.
        subscriber = self._hellos.get(address)
        if subscriber is None or self._is_released:
            return
        self._counts_at_hello[subscriber] = self.count
        for message in self._history:
            self._message_socket.send(
                subscriber_topic_part(subscriber, self.spec.topic) + message, block=False
            )
        self._send_notice_locked(subscriber, 0)
        self._changed.notify_all()

    def _send_notice_locked(self, subscriber: int, flags: int) -> None:
        header = Header(self.spec.codec.number, flags, self.count, time.time_ns(), self.spec.id)
        self._message_socket.send(
            subscriber_topic_part(subscriber, self.spec.topic) + header.pack(), block=False
        )

    # ---- closing

    def close(self, timeout_s: float) -> None:
        """Unregister, flush for up to `timeout_s` seconds and close the sockets. Must be called only once."""
        self._on_close(self, timeout_s)

    def send_bye(self) -> None:
        """Send the bye, after which subscribers read the remaining messages and disconnect."""
        with self._changed:
            self._is_closed = True
            self._send_bye_locked()

    def finish(self, deadline: float) -> None:
        """Wait until all subscribers have disconnected; log undelivered messages at `deadline`.

        `deadline` is a time of `time.monotonic`.
        """
        with self._changed:
            while self._counts_at_hello and (remaining_s := deadline - time.monotonic()) > 0.0:
                if not wait_until(
                    self._changed, lambda: not self._counts_at_hello, min(remaining_s, _BYE_RETRY_S)
                ):
                    self._send_bye_locked()  # a full queue drops the bye like any other message
            undelivered_counts = [
                max(self.count - seen_count, len(self._history))
                for seen_count in self._counts_at_hello.values()
            ]
            if any(undelivered_counts):
                _logger.warning(
                    "'%s' was closed before %d subscriber(s) received everything: "
                    "up to %d messages not delivered",
                    self.spec.topic,
                    sum(map(bool, undelivered_counts)),
                    max(undelivered_counts),
                )
            self._counts_at_hello.clear()

    def release(self) -> None:
        """Close the sockets. The I/O thread must have stopped serving them."""
        with self._changed:
            if self._is_released:
                return
            self._is_closed = self._is_released = True
        self._hello_socket.close()
        self._message_socket.close()

    def _send_bye_locked(self) -> None:
        for subscriber in () if self._is_released else self._counts_at_hello:
            self._send_notice_locked(subscriber, BYE)
