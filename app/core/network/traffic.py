"""How many messages there are, how many were lost, and how many of those looked at were shown."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

from app.core.network.mailbox import Batch
from app.core.network.topics import AT_ONCE, Topics, total_rate_hz
from nep.protocol.graph_view import GraphView

WINDOW_S = 30.0

SUM_EVERY_S = 0.5
"""Figures of very many topics are summed up this often, however often they are told."""


class RecentLosses:
    """Counts what was lost in the last 30 s."""

    def __init__(self) -> None:
        """What was lost before the first total is not counted."""
        self._grew: deque[tuple[float, int]] = deque()
        self._before: int | None = None

    def count(self, total: int, now: float) -> int:
        """The losses of the last 30 s; ``total`` is all that were ever lost, ``now`` monotonic seconds."""
        if self._before is not None and total > self._before:
            self._grew.append((now, total - self._before))
        self._before = total
        while self._grew and now - self._grew[0][0] > WINDOW_S:
            self._grew.popleft()
        return sum(lost for _, lost in self._grew)


class Traffic:
    """Figures of the whole network, and of what Studio looks at. One thread uses it (the window's).

    ``messages_per_s`` of all topics as their publishers tell it, None when none does; ``lost_30s`` messages
    that subscribers of all programs did not get. ``shown_30s`` of ``sent_30s`` messages on the topics that
    are looked at were kept for the panels: what came faster than the window shows was dropped, and counted.
    """

    def __init__(self, topics: Topics) -> None:
        """Count what arrives for these topics."""
        self._topics = topics
        self._losses = RecentLosses()
        self._recent: deque[tuple[float, int, int]] = deque()
        self._untold: GraphView | None = None
        self._summed_at = -SUM_EVERY_S
        self.messages_per_s: float | None = None
        self.lost_30s = 0
        self.shown_30s = 0
        self.sent_30s = 0

    def follow(self, view: GraphView, now: float) -> None:
        """Take over a new graph; ``now`` is monotonic seconds. Very many topics are summed up at leisure."""
        self._untold = view
        if len(view.topics) <= AT_ONCE:
            self._sum_up(view, now)
        else:
            self._sum_up_if_due(now)

    def add(self, batches: Mapping[str, Batch], now: float) -> None:
        """Count what a tick took over; called with every tick."""
        shown = sum(len(batch.messages) for batch in batches.values())
        self._count(shown, sum(batch.arrived for batch in batches.values()), now)
        self._sum_up_if_due(now)

    def _sum_up_if_due(self, now: float) -> None:
        if self._untold is not None and now - self._summed_at >= SUM_EVERY_S:
            self._sum_up(self._untold, now)

    def _sum_up(self, view: GraphView, now: float) -> None:
        self._untold, self._summed_at = None, now
        self.lost_30s = self._losses.count(sum(info.lost or 0 for info in view.topics.values()), now)
        self.messages_per_s = total_rate_hz(view.topics.values())

    def miss(self, missed: Mapping[str, int], now: float) -> None:
        """Count what did not arrive here; ``missed`` are totals since each topic is looked at."""
        grown = 0
        for name, total in missed.items():
            topic = self._topics.get(name)
            if topic is not None:
                grown += max(0, total - topic.missed)
                topic.missed = total
        self._count(0, grown, now)

    def _count(self, shown: int, sent: int, now: float) -> None:
        if sent:
            self._recent.append((now, shown, sent))
            self.shown_30s += shown
            self.sent_30s += sent
        while self._recent and now - self._recent[0][0] > WINDOW_S:
            _, shown, sent = self._recent.popleft()
            self.shown_30s -= shown
            self.sent_30s -= sent
