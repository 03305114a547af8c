"""PendingBatch: the newest messages of a publisher, which are sent together in a moment. No sockets.

A message goes out at once unless the one before was published less than `SOON_NS` ago. Then it waits for
those that follow: until there are `MOST`, or `WAIT_NS` are over. See docs/adr/0009-one-part.md.
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
"""A batch of about so many bytes goes out, too: copying more at once takes longer than sending it costs."""
SMALL_BYTES = 16_384
"""Only smaller messages are sent together: copying larger ones costs more than it saves."""
_GOES_ON_S = 500e-6
"""How often the node's thread looks while the publisher sends one batch after the other itself."""


_time_ns = time.time_ns


class Way(Protocol):
    """What a publisher's messages are sent through."""

    is_heard: bool
    """Whether anybody reads."""
    problem: str
    """What is wrong with the newest payload; empty when nothing is."""

    def send_now(self, data: bytes) -> None:
        """Send it, and what waits before it."""

    def flush(self) -> None:
        """Send what waits. With the lock held."""

    def flush_soon(self) -> None:
        """Let what waits be sent soon. With the lock held."""


class PendingBatch:
    """It lives under its publisher's lock, but for `waiting`. `may_wait`: its messages may wait at all."""

    def __init__(self, *, may_wait: bool) -> None:
        self.waiting: list[tuple[bytes, int]] = []
        """The payloads that wait, and when each was published. Any thread may append without the lock, which
        takes as long as all the rest of a message's way; who does then looks at `is_looked_after`."""
        self.until_ns = 0
        """A message that is published before this waits for more."""
        self.ends_ns = 0
        """Until then at most those wait that wait now."""
        self.is_allowed = False
        """Whether all who read now take several messages in one part."""
        self.is_looked_after = False
        """Whether the node's thread comes to send what waits."""
        self.is_leaving = False
        """Whether its messages are being sent."""
        self.has_gone_full = False
        """Whether the publisher sent one that was full since the node's thread looked."""
        self._may_wait = may_wait

    def allow(self, *, reads_batches: bool) -> None:
        """Whether all who read now take batches."""
        self.is_allowed = self._may_wait and reads_batches
        if not self.is_allowed:
            self.until_ns = 0

    def begin_after(self, stamp_ns: int) -> None:
        """A message of this stamp is sent alone: the next may wait if it comes soon."""
        if self.is_allowed:
            self.until_ns = stamp_ns + SOON_NS

    def publishing(self, asked: QuickPublish, way: Way, lock: threading.Lock) -> Callable[..., None]:
        """What `Publisher.publish` is: most of a small message's way is in here, so all of it is one closure.

        `way` sends; `lock` is its lock.
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
            except Exception:  # noqa: BLE001 - a payload may be of any class; `slowly` takes it or tells why not
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
            batch.until_ns = until_ns if until_ns < ends_ns else ends_ns  # noqa: FURB136 - in half the time of min

        return publish

    def take(self) -> list[tuple[bytes, int]]:
        """`BATCH_MAX` of those that wait at most, the oldest first; see `waiting`. There are some."""
        taken = self.waiting[:BATCH_MAX]
        del self.waiting[: len(taken)]  # others may have come since
        self.until_ns = taken[-1][1] + SOON_NS if self.is_allowed else 0
        return taken

    def look_again_s(self, now_ns: int) -> float:
        """For the node's thread: when it has to come again; 0: send what waits, if anything does, now."""
        has_gone, self.has_gone_full = self.has_gone_full, False
        # Before looking: who appends after that asks to be looked after.
        self.is_looked_after = has_gone
        waiting = self.waiting[:1]
        left_ns = waiting[0][1] + WAIT_NS - now_ns if waiting else 0
        if 0 < left_ns <= WAIT_NS:  # more: somebody has set the clock
            self.is_looked_after = True
            return _GOES_ON_S if has_gone else left_ns / 1e9
        return 0.0

    @property
    def goes_on_s(self) -> float:
        """After that: when to come again although nothing waits; 0 when the publisher has ended its burst."""
        return _GOES_ON_S if self.is_looked_after else 0.0
