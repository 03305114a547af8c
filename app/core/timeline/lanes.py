"""Lanes of a timeline and the marks in them.

A lane has layers, which are painted on top of each other: flags, bars, labelled spans, outlines, notches
and counts. Times are in ns from the origin of the timeline's scale.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

Status = Literal["", "ok", "warn", "error"]


@dataclass(frozen=True, slots=True)
class Mark:
    """Moment or period in a lane.

    Attributes:
        start_ns: Start, or the moment of a flag.
        end_ns: End; for a flag, the same as the start.
        text: Text at the mark.
        tooltip: Text of the tooltip, and for screen readers.
        icon: Name of the icon before the text, or "".
        status: Status, which determines the colour.
        result: Text at the right end of a bar.
        result_icon: Name of the icon before the result, or "".
        key: Object that the mark stands for, or None.
    """

    start_ns: int
    end_ns: int
    text: str
    tooltip: str = ""
    icon: str = ""
    status: Status = ""
    result: str = ""
    result_icon: str = ""
    key: object = None


@dataclass(frozen=True, slots=True)
class Notch:
    """Moment at which something was counted, such as lost messages."""

    at_ns: int
    count: int


@dataclass(frozen=True, slots=True)
class FlagLayer:
    """Moments with their texts.

    Attributes:
        marks: Moments, in order of time.
        placeholder: Text if there are none.
    """

    marks: Sequence[Mark]
    placeholder: str = ""


@dataclass(frozen=True, slots=True)
class BarLayer:
    """Periods as boxes that contain the texts. Bars at the playhead are highlighted."""

    marks: Sequence[Mark]


@dataclass(frozen=True, slots=True)
class SpanLayer:
    """Periods with their texts at the right, up to the next period."""

    marks: Sequence[Mark]


@dataclass(frozen=True, slots=True)
class OutlineLayer:
    """Periods as frames around the layers below."""

    marks: Sequence[Mark]


@dataclass(frozen=True, slots=True)
class NotchLayer:
    """Moments at which something was counted.

    Attributes:
        notches: Moments, in order of time.
        describe: Formats the sum of adjacent counts for a tooltip.
    """

    notches: Sequence[Notch]
    describe: Callable[[int], str] = str


@dataclass(frozen=True, slots=True)
class CountLayer:
    """Counts in equal intervals of the range [``start_ns``, ``end_ns``), as lines or shades.

    Attributes:
        counts: Count of each interval.
    """

    start_ns: int
    end_ns: int
    counts: Sequence[int]


LaneLayer = FlagLayer | BarLayer | SpanLayer | OutlineLayer | NotchLayer | CountLayer


@dataclass(frozen=True, slots=True)
class LaneFigure:
    """Text in a column at the right of a lane.

    Attributes:
        text: Text.
        icon: Name of the icon before the text, or "".
        status: Status, which determines the colour.
        is_muted: True for a less prominent colour.
    """

    text: str
    icon: str = ""
    status: Status = ""
    is_muted: bool = False


@dataclass(frozen=True, slots=True)
class TimelineLane:
    """Lane of a timeline.

    Attributes:
        id: Id, unique in the timeline.
        name: Name at the left.
        icon: Name of the icon before the name.
        layers: Layers, the lowest one first.
        figures: Texts in the columns at the right.
        is_code: True if the name is an identifier, such as the name of a topic.
    """

    id: str
    name: str
    icon: str
    layers: Sequence[LaneLayer] = ()
    figures: Sequence[LaneFigure] = ()
    is_code: bool = False

    def bars(self) -> Iterator[Mark]:
        """Yield the marks of its layers of bars."""
        for layer in self.layers:
            if isinstance(layer, BarLayer):
                yield from layer.marks

    def flags(self) -> Iterator[Mark]:
        """Yield the marks of its layers of flags."""
        for layer in self.layers:
            if isinstance(layer, FlagLayer):
                yield from layer.marks


@dataclass(frozen=True, slots=True)
class TimelineContent:
    """Lanes of a timeline.

    Attributes:
        pinned: Lanes at the top, which are always visible and can't be selected.
        lanes: Lanes below, which can be scrolled and selected.
        columns: Titles of the columns at the right.
    """

    pinned: Sequence[TimelineLane] = ()
    lanes: Sequence[TimelineLane] = ()
    columns: Sequence[str] = ()

    def index_of(self, lane: str) -> int | None:
        """Return the index of a lane in `lanes` by its id; None if there is none."""
        return next((index for index, each in enumerate(self.lanes) if each.id == lane), None)

    def neighbour(self, lane: str, by: int) -> str:
        """Return the id of the lane above or below, limited to the first and the last one.

        Args:
            lane: Id of a lane; without one, the first lane is used.
            by: Number of lanes; negative to go up.
        """
        if not self.lanes:
            return ""
        return self.lanes[max(0, min(len(self.lanes) - 1, (self.index_of(lane) or 0) + by))].id


def spaced_marks(
    marks: Iterable[Mark], x_of: Callable[[int], float], left: float, right: float, min_width: float
) -> Iterator[Mark]:
    """Yield the marks to paint: visible ones that the previous mark doesn't cover.

    Args:
        marks: Marks in order of time.
        x_of: Returns the x coordinate of a time.
        left: Left edge of the visible area.
        right: Right edge of the visible area.
        min_width: Minimum width of a mark.
    """
    free_x = -1.0
    for mark in marks:
        start_x, end_x = x_of(mark.start_ns), x_of(mark.end_ns)
        end_x = max(end_x, start_x + min_width)
        if x_of(mark.end_ns) < left - 1 or start_x > right + 1 or end_x < free_x:
            continue
        free_x = end_x + 1
        yield mark
