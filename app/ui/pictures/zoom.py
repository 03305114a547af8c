"""Image view that can be zoomed and moved with mouse, touch pad and keyboard."""

from __future__ import annotations

from typing import TypeGuard

from PySide6.QtCore import QEvent, QPointF, QSizeF, Qt, Signal
from PySide6.QtGui import QKeyEvent, QMouseEvent, QNativeGestureEvent, QWheelEvent

from app.ui.pictures.view import PictureView
from app.ui.theme.theme import Theme

ZOOM_STEP, WHEEL_NOTCH = 1.25, 120
KEY_MOVE_PX = 40
KEY_DIRECTIONS = {"Left": (1, 0), "Right": (-1, 0), "Up": (0, 1), "Down": (0, -1)}


class ZoomablePicture(PictureView):
    """Image view in which wheel, pinch and double click zoom, and dragging and arrow keys move the image.

    Emits `placement_changed` when the user has changed the placement, and `key_pressed` with the name of a
    pressed key. Keys in `keys` take precedence over the window's shortcuts while the image has the focus.

    Attributes:
        keys: Names of the reported keys, such as "Ctrl+C".
    """

    placement_changed = Signal()
    key_pressed = Signal(str)

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme)
        self.keys: frozenset[str] = frozenset()
        self._drag_position: QPointF | None = None
        self.setMouseTracking(True)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)

    def zoom_by(self, factor: float, position: QPointF | None = None) -> None:
        """Zoom by a factor around a point of the view.

        Args:
            factor: Factor; greater than 1 to zoom in.
            position: Point that stays in place (default: the centre).
        """
        middle = QPointF(self.width() / 2, self.height() / 2)
        self.placement.zoom_at(factor, position or middle, QSizeF(self.size()), self.picture_size())
        self.notify_changed()

    def fit_to_view(self) -> None:
        """Fit the image into the view."""
        self.placement.set_zoom(None)
        self.notify_changed()

    def show_actual_size(self, position: QPointF | None = None) -> None:
        """Show one device pixel per image pixel.

        Args:
            position: Point of the view that stays in place (default: the centre).
        """
        self.zoom_by(1 / max(1e-9, self.scale()), position)

    def move_by(self, dx: float, dy: float) -> None:
        """Move the image by a distance in px."""
        self.placement.move(dx, dy, QSizeF(self.size()), self.picture_size())
        self.notify_changed()

    def notify_changed(self) -> None:
        """Repaint and emit `placement_changed`."""
        self.update()
        self.placement_changed.emit()

    def wheelEvent(self, event: QWheelEvent) -> None:
        if self.picture is None:
            event.ignore()
            return
        self.zoom_by(ZOOM_STEP ** (event.angleDelta().y() / WHEEL_NOTCH), event.position())
        event.accept()

    def event(self, event: QEvent) -> bool:
        if isinstance(event, QNativeGestureEvent):
            if event.gestureType() == Qt.NativeGestureType.ZoomNativeGesture:
                self.zoom_by(1.0 + event.value(), event.position())
                return True
        elif _is_shortcut_override(event) and key_name(event) in self.keys:
            event.accept()  # takes precedence over the window's shortcut
            return True
        return super().event(event)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        name = key_name(event)
        if name in KEY_DIRECTIONS and self.placement.zoom is not None:
            dx, dy = KEY_DIRECTIONS[name]
            self.move_by(dx * KEY_MOVE_PX, dy * KEY_MOVE_PX)
        elif name in self.keys:
            self.key_pressed.emit(name)
        else:
            super().keyPressEvent(event)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() in {Qt.MouseButton.LeftButton, Qt.MouseButton.MiddleButton}:
            self._drag_position = event.position()
            if self.placement.zoom is not None:
                self.setCursor(Qt.CursorShape.ClosedHandCursor)
            self.setFocus(Qt.FocusReason.MouseFocusReason)
        else:
            super().mousePressEvent(event)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        self._drag_position = None
        self.unsetCursor()
        super().mouseReleaseEvent(event)

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            if self.placement.zoom is None:
                self.show_actual_size(event.position())
            else:
                self.fit_to_view()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self._drag_position is not None:
            step = event.position() - self._drag_position
            self._drag_position = event.position()
            self.move_by(step.x(), step.y())
        self.mouse_position = event.position()
        self.update()

    def leaveEvent(self, _event: object) -> None:
        self.mouse_position = None
        self.update()


def _is_shortcut_override(event: QEvent) -> TypeGuard[QKeyEvent]:
    return isinstance(event, QKeyEvent) and event.type() == QEvent.Type.ShortcutOverride


def key_name(event: QKeyEvent) -> str:
    """Return the name of a pressed key with its modifiers, such as "Ctrl+C", "R" or "+"."""
    modifiers = event.modifiers()
    text = event.text()
    if text and text in "+-":  # on some keyboards these keys need Shift, or are on the number pad
        name = text
    else:
        name = event.keyCombination().key().name.removeprefix("Key_")
        name = ("Shift+" if modifiers & Qt.KeyboardModifier.ShiftModifier else "") + name
    names = {"Plus": "+", "Minus": "-", "Equal": "+"}
    name = names.get(name.removeprefix("Shift+"), name)
    return f"Ctrl+{name}" if modifiers & Qt.KeyboardModifier.ControlModifier else name
