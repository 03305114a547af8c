"""Speech bubble of a robot with wrapped text; a long text scrolls while it is spoken."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPainterPath, QPen

from app.ui.robot_drawing.room import Spot
from app.ui.robot_drawing.state import RobotState

MIN_WIDTH, SHORT_WIDTH, LONG_WIDTH = 140.0, 190.0, 320.0
SHORT_LINES, MAX_LINES, MAX_NARROW_LINES = 4, 6, 8
LARGE_FONT_PX, SMALL_FONT_PX = 14, 12
PADDING, MARGIN = 14.0, 8.0
LINES_ABOVE_SPOKEN = 2
"""Number of visible lines above the line that is being spoken."""


@dataclass(frozen=True, slots=True)
class BubbleText:
    """Wrapped and scrolled text of a speech bubble.

    Attributes:
        lines: All lines of the text.
        first: Index of the first visible line.
        visible_count: Number of visible lines.
    """

    lines: Sequence[str]
    first: int
    visible_count: int

    @property
    def visible_lines(self) -> Sequence[str]:
        """Visible lines."""
        return self.lines[self.first : self.first + self.visible_count]


def wrap_text(text: str, metrics: QFontMetricsF, width: float) -> list[str]:
    """Wrap a text to a width in px; words that are too long are split."""
    lines = [""]
    for word in text.split():
        candidate = f"{lines[-1]} {word}".strip()
        if metrics.horizontalAdvance(candidate) <= width:
            lines[-1] = candidate
            continue
        for piece in _split_word(word, metrics, width):
            if lines[-1]:
                lines.append(piece)
            else:
                lines[-1] = piece
    return lines


def _split_word(word: str, metrics: QFontMetricsF, width: float) -> list[str]:
    pieces = [""]
    for letter in word:
        if pieces[-1] and metrics.horizontalAdvance(pieces[-1] + letter) > width:
            pieces.append("")
        pieces[-1] += letter
    return pieces


def scroll_to_spoken(lines: Sequence[str], max_lines: int, spoken_fraction: float) -> BubbleText:
    """Scroll a wrapped text so that the spoken line is visible.

    Args:
        lines: Lines of the text.
        max_lines: Maximum number of visible lines.
        spoken_fraction: Spoken fraction of the text, 0 to 1.
    """
    visible_count = max(1, min(max_lines, len(lines)))
    letters = sum(len(line) for line in lines)
    position, line = spoken_fraction * letters, 0
    while line < len(lines) - 1 and position >= len(lines[line]):
        position -= len(lines[line])
        line += 1
    first = min(
        max(0, line - (visible_count - 1 - LINES_ABOVE_SPOKEN if visible_count > LINES_ABOVE_SPOKEN else 0)),
        len(lines) - visible_count,
    )
    return BubbleText(lines, max(0, first), visible_count)


def paint_bubble(
    p: QPainter,
    bounds: QRectF,
    head: Spot,
    state: RobotState,
    font: QFont,
    occupied: Sequence[QRectF] = (),
) -> QRectF:
    """Paint the speech bubble of a robot beside its head, and return the rectangle of the bubble.

    Args:
        p: Painter in stage units.
        bounds: Area for the bubble.
        head: Position of the head, with its scale.
        state: State of the robot, with the text.
        font: Font of the text.
        occupied: Rectangles of other bubbles, which are covered only if there is no free space.
    """
    gap, caption = 31.0 * head.scale, state.caption
    space_right, space_left = bounds.right() - MARGIN - head.u - gap, head.u - gap - bounds.left() - MARGIN
    text_font = QFont(font)
    text_font.setWeight(QFont.Weight.DemiBold)
    text_font.setPixelSize(LARGE_FONT_PX)
    width = min(SHORT_WIDTH, bounds.width() - 2 * MARGIN)
    lines = wrap_text(caption, QFontMetricsF(text_font), width - 2 * PADDING)
    if len(lines) > SHORT_LINES:
        text_font.setPixelSize(SMALL_FONT_PX)
        max_space = max(
            space_right, space_left
        )  # narrower and higher, so that the bubble doesn't cover the face
        width = min(max(MIN_WIDTH, max_space), LONG_WIDTH, bounds.width() - 2 * MARGIN)
        lines = wrap_text(caption, QFontMetricsF(text_font), width - 2 * PADDING)
    metrics = QFontMetricsF(text_font)
    line_height = metrics.height() + 1
    max_lines = int((bounds.height() - 2 * MARGIN - 30) / line_height)
    text = scroll_to_spoken(
        lines, min(MAX_NARROW_LINES if width < SHORT_WIDTH else MAX_LINES, max_lines), state.spoken_fraction
    )
    width = max(metrics.horizontalAdvance(line) for line in lines) + 2 * PADDING
    height = text.visible_count * line_height + 18
    side = -1.0 if space_left > space_right and space_right < width else 1.0

    def box_at(bubble_side: float) -> QRectF:
        left = head.u + gap if bubble_side > 0 else head.u - gap - width
        left = min(
            max(left, bounds.left() + MARGIN), max(bounds.left() + MARGIN, bounds.right() - MARGIN - width)
        )
        return QRectF(left, max(bounds.top() + MARGIN, head.v - 39 * head.scale - height), width, height)

    side, box = _pick_box([(side, box_at(side)), (-side, box_at(-side))], occupied, bounds)
    _paint_box(p, box, min(max(head.u + side * 58 * head.scale, box.left() + 18), box.right() - 30), side)
    p.setFont(text_font)
    p.setPen(QColor("#1C1B19"))
    is_scrolled = text.visible_count < len(lines)
    for index, line in enumerate(text.visible_lines):
        line_rect = QRectF(box.left(), box.top() + 9 + index * line_height, width, line_height)
        p.drawText(line_rect, Qt.AlignmentFlag.AlignCenter, line)
    if is_scrolled:
        _paint_scroll_thumb(p, box, text)
    return box


def _pick_box(
    candidates: Sequence[tuple[float, QRectF]], occupied: Sequence[QRectF], bounds: QRectF
) -> tuple[float, QRectF]:
    # Tries places without overlap first, then below other bubbles, then the one with the smallest overlap.
    def covered_area(candidate: tuple[float, QRectF]) -> float:
        overlaps = [candidate[1].intersected(other) for other in occupied]
        return sum(each.width() * each.height() for each in overlaps)

    tops = [other.bottom() + MARGIN for other in occupied]
    lower = [(side, box.translated(0, top - box.top())) for top in tops for side, box in candidates]
    fitting = [candidate for candidate in lower if candidate[1].bottom() <= bounds.bottom() - MARGIN]
    return min([*candidates, *fitting], key=covered_area)


def paint_caption(p: QPainter, area: QRectF, text: str, font: QFont) -> None:
    """Paint speech as a caption in one line at the bottom of an area, after its bubble has disappeared.

    Args:
        p: Painter in px.
        area: Area in px.
        text: Text, elided if it is too long.
        font: Font of the text.
    """
    metrics = QFontMetricsF(font)
    max_width = max(0.0, area.width() - 4 * MARGIN - 2 * PADDING)
    line = metrics.elidedText(text, Qt.TextElideMode.ElideRight, max_width)
    width, height = metrics.horizontalAdvance(line) + 2 * PADDING, metrics.height() + 10
    box = QRectF(area.center().x() - width / 2, area.bottom() - MARGIN - height, width, height)
    p.setRenderHint(QPainter.RenderHint.Antialiasing)
    p.setPen(Qt.PenStyle.NoPen)
    p.setBrush(QColor(28, 27, 25, 215))
    p.drawRoundedRect(box, 8, 8)
    p.setFont(font)
    p.setPen(QColor("#FFFFFF"))
    p.drawText(box, Qt.AlignmentFlag.AlignCenter, line)


def _paint_box(p: QPainter, box: QRectF, tail_x: float, side: float) -> None:
    shape = QPainterPath()
    shape.addRoundedRect(box, min(12.0, box.height() / 2), min(12.0, box.height() / 2))
    tail = QPainterPath(QPointF(tail_x, box.bottom() - 1))
    tail.lineTo(tail_x + 15 if side > 0 else tail_x - 15, box.bottom() - 1)
    tail.lineTo(tail_x - 2.5 * side, box.bottom() + 11)
    tail.closeSubpath()
    p.setPen(QPen(QColor("#C9C4BA"), 0.8))
    p.setBrush(QColor("#FFFFFF"))
    p.drawPath(shape.united(tail))


def _paint_scroll_thumb(p: QPainter, box: QRectF, text: BubbleText) -> None:
    # Paints the scroll position.
    track = QRectF(box.right() - 7, box.top() + 10, 3, box.height() - 20)
    count = len(text.lines)
    thumb = QRectF(
        track.left(),
        track.top() + track.height() * text.first / count,
        track.width(),
        track.height() * text.visible_count / count,
    )
    p.setPen(Qt.PenStyle.NoPen)
    p.setBrush(QColor("#C9C4BA"))
    p.drawRoundedRect(thumb, 1.5, 1.5)
