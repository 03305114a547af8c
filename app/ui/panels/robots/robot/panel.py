"""Robot panel: a virtual robot in its room, with speech and simulated events."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import QVBoxLayout, QWidget

from app.core.robots.awaited_values import awaited_values
from app.errors import SettingsError, UnknownRobotError
from app.robots.description.description import Event
from app.robots.virtual.room import Ball, Box, Room
from app.robots.virtual.room_map import kind_of
from app.ui.intents import OpenPanel, RemoveVirtualRobot
from app.ui.panels.base import Panel, PanelContext
from app.ui.panels.command import Command
from app.ui.panels.home import RowHome, TabHome
from app.ui.panels.no_robot import NoRobotController
from app.ui.panels.one_robot_panel import OneRobotPanel
from app.ui.panels.robots.robot.large_room import LargeRoom
from app.ui.panels.robots.robot.room_view import RoomView
from app.ui.panels.robots.robot.say_bar import SayBar
from app.ui.robot_drawing.figure import figure_of
from app.ui.robot_drawing.state import RobotState, Thing
from app.ui.text import plain
from app.ui.widgets import Chip, EmptyAction, EmptyState, IconButton
from app.ui.widgets.indicators import STATUS_BY_ROBOT_STATE
from app.ui.widgets.menus import Menu, open_below
from nep.i18n import _, lazy

if TYPE_CHECKING:
    from app.core.network.watches import Suspendable, Watch
    from app.core.robots.robot_link import RobotLink

STALE_AFTER_S = 2.0
"""Time in s without a state message after which the drawing is stale.

Virtual robots publish their state many times a second.
"""


ADDABLE_THINGS = {
    "ball": (lazy("Add a ball"), "circle"),
    "person": (lazy("Add a person"), "person-standing"),
    "marker": (lazy("Add a marker"), "qr-code"),
    "table": (lazy("Add a table"), "lamp-desk"),
    "shelf": (lazy("Add a shelf"), "library"),
}


def things_of(room: Room) -> tuple[Thing, ...]:
    """Convert the things in a room to things of the drawing."""
    return tuple(
        Thing(
            kind_of(thing), thing.x, thing.y, thing.name,
            colour=thing.colour if isinstance(thing, Ball) else None,
            size_m=thing.radius if isinstance(thing, Ball) else None,
            height_m=thing.height if isinstance(thing, Box) else None,
        )
        for thing in room.things
    )  # fmt: skip


def radius_of(robot: RobotState) -> float:
    """Return the radius of a robot's footprint in m."""
    return figure_of(robot).radius_m


class RobotPanel(OneRobotPanel):
    """Panel with a virtual robot in its room; the title is the robot's name."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, _("Robot"))
        self._last_drawing: Mapping[str, object] | None = None
        self._last_drawing_s = 0.0
        self.chip = Chip(self.theme)
        self.add_button, self.reset_button = self._make_room_tools(size=30)
        self.reset_button.setVisible(False)
        self.choose_button = IconButton(self.theme, "chevron-down", _("Choose a robot"), size=26)
        self.choose_button.setProperty("place", "start")
        self.choose_button.clicked.connect(self._show_menu)
        self.choose_button.setVisible(False)
        self.chips = [self.choose_button, self.chip]
        self.add_button.setVisible(False)
        self.enlarge_button = IconButton(self.theme, "maximize-2", _("Large room"), size=30)
        self.enlarge_button.clicked.connect(self.toggle_enlarged)
        self.enlarge_button.setVisible(False)
        self.header = [self.add_button, self.reset_button, self.enlarge_button]
        self._make_stage()
        title = _("No robot is connected")
        text = _("With a virtual robot you can try everything right away.")
        start_action = EmptyAction(
            _("Use the virtual robot"), lambda: self.context.run("robots.virtual"), "bot"
        )
        self.empty = EmptyState(self.theme, "bot", title, text, [start_action])
        self._no_robot = NoRobotController(self.empty, title, text, [start_action])
        self._no_robot.set_starting(self.session.starting_robots)
        self.pages = self.make_page_stack(self.empty, self.stage)

    def _make_room_tools(self, size: int) -> tuple[IconButton, IconButton]:
        # Called once for the title bar and once for the enlarged room.
        add_button = IconButton(self.theme, "plus", _("Add something to the room"), size=size)
        add_button.clicked.connect(lambda: self._show_room_menu("", None, add_button))
        reset_button = IconButton(self.theme, "rotate-cw", _("Reset the robot and its room"), size=size)
        reset_button.clicked.connect(self._reset_room)
        return add_button, reset_button

    def _make_stage(self) -> None:
        # The drawing and the bar below it.
        self.view = RoomView(self.theme)
        view = self.view
        view.touched.connect(
            lambda name, part, is_pressed: self._change_world({"touch": part, "down": is_pressed}, name)
        )
        view.moved.connect(self._move_thing)
        view.robot_moved.connect(
            lambda name, x, y: self._change_world({"move": "robot", "x": round(x, 3), "y": round(y, 3)}, name)
        )
        view.robot_lifted.connect(lambda name, is_lifted: self._change_world({"hold": is_lifted}, name))
        view.bumper_pressed.connect(
            lambda name, side: self._change_world({"happen": "bump", "side": side}, name)
        )
        view.removed.connect(self.session.room.remove)
        view.menu_requested.connect(self._show_room_menu)
        view.enlarge_requested.connect(self.toggle_enlarged)
        self.say_bar = SayBar(self.theme, self._awaited_values)
        self.say_bar.speech_submitted.connect(lambda words: self._change_world({"say": words}))
        self.say_bar.event_simulated.connect(self._change_world)
        stage = QWidget()
        column = QVBoxLayout(stage)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(self.view, 1)
        column.addWidget(self.say_bar)
        self.stage = stage
        self.sound_button = IconButton(self.theme, "volume-2", _("Unmute the robots"), size=26)
        self.sound_button.clicked.connect(self._toggle_sound)
        self.say_bar.add(self.sound_button)
        self._shown_sound_state: object = None
        self._update_sound_button()
        self._large_room: LargeRoom | None = None
        self._cached_things: tuple[int, tuple[Thing, ...]] = (-1, ())
        self._sensor_watches: dict[str, Watch] = {}

    def fleet_changed(self) -> None:
        self.choose_button.setVisible(bool(self.session.fleet.links))

    def refresh_robot(self, link: RobotLink | None) -> None:
        if link is None:
            self._no_robot.set_starting(self.session.starting_robots)
            return
        self._update_sound_button()
        if self._large_room is not None:
            self._large_room.raise_()  # a panel raised in its tab group would cover it
        self.chip.set(link.chip_text, STATUS_BY_ROBOT_STATE[link.state])
        if link.drawing is not None:
            now = time.monotonic()
            if link.drawing is not self._last_drawing:
                self._last_drawing, self._last_drawing_s = link.drawing, now
            self._show_room(link)
            self.view.set_caption(self._speech_caption())
            self.view.set_stale(
                not link.is_connected or link.is_unresponsive or now - self._last_drawing_s > STALE_AFTER_S
            )
            if self._large_room is None:
                self.pages.setCurrentWidget(self.stage)

    def _show_menu(self) -> None:
        menu = Menu(self.theme, self)
        for link in self.session.fleet.links:
            action = menu.addAction(plain.escape_menu_text(link.name))
            action.setCheckable(True)
            action.setChecked(link.name == self._robot)
            action.triggered.connect(lambda _on=False, name=link.name: self.session.fleet.select(name))
        if self._robot in self.session.launcher.models_by_name:
            menu.addSeparator()
            remove_action = menu.addAction(
                plain.escape_menu_text(_("Remove {robot}").format(robot=self._robot))
            )
            remove_action.triggered.connect(
                lambda _on=False, name=self._robot: self.context.request(RemoveVirtualRobot(name))
            )
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        open_below(menu, self.choose_button)

    def show_robot(self, link: RobotLink) -> None:
        self.set_title(link.name)
        for button in (self.reset_button, self.add_button, self.enlarge_button):
            button.setVisible(link.is_virtual)
        self.view.robot_name = link.name
        self.say_bar.show_robot(link.robot)
        self._update_empty_state(link)

    def _update_empty_state(self, link: RobotLink) -> None:
        self.pages.setCurrentWidget(self.empty)
        if link.is_virtual:
            title = _("{robot} is starting").format(robot=link.name)
            self.empty.set_texts(title, _("The robot appears as soon as it reports its position."))
            self.empty.set_actions([])
        else:
            self.empty.set_texts(link.name, _hint_text(link))
            show_action = EmptyAction(
                _("Show actions"), lambda: self.context.request(OpenPanel("robots")), "bot"
            )
            self.empty.set_actions([show_action])

    def _awaited_values(self, event: Event, name: str) -> Sequence[str]:
        # Values used in the active behaviour come first.
        link, active = self.session.fleet.link(self._robot), self.session.document
        if link is None:
            return ()
        projects = [active, *(each for each in self.session.documents if each is not active)]
        return awaited_values((each.workspace for each in projects), link.robot, event, name)

    def _toggle_sound(self) -> None:
        # Speech bubbles are shown even if speech is off.
        with suppress(SettingsError):
            settings = self.session.settings
            settings.is_robot_sound_on = not settings.is_robot_sound_on
        self._update_sound_button()

    def _update_sound_button(self) -> None:
        # The reason is shown if speech is on but does not work.
        is_on, problem = self.session.voices.is_on, self.session.voices.problem
        if (is_on, problem) == self._shown_sound_state:
            return
        self._shown_sound_state = (is_on, problem)
        self.sound_button.set_icon("volume-2" if is_on and not problem else "volume-x")
        text = _("Mute the robots") if is_on else _("Unmute the robots")
        self.sound_button.set_name(text)
        self.sound_button.setAccessibleDescription(problem if is_on else "")
        if is_on and problem:
            self.sound_button.setToolTip(plain.tip(f"{text}\n{problem}"))

    # -- room ---------------------------------------------------------------------------------------------

    def _show_room(self, link: RobotLink) -> None:
        # The main robot, others in the same room, and things.
        drawing = link.drawing or {}
        if not RobotState.parse(drawing).is_room_shared:
            self.view.show_state(drawing)
            return
        room = self.session.room
        if self._cached_things[0] != room.revision:
            self._cached_things = (room.revision, things_of(room.room))
        others = [
            (other.name, other.drawing)
            for other in self._watch_other_robots(link)
            if other.drawing is not None
            and not other.is_unresponsive
            and RobotState.parse(other.drawing).is_room_shared
        ]
        self.view.show_state(drawing, others, self._cached_things[1])

    def _speech_caption(self) -> str:
        # Caption of speech that is still playing after its bubble disappeared, or of words that a robot
        # heard.
        speech = self.session.voices.current
        robots = [(self._robot, self.view.state), *self.view.others]
        if speech is not None and speech.text not in {state.speech for _name, state in robots}:
            return f"{speech.robot}: {speech.text}"
        heard_texts = [(name, state.heard_text) for name, state in robots if state.heard_text]
        return (
            _("{robot} heard “{words}”").format(robot=heard_texts[0][0], words=heard_texts[0][1])
            if heard_texts
            else ""
        )

    def _watch_other_robots(self, link: RobotLink) -> list[RobotLink]:
        # Every other virtual robot is watched while the panel is visible.
        fleet = self.session.fleet
        other_links = [each for each in fleet.connected if each.is_virtual and each.name != link.name]
        names = {each.name for each in other_links}
        for name in self._sensor_watches.keys() - names:
            self._sensor_watches.pop(name).close()
        for name in names - self._sensor_watches.keys():
            self._sensor_watches[name] = fleet.watch_sensors(name)
        return other_links

    def _move_thing(self, name: str, x: float, y: float) -> None:
        if self.view.state.is_room_shared:
            states = [self.view.state, *(state for _name, state in self.view.others)]
            robots = {str(index): (each.x, each.y, radius_of(each)) for index, each in enumerate(states)}
            self.session.room.move(name, x, y, robots)
        else:
            self._change_world({"move": name, "x": round(x, 3), "y": round(y, 3)})

    def _reset_room(self) -> None:
        # Resets robots and room.
        self.session.room.reset()
        for name in ("", *(name for name, _state in self.view.others)):
            self._change_world({"reset": True}, name)

    def _show_room_menu(self, thing: str, position: QPoint | None, button: QWidget | None = None) -> None:
        # Opens at a position (context menu), or below a button.
        menu = Menu(self.theme, self)
        if thing:
            text = plain.escape_menu_text(_("Remove {thing}").format(thing=thing))
            action = menu.addAction(self.theme.icon("trash-2"), text)
            action.triggered.connect(lambda: self.session.room.remove(thing))
            menu.addSeparator()
        if self.view.state.is_room_shared:
            for kind, (text, icon) in ADDABLE_THINGS.items():
                action = menu.addAction(self.theme.icon(icon), _(text))
                action.triggered.connect(lambda _on=False, kind=kind: self._add_thing(kind))
            menu.addSeparator()
        menu.addAction(self.theme.icon("rotate-cw"), _("Reset room")).triggered.connect(self._reset_room)
        reset_action = menu.addAction(_("Reset robots to their start position before each run"))
        reset_action.setCheckable(True)
        reset_action.setChecked(self.session.fleet.resets_at_start)
        reset_action.triggered.connect(lambda: self.context.run("run.from_start"))
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        if position is None:
            open_below(menu, button or self.add_button)
        else:
            menu.popup(position)

    def _add_thing(self, kind: str) -> None:
        # Adds a thing at a free place in front of the first robot.
        state = self.view.state
        room = self.session.room.room
        radius = {"ball": 0.3, "person": 0.4, "marker": 0.3}.get(kind, 0.8)
        x, y = room.nearest_free(state.x + 1.0, state.y + 0.9, radius)
        name = self.session.room.add(kind, x, y)
        if name is None:
            self.context.show_toast(_("The room is full. Remove something first"))
        else:
            self.view.selected_item = name

    # -- enlarged room ------------------------------------------------------------------------------------

    def toggle_enlarged(self) -> None:
        """Show or hide the enlarged room."""
        if self._large_room is not None:
            self._large_room.dispose()
            return
        self._large_room = LargeRoom(self.theme, self, self.stage, self._make_room_tools(size=26))
        self._large_room.closed.connect(self._restore_stage)
        self.context.focus_question()  # the question lies above the room
        self.enlarge_button.set_icon("minimize-2")

    def toggle_full_screen(self) -> None:
        """Show or hide the room in full screen mode, with the run bar above it."""
        if self._large_room is not None and self._large_room.is_full_screen:
            self._large_room.dispose()
            return
        if self._large_room is None:
            self.toggle_enlarged()
        if self._large_room is not None:
            self._large_room.toggle_full_screen()

    def _restore_stage(self) -> None:
        self._large_room = None
        self.pages.insertWidget(1, self.stage)
        self.pages.setCurrentWidget(self.stage)
        self.enlarge_button.set_icon("maximize-2")
        self.view.setFocus(Qt.FocusReason.OtherFocusReason)

    def _change_world(self, change: Mapping[str, object], robot: str = "") -> None:
        if robot or self._robot:
            with suppress(UnknownRobotError):
                self.session.fleet.change_world(robot or self._robot, change)

    def suspendables(self) -> Iterable[Suspendable | None]:
        return (*super().suspendables(), *self._sensor_watches.values())

    def dispose(self) -> None:
        super().dispose()
        for watch in self._sensor_watches.values():
            watch.close()
        self._sensor_watches.clear()

    def resume(self) -> None:
        if self._watch is not None and self._watch.is_suspended:
            # the watch was suspended, so the age of the state is unknown rather than stale
            self._last_drawing_s = time.monotonic()
        super().resume()


def _hint_text(link: RobotLink) -> str:
    # Mentions only parts that the robot has.
    image_flags = [sensor.is_image for sensor in link.robot.sensors]
    if True in image_flags and False in image_flags:
        return _("Use its camera and sensors to see its state.")
    if True in image_flags:
        return _("Use its camera to see its state.")
    if image_flags:
        return _("Use its sensors to see its state.")
    return _("This robot reports no state, but you can try its actions.")


def _room_disabled_reason(context: PanelContext) -> str:
    has_virtual_robot = any(link.is_virtual for link in context.session.fleet.connected)
    return "" if has_virtual_robot else _("No virtual robots")


PANEL = Panel(
    "robot",
    lazy("Robot"),
    "bot",
    (),
    RobotPanel,
    home=(RowHome("behaviour", 1, 0, 327), TabHome("developer", "image")),
    commands=(
        Command(
            "robots.room",
            lazy("Room in full screen"),
            RobotPanel.toggle_full_screen,
            "Robots",
            ("F11",),
            "fullscreen",
            disabled_reason=_room_disabled_reason,
            after="robots.end_virtual",
        ),
    ),
)
