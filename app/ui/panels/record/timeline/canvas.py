"""Ruler and lanes of a recording: a lane for events of each kind, and a lane for each topic.

The lanes of topics show message density and losses. The lanes are cached in a pixmap, so that only the
playhead is repainted during replay.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Sequence

from PySide6.QtCore import QEvent, QPoint, QPointF, QRect, QRectF, QSize, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QContextMenuEvent,
    QHelpEvent,
    QImage,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QPixmap,
    QPolygonF,
    QResizeEvent,
    QWheelEvent,
)
from PySide6.QtWidgets import QAbstractScrollArea, QToolTip

from app.core.recording.replay.replay import Replay
from app.core.recording.replay.scale import TimeScale, clock_text, duration_text
from app.ui.panels.record.timeline.event_lanes import LANE_LABELS, RUNS, EventLanes, LaneMark, visible_lanes
from app.ui.text import plain
from app.ui.text.numbers import group_digits
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.inputs.rename_field import RenameField
from nep.i18n import _, ngettext
from nep.recordings.bookmarks import Bookmark

NAMES_WIDTH, FIGURES_WIDTH = 200, 140
NARROW_NAMES_WIDTH, NARROW_FIGURES_WIDTH, NARROW_WIDTH = 120, 76, 560
RULER_HEIGHT, LANE_HEIGHT, ROW_HEIGHT = 26, 24, 22
DENSITY_HEIGHT, TICK_WIDTH = 10, 2
MIN_ALPHA, MAX_ALPHA = 0.14, 0.76
MIN_LINE_SPACING_PX = 8
"""Average distance between messages in px above which each message is drawn as a line."""
LABEL_SPACING_PX = 78
MAX_BUCKETS = 4000
GRIP_PX = 6
FIELD_WIDTH = 180
TOPIC_ICONS = {"image": "image", "json": "braces", "string": "type", "msgpack": "braces"}
ZOOM_PER_WHEEL_UNIT = 1.0015


class TimelineCanvas(QAbstractScrollArea):
    """Canvas with the timeline of one replay.

    Signals:
        selected: Topic that was clicked.
        opened: Topic that was double-clicked.
        rename_requested: Bookmark that was double-clicked.
        menu_requested: Bookmark and screen position for a context menu.
    """

    selected = Signal(str)
    opened = Signal(str)
    rename_requested = Signal(object)
    menu_requested = Signal(object, QPoint)

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self.shows_clock = False
        self.scale: TimeScale | None = None
        self._replay: Replay | None = None
        self._topics: Sequence[str] = ()
        self._lanes_pixmap: QPixmap | None = None
        self._marks: list[LaneMark] = []
        self.field: RenameField | None = None
        self._dragged_part = ""  # dragged part: "playhead", "start" or "end"
        self._position_ns = 0
        self._loop_range_ns: tuple[int, int] | None = None
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName(_("Timeline"))
        self.setFrameShape(QAbstractScrollArea.Shape.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.verticalScrollBar().valueChanged.connect(lambda _value: self.refresh_lanes())
        self.viewport().setMouseTracking(True)
        theme.changed.connect(self._restyle)

    # -- display ------------------------------------------------------------------------------------------

    def show_replay(self, replay: Replay | None) -> None:
        """Show the whole time range of a recording; None clears the canvas."""
        if self.field is not None:
            self.field.close_field()
        self._replay = replay
        self._topics = tuple(replay.recorded_topics) if replay is not None else ()
        is_open = replay is not None and replay.opened_recording is not None
        self.scale = (
            TimeScale.full(replay.start_ns, replay.end_ns) if replay is not None and is_open else None
        )
        self._position_ns, self._loop_range_ns = 0, None
        self.update_scroll_range()

    def move_to(self, position_ns: int, loop_range_ns: tuple[int, int] | None) -> None:
        """Move the playhead. The view scrolls to the playhead unless the mouse drags it or the loop range.

        Args:
            position_ns: Time of the playhead, in ns since 1970.
            loop_range_ns: Start and end of the repeated range in ns since 1970, or None.
        """
        if (position_ns, loop_range_ns) == (self._position_ns, self._loop_range_ns):
            return
        self._position_ns, self._loop_range_ns = position_ns, loop_range_ns
        if self.scale is not None and not self._dragged_part:
            self.set_scale(self.scale.with_time(position_ns))
        self.viewport().update()

    def set_scale(self, scale: TimeScale) -> None:
        """Set the visible time range."""
        if scale != self.scale:
            self.scale = scale
            self.refresh_lanes()

    def zoom(self, factor: float, at_ns: int | None = None) -> None:
        """Scale the visible time range around a time.

        Args:
            factor: Factor by which the length of the range is multiplied.
            at_ns: Time in ns since 1970 that stays at its place; by default the playhead.
        """
        if self.scale is not None:
            self.set_scale(self.scale.zoomed(factor, self._position_ns if at_ns is None else at_ns))

    def show_all(self) -> None:
        """Show the whole recording."""
        if self.scale is not None:
            self.set_scale(TimeScale.full(self.scale.first_ns, self.scale.last_ns))

    def refresh_lanes(self) -> None:
        """Repaint the lanes, and request the message counts of the visible time range."""
        self._lanes_pixmap = None
        self.request_counts()
        self.viewport().update()

    def request_counts(self) -> None:
        """Request the message counts of the visible time range, which are computed in a background thread."""
        replay, scale = self._replay, self.scale
        if replay is not None and replay.densities is not None and scale is not None:
            buckets = max(1, min(MAX_BUCKETS, round(self._plot_rect().width())))
            replay.densities.request(scale.start_ns, scale.end_ns + 1, buckets)

    # -- geometry -----------------------------------------------------------------------------------------

    def _row_height(self) -> float:
        return max(float(ROW_HEIGHT), self._theme.scaled(ROW_HEIGHT))

    def _lanes_top(self) -> float:
        # Top of the topic lanes.
        return self._theme.scaled(RULER_HEIGHT) + self._theme.scaled(LANE_HEIGHT) * len(
            visible_lanes(self._replay)
        )

    def _plot_rect(self) -> QRectF:
        # Area of the time axis, including the ruler.
        view = self.viewport()
        is_narrow = view.width() < self._theme.scaled(NARROW_WIDTH)
        left = self._theme.scaled(NARROW_NAMES_WIDTH if is_narrow else NAMES_WIDTH)
        right = self._theme.scaled(NARROW_FIGURES_WIDTH if is_narrow else FIGURES_WIDTH)
        return QRectF(left, 0, max(20.0, view.width() - left - right), view.height())

    def x_of(self, at_ns: int) -> float:
        """Return the x coordinate of a time in ns since 1970."""
        return self._x_mapper(self._plot_rect())(at_ns)

    def _x_mapper(self, plot: QRectF) -> Callable[[int], float]:
        # Returns a closure for speed: each rendering maps thousands of times.
        scale, left, width = self.scale, plot.left(), plot.width()
        if scale is None:
            return lambda _at_ns: left
        relative_position = scale.relative_position
        return lambda at_ns: left + max(-1.0, min(2.0, relative_position(at_ns))) * width

    def time_at(self, x: float) -> int:
        """Return the time at an x coordinate, in ns since 1970."""
        plot = self._plot_rect()
        return self.scale.time((x - plot.left()) / plot.width()) if self.scale is not None else 0

    def topic_at(self, y: float) -> str:
        """Return the topic whose lane is at a y coordinate, or "" if there is none."""
        if y < self._lanes_top():
            return ""
        index = int((y - self._lanes_top() + self.verticalScrollBar().value()) / self._row_height())
        return self._topics[index] if 0 <= index < len(self._topics) else ""

    def show_topic(self, topic: str) -> None:
        """Scroll to the lane of a topic."""
        if topic in self._topics:
            top, bar = round(self._topics.index(topic) * self._row_height()), self.verticalScrollBar()
            if not bar.value() <= top <= bar.value() + bar.pageStep() - self._row_height():
                bar.setValue(top)
        self.refresh_lanes()

    def update_scroll_range(self) -> None:
        """Update the scroll range and repaint."""
        bar, room = self.verticalScrollBar(), self.viewport().height() - self._lanes_top()
        bar.setRange(0, max(0, round(len(self._topics) * self._row_height() - room)))
        bar.setPageStep(max(1, round(room)))
        bar.setSingleStep(round(self._row_height()))
        self.refresh_lanes()

    def _restyle(self) -> None:
        self.update_scroll_range()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self.update_scroll_range()

    def sizeHint(self) -> QSize:
        return QSize(900, 260)

    def minimumSizeHint(self) -> QSize:
        return QSize(160, 60)

    # -- painting -----------------------------------------------------------------------------------------

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self.viewport())
        painter.fillRect(self.viewport().rect(), self._theme.colour("panel"))
        if self._replay is not None and self.scale is not None:
            if self._lanes_pixmap is None:
                self._lanes_pixmap = self._render_lanes()
            painter.drawPixmap(0, 0, self._lanes_pixmap)
            self._paint_current_run(painter)
            self._paint_loop(painter)
            self._paint_playhead(painter)
        painter.end()

    def _render_lanes(self) -> QPixmap:
        ratio = self.viewport().devicePixelRatioF()
        pixmap = QPixmap(self.viewport().size() * ratio)
        pixmap.setDevicePixelRatio(ratio)
        pixmap.fill(self._theme.colour("panel"))
        painter = QPainter(pixmap)
        plot = self._plot_rect()
        painter.save()
        painter.setClipRect(QRectF(0, self._lanes_top(), self.viewport().width(), self.viewport().height()))
        first = int(self.verticalScrollBar().value() / self._row_height())
        row_count = int((self.viewport().height() - self._lanes_top()) / self._row_height()) + 2
        for index in range(first, min(len(self._topics), first + row_count)):
            self._paint_topic(painter, plot, index)
        painter.restore()
        self._paint_ruler(painter, plot)
        self._paint_lanes(painter, plot)
        painter.end()
        return pixmap

    def _paint_ruler(self, painter: QPainter, plot: QRectF) -> None:
        theme, scale = self._theme, self.scale
        if scale is None:
            return
        height = theme.scaled(RULER_HEIGHT)
        max_marks = max(2, int(plot.width() / theme.scaled(LABEL_SPACING_PX)))
        digits = 0 if scale.mark_interval_s(max_marks) >= 1 else 3
        font, colour = theme.font("small"), theme.colour("textSecondary")
        painter.setPen(QPen(theme.colour("border"), 1))
        for at_ns in scale.marks(max_marks, by_clock=self.shows_clock):
            x = self.x_of(at_ns)
            painter.setPen(QPen(theme.colour("controlBorder"), 1))
            painter.drawLine(QPointF(x, height - 6), QPointF(x, height))
            from_start = duration_text(at_ns - scale.first_ns, digits=digits)
            text = clock_text(at_ns, digits=digits) if self.shows_clock else from_start
            # otherwise the label would overlap the text at the right
            if x + 3 + paint.width_of(font, text) <= plot.right():
                paint.text_line(
                    painter, QRectF(x + 3, 0, theme.scaled(LABEL_SPACING_PX), height - 4), text, font, colour
                )
        paint.hairline(
            painter, QRectF(0, 0, self.viewport().width(), height), Qt.Edge.BottomEdge, theme.colour("border")
        )
        right = QRectF(plot.right(), 0, self.viewport().width() - plot.right() - 10, height)
        tertiary = theme.colour("textTertiary")
        if right.width() > theme.scaled(FIGURES_WIDTH) - 12:
            half = QRectF(right.left(), 0, right.width() / 2, height)
            paint.text_line(painter, half, _("Messages"), font, tertiary, paint.RIGHT)
        paint.text_line(painter, right, _("Lost"), font, tertiary, paint.RIGHT)

    def _paint_lanes(self, painter: QPainter, plot: QRectF) -> None:
        # Bookmarks, and the lanes of runs and alarms if there are any.
        theme, replay = self._theme, self._replay
        self._marks = []
        if replay is None:
            return
        lanes, height = EventLanes(theme, painter, plot, self._x_mapper(plot)), theme.scaled(LANE_HEIGHT)
        for index, lane in enumerate(visible_lanes(replay)):
            top = theme.scaled(RULER_HEIGHT) + index * height
            icon, name = LANE_LABELS[lane]
            box = QRectF(0, top, plot.left(), height)
            self._paint_name(painter, box, icon, _(name), "textSecondary")
            self._marks += lanes.paint(lane, replay, top, height)
            rect = QRectF(0, 0, self.viewport().width(), top + height)
            paint.hairline(painter, rect, Qt.Edge.BottomEdge, theme.colour("border"))

    def _paint_current_run(self, painter: QPainter) -> None:
        # Highlights the run at the playhead.
        replay, theme, at_ns = self._replay, self._theme, self._position_ns
        lanes = visible_lanes(replay)
        if replay is None or replay.densities is None or RUNS not in lanes:
            return
        plot, height = self._plot_rect(), theme.scaled(LANE_HEIGHT)
        top = theme.scaled(RULER_HEIGHT) + lanes.index(RUNS) * height
        event_lanes = EventLanes(theme, painter, plot, self._x_mapper(plot))
        painter.save()
        painter.setClipRect(QRectF(plot.left(), top, plot.width(), height))
        for span in replay.densities.spans.runs:
            if span.start_ns <= at_ns < span.end_ns:
                event_lanes.paint_run(span, event_lanes.bar_rect(span, top, height), "changedTint", "running")
        painter.restore()

    def _paint_name(self, painter: QPainter, box: QRectF, icon: str, text: str, role: str) -> None:
        theme = self._theme
        side = theme.scaled(14)
        icon_rect = QRectF(12, box.center().y() - side / 2, side, side)
        paint_icon(painter, icon_rect, icon, theme.colour("textTertiary"))
        rest = box.adjusted(18 + side, 0, -6, 0)
        font = theme.font("code" if role in {"text", "selectedText"} else "body")
        paint.text_line(painter, rest, text, font, theme.colour(role))

    def _paint_topic(self, painter: QPainter, plot: QRectF, index: int) -> None:
        theme, replay, topic = self._theme, self._replay, self._topics[index]
        if replay is None:
            return
        top = self._lanes_top() + index * self._row_height() - self.verticalScrollBar().value()
        row_rect = QRectF(0, top, self.viewport().width(), self._row_height())
        is_selected = topic == replay.selected_topic
        if is_selected:
            painter.fillRect(row_rect, theme.colour("selected"))
        recorded = replay.recorded_topics[topic]
        role = "selectedText" if is_selected else "text"
        icon = TOPIC_ICONS.get(recorded.codec, "binary")
        self._paint_name(painter, QRectF(0, top, plot.left(), self._row_height()), icon, topic, role)
        self._paint_density(painter, plot, top, topic, is_selected=is_selected)
        self._paint_losses(painter, plot, top, topic)
        self._paint_alarms_of(painter, plot, top, topic)
        self._paint_stats(
            painter,
            QRectF(plot.right(), top, row_rect.right() - plot.right() - 10, self._row_height()),
            topic,
        )

    def _paint_density(
        self, painter: QPainter, plot: QRectF, top: float, topic: str, *, is_selected: bool
    ) -> None:
        replay, scale = self._replay, self.scale
        density = replay.densities.newest if replay is not None and replay.densities is not None else None
        if density is None or scale is None or topic not in density.counts:
            return
        counts = density.counts[topic]
        nonzero_count = sum(1 for count in counts if count)
        peak = density.peak(topic)
        colour = self._theme.colour("accentText" if is_selected else "textTertiary")
        left, right = self.x_of(density.start_ns), self.x_of(density.end_ns)
        box = QRectF(left, top + (self._row_height() - DENSITY_HEIGHT) / 2, right - left, DENSITY_HEIGHT)
        painter.save()
        painter.setClipRect(
            QRectF(plot.left(), top, plot.width(), self._row_height()), Qt.ClipOperation.IntersectClip
        )
        if nonzero_count * MIN_LINE_SPACING_PX < density.bucket_count:
            bucket_width = box.width() / density.bucket_count
            for index, count in enumerate(counts):
                if count:
                    painter.fillRect(
                        QRectF(left + index * bucket_width, box.top(), TICK_WIDTH, DENSITY_HEIGHT), colour
                    )
        elif peak:
            painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform, False)
            painter.drawImage(box, density_image(counts, peak, colour))
        painter.restore()

    def _paint_losses(self, painter: QPainter, plot: QRectF, top: float, topic: str) -> None:
        replay = self._replay
        if replay is None or replay.densities is None:
            return
        colour = self._theme.colour("warn")
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(colour)
        last_x = plot.left() - 4
        for mark in replay.densities.losses.get(topic, ()):
            x = self.x_of(mark.at_ns)
            if plot.left() <= x <= plot.right() and x >= last_x + 3:
                last_x = x
                middle = top + self._row_height() / 2
                painter.fillRect(QRectF(x - 1, middle - 8, 2, 16), colour)
                notch = [QPointF(x - 4, middle - 8), QPointF(x + 4, middle - 8), QPointF(x, middle - 3)]
                painter.drawPolygon(QPolygonF(notch))

    def _paint_alarms_of(self, painter: QPainter, plot: QRectF, top: float, topic: str) -> None:
        # Outlines the periods of alarms about this topic.
        replay = self._replay
        if replay is None or replay.densities is None:
            return
        painter.save()
        painter.setClipRect(
            QRectF(plot.left(), top, plot.width(), self._row_height()), Qt.ClipOperation.IntersectClip
        )
        topic_spans = [span for span in replay.densities.spans.alarms if span.topic == topic]
        for span in EventLanes(self._theme, painter, plot, self._x_mapper(plot)).visible_spans(topic_spans):
            left, right = self.x_of(span.start_ns), self.x_of(span.end_ns)
            box = QRectF(
                left,
                top + (self._row_height() - DENSITY_HEIGHT) / 2 - 2,
                max(4.0, right - left),
                DENSITY_HEIGHT + 4,
            )
            edge = self._theme.colour("error" if span.is_error else "warn")
            paint.box(painter, box, 2, None, edge)
        painter.restore()

    def _paint_stats(self, painter: QPainter, box: QRectF, topic: str) -> None:
        theme, replay = self._theme, self._replay
        if replay is None:
            return
        font, count = theme.font("code"), replay.recorded_topics[topic].message_count
        stats = replay.stats.get(topic)
        lost = None if stats is None or stats.lost is None else stats.lost + stats.unkept
        if box.width() > theme.scaled(FIGURES_WIDTH) - 12:
            half = QRectF(box.left(), box.top(), box.width() / 2, box.height())
            paint.text_line(
                painter, half, group_digits(count), font, theme.colour("textSecondary"), paint.RIGHT
            )
        if lost is not None:
            text, role = group_digits(lost), "warn" if lost else "textTertiary"
            paint.text_line(painter, box, text, font, theme.colour(role), paint.RIGHT)
            if lost:
                side = theme.scaled(13)
                left = box.right() - paint.width_of(font, text) - side - 4
                icon_rect = QRectF(left, box.center().y() - side / 2, side, side)
                paint_icon(painter, icon_rect, "triangle-alert", theme.colour("warn"))

    def _paint_loop(self, painter: QPainter) -> None:
        if self._loop_range_ns is None:
            return
        plot, accent = self._plot_rect(), self._theme.colour("accent")
        left, right = (self.x_of(each) for each in self._loop_range_ns)
        painter.save()
        painter.setClipRect(plot)
        tint = QColor(accent)
        tint.setAlphaF(0.1)
        painter.fillRect(QRectF(left, 0, right - left, plot.height()), tint)
        for x in (left, right):
            painter.fillRect(QRectF(x - 1, 0, 2, plot.height()), accent)
        ruler_height = self._theme.scaled(RULER_HEIGHT)
        for x in (left - 8, right):
            paint.box(painter, QRectF(x, 5, 8, ruler_height - 10), 2, accent)
        painter.restore()

    def _paint_playhead(self, painter: QPainter) -> None:
        plot, theme = self._plot_rect(), self._theme
        x = self.x_of(self._position_ns)
        if self.scale is None or not plot.left() - 1 <= x <= plot.right() + 1:
            return
        painter.fillRect(QRectF(x - 0.75, 0, 1.5, plot.height()), theme.colour("text"))
        font = theme.font("small")
        first_ns = self.scale.first_ns
        text = (
            clock_text(self._position_ns) if self.shows_clock else duration_text(self._position_ns - first_ns)
        )
        width = paint.width_of(font, text) + 12
        left = max(plot.left(), min(plot.right() - width, x - width / 2))
        flag = QRectF(left, 3, width, theme.scaled(RULER_HEIGHT) - 7)
        paint.box(painter, flag, theme.radius("small"), theme.colour("tooltip"))
        paint.text_line(painter, flag, text, font, theme.colour("tooltipText"), paint.CENTRE)

    # -- mouse --------------------------------------------------------------------------------------------

    def mark_at(self, position: QPointF) -> LaneMark | None:
        """Return the mark at a position, or None. If marks overlap, the narrowest one is returned."""
        matches = [mark for mark in self._marks if mark.box.contains(position)]
        return min(matches, key=lambda mark: mark.box.width(), default=None)

    def _grip_at(self, position: QPointF) -> str:
        # Part that is dragged after a press at this position.
        plot = self._plot_rect()
        if not plot.left() - GRIP_PX <= position.x() <= plot.right() + GRIP_PX or self.scale is None:
            return ""
        if self._loop_range_ns is not None and position.y() < self._theme.scaled(RULER_HEIGHT):
            for name, edge in zip(("start", "end"), self._loop_range_ns, strict=True):
                outer = self.x_of(edge) + (-4 if name == "start" else 4)
                if abs(position.x() - outer) <= GRIP_PX:
                    return name
        return "playhead"

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() != Qt.MouseButton.LeftButton or self._replay is None:
            return
        mark = self.mark_at(event.position())
        if mark is not None:
            self._replay.seek(mark.at_ns)
            return
        self._dragged_part = self._grip_at(event.position())
        topic = self.topic_at(event.position().y())
        if topic:
            self.selected.emit(topic)
        if self._dragged_part == "playhead":
            self._replay.seek(self.time_at(event.position().x()))

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        grip = self._dragged_part or self._grip_at(event.position())
        self.viewport().setCursor(
            Qt.CursorShape.SplitHCursor if grip in {"start", "end"} else Qt.CursorShape.ArrowCursor
        )
        if not self._dragged_part or self._replay is None:
            return
        at_ns = self.time_at(event.position().x())
        if self._dragged_part == "playhead":
            self._replay.seek(at_ns)
        elif self._loop_range_ns is not None:
            start_ns, end_ns = self._loop_range_ns
            self._replay.loop(*((at_ns, end_ns) if self._dragged_part == "start" else (start_ns, at_ns)))

    def mouseReleaseEvent(self, _event: QMouseEvent) -> None:
        self._dragged_part = ""

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        mark = self.mark_at(event.position())
        if mark is not None and mark.bookmark is not None:
            self.rename_requested.emit(mark.bookmark)
            return
        topic = self.topic_at(event.position().y())
        if topic and event.position().x() < self._plot_rect().left():
            self.opened.emit(topic)

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        # Context menu of the bookmark under the mouse or, by keyboard, at the playhead.
        bookmark, position = None, event.globalPos()
        if event.reason() == QContextMenuEvent.Reason.Keyboard:
            bookmark = self._replay.current_bookmark() if self._replay is not None else None
            if bookmark is not None:
                corner = QPoint(round(self.x_of(bookmark.at_ns)), round(self._theme.scaled(RULER_HEIGHT)))
                position = self.viewport().mapToGlobal(corner)
        elif (mark := self.mark_at(QPointF(event.pos()))) is not None:
            bookmark = mark.bookmark
        if bookmark is not None:
            self.menu_requested.emit(bookmark, position)
            event.accept()

    def rename(self, bookmark: Bookmark, on_rename: Callable[[str], bool]) -> None:
        """Start editing the name of a bookmark in place.

        Args:
            bookmark: Bookmark to rename.
            on_rename: Receives the new name and returns False if it is invalid.
        """
        if self.field is not None:
            return
        if self.scale is not None:
            self.set_scale(self.scale.with_time(bookmark.at_ns))
        scaled, view = self._theme.scaled, self.viewport()
        width = min(round(scaled(FIELD_WIDTH)), view.width())
        left = max(0, min(round(self.x_of(bookmark.at_ns)), view.width() - width))
        rect = QRect(left, round(scaled(RULER_HEIGHT)), width, round(scaled(LANE_HEIGHT)))
        self.field = RenameField(self._theme, view, rect, bookmark.name, on_rename, _("Bookmark name"))
        self.field.closed.connect(self._rename_finished)

    def _rename_finished(self) -> None:
        had_focus = self.field is not None and self.field.hasFocus()
        self.field = None
        if had_focus:
            self.setFocus(Qt.FocusReason.OtherFocusReason)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        # Leaves keys to the panel; a scroll area would consume the arrow keys.
        event.ignore()

    def wheelEvent(self, event: QWheelEvent) -> None:
        # Zooms if the mouse is above the time axis, scrolls if above the names.
        x, delta = event.position().x(), event.angleDelta()
        if x < self._plot_rect().left() or self.scale is None:
            super().wheelEvent(event)
        elif delta.x() and not delta.y():
            self.set_scale(self.scale.moved(-round(delta.x() / 1200 * self.scale.span_ns)))
        else:
            self.zoom(ZOOM_PER_WHEEL_UNIT ** -delta.y(), self.time_at(x))
        event.accept()

    def viewportEvent(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.ToolTip and isinstance(event, QHelpEvent):
            text = self._tooltip_at(QPointF(event.pos()))
            QToolTip.showText(event.globalPos(), plain.tip(text) if text else "", self.viewport())
            return True
        return super().viewportEvent(event)

    def _tooltip_at(self, position: QPointF) -> str:
        # Tooltip of a mark, of losses, or of an elided name.
        replay, topic = self._replay, self.topic_at(position.y())
        if replay is None or self.scale is None:
            return ""
        if not topic:
            mark = self.mark_at(position)
            return mark.text if mark is not None else ""
        losses = replay.densities.losses.get(topic, ()) if replay.densities is not None else ()
        lost = sum(each.count for each in losses if abs(self.x_of(each.at_ns) - position.x()) <= GRIP_PX)
        if position.x() >= self._plot_rect().left() and lost:
            template = ngettext(
                "{count} message of {topic} was lost here", "{count} messages of {topic} were lost here", lost
            )
            return template.format(count=group_digits(lost), topic=topic)
        return topic


def density_image(counts: Sequence[int], peak: int, colour: QColor) -> QImage:
    """Return an image with a height of 1 px that shows counts by opacity.

    Args:
        counts: Number of messages for each pixel.
        peak: Count that is shown with the highest opacity.
        colour: Colour of the pixels.
    """
    levels = []
    for level in range(256):
        alpha = 0.0 if level == 0 else MIN_ALPHA + (MAX_ALPHA - MIN_ALPHA) * level / 255
        rgb = (round(each * alpha) for each in (colour.red(), colour.green(), colour.blue()))
        red, green, blue = rgb
        levels.append(round(alpha * 255) << 24 | red << 16 | green << 8 | blue)
    pixels = array("I", [levels[0 if not count else max(1, count * 255 // peak)] for count in counts])
    image = QImage(
        pixels.tobytes(), len(counts), 1, 4 * len(counts), QImage.Format.Format_ARGB32_Premultiplied
    )
    return image.copy()  # copied because QImage doesn't own the buffer
