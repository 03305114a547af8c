"""Illustrations of the start page: the robot in its room, a first block, completed steps."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QPainter, QPainterPath, QPaintEvent, QPen, QPixmap, QPolygonF
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.ui.robot_drawing.scene import PREVIEW_STATE, RobotDrawing
from app.ui.shell.start_page.preview import block_path, paint_grid
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from nep.i18n import _, pgettext

ART_HEIGHT = 158
ROOM_HEIGHT = 296  # height of the painted room; the card shows its upper part


class Art(QWidget):
    """Base class of illustrations at the top of a card, clipped to the card's rounded corners."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    def sizeHint(self) -> QSize:
        return QSize(300, ART_HEIGHT)

    def paint_picture(self, painter: QPainter, area: QRectF) -> None:
        """Paint the illustration into a rectangle. Subclasses implement this."""

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        area = QRectF(self.rect())
        painter.setClipPath(upper_corners(area, self._theme.radius("card") - 1))
        self.paint_picture(painter, area)
        paint.hairline(painter, area, Qt.Edge.BottomEdge, self._theme.colour("border"))
        painter.end()


def upper_corners(area: QRectF, radius: float) -> QPainterPath:
    """Return the outline of a rectangle with rounded upper corners."""
    path = QPainterPath()
    path.addRoundedRect(area.adjusted(0, 0, 0, 2 * radius), radius, radius)
    box = QPainterPath()
    box.addRect(area)
    return path.intersected(box)


class RobotArt(Art):
    """Illustration of the virtual robot, waving, painted as in the Robot panel."""

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme)
        self._drawing = RobotDrawing(theme.font("bodyLarge"))
        self._pixmap_cache: tuple[tuple[object, ...], QPixmap] | None = None
        self.setAccessibleName(_("A small white robot in a room, waving"))

    def paint_picture(self, painter: QPainter, area: QRectF) -> None:
        room = QRectF(area.left(), area.top() - 55, area.width(), ROOM_HEIGHT)
        painter.drawPixmap(area.topLeft(), self._cached_pixmap(room, area))

    def _cached_pixmap(self, room: QRectF, area: QRectF) -> QPixmap:
        # Cached for each size and theme, in a pixmap because the drawing sets its own clip.
        ratio = self.devicePixelRatioF()
        key = (area.width(), area.height(), ratio, self._theme.is_dark)
        if self._pixmap_cache is None or self._pixmap_cache[0] != key:
            pixmap = QPixmap((area.size() * ratio).toSize())
            pixmap.setDevicePixelRatio(ratio)
            pixmap.fill(Qt.GlobalColor.transparent)
            inner = QPainter(pixmap)
            inner.setRenderHint(QPainter.RenderHint.Antialiasing)
            self._drawing.paint(
                inner, room.translated(-area.topLeft()), PREVIEW_STATE, is_dark=self._theme.is_dark
            )
            inner.end()
            self._pixmap_cache = (key, pixmap)
        return self._pixmap_cache[1]


class EmptyPageArt(Art):
    """Illustration of the block "when started" on an empty canvas, with a drop target and a mouse pointer."""

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme)
        self.setAccessibleName(
            _("An empty page with the block “{block}”").format(block=pgettext("block", "when started"))
        )

    def paint_picture(self, painter: QPainter, area: QRectF) -> None:
        theme = self._theme
        paint_grid(painter, area, theme)
        left, top = area.left() + max(24.0, area.width() / 2 - 108), area.top() + 41
        font = theme.font("body")
        font.setWeight(font.Weight.Bold)
        text = pgettext("block", "when started")
        block = QRectF(left, top, max(138.0, paint.width_of(font, text) + 32), 34)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(theme.block_colour("events"))
        painter.drawPath(block_path(block, radius=5, notch=12))
        paint.text_line(painter, block.adjusted(14, 0, 0, 0), text, font, theme.block_text("events"))
        quiet = theme.font("body")
        quiet.setWeight(quiet.Weight.Medium)
        text = _("drop a block here")
        width = max(200.0, paint.width_of(quiet, text) + 40)
        slot_rect = QRectF(left, block.bottom(), width, 34)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.setPen(QPen(theme.colour("controlBorder"), 1.25, Qt.PenStyle.DashLine))
        painter.drawPath(block_path(slot_rect, radius=5, notch=12))
        colour = theme.colour("textSecondary")
        paint.text_line(painter, slot_rect, text, quiet, colour, paint.CENTRE)
        self._paint_mouse_pointer(painter, QPointF(slot_rect.right() - 18, slot_rect.bottom() + 8))

    def _paint_mouse_pointer(self, painter: QPainter, tip: QPointF) -> None:
        shape = ((0, 0), (0, 17), (4, 13.3), (6.8, 19.5), (9.6, 18.2), (6.9, 12.2), (12.3, 12))
        arrow = QPolygonF([QPointF(tip.x() + x, tip.y() + y) for x, y in shape])
        painter.setPen(QPen(self._theme.colour("panel"), 1.2))
        painter.setBrush(self._theme.colour("text"))
        painter.drawPolygon(arrow)


class StepsArt(Art):
    """Illustration of two completed steps and the next one."""

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme)
        self.setAccessibleName(_("Three steps, two of them done"))

    def paint_picture(self, painter: QPainter, area: QRectF) -> None:
        theme = self._theme
        painter.fillRect(area, theme.colour("workspace"))
        font, strong = theme.font("body"), theme.font("body")
        strong.setWeight(strong.Weight.DemiBold)
        start, say_label = pgettext("block", "when started"), pgettext("robot", "say")
        steps = (
            _("Place “{block}” below “{start}”").format(block=say_label, start=start),
            _("Press Run and listen"),
            _("Make it turn"),
        )
        side, left = 20.0, area.left() + 24
        for index, text in enumerate(steps):
            middle = area.center().y() + (index - 1) * 36
            mark = QRectF(left, middle - side / 2, side, side)
            is_done = index < len(steps) - 1
            if is_done:
                paint_icon(painter, mark, "circle-check", theme.colour("ok"))
            else:
                paint.box(
                    painter, mark.adjusted(1, 1, -1, -1), side / 2, None, theme.colour("controlBorder"), 1.5
                )
                number = theme.font("caption")
                paint.text_line(painter, mark, "3", number, theme.colour("textSecondary"), paint.CENTRE)
            line = QRectF(mark.right() + 12, middle - 12, area.right() - mark.right() - 24, 24)
            colour = theme.colour("textSecondary" if is_done else "text")
            paint.text_line(painter, line, text, font if is_done else strong, colour)
