"""Plot of curves against each other: older parts are fainter, and an arrow marks the newest point."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QPainter, QPaintEvent, QPolygonF
from PySide6.QtWidgets import QGraphicsView

from app.core.series.calculated import held_values
from app.core.series.samples import Floats
from app.ui.panels.watch.plot.canvas import FLAG_SIZE, MAX_ABS_VALUE, ValueAxis
from app.ui.panels.watch.plot.plotted_curve import PlotCurve
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from nep.i18n import _

SHADE_COUNT = 8
MIN_ALPHA = 0.25
MAX_POINTS = 4000
ARROW_SIZE = 7.0
Path = tuple[PlotCurve, PlotCurve, Floats, Floats, Floats]


def path_of(
    x_curve: PlotCurve, y_curve: PlotCurve, begin_s: float, end_s: float
) -> tuple[Floats, Floats, Floats]:
    """Return the points of one curve plotted against another.

    Args:
        x_curve: Curve with the x coordinates; its times are used.
        y_curve: Curve with the y coordinates.
        begin_s: Start of the time range in s.
        end_s: End of the time range in s.

    Returns:
        Times, x and y coordinates of at most `MAX_POINTS` points.
    """
    samples = x_curve.curve.samples
    first, end = samples.index_range(begin_s, end_s)
    step = max(1, math.ceil((end - first) / MAX_POINTS))
    part = slice(first, end, step)
    times, xs = samples.times[part].copy(), np.clip(samples.values[part], -MAX_ABS_VALUE, MAX_ABS_VALUE)
    gaps = samples.gaps[part]
    ys = np.clip(held_values(y_curve.curve.samples, times), -MAX_ABS_VALUE, MAX_ABS_VALUE)
    if step == 1:
        xs[gaps] = np.nan
    return times, xs, ys


class XYCanvas(pg.GraphicsView):  # type: ignore[misc]  # pyqtgraph is untyped
    """XY plot of pairs of curves: the second against the first, the fourth against the third, and so on."""

    def __init__(self, theme: Theme) -> None:
        super().__init__(background=None)
        self.theme = theme
        self.setAccessibleName(_("XY plot"))
        self.setFrameShape(QGraphicsView.Shape.NoFrame)
        self.setViewportUpdateMode(QGraphicsView.ViewportUpdateMode.FullViewportUpdate)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMinimumSize(120, 80)
        self.view = pg.ViewBox(enableMenu=False, lockAspect=1.0)
        axes = {"bottom": ValueAxis("bottom"), "left": ValueAxis("left")}
        self.plot = pg.PlotItem(viewBox=self.view, axisItems=axes, enableMenu=False)
        self.plot.hideButtons()
        self.plot.layout.setContentsMargins(6, 10, 12, 0)
        self.setCentralItem(self.plot)
        self.view.setMouseEnabled(x=False, y=False)
        self.view.disableAutoRange()
        self._lines: list[pg.PlotCurveItem] = []
        self._paths: list[Path] = []
        self.cursors: dict[str, float] = {}
        self.restyle()
        theme.changed.connect(self.restyle)

    def restyle(self) -> None:
        """Apply the theme's colours, fonts and sizes."""
        theme = self.theme
        for name in ("bottom", "left"):
            axis = self.plot.getAxis(name)
            axis.enableAutoSIPrefix(False)
            axis.setStyle(tickLength=0, autoExpandTextSpace=False, autoReduceTextSpace=False)
            axis.setTickFont(theme.font("caption"))
            axis.setPen(pg.mkPen(theme.colour("border")))
            axis.setTickPen(pg.mkPen(theme.colour("controlBorder" if theme.is_high_contrast else "grid")))
            axis.setTextPen(theme.colour("textSecondary"))
        self.setBackground(theme.colour("panel"))
        self.plot.getAxis("bottom").setHeight(round(theme.scaled(24)))
        self.plot.getAxis("left").setWidth(round(theme.scaled(54)))
        self.plot.showGrid(x=True, y=True, alpha=1.0)
        self.viewport().update()

    def show_pairs(self, pairs: Sequence[tuple[PlotCurve, PlotCurve]], begin_s: float, end_s: float) -> None:
        """Draw pairs of curves.

        Args:
            pairs: Curves with the x and the y coordinates of each path.
            begin_s: Start of the time range in s.
            end_s: End of the time range in s.
        """
        self._paths = [
            (x_curve, y_curve, *path_of(x_curve, y_curve, begin_s, end_s)) for x_curve, y_curve in pairs
        ]
        count = 0
        for _x_curve, y_curve, times, xs, ys in self._paths:
            for shade in range(SHADE_COUNT):
                first = shade * len(times) // SHADE_COUNT
                last = (shade + 1) * len(times) // SHADE_COUNT + 1
                colour = y_curve.style.line_colour(self.theme)
                colour.setAlphaF(MIN_ALPHA + (1 - MIN_ALPHA) * (shade + 1) / SHADE_COUNT)
                self._line(count).setData(xs[first:last], ys[first:last], pen=pg.mkPen(colour, width=1.75))
                count += 1
        for line in self._lines[count:]:
            line.setData([], [])
        self._fit()
        self.viewport().update()

    def _line(self, number: int) -> pg.PlotCurveItem:
        if number == len(self._lines):
            self._lines.append(pg.PlotCurveItem(connect="finite", antialias=True))
            self.view.addItem(self._lines[-1], ignoreBounds=True)
        return self._lines[number]

    def _fit(self) -> None:
        points = [
            (xs[finite], ys[finite])
            for _x_curve, _y_curve, _times, xs, ys in self._paths
            if (finite := _finite_mask(xs, ys)).any()
        ]
        if not points:
            return
        edges = [
            (min(float(each[axis].min()) for each in points), max(float(each[axis].max()) for each in points))
            for axis in (0, 1)
        ]
        (left, right), (low, high) = ((a, b) if b > a else (a - 1, b + 1) for a, b in edges)
        self.view.setRange(QRectF(left, low, right - left, high - low), padding=0.08)

    def position_of(self, x: float, y: float) -> QPointF:
        """Return the widget coordinates of a point in the coordinates of the axes."""
        return QPointF(self.view.mapViewToScene(QPointF(x, y)))

    def distance(self) -> float | None:
        """Return the distance of cursors A and B on the first path in units of the axes.

        None if there are no cursors or no path, or if a curve has no value at a cursor.
        """
        if len(self.cursors) < 2 or not self._paths:
            return None
        points = [self._point_at(self._paths[0], time_s) for time_s in self.cursors.values()]
        if points[0] is None or points[1] is None:
            return None
        return math.dist(points[0], points[1])

    @staticmethod
    def _point_at(path: Path, time_s: float) -> tuple[float, float] | None:
        x_sample, y_sample = path[0].curve.samples.at(time_s), path[1].curve.samples.at(time_s)
        return (x_sample[1], y_sample[1]) if x_sample is not None and y_sample is not None else None

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        painter = QPainter(self.viewport())
        self.paint_marks(painter)
        painter.end()

    def paint_marks(self, painter: QPainter) -> None:
        """Paint arrows and cursors over the curves."""
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        for path in self._paths:
            self._paint_arrow(painter, path)
        for name, time_s in self.cursors.items():
            point = self._point_at(self._paths[0], time_s) if self._paths else None
            if point is not None:
                centre = self.position_of(*point)
                side = self.theme.scaled(FLAG_SIZE.height())
                flag = QRectF(centre.x() - side / 2, centre.y() - side / 2, side, side)
                paint.box(painter, flag, side / 2, self.theme.colour("tooltip"))
                font = self.theme.font("small")
                paint.text_line(painter, flag, name, font, self.theme.colour("tooltipText"), paint.CENTRE)

    def _paint_arrow(self, painter: QPainter, path: Path) -> None:
        _x_curve, y_curve, _times, xs, ys = path
        (finite,) = np.nonzero(_finite_mask(xs, ys))
        if len(finite) < 2:
            return
        tip = self.position_of(float(xs[finite[-1]]), float(ys[finite[-1]]))
        tail = next(
            (
                position
                for index in reversed(finite[-60:-1].tolist())
                if _distance_between(position := self.position_of(float(xs[index]), float(ys[index])), tip)
                > 3
            ),
            None,
        )
        if tail is None:
            return
        angle = math.atan2(tip.y() - tail.y(), tip.x() - tail.x())
        corners = [
            tip + QPointF(length * math.cos(angle + rotation), length * math.sin(angle + rotation))
            for length, rotation in (
                (ARROW_SIZE, 0.0),
                (ARROW_SIZE, 2.5),
                (ARROW_SIZE * 0.35, math.pi),
                (ARROW_SIZE, -2.5),
            )
        ]
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(y_curve.style.line_colour(self.theme))
        painter.drawPolygon(QPolygonF(corners))


def _finite_mask(xs: Floats, ys: Floats) -> np.ndarray:
    return np.isfinite(xs) & np.isfinite(ys)


def _distance_between(point: QPointF, other: QPointF) -> float:
    return math.hypot(point.x() - other.x(), point.y() - other.y())
