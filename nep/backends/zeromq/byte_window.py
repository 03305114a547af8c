"""Flow control in bytes, because libzmq limits its queues only by number of messages. Performs no I/O.

`SendWindow` is for subscribers that acknowledge messages; it covers the queues of both sockets and of
the kernel. `Backlog` is for all other subscribers; it covers only the messages that libzmq still queues
in this process.
"""

from __future__ import annotations

from collections import deque
from typing import Protocol

WINDOW_BYTES = 192 * 2**20
"""Maximum number of unacknowledged bytes per subscriber; 256 MB together with a batch in the sink."""
MIN_WINDOW_BYTES = 24 * 2**20
"""Smallest window in bytes that a subscriber may request.

Twice `ACK_INTERVAL_BYTES`, so that sending continues while an acknowledgement is in transit.
"""
ACK_INTERVAL_BYTES = 12 * 2**20
"""Number of bytes after which an acknowledgement is requested from a subscriber."""
TRACKING_INTERVAL_BYTES = 2**20
"""Number of bytes between tracked messages for subscribers that don't acknowledge messages."""
_MAX_ENTRY_BYTES = 2**20
"""Maximum total size in bytes of small messages that share an entry.

A shared entry is acknowledged with its newest message.
"""
_ACK_RETRY_S = 0.5
"""Interval in seconds for repeating a request for an acknowledgement.

Needed because libzmq drops requests while the subscriber's queue is full.
"""


class SendWindow:
    """Window of unacknowledged messages of one subscriber. Guarded by the publisher's lock."""

    def __init__(self) -> None:
        self.unacked_bytes = 0
        """Total size of the unacknowledged messages."""
        self._window_bytes = WINDOW_BYTES
        self._unacked: deque[tuple[int, int]] = deque()
        self._bytes_since_request = 0
        self._requested_at = float("-inf")
        self._has_drops = False

    def has_room(self, size_bytes: int) -> bool:
        """Return True if a message of this size can be sent.

        A message larger than the window is sent when the window is almost empty.
        """
        return (
            self.unacked_bytes <= ACK_INTERVAL_BYTES or self.unacked_bytes + size_bytes <= self._window_bytes
        )

    def add_sent(self, seq: int, size_bytes: int) -> None:
        """Add sent bytes to the window.

        Args:
            seq: Sequence number of the newest message that the bytes belong to.
            size_bytes: Number of bytes sent since the previous call.
        """
        if self._unacked and self._unacked[-1][1] + size_bytes <= _MAX_ENTRY_BYTES:
            self._unacked.append((seq, self._unacked.pop()[1] + size_bytes))
        else:
            self._unacked.append((seq, size_bytes))
        self.unacked_bytes += size_bytes
        self._bytes_since_request += size_bytes

    def record_drop(self) -> None:
        """Record that a message was dropped because the window is full."""
        self._has_drops = True

    def should_notify(self) -> bool:
        """Return True if the subscriber must be notified that the window has room again after a drop.

        Returns True only once for all drops since the last notification.
        """
        if not self._has_drops or self.unacked_bytes > ACK_INTERVAL_BYTES:
            return False
        self._has_drops = False
        return True

    def acknowledge(self, seq: int, window_bytes: int) -> None:
        """Handle an acknowledgement.

        Args:
            seq: Sequence number up to which all messages are acknowledged.
            window_bytes: Window requested by the subscriber, in bytes.
        """
        self._window_bytes = max(MIN_WINDOW_BYTES, min(window_bytes, WINDOW_BYTES))
        while self._unacked and self._unacked[0][0] <= seq:
            self.unacked_bytes -= self._unacked.popleft()[1]

    def should_request_ack(self, now: float, *, has_room: bool) -> bool:
        """Return True if an acknowledgement should be requested now, and restart the retry interval.

        Args:
            now: Current time (`time.monotonic`).
            has_room: True if the window had room for the last message.
        """
        if self._bytes_since_request < ACK_INTERVAL_BYTES and (
            has_room or now < self._requested_at + _ACK_RETRY_S
        ):
            return False
        self._bytes_since_request = 0
        self._requested_at = now
        return True


class ReleaseTracker(Protocol):
    """Interface of `zmq.MessageTracker`, which reports when libzmq has released a message."""

    @property
    def done(self) -> bool:
        """True after libzmq has released the message for all connections."""


class Backlog:
    """Estimate of libzmq's queue for the slowest subscriber that doesn't acknowledge messages.

    The estimate is an upper bound. Only some messages are tracked. libzmq releases messages in order, so
    while a tracked message is queued, all later messages are counted as queued, too.
    """

    def __init__(self) -> None:
        self._in_flight: deque[tuple[ReleaseTracker, int]] = deque()
        self._bytes = 0

    def has_room(self, size_bytes: int) -> bool:
        """Return True if a message of this size can be sent."""
        while self._in_flight and self._in_flight[0][0].done:
            self._bytes -= self._in_flight.popleft()[1]
        return self._bytes <= TRACKING_INTERVAL_BYTES or self._bytes + size_bytes <= WINDOW_BYTES

    def add_sent(self, tracker: ReleaseTracker, size_bytes: int) -> None:
        """Add sent bytes to the backlog.

        Args:
            tracker: Tracker of the newest message.
            size_bytes: Number of bytes sent since the previous call.
        """
        self._in_flight.append((tracker, size_bytes))
        self._bytes += size_bytes
