"""Painting of the layers of a timeline's lane."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QImage, QPainter, QPen, QPolygonF

from app.core.timeline.lanes import (
    BarLayer,
    CountLayer,
    FlagLayer,
    LaneLayer,
    Mark,
    NotchLayer,
    OutlineLayer,
    SpanLayer,
    Status,
    spaced_marks,
)
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint

STATUS_ROLES: dict[Status, str] = {"": "textSecondary", "ok": "ok", "warn": "warn", "error": "error"}
"""Colour of each status, as the name of a colour of the theme."""
MIN_MARK_WIDTH = 3.0
"""Minimum width of a mark in px."""
ICON_SIZE, GAP, MIN_TEXT_WIDTH, MAX_NAME_WIDTH, FLAG_SIZE = 13, 4, 34, 160, 8
COUNTS_HEIGHT, LINE_WIDTH, NOTCH_SIZE, MIN_NOTCH_SPACING = 10, 2, 4, 3
MIN_ALPHA, MAX_ALPHA = 0.14, 0.76
MIN_LINE_SPACING_PX = 8
"""Average distance between counts in px above which each of them is painted as a line."""


@dataclass(frozen=True, slots=True)
class PaintedMark:
    """Mark that can be clicked.

    Attributes:
        box: Rectangle of the mark.
        mark: Mark.
    """

    box: QRectF
    mark: Mark


class LanePainter:
    """Painter of the layers of one lane.

    Args:
        theme: Theme with colours and fonts.
        painter: Painter to use.
        box: Area of the lane; its width is the visible time range.
        x_of: Returns the x coordinate of a time.
        is_selected: True if the lane is selected.
    """

    def __init__(
        self,
        theme: Theme,
        painter: QPainter,
        box: QRectF,
        x_of: Callable[[int], float],
        *,
        is_selected: bool = False,
    ) -> None:
        self._theme, self._painter, self._box, self._x_of = theme, painter, box, x_of
        self._is_selected = is_selected

    def paint(self, layers: Iterable[LaneLayer]) -> list[PaintedMark]:
        """Paint layers, and return the marks of flags, bars and spans."""
        painter, painted_marks = self._painter, list[PaintedMark]()
        for layer in layers:
            margin = NOTCH_SIZE if isinstance(layer, NotchLayer) else 0
            painter.save()
            painter.setClipRect(self._box.adjusted(-margin, 0, margin, 0), Qt.ClipOperation.IntersectClip)
            match layer:
                case CountLayer():
                    self._paint_counts(layer)
                case NotchLayer():
                    self._paint_notches(layer)
                case OutlineLayer():
                    self._paint_outlines(layer)
                case FlagLayer():
                    painted_marks += self._paint_flags(layer)
                case BarLayer():
                    painted_marks += [self._paint_bar(mark) for mark in self._spaced(layer.marks)]
                case SpanLayer():
                    painted_marks += self._paint_spans(list(self._spaced(layer.marks)))
            painter.restore()
        return painted_marks

    def paint_current_bars(self, marks: Iterable[Mark]) -> None:
        """Paint bars highlighted, for the playhead in them."""
        for mark in marks:
            self._paint_bar(mark, "changedTint", "running")

    def _spaced(self, marks: Iterable[Mark]) -> Iterator[Mark]:
        return spaced_marks(marks, self._x_of, self._box.left(), self._box.right(), MIN_MARK_WIDTH)

    def _paint_icon(self, name: str, left: float, row: QRectF, role: str) -> None:
        side = self._theme.scaled(ICON_SIZE)
        icon_rect = QRectF(left, row.center().y() - side / 2, side, side)
        paint_icon(self._painter, icon_rect, name, self._theme.colour(role))

    # -- counts, notches and outlines ---------------------------------------------------------------------

    def _paint_counts(self, layer: CountLayer) -> None:
        counts, painter, lane = layer.counts, self._painter, self._box
        peak = max(counts, default=0)
        if not peak:
            return
        colour = self._theme.colour("accentText" if self._is_selected else "textTertiary")
        left, right = self._x_of(layer.start_ns), self._x_of(layer.end_ns)
        box = QRectF(left, lane.top() + (lane.height() - COUNTS_HEIGHT) / 2, right - left, COUNTS_HEIGHT)
        nonzero_count = sum(1 for count in counts if count)
        if nonzero_count * MIN_LINE_SPACING_PX < len(counts):
            interval_width = box.width() / len(counts)
            for index, count in enumerate(counts):
                if count:
                    line = QRectF(left + index * interval_width, box.top(), LINE_WIDTH, COUNTS_HEIGHT)
                    painter.fillRect(line, colour)
        else:
            painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform, False)
            painter.drawImage(box, counts_image(counts, peak, colour))

    def _paint_notches(self, layer: NotchLayer) -> None:
        box, colour = self._box, self._theme.colour("warn")
        self._painter.setPen(Qt.PenStyle.NoPen)
        self._painter.setBrush(colour)
        last_x = box.left() - MIN_NOTCH_SPACING - 1
        middle = box.top() + box.height() / 2
        for notch in layer.notches:
            x = self._x_of(notch.at_ns)
            if box.left() <= x <= box.right() and x >= last_x + MIN_NOTCH_SPACING:
                last_x = x
                self._painter.fillRect(QRectF(x - 1, middle - 8, LINE_WIDTH, 16), colour)
                left, right = QPointF(x - NOTCH_SIZE, middle - 8), QPointF(x + NOTCH_SIZE, middle - 8)
                self._painter.drawPolygon(QPolygonF([left, right, QPointF(x, middle - 3)]))

    def _paint_outlines(self, layer: OutlineLayer) -> None:
        lane = self._box
        for mark in self._spaced(layer.marks):
            left, right = self._x_of(mark.start_ns), self._x_of(mark.end_ns)
            top = lane.top() + (lane.height() - COUNTS_HEIGHT) / 2 - 2
            box = QRectF(left, top, max(MIN_MARK_WIDTH + 1, right - left), COUNTS_HEIGHT + 4)
            paint.box(self._painter, box, 2, None, self._theme.colour(STATUS_ROLES[mark.status]))

    # -- flags --------------------------------------------------------------------------------------------

    def _paint_flags(self, layer: FlagLayer) -> Iterator[PaintedMark]:
        theme, painter, box = self._theme, self._painter, self._box
        font, colour = theme.font("small"), theme.colour("accentText")
        if not layer.marks and layer.placeholder:
            left_aligned = box.adjusted(FLAG_SIZE, 0, 0, 0)
            paint.text_line(painter, left_aligned, layer.placeholder, font, theme.colour("textTertiary"))
        free_x = box.left() - 1.0
        for mark in layer.marks:
            x = self._x_of(mark.start_ns)
            if not box.left() - 1 <= x <= box.right() + 1:
                continue
            painter.setPen(QPen(colour, 1.5))
            painter.drawLine(QPointF(x, box.top() + 3), QPointF(x, box.bottom() - 3))
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(colour)
            painter.drawRect(QRectF(x, box.top() + 4, FLAG_SIZE, 7))
            text_width = 0.0
            if x >= free_x and mark.text:
                text_width = min(paint.width_of(font, mark.text), theme.scaled(MAX_NAME_WIDTH))
                text_rect = QRectF(x + 12, box.top(), text_width, box.height())
                paint.text_line(painter, text_rect, mark.text, font, theme.colour("text"))
                free_x = x + 16 + text_width
            yield PaintedMark(
                QRectF(x - GAP, box.top(), FLAG_SIZE + 2 * GAP + text_width, box.height()), mark
            )

    # -- bars ---------------------------------------------------------------------------------------------

    def _paint_bar(self, mark: Mark, fill: str = "sunken", edge: str = "controlBorder") -> PaintedMark:
        # With its text at the left and its result at the right if there is room for them.
        theme, painter, lane = self._theme, self._painter, self._box
        left, right = self._x_of(mark.start_ns), self._x_of(mark.end_ns)
        bar = QRectF(left, lane.top() + 3, max(MIN_MARK_WIDTH, right - left), lane.height() - 6)
        paint.box(painter, bar, theme.radius("small"), theme.colour(fill), theme.colour(edge))
        content_rect = bar.intersected(QRectF(lane.left(), bar.top(), lane.width(), bar.height()))
        content_rect.adjust(6, 0, -6, 0)
        if content_rect.width() < theme.scaled(MIN_TEXT_WIDTH):
            return PaintedMark(bar, mark)
        font, side = theme.font("small"), theme.scaled(ICON_SIZE)
        if mark.icon:
            self._paint_icon(mark.icon, content_rect.left(), content_rect, "textTertiary")
            content_rect.adjust(side + GAP, 0, 0, 0)
        role = STATUS_ROLES[mark.status]
        result_width = side + GAP + paint.width_of(font, mark.result)
        text_width = min(paint.width_of(font, mark.text), theme.scaled(MAX_NAME_WIDTH))
        if mark.result_icon and text_width + 2 * GAP + result_width <= content_rect.width():
            self._paint_icon(mark.result_icon, content_rect.right() - result_width, content_rect, role)
            paint.text_line(painter, content_rect, mark.result, font, theme.colour(role), paint.RIGHT)
            content_rect.adjust(0, 0, -result_width - GAP, 0)
        elif mark.result_icon and text_width + 2 * GAP + side <= content_rect.width():
            self._paint_icon(mark.result_icon, content_rect.right() - side, content_rect, role)
            content_rect.adjust(0, 0, -side - GAP, 0)
        paint.text_line(painter, content_rect, mark.text, font, theme.colour("text"))
        return PaintedMark(bar, mark)

    # -- spans --------------------------------------------------------------------------------------------

    def _paint_spans(self, marks: Sequence[Mark]) -> Iterator[PaintedMark]:
        theme, box = self._theme, self._box
        font, side = theme.font("small"), theme.scaled(ICON_SIZE)
        for index, mark in enumerate(marks):
            role = STATUS_ROLES[mark.status]
            left, right = self._x_of(mark.start_ns), self._x_of(mark.end_ns)
            bar = QRectF(left, box.top() + 5, max(MIN_MARK_WIDTH, right - left), box.height() - 10)
            paint.box(self._painter, bar, 1.5, theme.colour(role))
            next_x = self._x_of(marks[index + 1].start_ns) if index + 1 < len(marks) else box.right()
            begin = max(bar.right(), box.left()) + 5
            room = min(next_x, box.right()) - begin - side - GAP
            hit_rect = bar.adjusted(-3, -3, 3, 3)
            if room >= theme.scaled(MIN_TEXT_WIDTH):
                text_width = min(room, paint.width_of(font, mark.text) + 1)
                self._paint_icon(mark.icon, begin, box, role)
                text_rect = QRectF(begin + side + GAP, box.top(), text_width, box.height())
                paint.text_line(self._painter, text_rect, mark.text, font, theme.colour(role))
                hit_rect = hit_rect.united(text_rect)
            yield PaintedMark(hit_rect, mark)


def counts_image(counts: Sequence[int], peak: int, colour: QColor) -> QImage:
    """Return an image with a height of 1 px that shows counts by opacity.

    Args:
        counts: Count for each pixel.
        peak: Count that is shown with the highest opacity.
        colour: Colour of the pixels.
    """
    levels = []
    for level in range(256):
        alpha = 0.0 if level == 0 else MIN_ALPHA + (MAX_ALPHA - MIN_ALPHA) * level / 255
        red, green, blue = (round(each * alpha) for each in (colour.red(), colour.green(), colour.blue()))
        levels.append(round(alpha * 255) << 24 | red << 16 | green << 8 | blue)
    pixels = array("I", [levels[0 if not count else max(1, count * 255 // peak)] for count in counts])
    image = QImage(
        pixels.tobytes(), len(counts), 1, 4 * len(counts), QImage.Format.Format_ARGB32_Premultiplied
    )
    return image.copy()  # copied because QImage doesn't own the buffer
