"""Recent message losses of a topic, computed from the subscribers' counts in the graph."""

from __future__ import annotations

from collections import deque

from nep.protocol.graph_view import TopicInfo

_SAMPLE_PERIOD_S = 0.9
_MAX_SAMPLES = 700
"""Maximum number of samples, which cover ten minutes."""


class TopicLosses:
    """Sliding window over the loss counts of a topic's subscribers.

    Counts are compared per subscriber, so that a new or restarted subscriber doesn't appear as a loss.
    """

    def __init__(self) -> None:
        self._previous_counts: dict[int, tuple[int, int]] = {}
        self._samples: deque[tuple[float, int, int]] = deque(maxlen=_MAX_SAMPLES)
        self._has_counts = False

    def add(self, info: TopicInfo | None, now: float) -> None:
        """Add the counts of a graph snapshot.

        Args:
            info: Topic in the graph; None if the topic doesn't exist.
            now: Time of the snapshot (monotonic, s).
        """
        counts = {
            each.id: (each.lost, each.received)
            for each in (info.subscribers if info is not None else ())
            if each.lost is not None and each.received is not None
        }
        lost = received = 0
        for id, (lost_now, received_now) in counts.items():
            if id in self._previous_counts:
                lost_then, received_then = self._previous_counts[id]
                lost += max(0, lost_now - lost_then)
                received += max(0, received_now - received_then)
        self._previous_counts = counts
        self._has_counts = self._has_counts or bool(counts)
        if self._samples and now - self._samples[-1][0] < _SAMPLE_PERIOD_S:
            sampled_at, lost_before, received_before = self._samples[-1]
            self._samples[-1] = (sampled_at, lost_before + lost, received_before + received)
        else:
            self._samples.append((now, lost, received))

    def percent(self, window_s: float, now: float) -> float | None:
        """Return the percentage of messages lost in the last `window_s` seconds, or None if unknown."""
        if not self._has_counts:
            return None
        lost = received = 0
        for sampled_at, lost_then, received_then in reversed(self._samples):
            if now - sampled_at > window_s:
                break
            lost += lost_then
            received += received_then
        return 100.0 * lost / (lost + received) if lost + received else 0.0
