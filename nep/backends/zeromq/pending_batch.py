"""PendingBatch: the newest messages of a publisher, which are sent together in a moment. No sockets.

A message goes out at once unless the one before was published less than `SOON_NS` ago. Then it waits for
those that follow: until there are `MOST`, or `WAIT_NS` are over. See docs/adr/0009-one-part.md.
"""

from __future__ import annotations

__all__ = ["MOST", "SMALL_BYTES", "SOON_NS", "WAIT_NS", "PendingBatch"]

SOON_NS = 20_000
WAIT_NS = 100_000
MOST = 16
SMALL_BYTES = 16_384
"""Only smaller messages are sent together: copying larger ones costs more than it saves."""
_GOES_ON_S = 500e-6
"""How often the node's thread looks while the publisher sends one batch after the other itself."""


class PendingBatch:
    """It lives under its publisher's lock. `may_wait`: the publisher's messages may wait at all."""

    def __init__(self, *, may_wait: bool) -> None:
        self.payloads: list[bytes] = []
        self.stamps_ns: list[int] = []
        """When each was published."""
        self.until_ns = 0
        """A message that is published before this waits for more."""
        self.is_allowed = False
        """Whether all who read now take several messages in one part."""
        self.is_looked_after = False
        """Whether the node's thread comes to send what waits."""
        self.has_gone_full = False
        """Whether the publisher sent one that was full since the node's thread looked."""
        self._may_wait = may_wait

    def allow(self, *, reads_batches: bool) -> None:
        """Whether all who read now take batches."""
        self.is_allowed = self._may_wait and reads_batches

    def begin_after(self, stamp_ns: int) -> None:
        """A message of this stamp is sent alone: the next may wait if it comes soon."""
        if self.is_allowed:
            self.until_ns = stamp_ns + SOON_NS

    def take(self) -> tuple[list[bytes], list[int]]:
        """All that wait, and when each was published. There are some."""
        taken = self.payloads[:], self.stamps_ns[:]
        self.payloads.clear()
        self.stamps_ns.clear()
        self.until_ns = taken[1][-1] + SOON_NS
        return taken

    def look_again_s(self, now_ns: int) -> float:
        """For the node's thread: when it has to come again; 0: send what waits, if anything does, now."""
        has_gone, self.has_gone_full = self.has_gone_full, False
        left_ns = self.stamps_ns[0] + WAIT_NS - now_ns if self.payloads else 0
        if 0 < left_ns <= WAIT_NS:  # more: somebody has set the clock
            return _GOES_ON_S if has_gone else left_ns / 1e9
        self.is_looked_after = has_gone
        return 0.0

    @property
    def goes_on_s(self) -> float:
        """After that: when to come again although nothing waits; 0 when the publisher has ended its burst."""
        return _GOES_ON_S if self.is_looked_after else 0.0
