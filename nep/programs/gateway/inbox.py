"""Bounded queue from native threads to the gateway's thread, which polls a socket of the queue."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections import deque

from nep.messages.message import Message

MAX_MESSAGES = 10_000
MAX_BYTES = 64 * 1024 * 1024


class NativeInbox:
    """Bounded queue with many writers and one reader. Thread-safe.

    When it is full, new messages are dropped and counted.

    Args:
        max_messages: Maximum number of queued messages.
        max_bytes: Maximum total size of queued messages.
    """

    def __init__(self, max_messages: int = MAX_MESSAGES, max_bytes: int = MAX_BYTES) -> None:
        self._lock = threading.Lock()
        self._messages: deque[Message] = deque()
        self._size_bytes = 0
        self._max_messages = max_messages
        self._max_bytes = max_bytes
        self._dropped = 0
        self._reader, self._writer = socket.socketpair()
        self._reader.setblocking(False)
        self._writer.setblocking(False)

    def fileno(self) -> int:
        """Return the file descriptor that becomes readable when a message is posted."""
        return self._reader.fileno()

    @property
    def dropped(self) -> int:
        """Number of messages dropped because the queue was full."""
        return self._dropped

    def post(self, message: Message) -> None:
        """Queue a message and wake the reader, or drop the message if the queue is full."""
        size_bytes = message.size_bytes
        with self._lock:
            if len(self._messages) >= self._max_messages or self._size_bytes + size_bytes > self._max_bytes:
                self._dropped += 1
                return
            was_empty = not self._messages
            self._messages.append(message)
            self._size_bytes += size_bytes
        if was_empty:
            self.wake()

    def wake(self) -> None:
        """Wake the reader without posting a message."""
        with contextlib.suppress(OSError):  # full: the reader is already woken; closed: there is none
            self._writer.send(b"\x00")

    def pop_all(self) -> list[Message]:
        """Remove and return all messages, oldest first."""
        with contextlib.suppress(BlockingIOError):
            self._reader.recv(4096)
        with self._lock:
            messages = list(self._messages)
            self._messages.clear()
            self._size_bytes = 0
        return messages

    def close(self) -> None:
        """Close both sockets of the queue."""
        self._reader.close()
        self._writer.close()
