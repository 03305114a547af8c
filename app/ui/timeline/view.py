"""Timeline widget: ruler, lanes, playhead and selected range.

The lanes are cached in a pixmap, so that only the playhead is repainted while it moves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

from PySide6.QtCore import QEvent, QPoint, QPointF, QRect, QRectF, QSize, QSizeF, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QContextMenuEvent,
    QHelpEvent,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QPixmap,
    QResizeEvent,
    QWheelEvent,
)
from PySide6.QtWidgets import QAbstractScrollArea, QToolTip

from app.core.timeline.lanes import Mark, NotchLayer, TimelineContent, TimelineLane
from app.core.timeline.ruler import Ruler
from app.core.timeline.scale import TimeScale
from app.core.timeline.selection import RangeEdge, TimelineSelection
from app.ui.text import plain
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.timeline.geometry import TimelineGeometry
from app.ui.timeline.layers import STATUS_ROLES, LanePainter, PaintedMark
from app.ui.widgets import paint
from app.ui.widgets.inputs.rename_field import RenameField

LABEL_SPACING_PX, LABEL_GAP_PX = 78, 3
GRIP_PX = 6
FIELD_WIDTH = 180
NAME_ICON_SIZE, FIGURE_ICON_SIZE = 14, 13
ZOOM_FACTOR, ZOOM_PER_WHEEL_UNIT, MAX_WHEEL_UNITS = 1.5, 1.0015, 10_000

_NO_MODIFIER, _SHIFT = Qt.KeyboardModifier.NoModifier, Qt.KeyboardModifier.ShiftModifier


class TimelineView(QAbstractScrollArea):
    """Timeline with lanes of any content.

    Signals:
        position_requested: Time in ns that was clicked, or to which the playhead was dragged.
        range_requested: Start and end in ns to which an edge of the range was dragged.
        lane_selected: Id of the lane that was clicked or chosen by keyboard.
        lane_opened: Id of the lane whose name was double-clicked.
        mark_opened: Mark that was double-clicked.
        menu_requested: Mark and screen position for a context menu.
        viewport_changed: The visible range or the width of the time axis may have changed.

    Attributes:
        shows_clock: True if the ruler shows the time of day.
        scale: Visible range, or None while the timeline is empty.
        selection: Playhead, selected range and selected lane.
        marks: Visible marks that can be clicked.
        field: Field that edits the text of a mark, or None.
    """

    position_requested = Signal(object)
    range_requested = Signal(object, object)
    lane_selected = Signal(str)
    lane_opened = Signal(str)
    mark_opened = Signal(object)
    menu_requested = Signal(object, QPoint)
    viewport_changed = Signal()

    def __init__(self, theme: Theme, name: str) -> None:
        # `name` is the accessible name.
        super().__init__()
        self._theme = theme
        self.shows_clock = False
        self.scale: TimeScale | None = None
        self.selection = TimelineSelection()
        self.marks: list[PaintedMark] = []
        self.field: RenameField | None = None
        self._content = TimelineContent()
        self._lanes_pixmap: QPixmap | None = None
        self._dragged_part: Literal["", "playhead"] | RangeEdge = ""
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName(name)
        self.setFrameShape(QAbstractScrollArea.Shape.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.verticalScrollBar().valueChanged.connect(lambda _value: self.repaint_lanes())
        self.viewport().setMouseTracking(True)
        theme.changed.connect(self._update_scroll_range)

    # -- display ------------------------------------------------------------------------------------------

    def show_range(self, first_ns: int, last_ns: int) -> None:
        """Show another timeline, from its first to its last time in ns. Its lanes are set separately."""
        self.clear()
        self.scale = TimeScale.full(first_ns, last_ns)
        self._update_scroll_range()

    def clear(self) -> None:
        """Show an empty timeline."""
        if self.field is not None:
            self.field.close_field()
        self.scale, self.selection = None, TimelineSelection()
        self.set_content(TimelineContent())

    def set_content(self, content: TimelineContent) -> None:
        """Set the lanes and repaint them."""
        self._content = content
        self._update_scroll_range()

    def select(self, selection: TimelineSelection) -> None:
        """Show a selection.

        The view scrolls to a moved playhead unless the mouse drags it or the range.
        """
        previous, self.selection = self.selection, selection
        if selection == previous:
            return
        if selection.lane != previous.lane:
            self.repaint_lanes()
        has_moved = (selection.position_ns, selection.range_ns) != (previous.position_ns, previous.range_ns)
        if has_moved and self.scale is not None and not self._dragged_part:
            self.set_scale(self.scale.with_time(selection.position_ns))
        self.viewport().update()

    def set_scale(self, scale: TimeScale) -> None:
        """Set the visible time range."""
        if scale != self.scale:
            self.scale = scale
            self.repaint_lanes()

    def zoom(self, factor: float, at_ns: int | None = None) -> None:
        """Scale the visible time range around a time.

        Args:
            factor: Factor by which the length of the range is multiplied.
            at_ns: Time in ns that stays at its place; by default the playhead.
        """
        if self.scale is not None:
            self.set_scale(self.scale.zoomed(factor, self.selection.position_ns if at_ns is None else at_ns))

    def show_all(self) -> None:
        """Show the whole time range."""
        if self.scale is not None:
            self.set_scale(TimeScale.full(self.scale.first_ns, self.scale.last_ns))

    def set_clock(self, *, is_shown: bool) -> None:
        """Choose whether the ruler shows the time of day.

        Args:
            is_shown: False to show the time since the start.
        """
        self.shows_clock = is_shown
        self.repaint_lanes()

    def repaint_lanes(self) -> None:
        """Repaint the lanes, for example after a change of the theme."""
        self._lanes_pixmap = None
        self.viewport_changed.emit()
        self.viewport().update()

    def show_lane(self, lane: str) -> None:
        """Scroll to a lane."""
        index, bar = self._content.index_of(lane), self.verticalScrollBar()
        if index is not None:
            height = self.geometry_of_lanes().lane_height
            top = round(index * height)
            if not bar.value() <= top <= bar.value() + bar.pageStep() - height:
                bar.setValue(top)

    def _update_scroll_range(self) -> None:
        geometry, bar = self.geometry_of_lanes(), self.verticalScrollBar()
        bar.setRange(0, round(geometry.scroll_range))
        bar.setPageStep(max(1, round(geometry.size.height() - geometry.lanes_top)))
        bar.setSingleStep(round(geometry.lane_height))
        self.repaint_lanes()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._update_scroll_range()

    def sizeHint(self) -> QSize:
        return QSize(900, 260)

    def minimumSizeHint(self) -> QSize:
        return QSize(160, 60)

    # -- geometry -----------------------------------------------------------------------------------------

    def geometry_of_lanes(self) -> TimelineGeometry:
        """Return the places of the ruler and the lanes."""
        scroll_y = self.verticalScrollBar().value()
        return TimelineGeometry.of(self._theme, QSizeF(self.viewport().size()), self._content, scroll_y)

    def x_of(self, at_ns: int) -> float:
        """Return the x coordinate of a time in ns."""
        geometry = self.geometry_of_lanes()
        return geometry.x_mapper(self.scale)(at_ns) if self.scale is not None else geometry.plot.left()

    def time_at(self, x: float) -> int:
        """Return the time at an x coordinate, in ns."""
        return self.geometry_of_lanes().time_at(x, self.scale) if self.scale is not None else 0

    def _lane_at(self, y: float) -> TimelineLane | None:
        index = self.geometry_of_lanes().lane_at(y)
        return self._content.lanes[index] if index is not None else None

    def mark_at(self, position: QPointF) -> Mark | None:
        """Return the mark at a position, or None. If marks overlap, the narrowest one is returned."""
        matches = [each for each in self.marks if each.box.contains(position)]
        narrowest = min(matches, key=lambda each: each.box.width(), default=None)
        return narrowest.mark if narrowest is not None else None

    def flag_at_playhead(self) -> Mark | None:
        """Return the flag at the time of the playhead, or None."""
        at_ns = self.selection.position_ns
        lanes = (*self._content.pinned, *self._content.lanes)
        return next((flag for lane in lanes for flag in lane.flags() if flag.start_ns == at_ns), None)

    # -- painting -----------------------------------------------------------------------------------------

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self.viewport())
        painter.fillRect(self.viewport().rect(), self._theme.colour("panel"))
        if self.scale is not None:
            geometry = self.geometry_of_lanes()
            if self._lanes_pixmap is None:
                self._lanes_pixmap = self._render_lanes(geometry, self.scale)
            painter.drawPixmap(0, 0, self._lanes_pixmap)
            self._paint_current_bars(painter, geometry, self.scale)
            self._paint_range(painter, geometry, self.scale)
            self._paint_playhead(painter, geometry, self.scale)
        painter.end()

    def _render_lanes(self, geometry: TimelineGeometry, scale: TimeScale) -> QPixmap:
        ratio = self.viewport().devicePixelRatioF()
        pixmap = QPixmap(self.viewport().size() * ratio)
        pixmap.setDevicePixelRatio(ratio)
        pixmap.fill(self._theme.colour("panel"))
        painter = QPainter(pixmap)
        self.marks = []
        painter.save()
        painter.setClipRect(QRectF(QPointF(0, geometry.lanes_top), geometry.size))
        for index in geometry.visible_lanes:
            self._paint_lane(painter, geometry, scale, self._content.lanes[index], geometry.lane_rect(index))
        painter.restore()
        self._paint_ruler(painter, geometry, scale)
        for index, lane in enumerate(self._content.pinned):
            self._paint_pinned_lane(painter, geometry, scale, lane, geometry.pinned_rect(index))
        painter.end()
        return pixmap

    def _ruler(self, geometry: TimelineGeometry, scale: TimeScale) -> Ruler:
        return Ruler(
            scale, geometry.plot.width(), self._theme.scaled(LABEL_SPACING_PX), by_clock=self.shows_clock
        )

    def _paint_ruler(self, painter: QPainter, geometry: TimelineGeometry, scale: TimeScale) -> None:
        theme, plot, height = self._theme, geometry.plot, geometry.ruler_height
        font, colour = theme.font("small"), theme.colour("textSecondary")
        ruler = self._ruler(geometry, scale)
        for tick in ruler.ticks(lambda text: paint.width_of(font, text), LABEL_GAP_PX):
            x = plot.left() + tick.x
            painter.setPen(QPen(theme.colour("controlBorder"), 1))
            painter.drawLine(QPointF(x, height - 6), QPointF(x, height))
            if tick.text:
                label = QRectF(x + LABEL_GAP_PX, 0, plot.right() - x, height - 4)
                paint.text_line(painter, label, tick.text, font, colour)
        ruler_rect = QRectF(0, 0, geometry.size.width(), height)
        paint.hairline(painter, ruler_rect, Qt.Edge.BottomEdge, theme.colour("border"))
        tertiary = theme.colour("textTertiary")
        for title, box in zip(self._content.columns, self._columns(geometry, 0, height), strict=True):
            if box is not None:
                paint.text_line(painter, box, title, font, tertiary, paint.RIGHT)

    def _columns(self, geometry: TimelineGeometry, top: float, height: float) -> list[QRectF | None]:
        # Without room for all columns, only the last one is visible.
        count, area = len(self._content.columns), geometry.figures_rect(top, height)
        if not geometry.has_all_columns and count > 1:
            return [*[None] * (count - 1), area]
        width = area.width() / max(1, count)
        return [QRectF(area.left() + index * width, top, width, height) for index in range(count)]

    def _paint_pinned_lane(
        self,
        painter: QPainter,
        geometry: TimelineGeometry,
        scale: TimeScale,
        lane: TimelineLane,
        rect: QRectF,
    ) -> None:
        plot, theme = geometry.plot, self._theme
        self._paint_name(painter, QRectF(0, rect.top(), plot.left(), rect.height()), lane, "textSecondary")
        box = QRectF(plot.left(), rect.top(), plot.width(), rect.height())
        lane_painter = LanePainter(theme, painter, box, geometry.x_mapper(scale))
        self.marks += lane_painter.paint(lane.layers)
        self._paint_figures(painter, geometry, lane, rect)
        paint.hairline(painter, rect, Qt.Edge.BottomEdge, theme.colour("border"))

    def _paint_lane(
        self,
        painter: QPainter,
        geometry: TimelineGeometry,
        scale: TimeScale,
        lane: TimelineLane,
        rect: QRectF,
    ) -> None:
        plot, theme = geometry.plot, self._theme
        is_selected = lane.id == self.selection.lane
        if is_selected:
            painter.fillRect(rect, theme.colour("selected"))
        role = "selectedText" if is_selected else "text"
        self._paint_name(painter, QRectF(0, rect.top(), plot.left(), rect.height()), lane, role)
        box = QRectF(plot.left(), rect.top(), plot.width(), rect.height())
        lane_painter = LanePainter(theme, painter, box, geometry.x_mapper(scale), is_selected=is_selected)
        visible = QRectF(QPointF(0, geometry.lanes_top), geometry.size)
        for painted in lane_painter.paint(lane.layers):
            self.marks.append(PaintedMark(painted.box.intersected(visible), painted.mark))
        self._paint_figures(painter, geometry, lane, rect)

    def _paint_name(self, painter: QPainter, box: QRectF, lane: TimelineLane, role: str) -> None:
        theme = self._theme
        side = theme.scaled(NAME_ICON_SIZE)
        icon_rect = QRectF(12, box.center().y() - side / 2, side, side)
        paint_icon(painter, icon_rect, lane.icon, theme.colour("textTertiary"))
        text_rect = box.adjusted(18 + side, 0, -6, 0)
        font = theme.font("code" if lane.is_code else "body")
        paint.text_line(painter, text_rect, lane.name, font, theme.colour(role))

    def _paint_figures(
        self, painter: QPainter, geometry: TimelineGeometry, lane: TimelineLane, rect: QRectF
    ) -> None:
        theme, font = self._theme, self._theme.font("code")
        boxes = self._columns(geometry, rect.top(), rect.height())
        for figure, box in zip(lane.figures, boxes, strict=False):
            if box is None or not figure.text:
                continue
            role = "textTertiary" if figure.is_muted else STATUS_ROLES[figure.status]
            paint.text_line(painter, box, figure.text, font, theme.colour(role), paint.RIGHT)
            if figure.icon:
                side = theme.scaled(FIGURE_ICON_SIZE)
                left = box.right() - paint.width_of(font, figure.text) - side - 4
                icon_rect = QRectF(left, box.center().y() - side / 2, side, side)
                paint_icon(painter, icon_rect, figure.icon, theme.colour(role))

    def _paint_current_bars(self, painter: QPainter, geometry: TimelineGeometry, scale: TimeScale) -> None:
        lanes, pinned = self._content.lanes, self._content.pinned
        places = [(lane, geometry.pinned_rect(index), 0.0) for index, lane in enumerate(pinned)]
        top = geometry.lanes_top
        places += [(lanes[index], geometry.lane_rect(index), top) for index in geometry.visible_lanes]
        plot, x_of, at_ns = geometry.plot, geometry.x_mapper(scale), self.selection.position_ns
        for lane, rect, clip_top in places:
            bars = [mark for mark in lane.bars() if mark.start_ns <= at_ns < mark.end_ns]
            if bars:
                painter.save()
                painter.setClipRect(QRectF(plot.left(), clip_top, plot.width(), geometry.size.height()))
                box = QRectF(plot.left(), rect.top(), plot.width(), rect.height())
                LanePainter(self._theme, painter, box, x_of).paint_current_bars(bars)
                painter.restore()

    def _paint_range(self, painter: QPainter, geometry: TimelineGeometry, scale: TimeScale) -> None:
        if self.selection.range_ns is None:
            return
        plot, accent = geometry.plot, self._theme.colour("accent")
        left, right = map(geometry.x_mapper(scale), self.selection.range_ns)
        painter.save()
        painter.setClipRect(plot)
        tint = QColor(accent)
        tint.setAlphaF(0.1)
        painter.fillRect(QRectF(left, 0, right - left, plot.height()), tint)
        for x in (left, right):
            painter.fillRect(QRectF(x - 1, 0, 2, plot.height()), accent)
        for x in (left - 8, right):
            paint.box(painter, QRectF(x, 5, 8, geometry.ruler_height - 10), 2, accent)
        painter.restore()

    def _paint_playhead(self, painter: QPainter, geometry: TimelineGeometry, scale: TimeScale) -> None:
        plot, theme = geometry.plot, self._theme
        x = geometry.x_mapper(scale)(self.selection.position_ns)
        if not plot.left() - 1 <= x <= plot.right() + 1:
            return
        painter.fillRect(QRectF(x - 0.75, 0, 1.5, plot.height()), theme.colour("text"))
        font = theme.font("small")
        text = self._ruler(geometry, scale).text(self.selection.position_ns)
        width = paint.width_of(font, text) + 12
        left = max(plot.left(), min(plot.right() - width, x - width / 2))
        flag = QRectF(left, 3, width, geometry.ruler_height - 7)
        paint.box(painter, flag, theme.radius("small"), theme.colour("tooltip"))
        paint.text_line(painter, flag, text, font, theme.colour("tooltipText"), paint.CENTRE)

    # -- mouse --------------------------------------------------------------------------------------------

    def _grip_at(self, position: QPointF) -> Literal["", "playhead"] | RangeEdge:
        # Part that is dragged after a press at this position.
        geometry = self.geometry_of_lanes()
        plot = geometry.plot
        if not plot.left() - GRIP_PX <= position.x() <= plot.right() + GRIP_PX or self.scale is None:
            return ""
        if self.selection.range_ns is not None and position.y() < geometry.ruler_height:
            start_x, end_x = (self.x_of(each) for each in self.selection.range_ns)
            if abs(position.x() - (start_x - 4)) <= GRIP_PX:
                return "start"
            if abs(position.x() - (end_x + 4)) <= GRIP_PX:
                return "end"
        return "playhead"

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() != Qt.MouseButton.LeftButton or self.scale is None:
            return
        mark, lane = self.mark_at(event.position()), self._lane_at(event.position().y())
        if mark is not None:
            self.position_requested.emit(mark.start_ns)
            return
        self._dragged_part = self._grip_at(event.position())
        if lane is not None:
            self._select_lane(lane.id)
        if self._dragged_part == "playhead":
            self.position_requested.emit(self.time_at(event.position().x()))

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        grip = self._dragged_part or self._grip_at(event.position())
        self.viewport().setCursor(
            Qt.CursorShape.SplitHCursor if grip in {"start", "end"} else Qt.CursorShape.ArrowCursor
        )
        if self.scale is None or not self._dragged_part:
            return
        at_ns = self.time_at(event.position().x())
        if self._dragged_part == "playhead":
            self.position_requested.emit(at_ns)
        elif (resized := self.selection.resized_range(self._dragged_part, at_ns)) is not None:
            self.range_requested.emit(*resized)

    def mouseReleaseEvent(self, _event: QMouseEvent) -> None:
        self._dragged_part = ""

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        mark, lane = self.mark_at(event.position()), self._lane_at(event.position().y())
        if mark is not None:
            self.mark_opened.emit(mark)
        elif lane is not None and event.position().x() < self.geometry_of_lanes().plot.left():
            self.lane_opened.emit(lane.id)

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        # Context menu of the mark under the mouse or, by keyboard, of the flag at the playhead.
        position = event.globalPos()
        if event.reason() == QContextMenuEvent.Reason.Keyboard:
            mark = self.flag_at_playhead()
            if mark is not None:
                corner = QPoint(round(self.x_of(mark.start_ns)), round(self.geometry_of_lanes().ruler_height))
                position = self.viewport().mapToGlobal(corner)
        else:
            mark = self.mark_at(QPointF(event.pos()))
        if mark is not None:
            self.menu_requested.emit(mark, position)
            event.accept()

    def wheelEvent(self, event: QWheelEvent) -> None:
        # Zooms if the mouse is above the time axis, scrolls if above the names.
        x, delta = event.position().x(), event.angleDelta()
        if x < self.geometry_of_lanes().plot.left() or self.scale is None:
            super().wheelEvent(event)
        elif delta.x() and not delta.y():
            self.set_scale(self.scale.moved(-round(delta.x() / 1200 * self.scale.span_ns)))
        else:
            units = max(-MAX_WHEEL_UNITS, min(MAX_WHEEL_UNITS, delta.y()))
            self.zoom(ZOOM_PER_WHEEL_UNIT**-units, self.time_at(x))
        event.accept()

    # -- keyboard and screen readers ----------------------------------------------------------------------

    def keyPressEvent(self, event: QKeyEvent) -> None:
        # Leaves other keys to the panel; a scroll area would consume the arrow keys.
        if not self.handle_key(event):
            event.ignore()

    def handle_key(self, event: QKeyEvent) -> bool:
        """Zoom or select another lane; return False for other keys.

        Panels call this for keys that their other widgets have not used.
        """
        actions: dict[tuple[Qt.KeyboardModifier, int], Callable[[], object]] = {
            (_NO_MODIFIER, Qt.Key.Key_Plus): lambda: self.zoom(1 / ZOOM_FACTOR),
            (_SHIFT, Qt.Key.Key_Plus): lambda: self.zoom(1 / ZOOM_FACTOR),
            (_NO_MODIFIER, Qt.Key.Key_Minus): lambda: self.zoom(ZOOM_FACTOR),
            (_NO_MODIFIER, Qt.Key.Key_0): self.show_all,
            (_NO_MODIFIER, Qt.Key.Key_Up): lambda: self._select_neighbour(-1),
            (_NO_MODIFIER, Qt.Key.Key_Down): lambda: self._select_neighbour(1),
        }
        action = actions.get((event.modifiers() & ~Qt.KeyboardModifier.KeypadModifier, event.key()))
        if action is not None:
            action()
        return action is not None

    def _select_neighbour(self, by: int) -> None:
        # Selects the next lane above or below, and announces its name and figures.
        lane = self._content.neighbour(self.selection.lane, by)
        if lane:
            self._select_lane(lane)
            self.show_lane(lane)
            paint.announce(self, self.lane_text(lane))

    def _select_lane(self, lane: str) -> None:
        self.select(replace(self.selection, lane=lane))
        self.lane_selected.emit(lane)

    def lane_text(self, lane: str) -> str:
        """Return the name of a lane and its figures as a text for screen readers."""
        index = self._content.index_of(lane)
        if index is None:
            return ""
        shown = self._content.lanes[index]
        figures = zip(self._content.columns, shown.figures, strict=False)
        return ", ".join(
            [shown.name, *(f"{title} {figure.text}" for title, figure in figures if figure.text)]
        )

    # -- tooltips -----------------------------------------------------------------------------------------

    def viewportEvent(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.ToolTip and isinstance(event, QHelpEvent):
            text = self.tooltip_at(QPointF(event.pos()))
            QToolTip.showText(event.globalPos(), plain.tip(text) if text else "", self.viewport())
            return True
        return super().viewportEvent(event)

    def tooltip_at(self, position: QPointF) -> str:
        """Return the tooltip at a position: of a mark, of adjacent notches, or the name of the lane."""
        mark, lane = self.mark_at(position), self._lane_at(position.y())
        if self.scale is None:
            return ""
        if mark is not None:
            return mark.tooltip
        if lane is None:
            return ""
        if position.x() >= self.geometry_of_lanes().plot.left():
            for layer in lane.layers:
                if isinstance(layer, NotchLayer):
                    close = (n for n in layer.notches if abs(self.x_of(n.at_ns) - position.x()) <= GRIP_PX)
                    if total := sum(notch.count for notch in close):
                        return layer.describe(total)
        return lane.name

    # -- editing ------------------------------------------------------------------------------------------

    def edit(
        self, lane: str, at_ns: int, text: str, on_edited: Callable[[str], bool], accessible_name: str
    ) -> None:
        """Start editing the text of a flag in its lane.

        Args:
            lane: Id of a pinned lane.
            at_ns: Time of the flag.
            text: Current text.
            on_edited: Receives the new text and returns False if it is invalid.
            accessible_name: Accessible name of the field.
        """
        if self.field is not None:
            return
        if self.scale is not None:
            self.set_scale(self.scale.with_time(at_ns))
        scaled, view, geometry = self._theme.scaled, self.viewport(), self.geometry_of_lanes()
        index = next((index for index, each in enumerate(self._content.pinned) if each.id == lane), 0)
        width = min(round(scaled(FIELD_WIDTH)), view.width())
        left = max(0, min(round(self.x_of(at_ns)), view.width() - width))
        rect = QRect(left, round(geometry.pinned_rect(index).top()), width, round(geometry.pinned_height))
        self.field = RenameField(self._theme, view, rect, text, on_edited, accessible_name)
        self.field.closed.connect(self._finish_editing)

    def _finish_editing(self) -> None:
        had_focus = self.field is not None and self.field.hasFocus()
        self.field = None
        if had_focus:
            self.setFocus(Qt.FocusReason.OtherFocusReason)
