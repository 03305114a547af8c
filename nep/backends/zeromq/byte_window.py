"""Flow control in bytes, because libzmq bounds its queues only by a number of messages. No sockets.

`SendWindow` is for subscribers that acknowledge what they have read; it covers the queues of both sockets and
of the kernel. `Backlog` is for all others and covers only what libzmq still queues in this process.
"""

from __future__ import annotations

from collections import deque
from typing import Protocol

WINDOW_BYTES = 192 * 2**20
"""Maximum number of unacknowledged bytes per subscriber. With the batch in its sink this makes 256 MB."""
MIN_WINDOW_BYTES = 24 * 2**20
"""Smallest window that a subscriber may request: two steps, so that messages don't wait for each
acknowledgement.
"""
ACK_STEP_BYTES = 12 * 2**20
"""Bytes after which a subscriber is asked for an acknowledgement."""
BACKLOG_STEP_BYTES = 2**20
"""Bytes after which a message is tracked for subscribers without acknowledgements."""
_ENTRY_BYTES = 2**20
"""Small messages share an entry up to this size; it is acknowledged with its newest message."""
_ACK_RETRY_S = 0.5
"""Interval to repeat a request while a subscriber has no room: libzmq drops requests when its queue is full.
"""


class SendWindow:
    """Unacknowledged messages of one subscriber. Guarded by the publisher's lock."""

    def __init__(self) -> None:
        self.unacked_bytes = 0
        """Unacknowledged bytes."""
        self._bound = WINDOW_BYTES
        self._sent: deque[tuple[int, int]] = deque()
        self._bytes_since_request = 0
        self._requested_at = float("-inf")
        self._has_drops = False

    def has_room(self, size_bytes: int) -> bool:
        """Return True if a message of this size can be sent.

        One larger than the window waits for an almost empty one.
        """
        return self.unacked_bytes <= ACK_STEP_BYTES or self.unacked_bytes + size_bytes <= self._bound

    def sent(self, seq: int, size_bytes: int) -> None:
        """Count `size_bytes` that were sent up to and including message `seq`."""
        if self._sent and self._sent[-1][1] + size_bytes <= _ENTRY_BYTES:
            self._sent.append((seq, self._sent.pop()[1] + size_bytes))
        else:
            self._sent.append((seq, size_bytes))
        self.unacked_bytes += size_bytes
        self._bytes_since_request += size_bytes

    def note_drop(self) -> None:
        """Note that a message was dropped for lack of room."""
        self._has_drops = True

    def should_notify(self) -> bool:
        """Return True, once, if the subscriber has room again after a drop and should be notified."""
        if not self._has_drops or self.unacked_bytes > ACK_STEP_BYTES:
            return False
        self._has_drops = False
        return True

    def acknowledge(self, seq: int, bound_bytes: int) -> None:
        """Process an acknowledgement of everything up to `seq`, and adopt `bound_bytes` as the window."""
        self._bound = max(MIN_WINDOW_BYTES, min(bound_bytes, WINDOW_BYTES))
        while self._sent and self._sent[0][0] <= seq:
            self.unacked_bytes -= self._sent.popleft()[1]

    def should_request_ack(self, now: float, *, has_room: bool) -> bool:
        """Return True, and reset the interval, if the subscriber should be asked for an acknowledgement."""
        if self._bytes_since_request < ACK_STEP_BYTES and (
            has_room or now < self._requested_at + _ACK_RETRY_S
        ):
            return False
        self._bytes_since_request = 0
        self._requested_at = now
        return True


class Tracker(Protocol):
    """Object that reports when libzmq has released a message, as `zmq.MessageTracker` does."""

    @property
    def done(self) -> bool:
        """True after libzmq has released the message for all connections."""


class Backlog:
    """Upper bound of what libzmq queues for the slowest subscriber without acknowledgements.

    Only some messages are tracked. Messages are released in order, so while a tracked one is queued, all sent
    since are counted as queued, too.
    """

    def __init__(self) -> None:
        self._held: deque[tuple[Tracker, int]] = deque()
        self._bytes = 0

    def has_room(self, size_bytes: int) -> bool:
        """Return True if a message of this size can be sent."""
        while self._held and self._held[0][0].done:
            self._bytes -= self._held.popleft()[1]
        return self._bytes <= BACKLOG_STEP_BYTES or self._bytes + size_bytes <= WINDOW_BYTES

    def sent(self, tracker: Tracker, size_bytes: int) -> None:
        """Count `size_bytes` sent since the last call; `tracker` belongs to the newest message."""
        self._held.append((tracker, size_bytes))
        self._bytes += size_bytes
