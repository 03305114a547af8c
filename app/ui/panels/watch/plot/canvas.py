"""Canvas for curves over time. pyqtgraph draws axes and curves; cursors are painted on top.

The time axis counts seconds relative to its right end (`PlotCanvas.anchor_s`). While the plot follows
live data, this end moves but the labels of the axis do not, so the axis isn't repainted. pyqtgraph's
mouse handling is replaced: the wheel zooms time, Ctrl+wheel zooms values, dragging pans, a double click
shows everything.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import (
    QDragEnterEvent,
    QDragMoveEvent,
    QDropEvent,
    QFont,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QResizeEvent,
    QWheelEvent,
)
from PySide6.QtWidgets import QGraphicsView

from app.core.series.samples import Polyline
from app.ui.panels.watch.plot.plotted_curve import MINUS, PlotCurve
from app.ui.text.numbers import seconds_text
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.field_drag import dropped_field
from nep.i18n import _, number

AXIS_WIDTH, AXIS_HEIGHT = 54, 24
FLAG_SIZE = QSize(22, 19)
FLAG_SPACE = 24  # px, reserved for the flags of the cursors
ZOOM_STEP = 1.2
MIN_WINDOW_S, MAX_WINDOW_S = 1e-4, 1e9
MAX_ANTIALIASED_POINTS = 3000
"""Number of points above which antialiasing is disabled, because it is slow and no longer visible."""
DENSE_LINE_MARK_COUNT = 5
DENSE_TRAVEL_RATIO = 5.0  # vertical travel of a line relative to the plot's width, above which it is dense
TICK_SPACING_X, TICK_SPACING_Y = 84, 34  # minimum distance of ticks in px
LABEL_OVERHANG_PX = 60
MAX_ABS_VALUE = 1e300
"""Maximum absolute value; larger values are clipped, because axis calculations would overflow."""
HIT_WIDTH_PX = 10
CURSOR_RANGE_ALPHA = 0.045


@dataclass(slots=True)
class ValueRange:
    """Range of a value axis.

    Attributes:
        low: Lower end.
        high: Upper end.
        is_manual: True if the user set the range, which then isn't adjusted to new values.
        is_new: True until the first values arrive.
    """

    low: float = 0.0
    high: float = 1.0
    is_manual: bool = False
    is_new: bool = True

    def fit(self, low: float, high: float) -> bool:
        """Adjust the range to values, with margins. Return True if the range changed.

        The range does not change while the values are within it and fill at least half of it.

        Args:
            low: Smallest visible value.
            high: Largest visible value.
        """
        if self.is_manual or not (math.isfinite(low) and math.isfinite(high)):
            return False
        span = high - low
        is_within = self.low <= low and high <= self.high and not self.is_new
        if is_within and span >= 0.5 * (self.high - self.low):
            return False
        margin = span * 0.08 or abs(high) * 0.1 or 1.0
        self.low, self.high = max(-MAX_ABS_VALUE, low - margin), min(MAX_ABS_VALUE, high + margin)
        self.is_new = False
        return True


class TimeAxis(pg.AxisItem):  # type: ignore[misc]  # pyqtgraph is untyped
    """Time axis whose labels are relative to the right end, which is labelled with the time of day."""

    def __init__(self) -> None:
        super().__init__("bottom")
        self.clock = ""

    def boundingRect(self) -> QRectF:
        # pyqtgraph omits labels that exceed the bounding rectangle, such as the time of day at the edge.
        return QRectF(super().boundingRect()).adjusted(-LABEL_OVERHANG_PX, 0, LABEL_OVERHANG_PX, 0)

    def tickSpacing(self, min_value: float, max_value: float, size: float) -> list[tuple[float, float]]:
        return readable_levels(
            super().tickSpacing(min_value, max_value, size), max_value - min_value, size, TICK_SPACING_X
        )

    def tickStrings(self, values: Sequence[float], _scale: float, spacing: float) -> list[str]:
        return [self.clock if abs(value) < spacing / 100 else time_label(value, spacing) for value in values]


class ValueAxis(pg.AxisItem):  # type: ignore[misc]
    """Axis of numbers; the labels have as many decimals as the tick spacing requires."""

    def tickSpacing(self, min_value: float, max_value: float, size: float) -> list[tuple[float, float]]:
        min_spacing_px = TICK_SPACING_Y if self.orientation in {"left", "right"} else TICK_SPACING_X
        return readable_levels(
            super().tickSpacing(min_value, max_value, size), max_value - min_value, size, min_spacing_px
        )

    def tickStrings(self, values: Sequence[float], scale: float, spacing: float) -> list[str]:
        return [value_label(value * scale, spacing * scale) for value in values]


def readable_levels(
    levels: list[tuple[float, float]], span: float, size: float, min_spacing_px: float
) -> list[tuple[float, float]]:
    """Return the finest tick level whose labels do not overlap, in a list.

    If the labels of all levels would overlap, the list contains the coarsest level.

    Args:
        levels: Tick levels of pyqtgraph (spacing and offset), coarsest first.
        span: Length of the range.
        size: Length of the axis in px.
        min_spacing_px: Minimum distance of labels in px.
    """
    readable = [level for level in levels if span > 0 and level[0] / span * size >= min_spacing_px]
    return readable[-1:] or levels[:1]


def time_label(value_s: float, spacing_s: float) -> str:
    """Format the label of a tick on the time axis, such as "-2.5 s" or "-3 min".

    Args:
        value_s: Time relative to the right end in s.
        spacing_s: Distance between ticks in s, which determines unit and decimals.
    """
    if spacing_s >= 60:
        text = _("{minutes} min").format(minutes=number(round(abs(value_s) / 60, 3)))
    else:
        digits = max(0, math.ceil(-math.log10(spacing_s) - 1e-9)) if spacing_s < 1 else 0
        text = f"{number(abs(value_s), f'.{min(digits, 6)}f')} s"
    return f"{MINUS if value_s < 0 else '+'}{text}"


def value_label(value: float, spacing: float) -> str:
    """Format the label of a tick on a value axis.

    Args:
        value: Value at the tick.
        spacing: Distance between ticks, which determines the number of decimals.
    """
    if value and not 1e-4 <= abs(spacing) < 1e6:
        return number(value, ".3g").replace("-", MINUS)
    digits = max(0, math.ceil(-math.log10(abs(spacing)) - 1e-9)) if spacing else 0
    return number(round(value, digits) + 0.0, f".{digits}f").replace("-", MINUS)


class PlotCanvas(pg.GraphicsView):  # type: ignore[misc]
    """Canvas for curves and cursors.

    Attributes:
        begin_s: Start of the visible range, in the time base of the series.
        end_s: End of the visible range, in the time base of the series.
        anchor_s: Time at which the time axis has its origin.
        cursors: Times of the cursors "A" and "B".
        paint_time_s: Accumulated processor time of painting in s.

    Signals:
        zoomed: Zoom factor, and time at the mouse pointer in s.
        moved: Shift of the visible range in s.
        values_changed: The range of a value axis changed.
        show_all_requested: All data should be shown.
        cursor_moved: Name and new time of a cursor.
        field_dropped: Topic and path of a field that was dropped onto the canvas.
    """

    zoomed = Signal(float, float)  # factor, time at the mouse in s
    moved = Signal(float)  # shift in s
    values_changed = Signal()
    show_all_requested = Signal()
    cursor_moved = Signal(str, float)
    field_dropped = Signal(str, str)

    def __init__(self, theme: Theme) -> None:
        super().__init__(background=None)
        self.theme = theme
        self.begin_s, self.end_s, self.anchor_s = -60.0, 0.0, 0.0
        self.cursors: dict[str, float] = {}
        # (curve, time, value) of the marks that identify dense lines
        self.marks: list[tuple[PlotCurve, float, float]] = []
        self.mouse_s: float | None = None
        self.paint_time_s = 0.0  # accumulated processor time of painting
        # like `marks`, at fixed times on dense lines, which have no dashes
        self.line_marks: list[tuple[PlotCurve, float, float]] = []
        self._lines: dict[str, pg.PlotCurveItem] = {}
        self._drag_state: tuple[str, QPointF] | None = None
        self.ranges = {"left": ValueRange(), "right": ValueRange()}
        self._build()
        self.setAcceptDrops(True)
        self.setFrameShape(QGraphicsView.Shape.NoFrame)
        self.setViewportUpdateMode(QGraphicsView.ViewportUpdateMode.FullViewportUpdate)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName(_("Curves"))
        self.setMinimumSize(120, 80)
        self.restyle()
        theme.changed.connect(self.restyle)

    def _build(self) -> None:
        self.time_axis = TimeAxis()
        left, right = ValueAxis("left"), ValueAxis("right")
        axes: dict[str, Any] = {"bottom": self.time_axis, "left": left, "right": right}
        self.view = pg.ViewBox(enableMenu=False)
        self.plot = pg.PlotItem(viewBox=self.view, axisItems=axes, enableMenu=False)
        self.plot.hideButtons()
        self.plot.layout.setContentsMargins(6, FLAG_SPACE, 6, 0)
        self.setCentralItem(self.plot)
        self.right_view = pg.ViewBox(enableMenu=False)
        self.plot.showAxis("right")
        self.plot.scene().addItem(self.right_view)
        self.plot.getAxis("right").linkToView(self.right_view)
        for view in (self.view, self.right_view):
            view.setMouseEnabled(x=False, y=False)
            view.disableAutoRange()
        self.right_view.setXLink(self.view)
        self.view.sigResized.connect(self._sync_right_view)
        for axis in axes.values():
            axis.enableAutoSIPrefix(False)
            axis.setStyle(tickLength=0, autoExpandTextSpace=False, autoReduceTextSpace=False)

    def _sync_right_view(self) -> None:
        self.right_view.setGeometry(self.view.sceneBoundingRect())
        self.right_view.linkedViewChanged(self.view, pg.ViewBox.XAxis)

    def axis_font(self) -> QFont:
        """Return the font of the axis labels."""
        return self.theme.font("caption")

    def restyle(self) -> None:
        """Apply the theme's colours, fonts and sizes to the canvas."""
        theme = self.theme
        grid = theme.colour("controlBorder" if theme.is_high_contrast else "grid")
        for name in ("bottom", "left", "right"):
            axis = self.plot.getAxis(name)
            axis.setTickFont(self.axis_font())
            axis.setPen(pg.mkPen(theme.colour("border")))
            axis.setTickPen(pg.mkPen(grid, width=1))
            axis.setTextPen(theme.colour("textSecondary"))
        self.setBackground(theme.colour("panel"))
        self.time_axis.setHeight(round(theme.scaled(AXIS_HEIGHT)))
        for name in ("left", "right"):
            self.plot.getAxis(name).setWidth(round(theme.scaled(AXIS_WIDTH)))
        self.plot.showGrid(x=True, y=True, alpha=1.0)
        self.plot.getAxis("right").setGrid(False)
        self.viewport().update()

    # -- display ------------------------------------------------------------------------------------------

    @property
    def area(self) -> QRectF:
        """Rectangle of the curves in widget coordinates."""
        return QRectF(self.view.sceneBoundingRect())

    @property
    def columns(self) -> int:
        """Width of the area of the curves in px, at least 16."""
        return max(16, round(self.area.width()))

    def x_of(self, time_s: float, area: QRectF | None = None) -> float:
        """Return the x coordinate of a time.

        Args:
            time_s: Time in the time base of the series.
            area: Value of the property `area`, to avoid computing it repeatedly.
        """
        area = area or self.area
        return area.left() + (time_s - self.begin_s) / (self.end_s - self.begin_s) * area.width()

    def time_at(self, x: float) -> float:
        """Return the time at an x coordinate."""
        area = self.area
        fraction = (x - area.left()) / max(1.0, area.width())
        return self.begin_s + fraction * (self.end_s - self.begin_s)

    def y_of(self, value: float, *, right: bool, area: QRectF | None = None) -> float:
        """Return the y coordinate of a value.

        Args:
            value: Value of a curve.
            right: True for the right axis, False for the left one.
            area: Value of the property `area`, to avoid computing it repeatedly.
        """
        area, value_range = area or self.area, self.ranges["right" if right else "left"]
        return (
            area.bottom() - (value - value_range.low) / (value_range.high - value_range.low) * area.height()
        )

    def show_lines(self, lines: Sequence[tuple[PlotCurve, Polyline]], clock_s: float) -> None:
        """Draw curves in place of the previous ones.

        Args:
            lines: Curves with their points.
            clock_s: Time of day at the origin of the time axis, in s since 1970.
        """
        names = {curve.name for curve, _line in lines}
        for name in [name for name in self._lines if name not in names]:
            item = self._lines.pop(name)
            item.getViewBox().removeItem(item)
        self._show_axes([curve for curve, _line in lines])
        self._fit_values(lines)
        self.line_marks = []
        for index, (curve, line) in enumerate(lines):
            self._show_line(curve, line)
            if len(lines) > 1 and self._is_dense(line, right=curve.is_on_right_axis):
                self._add_marks(curve, index / len(lines))
        self._show_clock(clock_s)
        self.view.setXRange(self.begin_s - self.anchor_s, self.end_s - self.anchor_s, padding=0)
        self.viewport().update()

    def _show_line(self, curve: PlotCurve, line: Polyline) -> None:
        item = self._lines.get(curve.name)
        view = self.right_view if curve.is_on_right_axis else self.view
        if item is None:
            item = self._lines[curve.name] = pg.PlotCurveItem(connect="finite")
            view.addItem(item, ignoreBounds=True)
        elif item.getViewBox() is not view:
            item.getViewBox().removeItem(item)
            view.addItem(item, ignoreBounds=True)
        # dashes and antialiasing are invisible on dense lines but would dominate the cost
        is_dense = self._is_dense(line, right=curve.is_on_right_axis)
        item.setData(
            line.times - self.anchor_s,
            np.clip(line.values, -MAX_ABS_VALUE, MAX_ABS_VALUE),
            pen=curve.style.pen(self.theme, is_dense=is_dense),
            antialias=not is_dense,
        )

    def _is_dense(self, line: Polyline, *, right: bool) -> bool:
        # True for many points, and for steep oscillations.
        if len(line.times) > MAX_ANTIALIASED_POINTS or not line.is_complete:
            return True
        value_range = self.ranges["right" if right else "left"]
        with np.errstate(over="ignore", invalid="ignore"):
            travelled = float(np.nansum(np.abs(np.diff(line.values)))) / (value_range.high - value_range.low)
        return not travelled * self.area.height() < DENSE_TRAVEL_RATIO * self.area.width()

    def _add_marks(self, curve: PlotCurve, shift: float) -> None:
        # Dense lines have no dashes; marks at fixed times identify them instead.
        step_s = (self.end_s - self.begin_s) / DENSE_LINE_MARK_COUNT
        first = math.floor(self.begin_s / step_s) + shift
        for index in range(DENSE_LINE_MARK_COUNT + 1):
            time_s = (first + index) * step_s
            sample = curve.curve.samples.at(time_s)
            if sample is not None and self.begin_s <= time_s <= self.end_s:
                self.line_marks.append((curve, *sample))

    def _show_axes(self, curves: Sequence[PlotCurve]) -> None:
        for name, right in (("left", False), ("right", True)):
            axis_curves = [curve for curve in curves if curve.is_on_right_axis is right]
            axis = self.plot.getAxis(name)
            colour = (
                axis_curves[0].style.line_colour(self.theme)
                if len(axis_curves) == 1
                else self.theme.colour("textSecondary")
            )
            axis.setTextPen(colour)
            axis.setStyle(showValues=bool(axis_curves))

    def _fit_values(self, lines: Sequence[tuple[PlotCurve, Polyline]]) -> None:
        for name, right, view in (("left", False, self.view), ("right", True, self.right_view)):
            value_range = self.ranges[name]
            arrays = [
                line.values for curve, line in lines if curve.is_on_right_axis is right and len(line.values)
            ]
            finite = [each[np.isfinite(each)] for each in arrays]
            finite = [each for each in finite if len(each)]
            if finite:
                value_range.fit(
                    min(float(each.min()) for each in finite), max(float(each.max()) for each in finite)
                )
            view.setYRange(value_range.low, value_range.high, padding=0)

    def _show_clock(self, clock_s: float) -> None:
        try:
            text = f"{datetime.fromtimestamp(clock_s):%H:%M:%S}"  # noqa: DTZ006  local time, as on the user's clock
        except (OverflowError, ValueError, OSError):
            text = "0 s"
        if text != self.time_axis.clock:
            self.time_axis.clock = text
            self.time_axis.picture = None
            self.time_axis.update()

    def scale_values(self, factor: float = 1.0, shift: float = 0.0) -> None:
        """Zoom or shift the value axes, and disable their automatic range until `reset_value_ranges`.

        Args:
            factor: Factor by which the length of the range is multiplied.
            shift: Shift relative to the length of the range.
        """
        for value_range in self.ranges.values():
            middle, half = (
                (value_range.low + value_range.high) / 2,
                (value_range.high - value_range.low) / 2 * factor,
            )
            middle += shift * 2 * half
            if 1e-300 < half < MAX_ABS_VALUE and abs(middle) < MAX_ABS_VALUE:
                value_range.low, value_range.high, value_range.is_manual = middle - half, middle + half, True
        self.values_changed.emit()

    def reset_value_ranges(self) -> None:
        """Enable the automatic range of the value axes."""
        for value_range in self.ranges.values():
            value_range.is_manual, value_range.is_new = False, True
        self.values_changed.emit()

    # -- cursors ------------------------------------------------------------------------------------------

    def paintEvent(self, event: QPaintEvent) -> None:
        start_s = time.thread_time()
        super().paintEvent(event)
        painter = QPainter(self.viewport())
        self.paint_cursors(painter)
        painter.end()
        self.paint_time_s += time.thread_time() - start_s

    def paint_cursors(self, painter: QPainter) -> None:
        """Paint the cursors A and B, and the marks of curves, over the curves."""
        area, theme = self.area, self.theme
        positions = {name: self.x_of(time_s, area) for name, time_s in self.cursors.items()}
        visible = {name: x for name, x in positions.items() if area.left() - 1 <= x <= area.right() + 1}
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        if len(positions) == 2:
            left, right = sorted(min(max(x, area.left()), area.right()) for x in positions.values())
            tint = theme.colour("text")
            tint.setAlphaF(CURSOR_RANGE_ALPHA)
            painter.fillRect(QRectF(left, area.top(), right - left, area.height()), tint)
        pen = QPen(theme.colour("text"), 1.25)
        pen.setDashPattern([1.5, 2.5])
        for x in visible.values():
            painter.setPen(pen)
            painter.drawLine(QPointF(x, area.top()), QPointF(x, area.bottom()))
        for curve, time_s, value in (*self.line_marks, *self.marks):
            x, y = self.x_of(time_s, area), self.y_of(value, right=curve.is_on_right_axis, area=area)
            if area.left() <= x <= area.right() and area.top() - 1 <= y <= area.bottom() + 1:
                curve.style.paint_mark(painter, theme, QPointF(x, y), 9)
        self._paint_distance(painter, positions)
        for name, x in visible.items():
            flag = self._flag_rect(x)
            paint.box(painter, flag, theme.radius("key"), theme.colour("tooltip"))
            font = theme.font("small")
            font.setWeight(QFont.Weight.DemiBold)
            paint.text_line(painter, flag, name, font, theme.colour("tooltipText"), paint.CENTRE)

    def _flag_rect(self, x: float) -> QRectF:
        width, height = (
            self.theme.scaled(FLAG_SIZE.width()),
            min(FLAG_SPACE - 2.0, self.theme.scaled(FLAG_SIZE.height())),
        )
        return QRectF(x - width / 2, self.area.top() - height - 3, width, height)

    def _paint_distance(self, painter: QPainter, positions: dict[str, float]) -> None:
        if len(positions) < 2:
            return
        left, right = sorted(positions.values())
        distance_s = abs(self.cursors["A"] - self.cursors["B"])
        text = distance_text(distance_s)
        font = self.theme.font("small")
        font.setWeight(QFont.Weight.DemiBold)
        width, edge = paint.width_of(font, text), self.theme.scaled(FLAG_SIZE.width()) / 2
        if right - left > width + 2 * edge + 12:
            flag = self._flag_rect((left + right) / 2)
            box = QRectF(flag.center().x() - width / 2 - 1, flag.top(), width + 3, flag.height())
            paint.text_line(painter, box, text, font, self.theme.colour("text"), paint.CENTRE)

    def _cursor_at(self, position: QPointF) -> str | None:
        # Hit test of the cursors' flags and lines.
        for name, time_s in reversed(self.cursors.items()):
            x = self.x_of(time_s)
            if self._flag_rect(x).adjusted(-4, -4, 4, 4).contains(position):
                return name
            if abs(position.x() - x) <= HIT_WIDTH_PX / 2 and self.area.contains(position):
                return name
        return None

    # -- mouse --------------------------------------------------------------------------------------------

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self.setFocus(Qt.FocusReason.MouseFocusReason)
        position = event.position()
        if event.button() == Qt.MouseButton.LeftButton:
            self._drag_state = (self._cursor_at(position) or "", position)
            event.accept()
        else:
            event.ignore()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        position = event.position()
        self.mouse_s = self.time_at(position.x()) if self.area.contains(position) else None
        if self._drag_state is None:
            is_over_cursor = self._cursor_at(position) is not None
            self.setCursor(Qt.CursorShape.SizeHorCursor if is_over_cursor else Qt.CursorShape.ArrowCursor)
            return
        name, last_position = self._drag_state
        if name:
            self.cursor_moved.emit(name, self.time_at(position.x()))
        else:
            self.moved.emit(self.time_at(last_position.x()) - self.time_at(position.x()))
            if event.modifiers() & Qt.KeyboardModifier.ControlModifier:
                self.scale_values(shift=(position.y() - last_position.y()) / max(1.0, self.area.height()))
        self._drag_state = (name, position)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        self._drag_state = None
        event.accept()

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self.reset_value_ranges()
            self.show_all_requested.emit()

    def leaveEvent(self, _event: object) -> None:
        self.mouse_s = None

    def wheelEvent(self, event: QWheelEvent) -> None:
        steps = (event.angleDelta().y() or event.angleDelta().x()) / 120
        factor = ZOOM_STEP ** -max(-5.0, min(5.0, steps))
        if event.modifiers() & Qt.KeyboardModifier.ControlModifier:
            self.scale_values(factor)
        else:
            self.zoomed.emit(factor, self.time_at(event.position().x()))
        event.accept()

    def resizeEvent(self, event: QResizeEvent | None) -> None:
        super().resizeEvent(event)
        if event is not None:
            self.values_changed.emit()

    # -- drag and drop of fields --------------------------------------------------------------------------

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if dropped_field(event.mimeData()) is not None:
            event.acceptProposedAction()

    def dragMoveEvent(self, event: QDragMoveEvent) -> None:
        event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        field = dropped_field(event.mimeData())
        if field is not None:
            event.acceptProposedAction()
            self.field_dropped.emit(*field)


def distance_text(distance_s: float) -> str:
    """Format the time between cursors A and B, such as "12 ms", "7.5 s" or "3 min"."""
    if distance_s < 1:
        return f"{number(distance_s * 1000, '.3g')} ms"
    return (
        f"{number(distance_s, '.2f' if distance_s < 10 else '.1f')} s"
        if distance_s < 120
        else seconds_text(distance_s)
    )
