"""What is under way to subscribers, in bytes: libzmq bounds its queues by a number of messages only.

A `SendWindow` is for a subscriber that tells what it has read: what is queued here, in the kernel and in its
own socket. `Backlog` is for all others: what libzmq still holds here. No sockets.
"""

from __future__ import annotations

from collections import deque
from typing import Protocol

__all__ = ["BACKLOG_STEP_BYTES", "STEP_BYTES", "WINDOW_BYTES", "WINDOW_LEAST_BYTES", "Backlog", "SendWindow"]

WINDOW_BYTES = 192 * 2**20
"""So much may be under way to one subscriber. With the batch that its sink works on these are 256 MB."""
WINDOW_LEAST_BYTES = 24 * 2**20
"""The least that a subscriber may ask for: two steps, so that nobody waits for each message to be read."""
STEP_BYTES = 12 * 2**20
"""How often a subscriber is asked what it has read."""
BACKLOG_STEP_BYTES = 2**20
"""How often it is noted what libzmq holds for those that cannot be asked."""
_ENTRY_BYTES = 2**20
"""Small messages share an entry, which counts until the newest of them was read."""
_ASK_AGAIN_S = 0.5
"""A subscriber without room is asked again after this: libzmq drops a question when its own queue is full."""


class SendWindow:
    """What was sent to one subscriber and is not known to be read. It lives under its publisher's lock."""

    def __init__(self) -> None:
        self.under_way = 0
        """Bytes."""
        self._bound = WINDOW_BYTES
        self._sent: deque[tuple[int, int]] = deque()
        self._unasked = 0
        self._asked_at = float("-inf")
        self._has_missed = False

    def has_room(self, size_bytes: int) -> bool:
        """Whether a message of this size may follow. A larger one than the window has to wait for a step."""
        return self.under_way <= STEP_BYTES or self.under_way + size_bytes <= self._bound

    def sent(self, seq: int, size_bytes: int) -> None:
        """So many bytes more are under way, up to the message `seq`."""
        if self._sent and self._sent[-1][1] + size_bytes <= _ENTRY_BYTES:
            self._sent.append((seq, self._sent.pop()[1] + size_bytes))
        else:
            self._sent.append((seq, size_bytes))
        self.under_way += size_bytes
        self._unasked += size_bytes

    def missed(self) -> None:
        """There was no room for a message."""
        self._has_missed = True

    def is_to_tell(self) -> bool:
        """Whether it has room again and does not know yet what it missed; True counts as telling."""
        if not self._has_missed or self.under_way > STEP_BYTES:
            return False
        self._has_missed = False
        return True

    def read(self, seq: int, bound_bytes: int) -> None:
        """The subscriber has read everything up to `seq`, and wants so much under way at most."""
        self._bound = max(WINDOW_LEAST_BYTES, min(bound_bytes, WINDOW_BYTES))
        while self._sent and self._sent[0][0] <= seq:
            self.under_way -= self._sent.popleft()[1]

    def is_to_ask(self, now: float, *, has_room: bool) -> bool:
        """Whether to ask it now what it has read; True counts as asking."""
        if self._unasked < STEP_BYTES and (has_room or now < self._asked_at + _ASK_AGAIN_S):
            return False
        self._unasked = 0
        self._asked_at = now
        return True


class Tracker(Protocol):
    """Tells when libzmq has let go of a message's bytes; pyzmq's `MessageTracker`."""

    @property
    def done(self) -> bool:
        """Whether it has, for all connections."""


class Backlog:
    """What libzmq holds for the slowest of those that cannot be asked, at most. Messages leave it in order.

    Only some messages are tracked: while one is held, all since are counted as held, too.
    """

    def __init__(self) -> None:
        self._held: deque[tuple[Tracker, int]] = deque()
        self._bytes = 0

    def has_room(self, size_bytes: int) -> bool:
        """Whether a message of this size may follow."""
        while self._held and self._held[0][0].done:
            self._bytes -= self._held.popleft()[1]
        return self._bytes <= BACKLOG_STEP_BYTES or self._bytes + size_bytes <= WINDOW_BYTES

    def sent(self, tracker: Tracker, size_bytes: int) -> None:
        """So many bytes were sent since the last call; the newest message is tracked."""
        self._held.append((tracker, size_bytes))
        self._bytes += size_bytes
