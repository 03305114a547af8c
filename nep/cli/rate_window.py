"""Sliding windows behind `nep topic hz`, `bw` and `delay`."""

from __future__ import annotations

import itertools
import math
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from nep.messages.message import Message

__all__ = ["MAX_MESSAGES", "AgeWindow", "Bandwidth", "Delay", "Frequency", "RateWindow", "ReplayFilter"]

MAX_MESSAGES = 100_000
"""Capacity of a window in messages; faster topics are measured over a shorter time."""


@dataclass(frozen=True)
class Frequency:
    """Rate (Hz), and the minimum, maximum and standard deviation of the gaps (s)."""

    rate_hz: float
    min_s: float
    max_s: float
    std_s: float
    messages: int


@dataclass(frozen=True)
class Bandwidth:
    """Bandwidth (bytes/s), and the mean, minimum and maximum message size (bytes)."""

    bandwidth_Bps: float  # noqa: N815 - B/s
    mean_bytes: float
    min_bytes: int
    max_bytes: int
    messages: int


@dataclass(frozen=True)
class Delay:
    """Latency: mean, minimum, maximum and standard deviation (s).

    `uncertainty_s` is the error bound in either direction, None if the clocks are not compared.
    """

    mean_s: float
    min_s: float
    max_s: float
    std_s: float
    messages: int
    uncertainty_s: float | None = None


class RateWindow:
    """Messages of one topic from the last `seconds`. Thread-safe."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._lock = threading.Lock()
        self._messages: deque[tuple[float, float, int]] = deque(maxlen=MAX_MESSAGES)
        self.total = 0

    def add(self, arrived: float, stamp_s: float | None, size_bytes: int) -> None:
        """Add a message.

        Args:
            arrived: Arrival time (s, monotonic).
            stamp_s: Publishing time (s, the publisher's clock); None (original NEP) uses the arrival time.
            size_bytes: Size of the encoded message.
        """
        with self._lock:
            self.total += 1
            self._messages.append((arrived, arrived if stamp_s is None else stamp_s, size_bytes))

    def frequency(self, now: float) -> Frequency | None:
        """Return the figures at `now`, or None with fewer than two messages."""
        moments = sorted(stamp for _, stamp, _ in self._recent(now))
        if len(moments) < 2 or moments[-1] <= moments[0]:
            return None
        gaps = [later - earlier for earlier, later in itertools.pairwise(moments)]
        mean = (moments[-1] - moments[0]) / len(gaps)
        deviation = math.sqrt(sum((gap - mean) ** 2 for gap in gaps) / len(gaps))
        return Frequency(1 / mean, min(gaps), max(gaps), deviation, len(moments))

    def traffic(self, now: float) -> Bandwidth | None:
        """Return the figures at `now`, or None with fewer than two messages."""
        recent = self._recent(now)
        if len(recent) < 2:
            return None
        sizes = [size for _, _, size in recent]
        span = recent[-1][0] - recent[0][0]
        if span <= 0:
            return None
        # the first message marks the start of the span; its bytes belong to the time before
        bandwidth = sum(sizes[1:]) / span
        return Bandwidth(bandwidth, sum(sizes) / len(sizes), min(sizes), max(sizes), len(sizes))

    def _recent(self, now: float) -> Sequence[tuple[float, float, int]]:
        with self._lock:
            while self._messages and now - self._messages[0][0] > self._seconds:
                self._messages.popleft()
            return list(self._messages)


class ReplayFilter:
    """Detector of latched messages from before the subscription, which would distort the rate.

    `opened` is when the subscription began (s, monotonic). Not thread-safe.
    """

    def __init__(self, opened: float) -> None:
        self._opened = opened
        self._publishers: set[int | None] = set()

    def is_replay(self, message: Message, now: float) -> bool:
        """Return whether a message that arrived at `now` (s, monotonic) predates the subscription.

        While the publisher's clock isn't compared with this one, the first message of each latched publisher
        counts as a replay.
        """
        if not message.is_latched:
            return False
        is_first = message.publisher not in self._publishers
        self._publishers.add(message.publisher)
        age_s, uncertainty_s = message.latency_s, message.latency_uncertainty_s
        return is_first if age_s is None or uncertainty_s is None else now - age_s < self._opened


class AgeWindow(RateWindow):
    """Latencies of one topic's messages from the last `seconds`. Thread-safe."""

    def __init__(self, seconds: float) -> None:
        super().__init__(seconds)
        self._uncertainty_s: float | None = None

    def add_age(
        self, arrived: float, age_s: float | None, size_bytes: int, uncertainty_s: float | None = None
    ) -> None:
        """Add a message and its latency.

        Latencies from before and after the clocks were compared can't be combined: when `uncertainty_s`
        changes between None and a number, earlier ones are dropped.

        Args:
            arrived: Arrival time (s, monotonic).
            age_s: Latency (s), negative if the publisher's clock is ahead; None only counts the message.
            size_bytes: Size of the encoded message.
            uncertainty_s: Error bound of the latency, None if the clocks are not compared.
        """
        if age_s is None:
            with self._lock:
                self.total += 1
            return
        with self._lock:
            if (self._uncertainty_s is None) != (uncertainty_s is None):
                self._messages.clear()
            self._uncertainty_s = uncertainty_s
        self.add(arrived, age_s, size_bytes)

    def delay(self, now: float) -> Delay | None:
        """Return the figures at `now`, or None without a message of known latency."""
        ages = [age for _, age, _ in self._recent(now)]
        if not ages:
            return None
        mean = sum(ages) / len(ages)
        deviation = math.sqrt(sum((age - mean) ** 2 for age in ages) / len(ages))
        return Delay(mean, min(ages), max(ages), deviation, len(ages), self._uncertainty_s)
