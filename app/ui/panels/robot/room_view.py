"""The drawing of a robot in its room, under the mouse and the keyboard."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QKeyEvent, QMouseEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.ui.robot_drawing.scene import RobotDrawing
from app.ui.robot_drawing.state import RobotState
from app.ui.text import plain
from app.ui.theme.theme import Theme
from app.ui.widgets.keyboard import is_plain
from nep.i18n import _

TOUCHABLE = ("head", "left_hand", "right_hand")
STALE = QColor(90, 90, 90, 150)
KEYS = {Qt.Key.Key_H: "head", Qt.Key.Key_L: "left_hand", Qt.Key.Key_R: "right_hand"}


class RoomView(QWidget):
    """The drawing. A press on head or hands touches them; the ball and people can be dragged."""

    touched = Signal(str, bool)  # part, down
    moved = Signal(str, float, float)  # what, x, y in m

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._drawing = RobotDrawing(theme.font("label"))
        self._data: Mapping[str, object] | None = None
        self.state = RobotState()
        self.stale = False
        self._pressed: str | None = None
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(160, 120)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setMouseTracking(True)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setToolTip(plain.tip(_("Press its head or a hand to touch it; drag the ball")))
        theme.changed.connect(self.update)

    def show_state(self, data: Mapping[str, object]) -> None:
        """Draw this state; the same one again costs nothing."""
        if data is self._data:
            return
        self._data = data
        state = RobotState.parse(data)
        if state != self.state:
            self.state = state
            self.setAccessibleDescription("" if self.stale else state.speech or "")
            self.update()

    def set_stale(self, stale: bool) -> None:
        """Whether it has not told for a while how it is: grey, and what it said is not said any more."""
        if stale != self.stale:
            self.stale = stale
            self.setAccessibleDescription("" if stale else self.state.speech or "")
            self.update()

    def sizeHint(self) -> QSize:
        return QSize(382, 286)

    def place_of(self, part: str) -> QPointF | None:
        """Where a part is in the view; for tests and tools."""
        return self._drawing.place_of(part, QRectF(self.rect()), self.state)

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        state = replace(self.state, speech=None, moving=False) if self.stale else self.state
        self._drawing.paint(painter, QRectF(self.rect()), state, dark=self._theme.dark)
        if self.stale:
            painter.fillRect(self.rect(), STALE)
        painter.end()

    def _at(self, position: QPointF) -> str | None:
        return self._drawing.part_at(position, QRectF(self.rect()), self.state)

    def _movable(self, part: str | None) -> bool:
        return any(
            part in {thing.name, thing.kind} and thing.kind in {"ball", "person"}
            for thing in self.state.objects
        )

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self._pressed = self._at(event.position()) if event.button() == Qt.MouseButton.LeftButton else None
        if self._pressed in TOUCHABLE:
            self.touched.emit(self._pressed, True)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self._pressed is not None and self._movable(self._pressed):
            x, y = self._drawing.floor_at(event.position(), QRectF(self.rect()), self.state)
            self.moved.emit(self._pressed, x, y)
        elif self._pressed is None:
            part = self._at(event.position())
            hand = Qt.CursorShape.PointingHandCursor if part in TOUCHABLE else Qt.CursorShape.OpenHandCursor
            self.setCursor(hand if part in TOUCHABLE or self._movable(part) else Qt.CursorShape.ArrowCursor)

    def mouseReleaseEvent(self, _event: QMouseEvent) -> None:
        if self._pressed in TOUCHABLE:
            self.touched.emit(self._pressed, False)
        self._pressed = None

    def keyPressEvent(self, event: QKeyEvent) -> None:
        self._key(event, down=True)

    def keyReleaseEvent(self, event: QKeyEvent) -> None:
        self._key(event, down=False)

    def _key(self, event: QKeyEvent, *, down: bool) -> None:
        part = KEYS.get(Qt.Key(event.key())) if is_plain(event) else None
        if part is None:
            event.ignore()
        elif not event.isAutoRepeat():
            self.touched.emit(part, down)
