"""PendingBatch: messages published in quick succession, to be sent in one part. No sockets.

A message is sent at once unless the previous one was published less than `SOON_NS` ago. Otherwise it waits
for more, until there are `MOST` or `WAIT_NS` have passed. See docs/adr/0009-one-part.md.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any, Protocol

from nep.backends.base import QuickPublish
from nep.messages.codecs import NULL
from nep.messages.encoded import Encoded
from nep.protocol.batch import BATCH_MAX

__all__ = ["MOST", "SMALL_BYTES", "SOON_NS", "WAIT_NS", "PendingBatch"]

SOON_NS = 20_000
WAIT_NS = 100_000
MOST = 64
FULL_BYTES = 65_536
"""Size at which a batch is sent: copying more at once takes longer than a separate send."""
SMALL_BYTES = 16_384
"""Upper size limit of messages in a batch: copying larger ones costs more than it saves."""
_GOES_ON_S = 500e-6
"""Interval at which the I/O thread checks while the publisher itself sends full batches."""


_time_ns = time.time_ns


class Way(Protocol):
    """Sending end of a publisher."""

    is_heard: bool
    """True if any subscriber is connected."""
    problem: str
    """Problem of the newest payload; empty if none."""

    def send_now(self, data: bytes) -> None:
        """Send pending messages, then `data`."""

    def flush(self) -> None:
        """Send pending messages. Call with the lock held."""

    def flush_soon(self) -> None:
        """Have the I/O thread send pending messages soon. Call with the lock held."""


class PendingBatch:
    """Pending messages of one publisher; guarded by its lock, except `waiting`.

    `may_wait` is False to disable batches.
    """

    def __init__(self, *, may_wait: bool) -> None:
        self.waiting: list[tuple[bytes, int]] = []
        """Pending payloads and their time stamps. Any thread may append without the lock, which would cost as
        much as the rest of publishing; it then checks `is_looked_after`.
        """
        self.until_ns = 0
        """Time before which a new message is batched."""
        self.ends_ns = 0
        """Time by which the pending messages must be sent."""
        self.is_allowed = False
        """True if all current subscribers accept batches."""
        self.is_looked_after = False
        """True if the I/O thread is scheduled to send the pending messages."""
        self.is_leaving = False
        """True while pending messages are being sent."""
        self.has_gone_full = False
        """True if the publisher has sent a full batch since the I/O thread's last check."""
        self._may_wait = may_wait

    def allow(self, *, reads_batches: bool) -> None:
        """Set whether all current subscribers accept batches."""
        self.is_allowed = self._may_wait and reads_batches
        if not self.is_allowed:
            self.until_ns = 0

    def begin_after(self, stamp_ns: int) -> None:
        """Open the batching window after a message with this time stamp was sent alone."""
        if self.is_allowed:
            self.until_ns = stamp_ns + SOON_NS

    def publishing(self, asked: QuickPublish, way: Way, lock: threading.Lock) -> Callable[..., None]:
        """Return the function that implements `Publisher.publish`.

        It is one closure because nearly all of the time for a small message is spent here.

        Args:
            asked: Functions for encoding and for the slow path.
            way: Sending end.
            lock: Lock of `way`.
        """
        owner, kind, ordinary, look, slowly = asked
        batch, waiting, put, send_now = self, self.waiting, self.waiting.append, way.send_now

        def publish(payload: Any, *, strict: bool = False) -> None:  # noqa: ANN401 - as `Publisher.publish`
            if strict:
                slowly(payload, strict=True)
                return
            stamp_ns = _time_ns()
            if owner.is_closed or way.problem or not way.is_heard or type(payload) is Encoded:
                slowly(payload)
                return
            try:
                data: Any = payload if type(payload) is kind else ordinary(payload)
            except Exception:  # noqa: BLE001 - a payload may be of any class; `slowly` sends or reports it
                slowly(payload)
                return
            if look is not None and data.rfind(NULL) >= 0:
                look(payload)
            if stamp_ns >= batch.until_ns or len(data) >= SMALL_BYTES:
                send_now(data)
                return
            put((data, stamp_ns))
            count = len(waiting)
            if count >= MOST or count * len(data) >= FULL_BYTES:
                with lock:
                    way.flush()
                batch.has_gone_full = True
                return
            if count == 1:
                batch.ends_ns = stamp_ns + WAIT_NS
            if not batch.is_looked_after:
                with lock:
                    way.flush_soon()
            until_ns, ends_ns = stamp_ns + SOON_NS, batch.ends_ns
            batch.until_ns = until_ns if until_ns < ends_ns else ends_ns  # noqa: FURB136 - takes half the time of min

        return publish

    def take(self) -> list[tuple[bytes, int]]:
        """Remove and return up to `BATCH_MAX` pending messages, oldest first.

        Must not be called without any.
        """
        taken = self.waiting[:BATCH_MAX]
        del self.waiting[: len(taken)]  # more may have been appended meanwhile
        self.until_ns = taken[-1][1] + SOON_NS if self.is_allowed else 0
        return taken

    def look_again_s(self, now_ns: int) -> float:
        """Return seconds until the I/O thread must check again; 0 to send pending messages now.

        For the I/O thread.
        """
        has_gone, self.has_gone_full = self.has_gone_full, False
        # Before reading: a thread that appends afterwards requests a check itself.
        self.is_looked_after = has_gone
        waiting = self.waiting[:1]
        left_ns = waiting[0][1] + WAIT_NS - now_ns if waiting else 0
        if 0 < left_ns <= WAIT_NS:  # larger values mean that the clock was set
            self.is_looked_after = True
            return _GOES_ON_S if has_gone else left_ns / 1e9
        return 0.0

    @property
    def goes_on_s(self) -> float:
        """Seconds until the next check with no pending messages; 0 after the end of a burst."""
        return _GOES_ON_S if self.is_looked_after else 0.0
