"""Image view whose pixels can be clicked."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, Qt, QTimer, Signal
from PySide6.QtGui import QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPen, QWheelEvent
from PySide6.QtWidgets import QApplication

from app.core.messages.picture import Picture
from app.core.run.acting.picture_point import Button, PicturePoint
from app.ui.pictures.zoom import KEY_DIRECTIONS, ZoomablePicture, key_name
from app.ui.theme.theme import Theme
from app.ui.widgets.paint import announce
from nep.i18n import _, lazy

MARK_DURATION_MS = 1200
RING_PX, REACH_PX = 7.0, 12.0
LARGE_CURSOR_STEP_PX = 10  # cursor step with Shift, in image pixels
KEYBOARD_HINT = lazy("Use the arrow keys to point at a pixel and Enter to publish it.")
SCROLL_MARGINS = (16, 16, -16, -16)
BUTTON_NAMES: dict[Qt.MouseButton, Button] = {
    Qt.MouseButton.LeftButton: "left",
    Qt.MouseButton.MiddleButton: "middle",
}


class ClickablePicture(ZoomablePicture):
    """Image view that emits `clicked` with a `PicturePoint` when the user clicks a pixel.

    The signal is emitted after the double-click interval, or immediately if the user clicks elsewhere. Drags
    and double clicks don't count as clicks. On the keyboard, the arrow keys move a cursor by one pixel (with
    Shift by ten), and Enter clicks.
    """

    clicked = Signal(object)

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme)
        self._accepts_clicks = False
        self._pressed_point: tuple[QPointF, PicturePoint] | None = None
        self._pending_click: PicturePoint | None = None
        self._double_click_timer = QTimer(self)
        self._double_click_timer.setSingleShot(True)
        self._double_click_timer.timeout.connect(self._emit_click)
        self.cursor_pixel: tuple[int, int] | None = None
        """Pixel under the keyboard cursor, or None."""
        self.marked_point: PicturePoint | None = None
        """Point with a mark, or None."""
        self._mark_timer = QTimer(self)
        self._mark_timer.setSingleShot(True)
        self._mark_timer.timeout.connect(self._clear_mark)

    @property
    def accepts_clicks(self) -> bool:
        """True if clicks are emitted. Setting another value discards a pending click."""
        return self._accepts_clicks

    @accepts_clicks.setter
    def accepts_clicks(self, is_enabled: bool) -> None:
        """True if clicks are emitted. Setting another value discards a pending click."""
        if is_enabled != self._accepts_clicks:
            self._accepts_clicks = is_enabled
            self.discard_click()
            self._update_cursor_shape()
            if is_enabled:
                announce(self, _(KEYBOARD_HINT))

    def show_mark(self, point: PicturePoint) -> None:
        """Show a mark at a point for a short time."""
        self.marked_point = point
        self._mark_timer.start(MARK_DURATION_MS)
        self.update()

    def _clear_mark(self) -> None:
        self.marked_point = None
        self.update()

    def discard_click(self) -> None:
        """Discard a pending click and the keyboard cursor."""
        self._pressed_point = self._pending_click = None
        self._double_click_timer.stop()
        self._clear_cursor()

    def clear(self) -> None:
        super().clear()
        self.discard_click()
        self.marked_point = None

    def _emit_click(self) -> None:
        point, self._pending_click = self._pending_click, None
        self._double_click_timer.stop()
        if point is not None:
            self.clicked.emit(point)

    def _update_cursor_shape(self) -> None:
        if self._accepts_clicks:
            self.setCursor(Qt.CursorShape.CrossCursor)
        else:
            self.unsetCursor()

    # -- mouse --------------------------------------------------------------------------------------------

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self._emit_click()  # this press is not the second one of a double click
        super().mousePressEvent(event)
        point = self._point_at(event)
        is_single_button = event.buttons() == event.button()
        self._pressed_point = (event.position(), point) if point is not None and is_single_button else None

    def _point_at(self, event: QMouseEvent) -> PicturePoint | None:
        button, picture = BUTTON_NAMES.get(event.button()), self.picture
        pixel = self.pixel_at(event.position()) if self._accepts_clicks and button is not None else None
        if pixel is None or picture is None or button is None:
            return None
        return PicturePoint(*pixel, picture.width, picture.height, picture.stamp_ns, button)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        self._clear_cursor()
        if self._pressed_point is not None:
            distance = event.position() - self._pressed_point[0]
            if distance.manhattanLength() >= QApplication.startDragDistance():
                self._pressed_point = None
        super().mouseMoveEvent(event)

    def wheelEvent(self, event: QWheelEvent) -> None:
        self._pressed_point = None
        super().wheelEvent(event)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        super().mouseReleaseEvent(event)
        self._update_cursor_shape()
        pressed_point, self._pressed_point = self._pressed_point, None
        if pressed_point is not None:
            self._pending_click = pressed_point[1]
            self._double_click_timer.start(QApplication.doubleClickInterval())

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        self.discard_click()
        super().mouseDoubleClickEvent(event)

    # -- keyboard -----------------------------------------------------------------------------------------

    def keyPressEvent(self, event: QKeyEvent) -> None:
        name, picture = key_name(event), self.picture
        direction = KEY_DIRECTIONS.get(name.removeprefix("Shift+"))
        if not self._accepts_clicks or picture is None:
            super().keyPressEvent(event)
        elif direction is not None:
            self._move_cursor(
                -direction[0], -direction[1], LARGE_CURSOR_STEP_PX if name.startswith("Shift+") else 1
            )
        elif name in {"Return", "Enter"} and self.cursor_pixel is not None and not event.isAutoRepeat():
            self._emit_click()
            x, y = _clamp_to_picture(self.cursor_pixel, picture)
            self.clicked.emit(PicturePoint(x, y, picture.width, picture.height, picture.stamp_ns, "left"))
        else:
            super().keyPressEvent(event)

    def _move_cursor(self, dx: int, dy: int, count: int) -> None:
        # Directions are those on the screen. The cursor starts at the centre of the visible part.
        if self.cursor_pixel is None:
            target = QRectF(self.rect()).center()
        else:
            step = count * max(1.0, self.scale())
            target = self._view_position(self.cursor_pixel) + QPointF(dx * step, dy * step)
        area = self.area()
        clamped = QPointF(
            min(max(target.x(), area.left()), area.right() - 1e-3),
            min(max(target.y(), area.top()), area.bottom() - 1e-3),
        )
        pixel = self.pixel_at(clamped)
        if pixel is None:
            return
        self.cursor_pixel = pixel
        self._scroll_to_cursor()
        self.update()

    def _scroll_to_cursor(self) -> None:
        # Scrolls a zoomed image so that the cursor is visible.
        if self.cursor_pixel is None or self.placement.zoom is None:
            return
        position, visible_rect = (
            self._view_position(self.cursor_pixel),
            QRectF(self.rect()).adjusted(*SCROLL_MARGINS),
        )
        dx = min(0.0, visible_rect.right() - position.x()) + max(0.0, visible_rect.left() - position.x())
        dy = min(0.0, visible_rect.bottom() - position.y()) + max(0.0, visible_rect.top() - position.y())
        if dx or dy:
            self.move_by(dx, dy)

    def _view_position(self, pixel: tuple[int, int]) -> QPointF:
        # Centre of a pixel in view coordinates.
        picture = self.picture
        if picture is None:
            return QPointF()
        x, y = _clamp_to_picture(pixel, picture)
        fraction = QPointF((x + 0.5) / picture.width, (y + 0.5) / picture.height)
        return self.placement.to_view(self.area()).map(fraction)

    def _clear_cursor(self) -> None:
        if self.cursor_pixel is not None:
            self.cursor_pixel = self.mouse_position = None
            self.update()

    # -- painting -----------------------------------------------------------------------------------------

    def paintEvent(self, event: QPaintEvent) -> None:
        if self.cursor_pixel is not None:  # zoom, rotation or size may have moved the cursor's pixel
            self.mouse_position = self._view_position(self.cursor_pixel)
        super().paintEvent(event)
        if self.picture is None:
            return
        if self.marked_point is not None:
            self._paint_cross(
                self.placement.to_view(self.area()).map(QPointF(*self.marked_point.relative_position))
            )
        if self.cursor_pixel is not None and self._accepts_clicks:
            self._paint_cross(self._view_position(self.cursor_pixel), has_ring=False)

    def _paint_cross(self, position: QPointF, *, has_ring: bool = True) -> None:
        # Dark below and light above, so that the mark is visible on every image.
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        for colour, width in ((Qt.GlobalColor.black, 4.0), (Qt.GlobalColor.white, 1.6)):
            painter.setPen(QPen(colour, width))
            if has_ring:
                painter.drawEllipse(
                    QRectF(position.x() - RING_PX, position.y() - RING_PX, 2 * RING_PX, 2 * RING_PX)
                )
            for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
                direction = QPointF(dx, dy)
                painter.drawLine(position + direction * (RING_PX - 3), position + direction * REACH_PX)
        painter.end()


def _clamp_to_picture(pixel: tuple[int, int], picture: Picture) -> tuple[int, int]:
    # A later image can be smaller than the one that the cursor was placed on.
    return min(pixel[0], picture.width - 1), min(pixel[1], picture.height - 1)
