"""Statistics of all networks: message rate, losses, and the share of watched messages that panels show."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

from app.core.network.mailbox import Batch
from app.core.network.topics import MAX_TOPICS_PER_UPDATE, Topics, total_rate_hz
from nep.protocol.graph_view import GraphView

WINDOW_S = 30.0

SUM_INTERVAL_S = 0.5
"""Interval in seconds at which the statistics of more than `MAX_TOPICS_PER_UPDATE` topics are summed."""


class RecentLosses:
    """Counter of the messages lost in the last 30 s."""

    def __init__(self) -> None:
        # The first total is the baseline.
        self._increases: deque[tuple[float, int]] = deque()
        self._last_total: int | None = None

    def count(self, total: int, now: float) -> int:
        """Return the number of messages lost in the last 30 s.

        Args:
            total: Total number of lost messages.
            now: Monotonic seconds.
        """
        if self._last_total is not None and total > self._last_total:
            self._increases.append((now, total - self._last_total))
        self._last_total = total
        while self._increases and now - self._increases[0][0] > WINDOW_S:
            self._increases.popleft()
        return sum(lost for _, lost in self._increases)


class Traffic:
    """Statistics of the network and of the watched topics. Not thread-safe; use it from the main thread.

    Attributes:
        messages_per_s: Message rate of all topics as reported by publishers, or None.
        lost_30s: Number of messages lost by any subscriber in the last 30 s.
        sent_30s: Number of messages sent on watched topics in the last 30 s.
        shown_30s: Number of these messages that were passed to panels. The others were dropped, because
            the window can't show them fast enough.
    """

    def __init__(self, topics: Topics) -> None:
        self._topics = topics
        self._losses = RecentLosses()
        self._recent_counts: deque[tuple[float, int, int]] = deque()
        self._pending_view: GraphView | None = None
        self._summed_s = -SUM_INTERVAL_S
        self.messages_per_s: float | None = None
        self.lost_30s = 0
        self.shown_30s = 0
        self.sent_30s = 0

    def update_graph(self, view: GraphView, now: float) -> None:
        """Apply a new graph at ``now`` (monotonic seconds). Large graphs are evaluated less often."""
        self._pending_view = view
        if len(view.topics) <= MAX_TOPICS_PER_UPDATE:
            self._update_totals(view, now)
        else:
            self._update_totals_if_due(now)

    def add(self, batches: Mapping[str, Batch], now: float) -> None:
        """Count the messages received since the last tick."""
        shown_count = sum(len(batch.messages) for batch in batches.values())
        self._count(shown_count, sum(batch.arrived_count for batch in batches.values()), now)
        self._update_totals_if_due(now)

    def _update_totals_if_due(self, now: float) -> None:
        if self._pending_view is not None and now - self._summed_s >= SUM_INTERVAL_S:
            self._update_totals(self._pending_view, now)

    def _update_totals(self, view: GraphView, now: float) -> None:
        self._pending_view, self._summed_s = None, now
        self.lost_30s = self._losses.count(sum(info.lost or 0 for info in view.topics.values()), now)
        self.messages_per_s = total_rate_hz(view.topics.values())

    def count_lost(self, lost_counts: Mapping[str, int], now: float) -> None:
        """Count messages that were sent but not received.

        Args:
            lost_counts: Number of messages lost on each topic since its watch began.
            now: Monotonic seconds.
        """
        new_count = 0
        for name, total in lost_counts.items():
            topic = self._topics.get(name)
            if topic is not None:
                new_count += max(0, total - topic.missed)
                topic.missed = total
        self._count(0, new_count, now)

    def _count(self, shown_count: int, sent_count: int, now: float) -> None:
        if sent_count:
            self._recent_counts.append((now, shown_count, sent_count))
            self.shown_30s += shown_count
            self.sent_30s += sent_count
        while self._recent_counts and now - self._recent_counts[0][0] > WINDOW_S:
            _, shown_count, sent_count = self._recent_counts.popleft()
            self.shown_30s -= shown_count
            self.sent_30s -= sent_count
