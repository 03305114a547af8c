"""Selection in a timeline: playhead, range and lane."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

RangeEdge = Literal["start", "end"]


@dataclass(frozen=True, slots=True)
class TimelineSelection:
    """Selection in a timeline.

    Attributes:
        position_ns: Time of the playhead.
        range_ns: Start and end of the selected range, or None.
        lane: Id of the selected lane, or "".
    """

    position_ns: int = 0
    range_ns: tuple[int, int] | None = None
    lane: str = ""

    def resized_range(self, edge: RangeEdge, at_ns: int) -> tuple[int, int] | None:
        """Return the range with one edge moved; None without a range, or if it would be empty.

        Args:
            edge: Edge to move.
            at_ns: New time of the edge.
        """
        if self.range_ns is None:
            return None
        start_ns, end_ns = self.range_ns
        resized = (at_ns, end_ns) if edge == "start" else (start_ns, at_ns)
        return resized if resized[0] < resized[1] else None
