"""A picture whose pixels can be clicked: neither a drag nor a double click is a click."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, Qt, QTimer, Signal
from PySide6.QtGui import QMouseEvent, QPainter, QPaintEvent, QPen, QWheelEvent
from PySide6.QtWidgets import QApplication

from app.core.run.acting.picture_point import Button, PicturePoint
from app.ui.pictures.zoom import ZoomablePicture
from app.ui.theme.theme import Theme

MARK_MS = 1200
RING_PX, REACH_PX = 7.0, 12.0
BUTTONS: dict[Qt.MouseButton, Button] = {
    Qt.MouseButton.LeftButton: "left",
    Qt.MouseButton.MiddleButton: "middle",
}


class ClickablePicture(ZoomablePicture):
    """`clicked` with a `PicturePoint` while it takes clicks, once it is sure that it is no double click.

    The point is what was there when the button was pressed, and is told after the time that a double click
    may take; a click elsewhere tells the one before at once.
    """

    clicked = Signal(object)

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme)
        self._takes_clicks = False
        self._pressed: tuple[QPointF, PicturePoint] | None = None
        self._waiting: PicturePoint | None = None
        self._sure = QTimer(self)
        self._sure.setSingleShot(True)
        self._sure.timeout.connect(self._tell)
        self.marked: PicturePoint | None = None
        """Where a mark stands."""
        self._fading = QTimer(self)
        self._fading.setSingleShot(True)
        self._fading.timeout.connect(self._unmark)

    @property
    def takes_clicks(self) -> bool:
        """Whether a click is told; one before it was so, or that is not told yet when it ends, is not."""
        return self._takes_clicks

    @takes_clicks.setter
    def takes_clicks(self, takes: bool) -> None:
        if takes != self._takes_clicks:
            self._takes_clicks = takes
            self.forget_click()
            self._show_cursor()

    def mark(self, point: PicturePoint) -> None:
        """Show for a moment where this is."""
        self.marked = point
        self._fading.start(MARK_MS)
        self.update()

    def _unmark(self) -> None:
        self.marked = None
        self.update()

    def forget_click(self) -> None:
        """Tell nothing of what was pressed so far."""
        self._pressed = self._waiting = None
        self._sure.stop()

    def clear(self) -> None:
        super().clear()
        self.forget_click()
        self.marked = None

    def _tell(self) -> None:
        point, self._waiting = self._waiting, None
        self._sure.stop()
        if point is not None:
            self.clicked.emit(point)

    def _show_cursor(self) -> None:
        if self._takes_clicks:
            self.setCursor(Qt.CursorShape.CrossCursor)
        else:
            self.unsetCursor()

    # -- the mouse ----------------------------------------------------------------------------------------

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self._tell()  # this one is no second one of a double click
        super().mousePressEvent(event)
        point = self._point_at(event)
        alone = event.buttons() == event.button()
        self._pressed = (event.position(), point) if point is not None and alone else None

    def _point_at(self, event: QMouseEvent) -> PicturePoint | None:
        button, picture = BUTTONS.get(event.button()), self.picture
        pixel = self.pixel_at(event.position()) if self._takes_clicks and button is not None else None
        if pixel is None or picture is None or button is None:
            return None
        return PicturePoint(*pixel, picture.width, picture.height, picture.stamp_ns, button)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self._pressed is not None:
            moved = event.position() - self._pressed[0]
            if moved.manhattanLength() >= QApplication.startDragDistance():
                self._pressed = None
        super().mouseMoveEvent(event)

    def wheelEvent(self, event: QWheelEvent) -> None:
        self._pressed = None
        super().wheelEvent(event)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        super().mouseReleaseEvent(event)
        self._show_cursor()
        pressed, self._pressed = self._pressed, None
        if pressed is not None:
            self._waiting = pressed[1]
            self._sure.start(QApplication.doubleClickInterval())

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        self.forget_click()
        super().mouseDoubleClickEvent(event)

    # -- painting -----------------------------------------------------------------------------------------

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        if self.marked is None or self.picture is None:
            return
        at = self.place.to_view(self.area()).map(QPointF(*self.marked.share))
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        # dark below and light above: it is seen on every picture
        for ink, width in ((Qt.GlobalColor.black, 4.0), (Qt.GlobalColor.white, 1.6)):
            painter.setPen(QPen(ink, width))
            painter.drawEllipse(QRectF(at.x() - RING_PX, at.y() - RING_PX, 2 * RING_PX, 2 * RING_PX))
            for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
                way = QPointF(dx, dy)
                painter.drawLine(at + way * (RING_PX - 3), at + way * REACH_PX)
        painter.end()
