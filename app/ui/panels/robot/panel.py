"""The panel of virtual robots: which one it is about, its room, and what a person says to it."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QVBoxLayout, QWidget

from app.core.robots.awaited import awaited_values
from app.robots.description.description import Event
from app.ui.panels.base import Panel, PanelContext
from app.ui.panels.no_robot import NoRobot
from app.ui.panels.one_robot_panel import OneRobotPanel
from app.ui.panels.robot.room_view import RoomView
from app.ui.panels.robot.say_bar import SayBar
from app.ui.text import plain
from app.ui.widgets import Chip, EmptyAction, EmptyState, IconButton
from app.ui.widgets.indicators import ROBOT_STATUS
from app.ui.widgets.menus import Menu, drop_below
from nep.i18n import _, lazy

if TYPE_CHECKING:
    from app.core.robots.robot_link import RobotLink

STALE_AFTER_S = 2.0
"""A virtual robot tells how it is many times a second, also when it does nothing."""


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
        self.say = SayBar(self.theme, self._awaited)
        self.say.said.connect(lambda words: self._change({"say": words}))
        self.say.happened.connect(self._change)
        stage = QWidget()
        column = QVBoxLayout(stage)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(self.view, 1)
        column.addWidget(self.say)
        self.stage = stage
        title = _("No robot is connected")
        text = _("With the virtual robot you can try everything at once.")
        start = EmptyAction(_("Use the virtual robot"), lambda: self.context.run("robots.virtual"), "bot")
        self.empty = EmptyState(self.theme, "bot", title, text, [start])
        self._no_robot = NoRobot(self.empty, title, text, [start])
        self.pages = self.show_one_of(self.empty, self.stage)

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
            self.pages.setCurrentWidget(self.stage)

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
        self.say.show_robot(link.robot)
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

    def _awaited(self, event: Event, name: str) -> Sequence[str]:
        """What the open behaviours wait for, that which shows first."""
        link, shown = self.session.fleet.link(self._robot), self.session.document
        if link is None:
            return ()
        documents = [shown, *(each for each in self.session.documents if each is not shown)]
        return awaited_values((each.workspace for each in documents), link.robot, event, name)

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
