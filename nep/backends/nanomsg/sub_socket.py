"""SUB socket connected to publishers, with a hello sent to the second port of each publisher.

Not thread-safe. See `nep.backends.zeromq.subscriber.Readable`.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Any

import zmq

from nep.backends.base import SubscriberSpec
from nep.backends.bases.loss import PublisherTracker
from nep.backends.bases.message_parser import MessageParser
from nep.backends.bases.rejections import RejectionCounter
from nep.backends.nanomsg.endpoints import parse_endpoint, split_message, subscriber_topic_part
from nep.backends.nanomsg.library import FDS_PER_SOCKET, load_pynng, new_socket, queue_length
from nep.backends.zeromq.sockets import SHORT_WAIT_S
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
_HELLO_QUEUE_LENGTH = 8


class PollableSub:
    """SUB socket with a file descriptor for polling."""

    def __init__(self, codec: Codec) -> None:
        nng = load_pynng()
        self._empty_errors = (nng.TryAgain, nng.Timeout, nng.Closed)
        self.socket: Any = new_socket(
            "Sub0",
            recv_buffer_size=queue_length(codec),
            recv_max_size=0,
            recv_timeout=round(SHORT_WAIT_S * 1000),
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

    def close(self) -> None:
        """Close the socket."""
        self._is_closed = True
        self.socket.close()


@dataclass
class _Link:
    # Connection to a publisher, with the PUSH socket for the hello.
    endpoint: str
    address: str
    hello_socket: Any
    dialer: Any = None

    def close(self) -> None:
        if self.dialer is not None:
            self.dialer.close()
        self.hello_socket.close()


class NanomsgSubSocket(UnbatchedReader):
    """Subscriber socket for publishers of this back end. Endpoints of other back ends set `problem`."""

    def __init__(self, spec: SubscriberSpec) -> None:
        self.sources = PublisherTracker()
        self.rejections = RejectionCounter()
        self._sub = PollableSub(codec_for(spec.msg_type))
        self.fd = self._sub.fd
        self._topic_name = spec.topic
        self._topic = topic_part(spec.topic)
        self._own_topic = subscriber_topic_part(spec.id, spec.topic)
        self._hello = hello_part(spec.id, spec.topic)
        self._parser = MessageParser(
            spec, self._own_topic, self.sources, self.disconnect, lambda _publisher, _seq: None
        )
        self._links: dict[int, _Link] = {}
        self._hello_sockets: dict[str, Any] = {}
        """Sockets for the hellos, by address of the publisher. Also read by pynng's threads."""
        self._sub.socket.subscribe(self._topic)
        self._sub.socket.subscribe(self._own_topic)
        self._sub.socket.add_post_pipe_connect_cb(self._handle_pipe_added)

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
        return self._sub.has_input

    def connect(self, remote: RemotePublisher) -> None:
        """Connect to a publisher, and disconnect from silent publishers that it replaces. Idempotent."""
        for replaced in self.sources.replaced_publishers(remote):
            self.sources.count_missing(replaced)
            self.disconnect(replaced)
        source = self.sources.add_listed(remote)
        self._sub.enlarge_queue(remote.publisher.history)
        source.is_silent = False
        source.bye_deadline = None
        endpoint = remote.publisher.endpoints[0] if remote.publisher.endpoints else ""
        link = self._links.get(remote.publisher.id)
        if (
            not endpoint
            or endpoint == source.failed_endpoint
            or (link is not None and link.endpoint == endpoint)
        ):
            return
        if link is not None:
            self._remove_link(remote.publisher.id)
            source.has_echoed = False
        source.failed_endpoint = source.problem = source.endpoint = ""
        addresses = parse_endpoint(endpoint)
        reason = "" if addresses is None else self._create_link(remote.publisher.id, endpoint, *addresses)
        if addresses is not None and not reason:
            source.endpoint = f"tcp://{addresses[0]}"
            return
        source.failed_endpoint = endpoint
        source.problem = _("can't connect to the endpoint '{shown}' of '{name}': {why}").format(
            shown=ascii(endpoint[:100])[1:-1],
            name=remote.node_name,
            why=reason or _("not an endpoint of 'nanomsg'"),
        )
        if self.rejections.add(source.problem):
            _logger.warning("subscription to '%s': %s", self._topic_name, source.problem)

    def _create_link(self, publisher: int, endpoint: str, address: str, hello_address: str) -> str:
        # The hello is sent once the connection is established. Returns the error, or "".
        nng = load_pynng()
        try:
            check_free_descriptors(2 * FDS_PER_SOCKET, f"a subscriber of '{self._topic_name}'")
            # with a queue, sending never blocks pynng's threads
            link = _Link(endpoint, address, new_socket("Push0", send_buffer_size=_HELLO_QUEUE_LENGTH))
            self._links[publisher] = link
            self._hello_sockets[address] = link.hello_socket
            link.hello_socket.dial(f"tcp://{hello_address}", block=False)
            link.dialer = self._sub.socket.dial(f"tcp://{address}", block=False)
        except (nng.NNGException, TooManyFilesError) as error:
            self._remove_link(publisher)
            return str(error)
        return ""

    def _handle_pipe_added(self, pipe: Any) -> None:  # noqa: ANN401 - pynng is not typed
        # Called in a thread of pynng. Sends the hello with the local address of the connection.
        hello_socket = self._hello_sockets.get(str(pipe.remote_address))
        if hello_socket is not None:
            hello_socket.send(str(pipe.local_address).encode() + b" " + self._hello, block=False)

    def reconnect_remote(self) -> None:
        """Do nothing, because this back end connects only nodes of one computer."""

    def reconnect(self, publisher: int) -> None:
        """Do nothing, because nanomsg reconnects automatically."""

    def disconnect(self, publisher: int) -> None:
        """Disconnect from a publisher and remove it."""
        self.sources.pop(publisher)
        self._remove_link(publisher)

    def _remove_link(self, publisher: int) -> None:
        link = self._links.pop(publisher, None)
        if link is not None:
            self._hello_sockets.pop(link.address, None)
            link.close()

    def read(self, *, may_wait: bool = False) -> Message | None:
        """Return the next message, or None if there is none; with `may_wait`, wait up to `SHORT_WAIT_S`."""
        while (frame := self._sub.recv(may_wait=may_wait)) is not None:
            is_alone = frame.startswith(self._own_topic)
            prefix = self._own_topic if is_alone else self._topic
            try:
                message = self._parser.parse(prefix, split_message(frame, prefix, is_alone=is_alone))
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
        """Close all sockets."""
        for publisher in list(self._links):
            self._remove_link(publisher)
        self._sub.close()
