"""Robot: a virtual robot in its room, drawn from its state; touch it, drag the ball."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QKeyEvent, QMouseEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.ui.panels.base import Panel, PanelContext
from app.ui.panels.no_robot import NoRobot
from app.ui.panels.one_robot_panel import OneRobotPanel
from app.ui.robot_drawing.scene import RobotDrawing
from app.ui.robot_drawing.state import RobotState
from app.ui.text import plain
from app.ui.theme.theme import Theme
from app.ui.widgets import Chip, EmptyAction, EmptyState, IconButton
from app.ui.widgets.indicators import ROBOT_STATUS
from app.ui.widgets.keyboard import is_plain
from app.ui.widgets.menus import Menu, drop_below
from nep.i18n import _, lazy

if TYPE_CHECKING:
    from app.core.robots.robot_link import RobotLink

TOUCHABLE = ("head", "left_hand", "right_hand")
STALE = QColor(90, 90, 90, 150)
STALE_AFTER_S = 2.0
"""A virtual robot tells how it is many times a second, also when it does nothing."""
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


class RobotPanel(OneRobotPanel):
    """The first virtual robot; its name is the title."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, _("Robot"))
        self._told: Mapping[str, object] | None = None
        self._told_s = 0.0
        self.chip = Chip(self.theme)
        self.reset = IconButton(self.theme, "rotate-cw", _("Put the robot and its room back"), size=30)
        self.reset.clicked.connect(lambda: self._change({"reset": True}))
        self.reset.setVisible(False)
        self.choose = IconButton(self.theme, "chevron-down", _("Choose a robot"), size=26)
        self.choose.setProperty("place", "start")
        self.choose.clicked.connect(self._show_menu)
        self.choose.setVisible(False)
        self.chips = [self.choose, self.chip]
        self.header = [self.reset]
        self.view = RoomView(self.theme)
        self.view.setAccessibleName(_("The robot in its room"))
        self.view.touched.connect(lambda part, down: self._change({"touch": part, "down": down}))
        self.view.moved.connect(
            lambda what, x, y: self._change({"move": what, "x": round(x, 3), "y": round(y, 3)})
        )
        title = _("No robot is connected")
        text = _("With the virtual robot you can try everything at once.")
        start = EmptyAction(_("Use the virtual robot"), lambda: self.context.run("robots.virtual"), "bot")
        self.empty = EmptyState(self.theme, "bot", title, text, [start])
        self._no_robot = NoRobot(self.empty, title, text, [start])
        self.pages = self.show_one_of(self.empty, self.view)

    def fleet_changed(self) -> None:
        self.choose.setVisible(bool(self.session.fleet.links))

    def refresh_robot(self, link: RobotLink | None) -> None:
        if link is None:
            self._no_robot.tell(self.session.coming)
            return
        self.chip.set(link.chip, ROBOT_STATUS.get(link.state, "ok"))
        if link.drawing is not None:
            now = time.monotonic()
            if link.drawing is not self._told:
                self._told, self._told_s = link.drawing, now
            self.view.show_state(link.drawing)
            self.view.set_stale(not link.connected or link.mute or now - self._told_s > STALE_AFTER_S)
            self.pages.setCurrentWidget(self.view)

    def _show_menu(self) -> None:
        menu = Menu(self.theme, self)
        for link in self.session.fleet.links:
            action = menu.addAction(plain.entry(link.name))
            action.setCheckable(True)
            action.setChecked(link.name == self._robot)
            action.triggered.connect(lambda _on=False, name=link.name: self.session.fleet.choose(name))
        if self._robot in self.session.launcher.wanted:
            menu.addSeparator()
            away = menu.addAction(plain.entry(_("Put {robot} away").format(robot=self._robot)))
            away.triggered.connect(
                lambda _on=False, name=self._robot: self.context.run(f"robot.end_virtual:{name}")
            )
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        drop_below(menu, self.choose)

    def show_robot(self, link: RobotLink) -> None:
        self.set_title(link.name)
        self.reset.setVisible(link.virtual)
        self._say_nothing(link)

    def _say_nothing(self, link: RobotLink) -> None:
        self.pages.setCurrentWidget(self.empty)
        if link.virtual:
            title = _("{robot} is coming").format(robot=link.name)
            self.empty.say(title, _("It is drawn as soon as it tells where it is."))
            self.empty.set_actions([])
        else:
            self.empty.say(link.name, _where_to_look(link))
            show = EmptyAction(_("Show its actions"), lambda: self.context.run("panel:robots"), "bot")
            self.empty.set_actions([show])

    def _change(self, change: Mapping[str, object]) -> None:
        if self._robot:
            self.session.fleet.world(self._robot, change)

    def wake(self) -> None:
        if self._watch is not None and self._watch.resting:
            self._told_s = time.monotonic()  # it is not to blame that nobody looked
        super().wake()


def _where_to_look(link: RobotLink) -> str:
    """What shows how a robot is that is not drawn; only what it has is named."""
    images = [sensor.is_image for sensor in link.robot.sensors]
    if True in images and False in images:
        return _("Its camera and its sensors show how it is.")
    if True in images:
        return _("Its camera shows how it is.")
    if images:
        return _("Its sensors show how it is.")
    return _("It tells nothing of itself, but you can try what it can do.")


PANEL = Panel("robot", lazy("Robot"), "bot", (), RobotPanel)
