"""What `nep topic hz`, `bw` and `delay` work out: figures of the messages of the last seconds."""

from __future__ import annotations

import itertools
import math
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from nep.messages.message import Message

__all__ = ["MOST", "AgeWindow", "Bandwidth", "Delay", "Frequency", "RateWindow", "ReplayFilter"]

MOST = 100_000
"""Messages that a window holds at most; a faster topic is measured over a shorter time."""


@dataclass(frozen=True)
class Frequency:
    """How often: messages a second, and the shortest, longest and standard deviation of the gaps (s)."""

    rate_hz: float
    min_s: float
    max_s: float
    std_s: float
    messages: int


@dataclass(frozen=True)
class Bandwidth:
    """How much: bytes a second, and the mean, smallest and largest size of a message (bytes)."""

    bandwidth_Bps: float  # noqa: N815 - B/s
    mean_bytes: float
    min_bytes: int
    max_bytes: int
    messages: int


@dataclass(frozen=True)
class Delay:
    """How old messages are when they arrive: mean, least, greatest and standard deviation (s).

    All may be wrong by `uncertainty_s`, to either side; None when nobody has compared the clocks.
    """

    mean_s: float
    min_s: float
    max_s: float
    std_s: float
    messages: int
    uncertainty_s: float | None = None


class RateWindow:
    """The messages of one topic that arrived within the last `seconds`. Works in any thread."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._lock = threading.Lock()
        self._kept: deque[tuple[float, float, int]] = deque(maxlen=MOST)
        self.total = 0

    def add(self, arrived: float, stamp_s: float | None, size_bytes: int) -> None:
        """A message arrived (s, monotonic), was published (s, its publisher's clock) and has so many bytes.

        Without a stamp (programs of the original NEP) its arrival stands for it.
        """
        with self._lock:
            self.total += 1
            self._kept.append((arrived, arrived if stamp_s is None else stamp_s, size_bytes))

    def frequency(self, now: float) -> Frequency | None:
        """None as long as there are fewer than two messages."""
        moments = sorted(stamp for _, stamp, _ in self._recent(now))
        if len(moments) < 2 or moments[-1] <= moments[0]:
            return None
        gaps = [later - earlier for earlier, later in itertools.pairwise(moments)]
        mean = (moments[-1] - moments[0]) / len(gaps)
        deviation = math.sqrt(sum((gap - mean) ** 2 for gap in gaps) / len(gaps))
        return Frequency(1 / mean, min(gaps), max(gaps), deviation, len(moments))

    def traffic(self, now: float) -> Bandwidth | None:
        """None as long as there are fewer than two messages."""
        recent = self._recent(now)
        if len(recent) < 2:
            return None
        sizes = [size for _, _, size in recent]
        span = recent[-1][0] - recent[0][0]
        if span <= 0:
            return None
        # the first message came at the beginning of the span: it belongs to the time before
        bandwidth = sum(sizes[1:]) / span
        return Bandwidth(bandwidth, sum(sizes) / len(sizes), min(sizes), max(sizes), len(sizes))

    def _recent(self, now: float) -> Sequence[tuple[float, float, int]]:
        with self._lock:
            while self._kept and now - self._kept[0][0] > self._seconds:
                self._kept.popleft()
            return list(self._kept)


class ReplayFilter:
    """Recognizes messages that latched publishers kept for new subscribers: they say nothing about the rate.

    `opened` is when the subscription began (s, monotonic). Not thread-safe.
    """

    def __init__(self, opened: float) -> None:
        self._opened = opened
        self._publishers: set[int | None] = set()

    def is_replay(self, message: Message, now: float) -> bool:
        """Whether a message that arrived `now` (s, monotonic) was published before the subscription began.

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
    """How old the messages of one topic were that arrived within the last `seconds`. Works in any thread."""

    def __init__(self, seconds: float) -> None:
        super().__init__(seconds)
        self._uncertain_s: float | None = None

    def add_age(
        self, arrived: float, age_s: float | None, size_bytes: int, uncertainty_s: float | None = None
    ) -> None:
        """A message arrived (s, monotonic) and was so old (s); None is only counted: nobody knows.

        It may be wrong by `uncertainty_s`, None: by anything. Below 0 the publisher's clock is ahead.
        Ages from before and after the clocks were compared have nothing to do with each other: when that
        changes, those from before are forgotten.
        """
        if age_s is None:
            with self._lock:
                self.total += 1
            return
        with self._lock:
            if (self._uncertain_s is None) != (uncertainty_s is None):
                self._kept.clear()
            self._uncertain_s = uncertainty_s
        self.add(arrived, age_s, size_bytes)

    def delay(self, now: float) -> Delay | None:
        """None as long as there is no message whose age is known."""
        ages = [age for _, age, _ in self._recent(now)]
        if not ages:
            return None
        mean = sum(ages) / len(ages)
        deviation = math.sqrt(sum((age - mean) ** 2 for age in ages) / len(ages))
        return Delay(mean, min(ages), max(ages), deviation, len(ages), self._uncertain_s)
