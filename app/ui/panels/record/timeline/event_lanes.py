"""Lanes for bookmarks, runs of behaviours and alarms, above the topics. Their marks can be clicked."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QPainter, QPen

from app.core.recording.replay.replay import Replay
from app.core.recording.replay.scale import duration_text
from app.core.recording.replay.spans import RecordedSpan
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from nep.i18n import _, lazy
from nep.recordings.bookmarks import Bookmark

BOOKMARKS, RUNS, ALARMS = "bookmarks", "runs", "alarms"
LANE_LABELS = {
    BOOKMARKS: ("bookmark", lazy("Bookmarks")),
    RUNS: ("blocks", lazy("Behaviours")),
    ALARMS: ("bell", lazy("Alarms")),
}
"""Icon and name of each lane."""
RESULT_STYLES = {
    "ended": ("circle-check", "ok", lazy("ended")),
    "stopped": ("square", "textSecondary", lazy("stopped")),
    "failed": ("circle-x", "error", lazy("failed")),
}
"""Icon, colour and text for each result of a run, by id."""
MIN_MARK_WIDTH = 3.0
"""Minimum width of a mark in px."""
ICON_SIZE, GAP, MIN_TEXT_WIDTH, MAX_NAME_WIDTH, FLAG_SIZE = 13, 4, 34, 160, 8


@dataclass(frozen=True, slots=True)
class LaneMark:
    """Mark in a lane that can be clicked.

    Attributes:
        box: Rectangle of the mark.
        at_ns: Time to seek to on click, in ns since 1970.
        text: Tooltip.
        bookmark: Bookmark that the mark stands for, or None.
    """

    box: QRectF
    at_ns: int
    text: str
    bookmark: Bookmark | None = None


def visible_lanes(replay: Replay | None) -> tuple[str, ...]:
    """Return the lanes to show: always bookmarks, and runs and alarms if the recording contains any."""
    spans = replay.densities.spans if replay is not None and replay.densities is not None else None
    if spans is None:
        return (BOOKMARKS,)
    return (BOOKMARKS, *([RUNS] if spans.runs else []), *([ALARMS] if spans.alarms else []))


class EventLanes:
    """Painter of the event lanes.

    Args:
        theme: Theme with colours and fonts.
        painter: Painter to use.
        plot: Area of all lanes; its width is the visible time range.
        x_of: Returns the x coordinate of a time in ns since 1970.
    """

    def __init__(self, theme: Theme, painter: QPainter, plot: QRectF, x_of: Callable[[int], float]) -> None:
        self._theme, self._painter, self._plot, self._x_of = theme, painter, plot, x_of

    def paint(self, lane: str, replay: Replay, top: float, height: float) -> list[LaneMark]:
        """Paint one lane and return its marks.

        Args:
            lane: Lane, a key in `LANE_LABELS`.
            replay: Open recording.
            top: Upper edge of the lane in px.
            height: Height of the lane in px.
        """
        plot = self._plot
        box = QRectF(plot.left(), top, plot.width(), height)
        spans = replay.densities.spans if replay.densities is not None else None
        self._painter.save()
        self._painter.setClipRect(box)
        if lane == BOOKMARKS:
            marks = self._paint_bookmarks(replay, box)
        elif spans is None:
            marks = []
        elif lane == RUNS:
            marks = [
                self._paint_run_mark(span, box, replay.start_ns) for span in self.visible_spans(spans.runs)
            ]
        else:
            marks = self._paint_alarms(list(self.visible_spans(spans.alarms)), box, replay.start_ns)
        self._painter.restore()
        return marks

    def visible_spans(self, spans: Iterable[RecordedSpan]) -> Iterator[RecordedSpan]:
        """Yield the spans to paint: visible spans that the mark of the previous span does not hide."""
        plot, next_free_x = self._plot, -1.0
        for span in spans:
            left, right = self._x_of(span.start_ns), self._x_of(span.end_ns)
            if (
                right < plot.left() - 1
                or left > plot.right() + 1
                or max(right, left + MIN_MARK_WIDTH) < next_free_x
            ):
                continue
            next_free_x = max(right, left + MIN_MARK_WIDTH) + 1
            yield span

    # -- bookmarks ----------------------------------------------------------------------------------------

    def _paint_bookmarks(self, replay: Replay, box: QRectF) -> list[LaneMark]:
        theme, painter, bookmarks = self._theme, self._painter, replay.bookmarks
        font, colour = theme.font("small"), theme.colour("accentText")
        if not bookmarks:
            tertiary = theme.colour("textTertiary")
            paint.text_line(
                painter, box.adjusted(FLAG_SIZE, 0, 0, 0), _("Press B to add a bookmark"), font, tertiary
            )
        lane_marks, next_free_x = [], box.left() - 1.0
        for bookmark in bookmarks:
            x = self._x_of(bookmark.at_ns)
            if not box.left() - 1 <= x <= box.right() + 1:
                continue
            painter.setPen(QPen(colour, 1.5))
            painter.drawLine(QPointF(x, box.top() + 3), QPointF(x, box.bottom() - 3))
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(colour)
            painter.drawRect(QRectF(x, box.top() + 4, FLAG_SIZE, 7))
            name_width = 0.0
            if x >= next_free_x and bookmark.name:
                name_width = min(paint.width_of(font, bookmark.name), theme.scaled(MAX_NAME_WIDTH))
                name_rect = QRectF(x + 12, box.top(), name_width, box.height())
                paint.text_line(painter, name_rect, bookmark.name, font, theme.colour("text"))
                next_free_x = x + 16 + name_width
            hit_rect = QRectF(x - GAP, box.top(), FLAG_SIZE + 2 * GAP + name_width, box.height())
            lane_marks.append(LaneMark(hit_rect, bookmark.at_ns, bookmark.name or _("Bookmark"), bookmark))
        return lane_marks

    # -- behaviours ---------------------------------------------------------------------------------------

    def bar_rect(self, span: RecordedSpan, top: float, height: float) -> QRectF:
        """Return the rectangle of a run in a lane.

        Args:
            span: Run.
            top: Upper edge of the lane in px.
            height: Height of the lane in px.
        """
        left, right = self._x_of(span.start_ns), self._x_of(span.end_ns)
        return QRectF(left, top + 3, max(MIN_MARK_WIDTH, right - left), height - 6)

    def _paint_run_mark(self, span: RecordedSpan, box: QRectF, start_ns: int) -> LaneMark:
        bar = self.bar_rect(span, box.top(), box.height())
        self.paint_run(span, bar, "sunken", "controlBorder")
        return LaneMark(bar, span.start_ns, run_text(span, start_ns))

    def paint_run(self, span: RecordedSpan, bar: QRectF, fill: str, edge: str) -> None:
        """Paint a run, with its name at the left and its result at the right if there is room for them.

        Args:
            span: Run.
            bar: Rectangle of the run.
            fill: Name of the theme's fill colour.
            edge: Name of the theme's border colour.
        """
        theme, painter = self._theme, self._painter
        paint.box(painter, bar, theme.radius("small"), theme.colour(fill), theme.colour(edge))
        visible_rect = bar.intersected(QRectF(self._plot.left(), bar.top(), self._plot.width(), bar.height()))
        content_rect = visible_rect.adjusted(6, 0, -6, 0)
        if content_rect.width() < theme.scaled(MIN_TEXT_WIDTH):
            return
        font, side = theme.font("small"), theme.scaled(ICON_SIZE)
        self._paint_icon("blocks", content_rect.left(), content_rect, "textTertiary")
        content_rect.adjust(side + GAP, 0, 0, 0)
        icon, role, result = RESULT_STYLES.get(span.result, ("", "", ""))
        text = span.details or (_(result) if result else "")
        result_width = side + GAP + paint.width_of(font, text)
        name_width = min(paint.width_of(font, span.name), theme.scaled(MAX_NAME_WIDTH))
        if icon and name_width + 2 * GAP + result_width <= content_rect.width():
            self._paint_icon(icon, content_rect.right() - result_width, content_rect, role)
            paint.text_line(painter, content_rect, text, font, theme.colour(role), paint.RIGHT)
            content_rect.adjust(0, 0, -result_width - GAP, 0)
        elif icon and name_width + 2 * GAP + side <= content_rect.width():
            self._paint_icon(icon, content_rect.right() - side, content_rect, role)
            content_rect.adjust(0, 0, -side - GAP, 0)
        paint.text_line(painter, content_rect, span.name, font, theme.colour("text"))

    def _paint_icon(self, name: str, left: float, row: QRectF, role: str) -> None:
        side = self._theme.scaled(ICON_SIZE)
        icon_rect = QRectF(left, row.center().y() - side / 2, side, side)
        paint_icon(self._painter, icon_rect, name, self._theme.colour(role))

    # -- alarms -------------------------------------------------------------------------------------------

    def _paint_alarms(self, spans: list[RecordedSpan], box: QRectF, start_ns: int) -> list[LaneMark]:
        # Each bar has its text at the right, up to the next bar.
        marks, theme = [], self._theme
        font, side = theme.font("small"), theme.scaled(ICON_SIZE)
        for index, span in enumerate(spans):
            role = "error" if span.is_error else "warn"
            left, right = self._x_of(span.start_ns), self._x_of(span.end_ns)
            bar = QRectF(left, box.top() + 5, max(MIN_MARK_WIDTH, right - left), box.height() - 10)
            paint.box(self._painter, bar, 1.5, theme.colour(role))
            message = alarm_text(span)
            next_start = self._x_of(spans[index + 1].start_ns) if index + 1 < len(spans) else box.right()
            begin = max(bar.right(), box.left()) + 5
            room = min(next_start, box.right()) - begin - side - GAP
            hit_rect = bar.adjusted(-3, -3, 3, 3)
            if room >= theme.scaled(MIN_TEXT_WIDTH):
                text_width = min(room, paint.width_of(font, message) + 1)
                self._paint_icon("circle-x" if span.is_error else "triangle-alert", begin, box, role)
                text_rect = QRectF(begin + side + GAP, box.top(), text_width, box.height())
                paint.text_line(self._painter, text_rect, message, font, theme.colour(role))
                hit_rect = hit_rect.united(text_rect)
            marks.append(LaneMark(hit_rect, span.start_ns, _with_times(message, span, start_ns)))
        return marks


def alarm_text(span: RecordedSpan) -> str:
    """Format an alarm and, if known, its duration: "/distance: range is 0.36, below 0.4, 1.2 s"."""
    name = span.name.rstrip(".")
    name = f"{name[:1].upper()}{name[1:]}"
    if not span.has_ended:
        return name
    seconds = (span.end_ns - span.start_ns) / 1e9
    return _("{alarm}, {seconds} s").format(alarm=name, seconds=f"{seconds:.1f}")


def run_text(span: RecordedSpan, start_ns: int) -> str:
    """Format a run: name of the behaviour, result and times.

    Args:
        span: Run.
        start_ns: Start of the recording, in ns since 1970.
    """
    style = RESULT_STYLES.get(span.result)
    result = span.details or (_(style[2]) if style is not None else "")
    return _with_times(f"{span.name}: {result}" if result else span.name, span, start_ns)


def _with_times(text: str, span: RecordedSpan, start_ns: int) -> str:
    begin, end = (duration_text(each - start_ns, digits=1) for each in (span.start_ns, span.end_ns))
    if not span.has_ended:
        return _("{what}\nsince {begin}").format(what=text, begin=begin)
    return _("{what}\n{begin} to {end}").format(what=text, begin=begin, end=end)
