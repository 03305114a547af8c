"""The publishers that a subscriber hears, and how many of their messages were lost. No sockets."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field

from nep.errors import WireError
from nep.messages.clocks import SAME_CLOCK, ClockDifference, PublisherClock
from nep.messages.message import MessageKind, kind_of
from nep.protocol.requests import RemotePublisher
from nep.system.addresses import is_loopback
from nep.system.computer import computer_id

__all__ = ["UNLISTED_MAX", "HeardPublisher", "HeardPublishers"]

FAREWELL_S = 3.0
"""So long after a publisher has unregistered its last messages may still come."""
EARLY_S = 5.0
GAP_MAX = 2**32
"""More messages than these nobody misses at once: an hour of a million a second."""
MIN_RECONNECT_S, MAX_RECONNECT_S = 2.0, 30.0
UNLISTED_MAX = 1000
"""So many publishers are remembered that no master lists: whoever sends on a topic may call itself any."""
_UNKNOWN = kind_of("", "", "")


@dataclass
class HeardPublisher:
    """One publisher.

    `last` is the number of its newest message that was received or counted as lost; None while unknown, 0 if
    all of its messages are still to come.

    `form` is that of the header of its last message, and `kind` goes with it; 0 when there was none.
    """

    form: int = 0
    shared_form: int = 0
    """The same of its last message in shared memory."""
    kind: MessageKind = _UNKNOWN
    clock: PublisherClock = field(default_factory=PublisherClock)
    """That of its computer; its messages ask it."""
    remote: RemotePublisher | None = None
    endpoint: str = ""
    refused: str = ""
    """The endpoint to which it could not be connected, and `problem` why."""
    problem: str = ""
    early_until: float | None = None
    """Until then at most, what comes before the echo is left out: see `HeardPublishers.is_early`."""
    last: int | None = None
    is_heard: bool = False
    """Whether a message, an echo or a bye has been received."""
    is_connected: bool = False
    """The same, since the socket was connected to `endpoint`."""
    reconnect_s: float = MIN_RECONNECT_S
    reconnect_at: float = math.inf
    has_echoed: bool = False
    is_lapsed: bool = False
    ends_at: float | None = None
    promised: int = 0
    """The newest message that the master, or its last word of it, has told of."""
    late_from: int = 0
    late_to: int = 0
    """These were counted as lost because they were promised, and may still come: as long as `late_to` is the
    last, because what follows it overtook them."""
    leapt_to: int = 0
    """The number of a message that was refused because too many would be missing before it; else 0."""

    def connecting(self, endpoint: str) -> None:
        """Forget the previous connection; the next one is about to be made, over the same socket."""
        is_retry = endpoint == self.endpoint
        self.reconnect_s = min(MAX_RECONNECT_S, 2 * self.reconnect_s) if is_retry else MIN_RECONNECT_S
        self.reconnect_at = time.monotonic() + self.reconnect_s
        self.is_connected = self.has_echoed = False
        self.form = self.shared_form = 0  # so that the next message passes `HeardPublishers.arrived`
        self.endpoint = ""


class HeardPublishers:
    """Counts `received` and `lost`, from sequence numbers without gaps."""

    def __init__(self) -> None:
        self.received = 0
        self.lost = 0
        self.by_id: dict[int, HeardPublisher] = {}
        """All of them. Only to be looked at."""
        self._clocks: Mapping[str, ClockDifference] = {}
        self._unlisted: dict[int, None] = {}
        """Those that no master lists, the oldest first."""

    def get(self, publisher: int) -> HeardPublisher:
        """The source of this id, made when it is new; the oldest that no master lists may go for it."""
        source = self.by_id.get(publisher)
        if source is None:
            source = self.by_id[publisher] = HeardPublisher()
            self._unlisted[publisher] = None
            if len(self._unlisted) > UNLISTED_MAX:
                self.pop(next(iter(self._unlisted)))
        return source

    def expect_all_of(self, publisher: int) -> None:
        """Count losses from the first message of a new publisher. Has no effect once it was heard."""
        source = self.get(publisher)
        if source.last is None:
            source.last = 0

    def listed(self, remote: RemotePublisher) -> HeardPublisher:
        """The source of a publisher that the master lists, made when it is new."""
        source = self.get(remote.publisher.id)
        source.remote = remote
        source.clock.difference = self._difference(remote)
        self._unlisted.pop(remote.publisher.id, None)
        return source

    def correct(self, clocks: Mapping[str, ClockDifference]) -> None:
        """By node, how the clocks of other computers differ from this one's: no others are known."""
        self._clocks = clocks
        for source in self.by_id.values():
            if source.remote is not None:
                source.clock.difference = self._difference(source.remote)

    def _difference(self, remote: RemotePublisher) -> ClockDifference | None:
        return SAME_CLOCK if _is_here(remote) else self._clocks.get(remote.node_id)

    def find(self, publisher: int) -> HeardPublisher | None:
        """The source of this id, if there is one."""
        return self.by_id.get(publisher)

    def pop(self, publisher: int) -> HeardPublisher | None:
        """Forget a source."""
        self._unlisted.pop(publisher, None)
        return self.by_id.pop(publisher, None)

    def items(self) -> list[tuple[int, HeardPublisher]]:
        """All of them, by id."""
        return list(self.by_id.items())

    @property
    def echoing(self) -> int:
        """How many publishers have said that they see this subscriber."""
        return sum(source.has_echoed for source in self.by_id.values())

    def arrived(self, publisher: int, seq: int, *, is_alone: bool) -> bool:
        """A message arrived; False when it was heard already: it came for this subscriber alone (latched).

        Raises `WireError` when more than `GAP_MAX` would be missing before it. A publisher that goes on from
        there counts anew: nobody knows then how many are missing.
        """
        source = self.get(publisher)
        source.is_heard = source.is_connected = True
        last = source.last
        if last is not None and seq - last > GAP_MAX:
            if not source.leapt_to or source.leapt_to != seq - 1:
                source.leapt_to = seq
                raise WireError(f"its number leaps from {last} to {seq}", code="seq-leap")
            source.leapt_to, source.promised, source.last = 0, 0, seq
            self.received += 1
            return True
        if last is None or seq > last:
            if last is not None:
                self.lost += seq - last - 1
            source.last = seq
        elif source.late_to == last and source.late_from <= seq:  # it was only late
            source.late_from = seq + 1
            self.lost -= 1
        elif is_alone:
            return False
        self.received += 1
        return True

    def is_early(self, publisher: int) -> bool:
        """Whether a message, not for this subscriber alone, is one that comes again before the echo.

        Between a publisher's first look at a filter and at the hello behind it, messages go out to a new
        subscriber: newer ones than those of its history, which follows with all of them. For a publisher that
        does not greet that is over in a moment.
        """
        source = self.by_id.get(publisher)
        if source is None or source.has_echoed or source.is_heard or source.remote is None:
            return False
        if source.remote.publisher.history <= 1:
            return False
        now = time.monotonic()
        if source.early_until is None:
            source.early_until = now + EARLY_S
        return now < source.early_until

    def reached(self, publisher: int, seq: int) -> bool:
        """An echo or a bye: messages up to `seq` were sent before it, on the same connection.

        False when that cannot be, because more than `GAP_MAX` would be missing: nothing is counted then.
        """
        source = self.get(publisher)
        source.is_heard = source.is_connected = True
        if source.last is not None and seq - source.last > GAP_MAX:
            return False
        if source.last is not None and seq > source.last:
            self.lost += seq - source.last
        if source.last is None or seq > source.last:
            source.last = seq
        return True

    def promised(self, publisher: int, seq: int) -> None:
        """The master says that `seq` was sent. Nothing waits in the socket.

        What was promised one renewal ago and has not come since is lost. Should it come after all, it is
        taken off again. Also of publishers that are not listed any more: they may have ended while this
        computer was cut off.
        """
        source = self.by_id.get(publisher)
        if source is None or source.last is None or seq - source.last > GAP_MAX:
            return
        if source.promised > source.last:
            if source.late_to != source.last:
                source.late_from = source.last + 1
            self.lost += source.promised - source.last
            source.last = source.late_to = source.promised
        source.promised = seq

    def dropped(self, count: int) -> None:
        """So many messages that had been received were dropped for lack of room."""
        self.received -= count
        self.lost += count

    def closing(self, publisher: int, final: int, now: float) -> None:
        """A publisher has unregistered, or was replaced; its last message was `final`, if that is known."""
        source = self.by_id.get(publisher)
        if source is not None and source.ends_at is None:
            source.ends_at = now + FAREWELL_S
            source.promised = max(source.promised, final)

    def lapsed(self, publisher: int, final: int) -> None:
        """A publisher is not listed any more; `final` is the newest message that the master knew of."""
        source = self.by_id.get(publisher)
        if source is not None:
            source.is_lapsed = True
            source.promised = max(source.promised, final)

    def settle(self, publisher: int) -> None:
        """It is about to be left: what has not come of what was promised is lost for good."""
        source = self.by_id.get(publisher)
        if source is not None and source.last is not None:
            self.reached(publisher, source.promised)

    def ended(self, now: float) -> list[int]:
        """Publishers to leave: they unregistered long ago and their bye has not come.

        Beside them the oldest of more than `UNLISTED_MAX` that fell silent and were not replaced.
        """
        all_ = self.by_id.items()
        silent = [each for each, source in all_ if source.is_lapsed and source.ends_at is None]
        over = [each for each, source in all_ if source.ends_at is not None and now >= source.ends_at]
        return silent[: max(0, len(silent) - UNLISTED_MAX)] + over

    def silent(self, now: float) -> list[int]:
        """Publishers of which nothing was received in time after the socket was connected to them."""
        return [
            each
            for each, source in self.by_id.items()
            if source.endpoint and not source.is_connected and now >= source.reconnect_at
        ]

    def replaced_by(self, remote: RemotePublisher) -> list[int]:
        """Silent publishers whose program has been started again, as `remote`."""
        return [
            each
            for each, source in self.by_id.items()
            if source.is_lapsed
            and source.remote is not None
            and each != remote.publisher.id
            and source.remote.node_name == remote.node_name
        ]


def _is_here(remote: RemotePublisher) -> bool:
    """Whether a publisher is on this very computer.

    Older programs do not say where they are: then how they are reached tells.
    """
    own = computer_id()
    if own and remote.computer:
        return own == remote.computer
    endpoint = remote.publisher.endpoints[0] if remote.publisher.endpoints else ""
    return endpoint.startswith("ipc://") or is_loopback(endpoint.partition("://")[2])
