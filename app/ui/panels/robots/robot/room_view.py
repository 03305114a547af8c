"""Interactive drawing of robots in their room."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from PySide6.QtCore import QPoint, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QContextMenuEvent,
    QFocusEvent,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
)
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.ui.robot_drawing.bubble import paint_caption
from app.ui.robot_drawing.figure import figure_of
from app.ui.robot_drawing.scene import Marks, RobotDrawing
from app.ui.robot_drawing.state import RobotState, Thing
from app.ui.text import plain
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.keyboard import has_no_modifiers
from nep.i18n import _

TOUCHABLE_PARTS = ("head", "left_hand", "right_hand")
BODY = "body"
"""Name of the part by which a robot is lifted and moved."""
STALE_COLOUR = QColor(90, 90, 90, 150)
TOUCH_KEYS = {Qt.Key.Key_H: "head", Qt.Key.Key_L: "left_hand", Qt.Key.Key_R: "right_hand"}
ARROW_DIRECTIONS = {
    Qt.Key.Key_Up: (-1, 0),
    Qt.Key.Key_Down: (1, 0),
    Qt.Key.Key_Left: (0, -1),
    Qt.Key.Key_Right: (0, 1),
}
PRESS_KEYS = {Qt.Key.Key_Space, Qt.Key.Key_Return, Qt.Key.Key_Enter}
STEP_M, SMALL_STEP_M = 0.1, 0.02
DRAG_DISTANCE_PX = 4


def split_part(part: str) -> tuple[str, str]:
    """Split the id of a part, such as ``Turtle/body``, into the name of the robot and the part.

    The name is "" for the main robot.
    """
    name, _slash, part_name = part.rpartition("/")
    return name, part_name


class RoomView(QWidget):
    """Interactive drawing of robots and things in a room.

    Heads and hands can be pressed; robots and things can be dragged over the floor. A click on a robot with
    a bumper presses the bumper. Keys: Tab selects the next item, arrows move it. Space presses a bumper, or
    touches a head while held. H, L and R touch head and hands, Delete removes a thing.
    """

    touched = Signal(str, str, bool)  # robot ("" for the main one), part, True if pressed
    moved = Signal(str, float, float)  # thing, x, y in m
    robot_moved = Signal(str, float, float)  # robot, x, y in m
    robot_lifted = Signal(str, bool)  # robot, True if lifted
    bumper_pressed = Signal(str, str)  # robot, side of the bumper
    removed = Signal(str)  # thing
    menu_requested = Signal(str, QPoint)  # thing or "", position on the screen
    enlarge_requested = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._drawing = RobotDrawing(theme.font("label"))
        self._state_key: object = None
        self.state = RobotState()
        self.others: Sequence[tuple[str, RobotState]] = ()
        self.is_stale = False
        self.caption = ""
        self._pressed_part: str | None = None
        self._press_position = QPointF()
        self._drag_offset = QPointF()
        self._is_dragging = False
        self._hovered_part: str | None = None
        self.selected_item: str | None = None
        self.robot_name = ""
        """Name of the main robot."""
        self._touches_by_key: dict[int, tuple[str, str]] = {}  # part touched by each pressed key
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(160, 120)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setMouseTracking(True)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName(_("Robots in their room"))
        tooltip = _(
            "Click a robot's head or hand, or a small robot, to touch it. Drag robots and objects to "
            "move them. Double-click to enlarge the room.\nKeys: Tab selects, the arrow keys move, "
            "Space touches, H, L and R touch the head and the hands"
        )
        self.setToolTip(plain.tip(tooltip))
        theme.changed.connect(self.update)

    # -- display ------------------------------------------------------------------------------------------

    def show_state(
        self,
        data: Mapping[str, object],
        others: Sequence[tuple[str, Mapping[str, object]]] = (),
        things: tuple[Thing, ...] | None = None,
    ) -> None:
        """Draw robots and things. Repeated calls with the same objects are cheap.

        Args:
            data: State of the main robot.
            others: Names and states of the other robots in the room.
            things: Things to draw; None for the things in the state of the main robot.
        """
        state_key = (id(data), [(name, id(each)) for name, each in others], things)
        if state_key == self._state_key:
            return
        self._state_key = state_key
        self._state_refs = (data, others)  # keeps the objects alive, so that their ids are not reused
        state = RobotState.parse(data)
        if things is not None:
            state = replace(state, objects=things)
        other_states = [(name, RobotState.parse(each)) for name, each in others]
        if (state, other_states) != (self.state, self.others):
            self.state, self.others = state, other_states
            self.setAccessibleDescription(self._description())
            self.update()

    def set_stale(self, is_stale: bool) -> None:
        """Set if the robot is stale: a stale robot is grey and shows no speech."""
        if is_stale != self.is_stale:
            self.is_stale = is_stale
            self.setAccessibleDescription(self._description())
            self.update()

    def set_caption(self, text: str) -> None:
        """Show speech as a caption at the bottom of the drawing; "" removes the caption."""
        if text != self.caption:
            self.caption = text
            self.update()

    def _description(self) -> str:
        return "" if self.is_stale else self.state.caption

    def sizeHint(self) -> QSize:
        return QSize(382, 286)

    def position_of(self, part: str) -> QPointF | None:
        """Return the position of a part in the view, or None if it is not drawn; used by tests and tools."""
        return self._drawing.point_of(part, QRectF(self.rect()), self.state, self.others)

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        state = replace(self.state, speech=None, sound="", is_moving=False) if self.is_stale else self.state
        selected_item = self.selected_item if self.hasFocus() else None
        marks = Marks(self._hovered_part, selected_item, self._theme.colour("focus"))
        area = QRectF(self.rect())
        self._drawing.paint(painter, area, state, self.others, marks=marks, is_dark=self._theme.is_dark)
        if self.is_stale:
            painter.fillRect(self.rect(), STALE_COLOUR)
        if self.caption:
            paint_caption(painter, area, self.caption, self._theme.font("label"))
        painter.end()

    # -- geometry -----------------------------------------------------------------------------------------

    def _part_at(self, position: QPointF) -> str | None:
        return self._drawing.part_at(position, QRectF(self.rect()), self.state, self.others)

    def _thing(self, part: str | None) -> Thing | None:
        matches = (thing for thing in self.state.objects if part in {thing.name, thing.kind})
        return next(matches, None) if part else None

    def _robot(self, part: str | None) -> RobotState | None:
        # Returns the robot that has this part as its body.
        name, part_name = split_part(part or "")
        return ({"": self.state} | dict(self.others)).get(name) if part_name == BODY else None

    def _position_m(self, part: str | None) -> tuple[float, float] | None:
        # Returns the position in m of an item that can be moved.
        item = self._robot(part) or self._thing(part)
        is_movable = item is not None and (isinstance(item, RobotState) or self._is_movable(item))
        return (item.x, item.y) if item is not None and is_movable else None

    def _is_movable(self, thing: Thing) -> bool:
        return self.state.is_room_shared or thing.kind in {"ball", "person"}

    def selectable_items(self) -> list[str]:
        """Return the items that can be selected by keyboard: robots, then things."""
        robots = [BODY, *(f"{name}/{BODY}" for name, _state in self.others)]
        return [
            *robots,
            *(thing.name for thing in self.state.objects if thing.name and self._is_movable(thing)),
        ]

    # -- mouse --------------------------------------------------------------------------------------------

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self._pressed_part = (
            self._part_at(event.position()) if event.button() == Qt.MouseButton.LeftButton else None
        )
        self._press_position, self._is_dragging = event.position(), False
        position_m = self._position_m(self._pressed_part)
        if self._pressed_part is not None and split_part(self._pressed_part)[1] in TOUCHABLE_PARTS:
            self.touched.emit(*split_part(self._pressed_part), True)
        elif position_m is not None:
            self.selected_item = self._pressed_part
            self.update()
            pixel = self._drawing.pixel_of(*position_m, QRectF(self.rect()), self.state)
            self._drag_offset = pixel - event.position()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self._pressed_part is None:
            part = self._part_at(event.position())
            self._hover(part)
        elif self._position_m(self._pressed_part) is not None:
            self._drag(event.position())

    def _hover(self, part: str | None) -> None:
        is_touchable = part is not None and split_part(part)[1] in TOUCHABLE_PARTS
        is_movable = self._position_m(part) is not None
        shape = Qt.CursorShape.PointingHandCursor if is_touchable else Qt.CursorShape.OpenHandCursor
        self.setCursor(shape if is_touchable or is_movable else Qt.CursorShape.ArrowCursor)
        hovered_part = part if is_movable else None
        if hovered_part != self._hovered_part:
            self._hovered_part = hovered_part
            self.update()

    def _drag(self, position: QPointF) -> None:
        if not self._is_dragging:
            if (position - self._press_position).manhattanLength() < DRAG_DISTANCE_PX:
                return
            self._is_dragging = True
            self.setCursor(Qt.CursorShape.ClosedHandCursor)
            if self._robot(self._pressed_part) is not None:
                self.robot_lifted.emit(split_part(self._pressed_part or "")[0], True)
        area = QRectF(self.rect())
        self._move(
            self._pressed_part or "", *self._drawing.floor_at(position + self._drag_offset, area, self.state)
        )

    def _move(self, part: str, x: float, y: float) -> None:
        if self._robot(part) is not None:
            self.robot_moved.emit(split_part(part)[0], x, y)
        else:
            self.moved.emit(part, x, y)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        pressed_part, self._pressed_part = self._pressed_part, None
        if pressed_part is not None and split_part(pressed_part)[1] in TOUCHABLE_PARTS:
            self.touched.emit(*split_part(pressed_part), False)
        elif self._is_dragging and self._robot(pressed_part) is not None:
            self.robot_lifted.emit(split_part(pressed_part or "")[0], False)
        elif pressed_part is not None:
            self._bump(pressed_part, event.position())
        self._is_dragging = False
        self._hover(self._part_at(event.position()))

    def _bump(self, part: str, position: QPointF) -> bool:
        # Returns False for robots without a bumper.
        area = QRectF(self.rect())
        side = self._drawing.bumper_side_at(position, area, part, self.state, self.others)
        if side is not None:
            self.bumper_pressed.emit(split_part(part)[0], side)
        return side is not None

    def _has_bumper(self, part: str | None) -> bool:
        robot = self._robot(part)
        return robot is not None and figure_of(robot).bumper_side_at is not None

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        part = self._part_at(event.position())
        if part is not None and (split_part(part)[1] in TOUCHABLE_PARTS or self._has_bumper(part)):
            self.mousePressEvent(event)  # second press of a fast double click
        elif event.button() == Qt.MouseButton.LeftButton:
            self.enlarge_requested.emit()

    def leaveEvent(self, _event: object) -> None:
        if self._pressed_part is None:
            self._hover(None)

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        if event.reason() == QContextMenuEvent.Reason.Mouse:
            part, position = self._part_at(QPointF(event.pos())), event.globalPos()
        else:
            part = self.selected_item
            position = self.mapToGlobal(
                (self.position_of(part or "") or QPointF(self.rect().center())).toPoint()
            )
        thing = self._thing(part)
        self.menu_requested.emit(
            thing.name if thing is not None and self._is_movable(thing) else "", position
        )

    # -- keyboard -----------------------------------------------------------------------------------------

    def focusNextPrevChild(self, forward: bool) -> bool:
        choices = self.selectable_items()
        index = (
            choices.index(self.selected_item)
            if self.selected_item in choices
            else -1
            if forward
            else len(choices)
        )
        index += 1 if forward else -1
        if 0 <= index < len(choices):
            self.selected_item = choices[index]
            thing = self._thing(self.selected_item)
            name = split_part(self.selected_item)[0] or self.robot_name
            paint.announce(self, thing.name if thing is not None else name)
            self.update()
            return True
        self.selected_item = None
        self.update()
        return super().focusNextPrevChild(forward)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        key, position_m = Qt.Key(event.key()), self._position_m(self.selected_item)
        if key in ARROW_DIRECTIONS and position_m is not None and self.selected_item is not None:
            is_small_step = bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier)
            step = SMALL_STEP_M if is_small_step else STEP_M
            dx, dy = ARROW_DIRECTIONS[key]
            self._move(self.selected_item, position_m[0] + dx * step, position_m[1] + dy * step)
        elif key in {Qt.Key.Key_Delete, Qt.Key.Key_Backspace} and self._thing(self.selected_item) is not None:
            self.removed.emit(self.selected_item)
        elif key in PRESS_KEYS and self._has_bumper(self._keyboard_target()) and has_no_modifiers(event):
            if not event.isAutoRepeat():
                self.bumper_pressed.emit(split_part(self.selected_item or "")[0], "front")
        else:
            self._touch_with_key(event, key)

    def _keyboard_target(self) -> str:
        # Space acts on the selected item, else on the main robot.
        return self.selected_item or BODY

    def _touch_with_key(self, event: QKeyEvent, key: Qt.Key) -> None:
        part = TOUCH_KEYS.get(key) if has_no_modifiers(event) else None
        if key in PRESS_KEYS and has_no_modifiers(event) and self._robot(self._keyboard_target()) is not None:
            part = "head"
        if part is None:
            event.ignore()
        elif not event.isAutoRepeat() and event.key() not in self._touches_by_key:
            self._touches_by_key[event.key()] = split_part(self.selected_item or "")[0], part
            self.touched.emit(*self._touches_by_key[event.key()], True)

    def keyReleaseEvent(self, event: QKeyEvent) -> None:
        if event.isAutoRepeat():
            return
        touch = self._touches_by_key.pop(event.key(), None)
        if touch is None:
            event.ignore()
        else:
            self.touched.emit(*touch, False)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        # The key release goes to the newly focused widget, so end all touches here.
        while self._touches_by_key:
            self.touched.emit(*self._touches_by_key.popitem()[1], False)
        super().focusOutEvent(event)
