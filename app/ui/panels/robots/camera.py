"""Camera panel: images of the robot's camera with boxes around detected objects."""

from __future__ import annotations

import time
from collections.abc import Iterable
from operator import is_
from typing import TYPE_CHECKING

from PySide6.QtCore import QSize

from app.ui.panels.base import Panel, PanelContext
from app.ui.panels.home import RowHome, TabHome
from app.ui.panels.no_robot import NoRobotController
from app.ui.panels.one_robot_panel import OneRobotPanel
from app.ui.pictures.boxes import boxes_in_camera, camera_of
from app.ui.pictures.view import STALE_AFTER_S, PictureView, RateText
from app.ui.text.numbers import age_text
from app.ui.widgets import Chip, EmptyAction, EmptyState, SteadyLabel
from nep.i18n import _, lazy

if TYPE_CHECKING:
    from app.core.messages.image_streams import ImageStream
    from app.core.network.watches import Suspendable
    from app.core.robots.robot_link import RobotLink

REFRESH_INTERVAL_S = 0.1
"""Interval in s between updates without a new image or detection, for example of the frame rate."""


class CameraPanel(OneRobotPanel):
    """Panel with the camera of the selected robot, or of the first robot that has a camera."""

    shows_video = True

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, _("Camera"))
        self._topic = ""
        self._stream: ImageStream | None = None
        # has a fixed width: the topic next to it is elided instead
        self.rate_label = SteadyLabel("body", "textSecondary", min_width=110)
        self.header = [self.rate_label]
        self._rates = RateText()
        self._detection_names: tuple[str, ...] = ()
        self._last_snapshot: tuple[object, ...] = ()
        self._last_size = QSize()
        self._next_update_s = 0.0
        self.chip = Chip(self.theme)
        self.chips = [self.chip]
        self.view = PictureView(self.theme, fills_view=True, has_label=False)
        self.view.setAccessibleName(_("Robot camera"))
        title, text = (
            _("No images yet"),
            _("Images appear here as soon as a robot with a camera is connected."),
        )
        start_action = EmptyAction(_("Use the virtual robot"), lambda: context.run("robots.virtual"), "bot")
        self.empty = EmptyState(self.theme, "camera", title, text, [start_action])
        self._no_robot = NoRobotController(self.empty, title, text, [start_action])
        self._no_robot.set_starting(self.session.starting_robots)
        self.pages = self.make_page_stack(self.empty, self.view)

    def refresh_robot(self, link: RobotLink | None) -> None:
        if link is None:
            self._no_robot.set_starting(self.session.starting_robots)
        if self._stream is None or link is None:
            return
        silent_s = self._stream.silent_s
        snapshot, size, now = self._snapshot(link, silent_s), self.view.size(), time.monotonic()
        if (
            now < self._next_update_s
            and size == self._last_size
            and len(snapshot) == len(self._last_snapshot)
            and all(map(is_, snapshot, self._last_snapshot))
        ):
            return  # called 60 times a second, mostly without a new image
        self.view.show_image(self._stream, boxes_in_camera(link, self._topic))
        is_silent = silent_s is not None and silent_s > STALE_AFTER_S
        rate_text = self._rates.for_stream(self._stream)
        self.rate_label.setText("" if is_silent else rate_text)
        self.chip.set(_("silent for {age}").format(age=age_text(silent_s)) if is_silent else "", "error")
        if self._stream.picture is not None:
            self.pages.setCurrentWidget(self.view)
        self._last_snapshot, self._last_size, self._next_update_s = snapshot, size, now + REFRESH_INTERVAL_S

    def _snapshot(self, link: RobotLink, silent_s: float | None) -> tuple[object, ...]:
        # Unchanged items must be the identical objects of the last call.
        detections = (link.values.get(name) for name in self._detection_names)
        picture = self._stream.picture if self._stream is not None else None
        return (picture, None if silent_s is None else int(silent_s * 2), *detections)

    def robot_to_show(self) -> RobotLink | None:
        """Return the selected robot if it has a camera, else the first connected one with a camera.

        Return None if no connected robot has a camera.
        """
        fleet = self.session.fleet
        current = fleet.current
        candidates = (
            [current, *fleet.connected] if current is not None and current.is_connected else fleet.connected
        )
        return next((link for link in candidates if camera_of(link) is not None), None)

    def rebuild_key(self, link: RobotLink) -> object:
        return (link.name, _topic_of(link))

    def show_robot(self, link: RobotLink) -> None:
        self._topic = _topic_of(link)
        self._detection_names = tuple(each.name for each in link.robot.sensors if each.kind == "detections")
        self._last_snapshot = ()
        self._stream = self.session.live.images.stream(self._topic)
        self.view.clear()
        self._rates.clear()
        self.set_title(_("Camera"), self._topic)
        hint = _("The next image from {robot} appears here.").format(robot=link.name)
        self.empty.set_texts(_("No images yet"), hint)
        self.empty.set_actions([])
        self.pages.setCurrentWidget(self.empty)

    def suspendables(self) -> Iterable[Suspendable | None]:
        return (self._stream, self._watch)

    def dispose(self) -> None:
        super().dispose()
        if self._stream is not None:
            self._stream.close()
            self._stream = None


def _topic_of(link: RobotLink) -> str:
    camera = camera_of(link)
    return camera.topic if camera is not None else ""


PANEL = Panel(
    "camera",
    lazy("Camera"),
    "camera",
    (),
    CameraPanel,
    home=(RowHome("behaviour", 1, 1, 275), TabHome("developer", "image")),
)
