"""Sequence numbers of a subscriber's publishers, and the number of lost messages. Performs no I/O."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field

from nep.errors import WireError
from nep.messages.clocks import SAME_CLOCK, ClockDifference, PublisherClock
from nep.messages.message import MessageKind, message_kind
from nep.protocol.requests import RemotePublisher
from nep.system.addresses import is_loopback
from nep.system.computer import computer_id

BYE_TIMEOUT_S = 3.0
"""Maximum time in seconds in which the last messages of an unregistered publisher can still arrive."""
EARLY_MESSAGE_WINDOW_S = 5.0
MAX_GAP = 2**32
"""Maximum accepted gap in sequence numbers, which is an hour at a million messages per second."""
MIN_RECONNECT_S, MAX_RECONNECT_S = 2.0, 30.0
MAX_UNLISTED_PUBLISHERS = 1000
"""Maximum number of tracked publishers that the master doesn't list.

Limited because any sender can invent publisher ids.
"""
_UNKNOWN_KIND = message_kind("", "", "")


@dataclass
class TrackedPublisher:
    """State of a publisher, as tracked by a subscriber.

    Attributes:
        form: Header form of the publisher's last message, to which `kind` belongs; 0 if there is none.
        last: Sequence number of the newest message that was received or counted as lost. None if unknown; 0
            before the first message, if all messages of the publisher are expected.
    """

    form: int = 0
    shared_form: int = 0
    """Header form of the publisher's last message in shared memory."""
    kind: MessageKind = _UNKNOWN_KIND
    clock: PublisherClock = field(default_factory=PublisherClock)
    """Clock of the publisher's computer, to which the time stamps of its messages refer."""
    remote: RemotePublisher | None = None
    endpoint: str = ""
    failed_endpoint: str = ""
    """Endpoint to which connecting failed, for the reason in `problem`."""
    problem: str = ""
    early_until: float | None = None
    """Time (`time.monotonic`) until which messages before the echo are skipped.

    See `PublisherTracker.is_early`.
    """
    last: int | None = None
    has_responded: bool = False
    """True if a message, echo or bye was received."""
    is_connected: bool = False
    """True if a message, echo or bye was received since the socket was connected to `endpoint`."""
    reconnect_s: float = MIN_RECONNECT_S
    reconnect_at: float = math.inf
    has_echoed: bool = False
    is_silent: bool = False
    bye_deadline: float | None = None
    announced_seq: int = 0
    """Newest sequence number reported by the master; the final one after the publisher has unregistered."""
    late_from: int = 0
    late_to: int = 0
    """Last message of a range of messages that were counted as lost but may still arrive.

    The range starts at `late_from`. Its messages can arrive only while `late_to` equals `last`, because a
    later message would have been sent after them.
    """
    jump_seq: int = 0
    """Sequence number of a message rejected because the gap before it is too large; 0 if there is none."""

    def reset_connection(self, endpoint: str) -> None:
        """Reset the state of the connection. Call before the socket connects to `endpoint`."""
        is_retry = endpoint == self.endpoint
        self.reconnect_s = min(MAX_RECONNECT_S, 2 * self.reconnect_s) if is_retry else MIN_RECONNECT_S
        self.reconnect_at = time.monotonic() + self.reconnect_s
        self.is_connected = self.has_echoed = False
        self.form = self.shared_form = 0  # the next message takes the careful path, which sets `is_connected`
        self.endpoint = ""


class PublisherTracker:
    """Tracker of a subscriber's publishers, which counts received and lost messages.

    Losses are derived from gaps in the sequence numbers.
    """

    def __init__(self) -> None:
        self.received = 0
        self.lost = 0
        self.by_id: dict[int, TrackedPublisher] = {}
        """State of each publisher by id. Read-only for other modules."""
        self._clocks: Mapping[str, ClockDifference] = {}
        self._unlisted: dict[int, None] = {}
        """Ids of publishers that the master doesn't list, oldest first."""

    def get(self, publisher: int) -> TrackedPublisher:
        """Return a publisher's state; create it if needed.

        Creating the state of an unlisted publisher may evict the oldest unlisted publisher.
        """
        source = self.by_id.get(publisher)
        if source is None:
            source = self.by_id[publisher] = TrackedPublisher()
            self._unlisted[publisher] = None
            if len(self._unlisted) > MAX_UNLISTED_PUBLISHERS:
                self.pop(next(iter(self._unlisted)))
        return source

    def expect_all_messages(self, publisher: int) -> None:
        """Count losses from the first message of a new publisher. No effect after a message was received."""
        source = self.get(publisher)
        if source.last is None:
            source.last = 0

    def add_listed(self, remote: RemotePublisher) -> TrackedPublisher:
        """Store the master's record of a publisher and return the publisher's state, created if needed."""
        source = self.get(remote.publisher.id)
        source.remote = remote
        source.clock.difference = self._clock_difference(remote)
        self._unlisted.pop(remote.publisher.id, None)
        return source

    def set_clock_differences(self, clocks: Mapping[str, ClockDifference]) -> None:
        """Set the clock differences of other computers, given by node id."""
        self._clocks = clocks
        for source in self.by_id.values():
            if source.remote is not None:
                source.clock.difference = self._clock_difference(source.remote)

    def _clock_difference(self, remote: RemotePublisher) -> ClockDifference | None:
        return SAME_CLOCK if _is_on_this_computer(remote) else self._clocks.get(remote.node_id)

    def find(self, publisher: int) -> TrackedPublisher | None:
        """Return a publisher's state, or None if the publisher isn't tracked."""
        return self.by_id.get(publisher)

    def pop(self, publisher: int) -> TrackedPublisher | None:
        """Remove and return a publisher's state; return None if the publisher isn't tracked."""
        self._unlisted.pop(publisher, None)
        return self.by_id.pop(publisher, None)

    def items(self) -> list[tuple[int, TrackedPublisher]]:
        """Return (publisher id, state) of all publishers."""
        return list(self.by_id.items())

    @property
    def echo_count(self) -> int:
        """Number of publishers that have sent an echo to this subscriber."""
        return sum(source.has_echoed for source in self.by_id.values())

    def count_message(self, publisher: int, seq: int, *, is_alone: bool) -> bool:
        """Count a message; return False if it is a duplicate.

        If the gap before a message exceeds `MAX_GAP` and the publisher continues from there, counting
        restarts with an unknown number of losses.

        Args:
            publisher: Id of the publisher.
            seq: Sequence number of the message.
            is_alone: True if the message was sent only to this subscriber, as latched messages are. Only
                such messages can be duplicates.

        Raises:
            WireError: The gap before the message exceeds `MAX_GAP`.
        """
        source = self.get(publisher)
        source.has_responded = source.is_connected = True
        last = source.last
        if last is not None and seq - last > MAX_GAP:
            if not source.jump_seq or source.jump_seq != seq - 1:
                source.jump_seq = seq
                raise WireError(f"its sequence number jumps from {last} to {seq}", code="seq-leap")
            source.jump_seq, source.announced_seq, source.last = 0, 0, seq
            self.received += 1
            return True
        if last is None or seq > last:
            if last is not None:
                self.lost += seq - last - 1
            source.last = seq
        elif 0 < source.late_to == last and source.late_from <= seq:  # the message was only late
            source.late_from = seq + 1
            self.lost -= 1
        elif is_alone:
            return False
        self.received += 1
        return True

    def is_early(self, publisher: int) -> bool:
        """Return True if a message to all subscribers must be skipped because the history will contain it.

        A publisher with a history may process this subscriber's topic filter before its hello. Messages
        sent in between are sent again as part of the history, which precedes the echo. If a publisher sends
        no echo, its messages are accepted after `EARLY_MESSAGE_WINDOW_S`.
        """
        source = self.by_id.get(publisher)
        if source is None or source.has_echoed or source.has_responded or source.remote is None:
            return False
        if source.remote.publisher.history <= 1:
            return False
        now = time.monotonic()
        if source.early_until is None:
            source.early_until = now + EARLY_MESSAGE_WINDOW_S
        return now < source.early_until

    def advance_to(self, publisher: int, seq: int) -> bool:
        """Handle an echo or bye, before which all messages up to `seq` were sent on the same connection.

        Messages up to `seq` that have not been received are counted as lost. Returns False, and counts
        nothing, if the gap exceeds `MAX_GAP`.
        """
        source = self.get(publisher)
        source.has_responded = source.is_connected = True
        if source.last is not None and seq - source.last > MAX_GAP:
            return False
        if source.last is not None and seq > source.last:
            self.lost += seq - source.last
        if source.last is None or seq > source.last:
            source.last = seq
        return True

    def expect_up_to(self, publisher: int, seq: int) -> None:
        """Handle the master's report that `seq` was sent. Call only when the socket is empty.

        Messages that the previous report already contained and that have not been received since then are
        counted as lost. If they arrive later, the count is corrected. Publishers that aren't listed are
        included, because they may have ended while this computer was disconnected.
        """
        source = self.by_id.get(publisher)
        if source is None or source.last is None or seq - source.last > MAX_GAP:
            return
        if source.announced_seq > source.last:
            if source.late_to != source.last:
                source.late_from = source.last + 1
            self.lost += source.announced_seq - source.last
            source.last = source.late_to = source.announced_seq
        source.announced_seq = seq

    def count_dropped(self, count: int) -> None:
        """Count received messages that were dropped from a full queue."""
        self.received -= count
        self.lost += count

    def mark_closing(self, publisher: int, last_seq: int, now: float) -> None:
        """Record that a publisher was unregistered or replaced.

        Args:
            publisher: Id of the publisher.
            last_seq: Sequence number of its last message, 0 if unknown.
            now: Current time (`time.monotonic`).
        """
        source = self.by_id.get(publisher)
        if source is not None and source.bye_deadline is None:
            source.bye_deadline = now + BYE_TIMEOUT_S
            source.announced_seq = max(source.announced_seq, last_seq)

    def mark_silent(self, publisher: int, last_seq: int) -> None:
        """Record that the master no longer lists a publisher.

        Args:
            publisher: Id of the publisher.
            last_seq: Sequence number of the newest message known to the master.
        """
        source = self.by_id.get(publisher)
        if source is not None:
            source.is_silent = True
            source.announced_seq = max(source.announced_seq, last_seq)

    def count_missing(self, publisher: int) -> None:
        """Count the missing messages of a publisher as lost. Call before removing the publisher."""
        source = self.by_id.get(publisher)
        if source is not None and source.last is not None:
            self.advance_to(publisher, source.announced_seq)

    def expired_publishers(self, now: float) -> list[int]:
        """Return the ids of publishers to remove.

        These are unregistered publishers whose bye is overdue at `now`, and the oldest silent publishers
        beyond `MAX_UNLISTED_PUBLISHERS`.
        """
        sources = self.by_id.items()
        silent_ids = [each for each, source in sources if source.is_silent and source.bye_deadline is None]
        overdue_ids = [
            each for each, source in sources if source.bye_deadline is not None and now >= source.bye_deadline
        ]
        return silent_ids[: max(0, len(silent_ids) - MAX_UNLISTED_PUBLISHERS)] + overdue_ids

    def unresponsive_publishers(self, now: float) -> list[int]:
        """Return the ids of publishers from which nothing was received before the reconnection time."""
        return [
            each
            for each, source in self.by_id.items()
            if source.endpoint and not source.is_connected and now >= source.reconnect_at
        ]

    def replaced_publishers(self, remote: RemotePublisher) -> list[int]:
        """Return the ids of silent publishers that `remote` replaces, because their program was restarted."""
        return [
            each
            for each, source in self.by_id.items()
            if source.is_silent
            and source.remote is not None
            and each != remote.publisher.id
            and source.remote.node_name == remote.node_name
        ]


def _is_on_this_computer(remote: RemotePublisher) -> bool:
    # Older versions don't send the id of the computer; then the endpoints are compared.
    own_computer = computer_id()
    if own_computer and remote.computer:
        return own_computer == remote.computer
    endpoint = remote.publisher.endpoints[0] if remote.publisher.endpoints else ""
    return endpoint.startswith("ipc://") or is_loopback(endpoint.partition("://")[2])
