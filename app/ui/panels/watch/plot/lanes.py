"""Lanes of states (text or boolean fields) over time, aligned with the curves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from PySide6.QtCore import QEvent, QPointF, QRectF, QSize
from PySide6.QtGui import QHelpEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QToolTip, QWidget

from app.core.series.states import StateRun
from app.ui.panels.watch.plot.canvas import PlotCanvas
from app.ui.panels.watch.plot.curve_style import paint_state
from app.ui.panels.watch.plot.plotted_curve import PlotCurve
from app.ui.text import plain
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from nep.i18n import _

LANE_HEIGHT, MIN_WORD_WIDTH = 26, 34
MAX_LANES = 8
MIN_BOX_WIDTH = 2.0


class StateLanes(QWidget):
    """Lanes of states over the time range of the canvas."""

    def __init__(self, theme: Theme, canvas: PlotCanvas) -> None:
        super().__init__()
        self._theme, self._canvas = theme, canvas
        self.curves: Sequence[PlotCurve] = ()
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName(_("States"))
        theme.changed.connect(self.updateGeometry)

    def show_curves(self, curves: Sequence[PlotCurve]) -> None:
        """Set the curves whose states are shown. Only the first eight curves have a lane."""
        count = len(self.curves)
        self.curves = curves[:MAX_LANES]
        if len(self.curves) != count:
            self.updateGeometry()
        paint.show_when(self, bool(self.curves))
        self.update()

    def _lane_height(self) -> float:
        return max(float(LANE_HEIGHT), self._theme.scaled(LANE_HEIGHT))

    def sizeHint(self) -> QSize:
        return QSize(200, round(self._lane_height() * len(self.curves)))

    def minimumSizeHint(self) -> QSize:
        return QSize(60, self.sizeHint().height())

    def boxes(self) -> Iterator[tuple[PlotCurve, StateRun, QRectF]]:
        """Yield curve, run and rectangle of each box to paint.

        A run is a time range in which the value of a curve is the same. For boolean curves, only the runs
        of true are included.
        """
        canvas, area = self._canvas, self._canvas.area
        for row, curve in enumerate(self.curves):
            states = curve.curve.states
            if states is None or curve.is_hidden:
                continue
            top = row * self._lane_height()
            is_boolean = states.values_in(canvas.begin_s, canvas.end_s) <= {"true", "false"}
            without = ("false",) if is_boolean else ()
            pixel_s = (canvas.end_s - canvas.begin_s) / canvas.columns
            last_right = -1.0  # right edge of the last box; one box per pixel is enough
            for run in states.runs(canvas.begin_s, canvas.end_s, step_s=pixel_s / 2, excluded_values=without):
                left = max(area.left(), canvas.x_of(run.start_s))
                right = min(area.right(), canvas.x_of(run.end_s))
                if right >= left and max(right, left + MIN_BOX_WIDTH) > last_right + 0.5:
                    last_right = max(right, left + MIN_BOX_WIDTH)
                    yield (
                        curve,
                        run,
                        QRectF(left, top + 2, max(MIN_BOX_WIDTH, right - left), self._lane_height() - 3),
                    )

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        self.paint_lanes(painter)
        painter.end()

    def paint_lanes(self, painter: QPainter) -> None:
        """Paint all lanes, with the origin at the top left corner."""
        theme, area = self._theme, self._canvas.area
        font = theme.font("code")
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        for row, curve in enumerate(self.curves):
            background_rect = QRectF(
                area.left(), row * self._lane_height() + 1, area.width(), self._lane_height() - 1
            )
            painter.fillRect(background_rect, theme.colour("sunken"))
            name = QRectF(4, background_rect.top(), area.left() - 10, background_rect.height())
            role = "textDisabled" if curve.is_hidden else "textSecondary"
            paint.text_line(painter, name, short_name(curve.name), font, theme.colour(role), paint.RIGHT)
        for curve, run, box in self.boxes():
            paint_state(painter, theme, box, curve.style)
            if box.width() >= MIN_WORD_WIDTH:
                text_box = box.adjusted(6, 0, -4, 0)
                paint.text_line(painter, text_box, run.value or "", theme.font("small"), theme.colour("text"))
        self._paint_cursors(painter)

    def _paint_cursors(self, painter: QPainter) -> None:
        area = self._canvas.area
        pen = QPen(self._theme.colour("text"), 1.25)
        pen.setDashPattern([1.5, 2.5])
        painter.setPen(pen)
        height = self._lane_height() * len(self.curves)
        for time_s in self._canvas.cursors.values():
            x = self._canvas.x_of(time_s)
            if area.left() <= x <= area.right():
                painter.drawLine(QPointF(x, 0), QPointF(x, height))

    def event(self, event: QEvent) -> bool:
        if isinstance(event, QHelpEvent) and event.type() == QEvent.Type.ToolTip:
            position = QPointF(event.pos())
            values = (run.value for _curve, run, box in self.boxes() if box.contains(position))
            value = next(values, None)
            row = int(position.y() // self._lane_height())
            name = self.curves[row].name if row < len(self.curves) else ""
            QToolTip.showText(event.globalPos(), plain.tip(value or name), self)
            return True
        return super().event(event)


def short_name(name: str) -> str:
    """Return the last part of a field path, such as "emotion" of "/blackboard.robots.Pepper.emotion"."""
    return name.rpartition(".")[2] or name
