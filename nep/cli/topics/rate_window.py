"""Sliding windows for `nep topic hz`, `bw` and `delay`."""

from __future__ import annotations

import itertools
import math
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from nep.messages.message import Message

MAX_MESSAGES = 100_000
"""Maximum number of messages in a window; topics with higher rates are measured over a shorter time."""


@dataclass(frozen=True)
class Frequency:
    """Rate in Hz, and minimum, maximum and standard deviation of the gaps between messages in seconds."""

    rate_hz: float
    min_s: float
    max_s: float
    std_s: float
    messages: int


@dataclass(frozen=True)
class Bandwidth:
    """Bandwidth in bytes/s, and mean, minimum and maximum size of messages in bytes."""

    bandwidth_Bps: float  # noqa: N815 - B/s
    mean_bytes: float
    min_bytes: int
    max_bytes: int
    messages: int


@dataclass(frozen=True)
class Delay:
    """Latency of messages: mean, minimum, maximum and standard deviation in seconds.

    Attributes:
        uncertainty_s: Error bound in either direction; None if the clocks were not compared.
    """

    mean_s: float
    min_s: float
    max_s: float
    std_s: float
    messages: int
    uncertainty_s: float | None = None


class RateWindow:
    """Sliding window over the messages of one topic. Thread-safe.

    Args:
        duration_s: Length of the window.
    """

    def __init__(self, duration_s: float) -> None:
        self._duration_s = duration_s
        self._lock = threading.Lock()
        self._messages: deque[tuple[float, float, int]] = deque(maxlen=MAX_MESSAGES)
        self.total = 0

    def add(self, arrival_s: float, stamp_s: float | None, size_bytes: int) -> None:
        """Add a message.

        Args:
            arrival_s: Time of arrival (s, monotonic).
            stamp_s: Time of publication (s, publisher's clock); None (original NEP) uses the time of arrival.
            size_bytes: Size of the encoded message.
        """
        with self._lock:
            self.total += 1
            self._messages.append((arrival_s, arrival_s if stamp_s is None else stamp_s, size_bytes))

    def frequency(self, now: float) -> Frequency | None:
        """Return the rate at the time `now`.

        Returns None if the window has fewer than two messages, or if all have the same time stamp.
        """
        moments = sorted(stamp for _, stamp, _ in self._recent_messages(now))
        if len(moments) < 2 or moments[-1] <= moments[0]:
            return None
        gaps = [later - earlier for earlier, later in itertools.pairwise(moments)]
        mean = (moments[-1] - moments[0]) / len(gaps)
        deviation = math.sqrt(sum((gap - mean) ** 2 for gap in gaps) / len(gaps))
        return Frequency(1 / mean, min(gaps), max(gaps), deviation, len(moments))

    def bandwidth(self, now: float) -> Bandwidth | None:
        """Return the bandwidth at the time `now`.

        Returns None if the window has fewer than two messages, or if all arrived at the same time.
        """
        recent = self._recent_messages(now)
        if len(recent) < 2:
            return None
        sizes = [size for _, _, size in recent]
        span = recent[-1][0] - recent[0][0]
        if span <= 0:
            return None
        # the first message marks the start of the span; its bytes belong to the time before
        bandwidth = sum(sizes[1:]) / span
        return Bandwidth(bandwidth, sum(sizes) / len(sizes), min(sizes), max(sizes), len(sizes))

    def _recent_messages(self, now: float) -> Sequence[tuple[float, float, int]]:
        with self._lock:
            while self._messages and now - self._messages[0][0] > self._duration_s:
                self._messages.popleft()
            return list(self._messages)


class LatchedFilter:
    """Detector of latched messages from before the subscription, which would distort the rate.

    Not thread-safe.

    Args:
        start_s: Start of the subscription (s, monotonic).
    """

    def __init__(self, start_s: float) -> None:
        self._start_s = start_s
        self._publishers: set[int | None] = set()

    def predates_subscription(self, message: Message, now: float) -> bool:
        """Return True if a latched message was published before the subscription started.

        Until the publisher's clock has been compared with this computer's clock, the first message of
        each latched publisher is assumed to be older.

        Args:
            message: Received message.
            now: Time of arrival (s, monotonic).
        """
        if not message.is_latched:
            return False
        is_first = message.publisher not in self._publishers
        self._publishers.add(message.publisher)
        latency_s, uncertainty_s = message.latency_s, message.latency_uncertainty_s
        return is_first if latency_s is None or uncertainty_s is None else now - latency_s < self._start_s


class LatencyWindow(RateWindow):
    """Sliding window over the latencies of one topic's messages. Thread-safe.

    Args:
        duration_s: Length of the window.
    """

    def __init__(self, duration_s: float) -> None:
        super().__init__(duration_s)
        self._uncertainty_s: float | None = None

    def add_latency(
        self, arrival_s: float, latency_s: float | None, size_bytes: int, uncertainty_s: float | None = None
    ) -> None:
        """Add a message and its latency.

        Latencies measured before and after the clocks were compared can't be combined: if `uncertainty_s`
        changes between None and a number, earlier latencies are discarded.

        Args:
            arrival_s: Time of arrival (s, monotonic).
            latency_s: Latency in seconds, negative if the publisher's clock is ahead; None only counts the
                message.
            size_bytes: Size of the encoded message.
            uncertainty_s: Error bound of the latency; None if the clocks were not compared.
        """
        if latency_s is None:
            with self._lock:
                self.total += 1
            return
        with self._lock:
            if (self._uncertainty_s is None) != (uncertainty_s is None):
                self._messages.clear()
            self._uncertainty_s = uncertainty_s
        self.add(arrival_s, latency_s, size_bytes)

    def delay(self, now: float) -> Delay | None:
        """Return the latency at the time `now`, or None if the window has no message of known latency."""
        latencies = [latency for _, latency, _ in self._recent_messages(now)]
        if not latencies:
            return None
        mean = sum(latencies) / len(latencies)
        deviation = math.sqrt(sum((latency - mean) ** 2 for latency in latencies) / len(latencies))
        return Delay(mean, min(latencies), max(latencies), deviation, len(latencies), self._uncertainty_s)
