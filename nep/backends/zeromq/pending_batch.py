"""Messages published in quick succession, which are sent in one part. Performs no I/O.

A message is sent immediately unless the previous one was published less than `BATCH_WINDOW_NS` ago.
Otherwise it waits for others until there are `MAX_PENDING_MESSAGES`, or until `MAX_DELAY_NS` have passed. See
docs/adr/0009-one-part.md.
"""

from __future__ import annotations

from nep.protocol.batch import MAX_BATCH_MESSAGES

BATCH_WINDOW_NS = 20_000
MAX_DELAY_NS = 100_000
MAX_PENDING_MESSAGES = 64
FULL_BATCH_BYTES = 65_536
"""Size in bytes at which a batch is sent. Copying more would take longer than sending separately."""
MAX_BATCHED_BYTES = 16_384
"""Maximum size in bytes of a message in a batch. Copying larger messages would cost more than it saves."""
_BURST_CHECK_INTERVAL_S = 500e-6
"""Interval in seconds of the I/O thread's checks while the publisher itself sends full batches."""


class PendingBatch:
    """Pending messages of one publisher. Guarded by the publisher's lock, except `pending`.

    Args:
        is_enabled: False to disable batches.
    """

    def __init__(self, *, is_enabled: bool) -> None:
        self.pending: list[tuple[bytes, int]] = []
        """Pending payloads with their time stamps.

        Any thread may append without the lock, because acquiring it would take as long as the rest of
        publishing; the thread then checks `is_flush_scheduled`.
        """
        self.until_ns = 0
        """Time (ns since 1970) until which a new message is batched."""
        self.flush_deadline_ns = 0
        """Time (ns since 1970) by which the pending messages must be sent."""
        self.is_allowed = False
        """True if all current subscribers accept batches."""
        self.is_flush_scheduled = False
        """True if the I/O thread is scheduled to send the pending messages."""
        self.is_flushing = False
        """True while pending messages are being sent."""
        self.has_sent_full_batch = False
        """True if the publisher has sent a full batch since the I/O thread last checked."""
        self._is_enabled = is_enabled

    def set_allowed(self, *, is_supported: bool) -> None:
        """Enable batches only while all current subscribers accept them.

        Args:
            is_supported: True if all current subscribers accept batches.
        """
        self.is_allowed = self._is_enabled and is_supported
        if not self.is_allowed:
            self.until_ns = 0

    def open_window(self, stamp_ns: int) -> None:
        """Open the batching window after a message was sent alone.

        Args:
            stamp_ns: Time stamp of the message in nanoseconds.
        """
        if self.is_allowed:
            self.until_ns = stamp_ns + BATCH_WINDOW_NS

    def pop_batch(self) -> list[tuple[bytes, int]]:
        """Remove and return up to `MAX_BATCH_MESSAGES` pending messages, oldest first.

        At least one message must be pending.
        """
        batch = self.pending[:MAX_BATCH_MESSAGES]
        del self.pending[: len(batch)]  # more may have been appended meanwhile
        self.until_ns = batch[-1][1] + BATCH_WINDOW_NS if self.is_allowed else 0
        return batch

    def next_check_s(self, now_ns: int) -> float:
        """Return the time in seconds until the I/O thread must check again.

        0 means that no message is pending, or that pending messages must be sent now. Call only in the
        I/O thread.

        Args:
            now_ns: Current time in nanoseconds.
        """
        had_full_batch, self.has_sent_full_batch = self.has_sent_full_batch, False
        # Must precede reading: a thread that appends afterwards requests a check itself.
        self.is_flush_scheduled = had_full_batch
        pending = self.pending[:1]
        remaining_ns = pending[0][1] + MAX_DELAY_NS - now_ns if pending else 0
        if 0 < remaining_ns <= MAX_DELAY_NS:  # larger values mean that the clock was set
            self.is_flush_scheduled = True
            return _BURST_CHECK_INTERVAL_S if had_full_batch else remaining_ns / 1e9
        return 0.0

    @property
    def burst_check_s(self) -> float:
        """Time in seconds until the next check while nothing is pending; 0 after the end of a burst."""
        return _BURST_CHECK_INTERVAL_S if self.is_flush_scheduled else 0.0
