"""BUS socket connected to publishers; it sends a hello over each new connection.

Not thread-safe. See `nep.backends.zeromq.subscriber.Readable`.
"""

from __future__ import annotations

import contextlib
import logging
from typing import Any

import zmq

from nep.backends.base import SubscriberSpec
from nep.backends.bases.loss import PublisherTracker
from nep.backends.bases.message_parser import MessageParser
from nep.backends.bases.rejections import RejectionCounter
from nep.backends.nanomsg.endpoints import parse_endpoint, split_message, subscriber_topic_part
from nep.backends.nanomsg.library import FDS_PER_CONNECTION, load_pynng, new_socket, queue_length
from nep.backends.zeromq.sockets import SHORT_WAIT_S, is_remote
from nep.backends.zeromq.subscriber import UnbatchedReader
from nep.errors import TooManyFilesError, WireError
from nep.i18n import _
from nep.messages.codecs import Codec, codec_for
from nep.messages.history import MAX_HISTORY
from nep.messages.message import Message
from nep.protocol.requests import RemotePublisher
from nep.protocol.wire import hello_part, topic_part
from nep.system.descriptors import check_free_descriptors

_logger = logging.getLogger("nep")
_MAX_SKIPPED_MESSAGES = 1000
"""Maximum number of messages skipped at once, so that a publisher can't keep a thread busy."""


class PollableSocket:
    """Socket that receives messages, with a file descriptor for polling.

    Args:
        kind: Name of pynng's class, such as "Sub0".
        codec: Codec of the messages.
        options: Further options of the socket.
    """

    def __init__(self, kind: str, codec: Codec, **options: object) -> None:
        nng = load_pynng()
        self._empty_errors = (nng.TryAgain, nng.Timeout, nng.Closed)
        self.socket: Any = new_socket(
            kind,
            recv_buffer_size=queue_length(codec),
            recv_max_size=0,
            recv_timeout=round(SHORT_WAIT_S * 1000),
            **options,
        )
        self.fd = int(self.socket.recv_fd)
        self._queue_length = queue_length(codec)
        self._is_closed = False

    @property
    def has_input(self) -> bool:
        """True if a message can be read."""
        return not self._is_closed and bool(zmq.zmq_poll([(self.fd, zmq.POLLIN)], 0))

    def enlarge_queue(self, history: int) -> None:
        """Enlarge the receive queue so that a history of `history` messages fits."""
        required_length = 2 * min(history, MAX_HISTORY)
        if required_length > self._queue_length:
            self._queue_length = self.socket.recv_buffer_size = required_length

    def recv(self, *, may_wait: bool) -> bytes | None:
        """Return the next message, or None if there is none; with `may_wait`, wait up to `SHORT_WAIT_S`."""
        try:
            return bytes(self.socket.recv(block=may_wait))
        except self._empty_errors:
            return None
        except RuntimeError:  # pynng can't return a message of 0 bytes
            return b""

    def close(self) -> None:
        """Close the socket."""
        self._is_closed = True
        self.socket.close()


class NanomsgSubSocket(UnbatchedReader):
    """Subscriber socket for publishers of this back end. Endpoints of other back ends set `problem`."""

    def __init__(self, spec: SubscriberSpec) -> None:
        self.sources = PublisherTracker()
        self.rejections = RejectionCounter()
        self._nng_error = load_pynng().NNGException
        self._bus = PollableSocket(
            "Bus0", codec_for(spec.msg_type), reconnect_time_min=100, reconnect_time_max=1000
        )
        self.fd = self._bus.fd
        self._topic_name = spec.topic
        self._topic = topic_part(spec.topic)
        self._own_topic = subscriber_topic_part(spec.id, spec.topic)
        self._hello = hello_part(spec.id, spec.topic)
        self._parser = MessageParser(
            spec, self._own_topic, self.sources, self.disconnect, lambda _publisher, _seq: None
        )
        self._dialers: dict[int, Any] = {}
        """Dialers by publisher id."""
        self._bus.socket.add_post_pipe_connect_cb(self._send_hello)

    @property
    def received(self) -> int:
        """Number of messages received."""
        return self.sources.received

    @property
    def lost(self) -> int:
        """Number of messages lost."""
        return self.sources.lost

    @property
    def problem(self) -> str:
        """Reason why messages of a listed publisher can't be received; "" if there is none."""
        problem_sources = (
            each for each in self.sources.by_id.values() if each.problem and not each.is_silent
        )
        return next((each.problem for each in problem_sources), "")

    @property
    def has_input(self) -> bool:
        """True if a message can be read."""
        return self._bus.has_input

    # ---- connections

    def connect(self, remote: RemotePublisher) -> None:
        """Connect to a publisher, and disconnect from silent publishers that it replaces. Idempotent."""
        for replaced in self.sources.replaced_publishers(remote):
            self.sources.count_missing(replaced)
            self.disconnect(replaced)
        source = self.sources.add_listed(remote)
        self._bus.enlarge_queue(remote.publisher.history)
        source.is_silent = False
        source.bye_deadline = None
        endpoint = remote.publisher.endpoints[0] if remote.publisher.endpoints else ""
        url = parse_endpoint(endpoint)
        if not endpoint or endpoint == source.failed_endpoint or (url and url == source.endpoint):
            return
        source.failed_endpoint = source.problem = ""
        reason = self._connect(remote.publisher.id, url) if url else _("not an endpoint of 'nanomsg'")
        if reason:
            source.failed_endpoint = endpoint
            source.problem = _("can't connect to the endpoint '{shown}' of '{name}': {why}").format(
                shown=ascii(endpoint[:100])[1:-1], name=remote.node_name, why=reason
            )
            if self.rejections.add(source.problem):
                _logger.warning("subscription to '%s': %s", self._topic_name, source.problem)

    def _connect(self, publisher: int, url: str) -> str:
        # Replaces the connection to a publisher. Returns the error, or "".
        self._close_dialer(publisher)
        source = self.sources.get(publisher)
        source.reset_connection(url)
        try:
            check_free_descriptors(FDS_PER_CONNECTION, f"a subscriber of '{self._topic_name}'")
            self._dialers[publisher] = self._bus.socket.dial(url, block=False)
        except (self._nng_error, TooManyFilesError) as error:
            return str(error)
        source.endpoint = url
        return ""

    def _send_hello(self, _pipe: object) -> None:
        # Called in a thread of pynng. A BUS socket sends to all; publishers that know the hello ignore it.
        with contextlib.suppress(self._nng_error):  # closed meanwhile
            self._bus.socket.send(self._hello, block=False)

    def reconnect_remote(self) -> None:
        """Reconnect to publishers on other computers, because the address of this computer has changed."""
        for publisher, source in self.sources.items():
            if is_remote(source.endpoint):
                self._connect(publisher, source.endpoint)

    def reconnect(self, publisher: int) -> None:
        """Disconnect from the endpoint of a known publisher and connect to it again."""
        self._connect(publisher, self.sources.get(publisher).endpoint)

    def disconnect(self, publisher: int) -> None:
        """Disconnect from a publisher and remove it."""
        self.sources.pop(publisher)
        self._close_dialer(publisher)

    def _close_dialer(self, publisher: int) -> None:
        dialer = self._dialers.pop(publisher, None)
        if dialer is not None:
            dialer.close()

    # ---- reading

    def read(self, *, may_wait: bool = False) -> Message | None:
        """Return the next message, or None if there is none; with `may_wait`, wait up to `SHORT_WAIT_S`.

        Also returns None after `_MAX_SKIPPED_MESSAGES` notices, malformed messages and messages to others.
        """
        for number in range(_MAX_SKIPPED_MESSAGES):
            frame = self._bus.recv(may_wait=may_wait and not number)
            if frame is None:
                break
            try:
                parts = split_message(frame, self._topic, self._own_topic)
                message = None if parts is None else self._parser.parse(*parts)
            except WireError as error:
                if self.rejections.add(error.reason):
                    _logger.warning("malformed message on '%s': %s", self._topic_name, error)
                continue
            if message is not None:
                return message
        return None

    def count_dropped(self, count: int) -> None:
        """Add received messages that were dropped from the full queue to the losses."""
        self.sources.count_dropped(count)

    def close(self) -> None:
        """Close the socket and all connections."""
        self._bus.close()
