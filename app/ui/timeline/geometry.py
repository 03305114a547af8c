"""Geometry of a timeline: places of the ruler, the lanes and the columns, and the x coordinates of times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from PySide6.QtCore import QRectF, QSizeF

from app.core.timeline.lanes import TimelineContent
from app.core.timeline.scale import TimeScale
from app.ui.theme.theme import Theme

NAMES_WIDTH, FIGURES_WIDTH = 200, 140
NARROW_NAMES_WIDTH, NARROW_FIGURES_WIDTH, NARROW_WIDTH = 120, 76, 560
MIN_PLOT_WIDTH = 20.0
RULER_HEIGHT, PINNED_HEIGHT, LANE_HEIGHT = 26, 24, 22
RIGHT_MARGIN, FIGURES_GAP = 10, 12


@dataclass(frozen=True, slots=True)
class TimelineGeometry:
    """Geometry of a timeline in logical pixels.

    Attributes:
        size: Size of the view.
        plot: Area of the time axis, including the ruler.
        ruler_height: Height of the ruler.
        pinned_height: Height of a pinned lane.
        lane_height: Height of another lane.
        pinned_count: Number of pinned lanes.
        lane_count: Number of other lanes.
        scroll_y: Distance by which these are scrolled.
        has_all_columns: True if there is room for all columns at the right, False if only for the last one.
    """

    size: QSizeF
    plot: QRectF
    ruler_height: float
    pinned_height: float
    lane_height: float
    pinned_count: int
    lane_count: int
    scroll_y: float
    has_all_columns: bool

    @classmethod
    def of(cls, theme: Theme, size: QSizeF, content: TimelineContent, scroll_y: float) -> TimelineGeometry:
        """Return the geometry of a view.

        Args:
            theme: Theme, whose text size scales all parts.
            size: Size of the view.
            content: Lanes and columns.
            scroll_y: Distance by which the lanes are scrolled.
        """
        is_narrow = size.width() < theme.scaled(NARROW_WIDTH)
        left = theme.scaled(NARROW_NAMES_WIDTH if is_narrow else NAMES_WIDTH)
        right = theme.scaled(NARROW_FIGURES_WIDTH if is_narrow else FIGURES_WIDTH)
        if not content.columns:
            right = RIGHT_MARGIN
        plot = QRectF(left, 0, max(MIN_PLOT_WIDTH, size.width() - left - right), size.height())
        figures_width = size.width() - plot.right() - RIGHT_MARGIN
        return cls(
            size,
            plot,
            theme.scaled(RULER_HEIGHT),
            theme.scaled(PINNED_HEIGHT),
            max(float(LANE_HEIGHT), theme.scaled(LANE_HEIGHT)),
            len(content.pinned),
            len(content.lanes),
            scroll_y,
            figures_width > theme.scaled(FIGURES_WIDTH) - FIGURES_GAP,
        )

    @property
    def lanes_top(self) -> float:
        """Upper edge of the lanes that scroll."""
        return self.ruler_height + self.pinned_height * self.pinned_count

    @property
    def scroll_range(self) -> float:
        """Maximum distance by which the lanes can be scrolled."""
        return max(0.0, self.lane_count * self.lane_height - (self.size.height() - self.lanes_top))

    @property
    def visible_lanes(self) -> range:
        """Indices of the lanes that are at least partly visible."""
        first = int(self.scroll_y / self.lane_height)
        count = int((self.size.height() - self.lanes_top) / self.lane_height) + 2
        return range(first, min(self.lane_count, first + count))

    def pinned_rect(self, index: int) -> QRectF:
        """Return the rectangle of a pinned lane."""
        top = self.ruler_height + index * self.pinned_height
        return QRectF(0, top, self.size.width(), self.pinned_height)

    def lane_rect(self, index: int) -> QRectF:
        """Return the rectangle of a lane that scrolls."""
        top = self.lanes_top + index * self.lane_height - self.scroll_y
        return QRectF(0, top, self.size.width(), self.lane_height)

    def lane_at(self, y: float) -> int | None:
        """Return the index of the lane at a y coordinate, or None."""
        index = int((y - self.lanes_top + self.scroll_y) / self.lane_height)
        return index if y >= self.lanes_top and 0 <= index < self.lane_count else None

    def figures_rect(self, top: float, height: float) -> QRectF:
        """Return the area of the columns in a lane or in the ruler.

        Args:
            top: Upper edge.
            height: Height.
        """
        return QRectF(self.plot.right(), top, self.size.width() - self.plot.right() - RIGHT_MARGIN, height)

    def x_mapper(self, scale: TimeScale) -> Callable[[int], float]:
        """Return a function from times to x coordinates, which are limited to one width beyond the edges."""
        left, width, relative_position = self.plot.left(), self.plot.width(), scale.relative_position
        return lambda at_ns: left + max(-1.0, min(2.0, relative_position(at_ns))) * width

    def time_at(self, x: float, scale: TimeScale) -> int:
        """Return the time at an x coordinate.

        Args:
            x: Coordinate in px.
            scale: Visible range.
        """
        return scale.time((x - self.plot.left()) / self.plot.width())
