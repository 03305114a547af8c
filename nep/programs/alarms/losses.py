"""What a topic's subscribers lost within the last seconds, as the graph tells their counts."""

from __future__ import annotations

from collections import deque

from nep.protocol.graph_view import TopicInfo

__all__ = ["TopicLosses"]

_EVERY_S = 0.9
_MOST = 700
"""Samples: ten minutes."""


class TopicLosses:
    """Counts by subscriber, so that one who comes, or begins anew, does not look like a loss."""

    def __init__(self) -> None:
        self._before: dict[int, tuple[int, int]] = {}
        self._grew: deque[tuple[float, int, int]] = deque(maxlen=_MOST)
        self._known = False

    def add(self, info: TopicInfo | None, now: float) -> None:
        """Take over the counts of a graph; None when the topic is not there."""
        counts = {
            each.id: (each.lost, each.received)
            for each in (info.subscribers if info is not None else ())
            if each.lost is not None and each.received is not None
        }
        lost = received = 0
        for id, (lost_now, received_now) in counts.items():
            if id in self._before:
                lost_then, received_then = self._before[id]
                lost += max(0, lost_now - lost_then)
                received += max(0, received_now - received_then)
        self._before = counts
        self._known = self._known or bool(counts)
        if self._grew and now - self._grew[-1][0] < _EVERY_S:
            at, lost_before, received_before = self._grew[-1]
            self._grew[-1] = (at, lost_before + lost, received_before + received)
        else:
            self._grew.append((now, lost, received))

    def percent(self, window_s: float, now: float) -> float | None:
        """Lost ones of all that should have arrived within the last `window_s`, 0 to 100; None if unknown."""
        if not self._known:
            return None
        lost = received = 0
        for at, lost_then, received_then in reversed(self._grew):
            if now - at > window_s:
                break
            lost += lost_then
            received += received_then
        return 100.0 * lost / (lost + received) if lost + received else 0.0
