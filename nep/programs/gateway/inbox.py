"""What native threads hand to the gateway's thread: a bounded queue that wakes a poll."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections import deque

from nep.messages.message import Message

MAX_MESSAGES = 10_000
MAX_BYTES = 64 * 1024 * 1024


class NativeInbox:
    """Any thread posts, one thread takes. When it is full the newest is refused and counted."""

    def __init__(self, max_messages: int = MAX_MESSAGES, max_bytes: int = MAX_BYTES) -> None:
        self._lock = threading.Lock()
        self._waiting: deque[Message] = deque()
        self._size_bytes = 0
        self._max_messages = max_messages
        self._max_bytes = max_bytes
        self._dropped = 0
        self._ear, self._bell = socket.socketpair()
        self._ear.setblocking(False)
        self._bell.setblocking(False)

    def fileno(self) -> int:
        """What a poll watches: readable when something was posted."""
        return self._ear.fileno()

    @property
    def dropped(self) -> int:
        """How many were refused because the queue was full."""
        return self._dropped

    def post(self, message: Message) -> None:
        """Queue one message and wake the reader."""
        size = message.size_bytes
        with self._lock:
            if len(self._waiting) >= self._max_messages or self._size_bytes + size > self._max_bytes:
                self._dropped += 1
                return
            was_empty = not self._waiting
            self._waiting.append(message)
            self._size_bytes += size
        if was_empty:
            self.wake()

    def wake(self) -> None:
        """Make the reader look, also when nothing was posted."""
        with contextlib.suppress(OSError):  # a full bell rings already, a closed one has no listener
            self._bell.send(b"\x00")

    def take(self) -> list[Message]:
        """Everything that was posted, oldest first."""
        with contextlib.suppress(BlockingIOError):
            self._ear.recv(4096)
        with self._lock:
            taken = list(self._waiting)
            self._waiting.clear()
            self._size_bytes = 0
        return taken

    def close(self) -> None:
        """Give the two handles back."""
        self._ear.close()
        self._bell.close()
