"""What became of each topic's messages: how many came, were lost, came late, or could not be read.

A publisher numbers its messages; so what did not come shows as a gap. Pure; used by the thread that writes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import orjson

__all__ = ["MOST_LOST", "MOST_PUBLISHERS", "MOST_TOPICS", "TopicCounter", "TopicFigures", "read_figures"]

MOST_TOPICS = 10_000
"""Counted each; all others are counted together."""
MOST_PUBLISHERS = 1_000
"""Of one topic, whose numbers are followed; of later ones nobody knows what was lost."""
MOST_LOST = 2**63 - 1
"""More is not told: who sends numbers at random would make figures that no JSON holds."""


@dataclass(frozen=True)
class TopicFigures:
    """Of one topic.

    `received`: messages that came. `lost`: those that did not, by their publishers' numbers; None where they
    have none. `late`: came after one that was published after them. `undecodable`: are in the recording, but
    cannot be read. `unkept`: came and are not in the recording, because it could not be written so fast.
    `size_bytes`: of the payloads of all that came.
    """

    received: int = 0
    lost: int | None = None
    late: int = 0
    undecodable: int = 0
    unkept: int = 0
    size_bytes: int = 0

    def since(self, earlier: TopicFigures) -> TopicFigures:
        """What was counted since earlier figures of the same counts."""
        return TopicFigures(
            max(0, self.received - earlier.received),
            None if self.lost is None else max(0, self.lost - (earlier.lost or 0)),
            max(0, self.late - earlier.late),
            max(0, self.undecodable - earlier.undecodable),
            max(0, self.unkept - earlier.unkept),
            max(0, self.size_bytes - earlier.size_bytes),
        )

    def to_plain(self) -> dict[str, int | None]:
        """As a map, for JSON."""
        return {
            "received": self.received,
            "lost": self.lost,
            "late": self.late,
            "undecodable": self.undecodable,
            "unkept": self.unkept,
            "size_bytes": self.size_bytes,
        }


def read_figures(value: object) -> TopicFigures | None:
    """Figures of a map, or of its JSON text; None for what is none."""
    if isinstance(value, str):
        try:
            value = orjson.loads(value)
        except orjson.JSONDecodeError:
            return None
    if not isinstance(value, Mapping):
        return None
    lost = value.get("lost")
    names = ("received", "late", "undecodable", "unkept", "size_bytes")
    counts = {name: each for name in names if type(each := value.get(name)) is int and each >= 0}
    is_whole = len(counts) == len(names) and (lost is None or (type(lost) is int and lost >= 0))
    return TopicFigures(lost=lost, **counts) if is_whole else None


@dataclass
class _Numbers:
    """The numbers of one publisher's messages."""

    first: int
    last: int
    came: int = 0

    @property
    def lost(self) -> int:
        return max(0, self.last - self.first + 1 - self.came)


@dataclass
class TopicCounter:
    """Counts the messages of one topic."""

    received: int = 0
    late: int = 0
    undecodable: int = 0
    unkept: int = 0
    size_bytes: int = 0
    is_changed: bool = True
    """Whether there is something new since `figures` were last written."""
    _publishers: dict[int | None, _Numbers] = field(default_factory=dict)

    def add(self, publisher: int | None, seq: int | None, size_bytes: int, *, is_decodable: bool) -> None:
        """A message came, and is in the recording."""
        self.received += 1
        self.size_bytes += size_bytes
        self.is_changed = True
        if not is_decodable:
            self.undecodable += 1
        if seq is None:
            return
        numbers = self._publishers.get(publisher)
        if numbers is None:
            if len(self._publishers) < MOST_PUBLISHERS:
                self._publishers[publisher] = _Numbers(seq, seq, 1)
            return
        numbers.came += 1
        if seq > numbers.last:
            numbers.last = seq
        else:
            self.late += 1
            numbers.first = min(numbers.first, seq)

    def leave_out(self, publisher: int | None, count: int, size_bytes: int) -> None:
        """So many messages of a publisher came and are not in the recording."""
        self.received += count
        self.unkept += count
        self.size_bytes += size_bytes
        self.is_changed = True
        numbers = self._publishers.get(publisher)
        if numbers is not None:
            numbers.came += count

    def figures(self) -> TopicFigures:
        """The counts as of now."""
        lost = None
        if self._publishers:
            lost = min(sum(each.lost for each in self._publishers.values()), MOST_LOST)
        return TopicFigures(self.received, lost, self.late, self.undecodable, self.unkept, self.size_bytes)


def changed(counters: Mapping[str, TopicCounter]) -> Iterable[tuple[str, TopicCounter]]:
    """Those of which there is something new."""
    return [(topic, each) for topic, each in counters.items() if each.is_changed]
