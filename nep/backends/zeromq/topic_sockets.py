"""Sockets of a subscriber to a pattern: one for each topic, read as one.

libzmq sends every filter of a SUB socket to every publisher that the socket connects to. With one socket for
all topics, each publisher would therefore receive and store the filters of all of them, see
docs/adr/0044-one-subscriber-for-many-topics.md.
"""

from __future__ import annotations

import logging
import select
import sys
import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol

import zmq

from nep.backends.base import SubscriberSpec
from nep.backends.bases.message_parser import MessageBuffer
from nep.backends.bases.rejections import RejectionCounter
from nep.backends.zeromq.sockets import SHORT_WAIT_S
from nep.backends.zeromq.subscriber import NativeReadable
from nep.errors import NepError
from nep.messages.message import Message
from nep.system.descriptors import check_free_descriptors
from nep.system.forks import call_in_child
from nep.system.log_rarely import is_logged
from nep.system.wakeup import Waker

_logger = logging.getLogger("nep")
_POLLIN = int(zmq.POLLIN)
_MAX_TOPICS = 2_000
"""Maximum number of topics per subscriber, because any program can publish on any number of topics."""
_FDS_PER_GROUP = 4
_RETRY_S = 1.0


class DescriptorGroup(Protocol):
    """Group of file descriptors that are polled as one."""

    fd: int
    """Descriptor that is readable while `take_readable` returns any."""

    def add(self, fd: int) -> None:
        """Add a descriptor."""

    def remove(self, fd: int) -> None:
        """Remove a descriptor. Call before closing it."""

    def take_readable(self) -> Sequence[int]:
        """Return descriptors that have become readable. Those that stay readable are returned again."""

    def close(self) -> None:
        """Close the descriptor of the group."""


class EpollGroup:
    """`DescriptorGroup` of Linux."""

    if sys.platform == "linux":

        def __init__(self) -> None:
            self._epoll = select.epoll()
            self.fd = self._epoll.fileno()
            call_in_child(self.close)

        def add(self, fd: int) -> None:
            """Add a descriptor."""
            self._epoll.register(fd, select.EPOLLIN)

        def remove(self, fd: int) -> None:
            """Remove a descriptor. Call before closing it."""
            self._epoll.unregister(fd)

        def take_readable(self) -> Sequence[int]:
            """Return descriptors that are readable."""
            return [fd for fd, _events in self._epoll.poll(0)]

        def close(self) -> None:
            """Close the descriptor of the group."""
            self._epoll.close()


class ThreadGroup:
    """`DescriptorGroup` for systems on which no descriptor represents several others: a thread polls them."""

    def __init__(self) -> None:
        self._signal, self._interrupt = Waker(), Waker()
        self.fd = self._signal.fd
        self._lock = threading.Lock()
        self._fds: set[int] = set()
        self._readable: set[int] = set()
        self._closing = threading.Event()
        threading.Thread(target=self._run, name="nep-topics", daemon=True).start()

    def add(self, fd: int) -> None:
        """Add a descriptor."""
        with self._lock:
            self._fds.add(fd)
        self._interrupt.wake()

    def remove(self, fd: int) -> None:
        """Remove a descriptor. Call before closing it."""
        with self._lock:
            self._fds.discard(fd)
            self._readable.discard(fd)
        self._interrupt.wake()

    def take_readable(self) -> Sequence[int]:
        """Return descriptors that have become readable. Those that stay readable are returned again."""
        with self._lock:
            readable = tuple(self._readable)
            self._readable.clear()
            if readable:
                self._signal.clear()
                self._interrupt.wake()
        return readable

    def close(self) -> None:
        """End the thread, which closes the descriptor of the group."""
        self._closing.set()
        self._interrupt.wake()

    def _polled(self) -> set[int]:
        with self._lock:
            return {self._interrupt.fd, *(self._fds - self._readable)}

    def _run(self) -> None:
        while not self._closing.is_set():
            polled = self._polled()
            try:
                readable = {fd for fd, _events in zmq.zmq_poll([(fd, _POLLIN) for fd in polled], -1)}
            except (OSError, ValueError, zmq.ZMQError):  # a removed one was closed, or there are too many
                if polled == self._polled():
                    self._closing.wait(_RETRY_S)
                continue
            self._interrupt.clear()
            with self._lock:
                self._readable |= self._fds & readable
                if self._readable:
                    self._signal.wake()
        self._signal.close()
        self._interrupt.close()


def _new_descriptor_group() -> DescriptorGroup:
    return EpollGroup() if sys.platform == "linux" else ThreadGroup()


class TopicSockets:
    """Sockets of all topics that match a pattern. Implements `Readable`; guarded by the subscriber's lock.

    Args:
        new_socket: Creates the socket for a topic.
        spec: Settings of the subscriber; the topic is the pattern.
    """

    def __init__(self, new_socket: Callable[[SubscriberSpec], NativeReadable], spec: SubscriberSpec) -> None:
        self.rejections = RejectionCounter()
        self._new_socket = new_socket
        self._spec = spec
        check_free_descriptors(_FDS_PER_GROUP, f"a subscriber of '{spec.topic}'")
        self._descriptors = _new_descriptor_group()
        self.fd = self._descriptors.fd
        self._by_topic: dict[str, NativeReadable] = {}
        self._by_fd: dict[int, NativeReadable] = {}
        self._pending: dict[NativeReadable, None] = {}
        """Sockets that may have input which their descriptor doesn't signal any more; the next one first."""
        self._counters: tuple[tuple[NativeReadable, ...], int, int] = ((), 0, 0)
        """Open sockets, and the numbers of messages received and lost by closed ones or dropped.

        Replaced as a whole, because the counters are read without the lock.
        """
        self._error = ""
        self._failure_count = 0

    # ---- topics

    @property
    def sockets(self) -> tuple[NativeReadable, ...]:
        """Open sockets. May be read without the lock."""
        return self._counters[0]

    def find(self, topic: str) -> NativeReadable | None:
        """Return the open socket for a topic, or None."""
        return self._by_topic.get(topic)

    def open(self, topic: str) -> NativeReadable | None:
        """Return the socket for a topic, created if needed.

        Returns None if it can't be created: there are `_MAX_TOPICS`, or the process is out of file
        descriptors. `problem` then contains the reason.

        Args:
            topic: Name of the topic.
        """
        existing = self._by_topic.get(topic)
        if existing is not None:
            return existing
        try:
            if len(self._by_topic) >= _MAX_TOPICS:
                raise NepError(f"the pattern is already subscribed to {_MAX_TOPICS} topics")
            socket = self._new_socket(replace(self._spec, topic=topic, is_pattern=False))
        except NepError as error:
            self._error = str(error)
            self._failure_count += 1
            if is_logged(self._failure_count):
                _logger.warning("'%s' can't subscribe to '%s': %s", self._spec.topic, topic, error)
            return None
        self._error = ""
        socket.rejections = self.rejections
        self._by_topic[topic] = self._by_fd[socket.fd] = socket
        self._descriptors.add(socket.fd)
        self._update_sockets(0, 0)
        return socket

    def close_unused(self) -> None:
        """Close the sockets of topics without publishers."""
        for topic, socket in list(self._by_topic.items()):
            if socket.sources.by_id:
                continue
            if socket.has_input:
                self.recheck(socket)
                continue
            del self._by_topic[topic], self._by_fd[socket.fd]
            self._pending.pop(socket, None)
            self._descriptors.remove(socket.fd)
            self._update_sockets(socket.received, socket.lost or 0)
            socket.close()

    def _update_sockets(self, received: int, lost: int) -> None:
        # Adds the statistics of a closed socket.
        _sockets, earlier_received, earlier_lost = self._counters
        self._counters = (tuple(self._by_topic.values()), earlier_received + received, earlier_lost + lost)

    # ---- reading

    def recheck(self, *sockets: NativeReadable) -> None:
        """Check sockets for input at the next read. Call after using them other than by `read_into`."""
        self._pending.update(dict.fromkeys(sockets))

    @property
    def has_input(self) -> bool:
        """True if a message can be read."""
        return self._next_socket() is not None

    def _next_socket(self) -> NativeReadable | None:
        for fd in self._descriptors.take_readable():
            self._pending[self._by_fd[fd]] = None
        while self._pending:
            socket = next(iter(self._pending))
            if socket.has_input:
                return socket
            del self._pending[socket]
        return None

    def read_into(
        self, buffer: MessageBuffer, max_messages: int, max_bytes: int, *, may_wait: bool = False
    ) -> int:
        """Read messages of all topics in turn. See `Readable.read_into`."""
        count = 0
        if may_wait and not self.has_input:
            zmq.zmq_poll([(self.fd, _POLLIN)], round(SHORT_WAIT_S * 1000))
        while count < max_messages and max_bytes > 0:
            socket = self._next_socket()
            if socket is None:
                break
            messages: list[Message] = []
            count += socket.read_into(messages, max_messages - count, max_bytes)
            max_bytes -= sum(message.size_bytes for message in messages)
            buffer.extend(messages)
            del self._pending[socket]
            self._pending[socket] = None  # the last one in turn
        return count

    # ---- statistics

    @property
    def received(self) -> int:
        """Number of messages received on all topics."""
        sockets, received, _lost = self._counters
        return received + sum(each.received for each in sockets)

    @property
    def lost(self) -> int:
        """Number of messages lost on all topics."""
        sockets, _received, lost = self._counters
        return lost + sum(each.lost or 0 for each in sockets)

    @property
    def problem(self) -> str:
        """Reason why messages can't be received; "" if there is none."""
        return self._error or next((each.problem for each in self.sockets if each.problem), "")

    def count_dropped(self, count: int) -> None:
        """Add received messages that were dropped from a full queue to the losses."""
        sockets, received, lost = self._counters
        self._counters = (sockets, received - count, lost + count)

    def close(self) -> None:
        """Close all sockets."""
        self._descriptors.close()
        for socket in self.sockets:
            socket.close()
