"""Flow control in bytes, because libzmq limits its queues only by number of messages. No sockets.

`SendWindow` is for subscribers that acknowledge messages; it covers the queues of both sockets and of the
kernel. `Backlog` is for all others; it covers only the messages that libzmq still queues in this process.
"""

from __future__ import annotations

from collections import deque
from typing import Protocol

WINDOW_BYTES = 192 * 2**20
"""Maximum number of unacknowledged bytes per subscriber. Together with a batch in its sink this is 256 MB."""
MIN_WINDOW_BYTES = 24 * 2**20
"""Smallest window that a subscriber may request.

It is two steps long, so that sending continues while an acknowledgement is under way.
"""
ACK_INTERVAL_BYTES = 12 * 2**20
"""Number of bytes after which an acknowledgement is requested from a subscriber."""
TRACKING_INTERVAL_BYTES = 2**20
"""Number of bytes after which a message is tracked for subscribers without acknowledgements."""
_MAX_ENTRY_BYTES = 2**20
"""Maximum size of an entry that several small messages share; acknowledged with its newest message."""
_ACK_RETRY_S = 0.5
"""Interval in seconds for repeating a request. libzmq drops requests while the subscriber's queue is full."""


class SendWindow:
    """Unacknowledged messages of one subscriber. Guarded by the publisher's lock."""

    def __init__(self) -> None:
        self.unacked_bytes = 0
        """Total size of the unacknowledged messages."""
        self._bound = WINDOW_BYTES
        self._sent: deque[tuple[int, int]] = deque()
        self._bytes_since_request = 0
        self._requested_at = float("-inf")
        self._has_drops = False

    def has_room(self, size_bytes: int) -> bool:
        """Return True if a message of this size can be sent.

        A message larger than the window is sent when the window is almost empty.
        """
        return self.unacked_bytes <= ACK_INTERVAL_BYTES or self.unacked_bytes + size_bytes <= self._bound

    def add_sent(self, seq: int, size_bytes: int) -> None:
        """Add `size_bytes` that were sent up to and including message `seq`."""
        if self._sent and self._sent[-1][1] + size_bytes <= _MAX_ENTRY_BYTES:
            self._sent.append((seq, self._sent.pop()[1] + size_bytes))
        else:
            self._sent.append((seq, size_bytes))
        self.unacked_bytes += size_bytes
        self._bytes_since_request += size_bytes

    def record_drop(self) -> None:
        """Record that a message was dropped because the window is full."""
        self._has_drops = True

    def should_notify(self) -> bool:
        """Return True once when the subscriber has room again after a drop and should be notified."""
        if not self._has_drops or self.unacked_bytes > ACK_INTERVAL_BYTES:
            return False
        self._has_drops = False
        return True

    def acknowledge(self, seq: int, bound_bytes: int) -> None:
        """Handle an acknowledgement of all messages up to `seq`, and adopt `bound_bytes` as the window."""
        self._bound = max(MIN_WINDOW_BYTES, min(bound_bytes, WINDOW_BYTES))
        while self._sent and self._sent[0][0] <= seq:
            self.unacked_bytes -= self._sent.popleft()[1]

    def should_request_ack(self, now: float, *, has_room: bool) -> bool:
        """Return True, and restart the interval, if an acknowledgement should be requested."""
        if self._bytes_since_request < ACK_INTERVAL_BYTES and (
            has_room or now < self._requested_at + _ACK_RETRY_S
        ):
            return False
        self._bytes_since_request = 0
        self._requested_at = now
        return True


class ReleaseTracker(Protocol):
    """Object that reports when libzmq has released a message, as `zmq.MessageTracker` does."""

    @property
    def done(self) -> bool:
        """True after libzmq has released the message for all connections."""


class Backlog:
    """Estimated backlog of the slowest subscriber without acknowledgements: an upper bound of libzmq's queue.

    Only some messages are tracked. libzmq releases messages in order, so while a tracked message is queued,
    all messages after it are counted as queued, too.
    """

    def __init__(self) -> None:
        self._held: deque[tuple[ReleaseTracker, int]] = deque()
        self._bytes = 0

    def has_room(self, size_bytes: int) -> bool:
        """Return True if a message of this size can be sent."""
        while self._held and self._held[0][0].done:
            self._bytes -= self._held.popleft()[1]
        return self._bytes <= TRACKING_INTERVAL_BYTES or self._bytes + size_bytes <= WINDOW_BYTES

    def add_sent(self, tracker: ReleaseTracker, size_bytes: int) -> None:
        """Add `size_bytes` that were sent since the last call; `tracker` belongs to the newest message."""
        self._held.append((tracker, size_bytes))
        self._bytes += size_bytes
