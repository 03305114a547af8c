"""Camera: what the robot sees, with boxes around what it recognises."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from PySide6.QtWidgets import QStackedWidget, QVBoxLayout

from app.ui.panels.base import Panel, PanelContext, PanelWidget
from app.ui.pictures.boxes import boxes_on, camera_of
from app.ui.pictures.view import SILENT_AFTER_S, PictureView, rate_sentence
from app.ui.text.numbers import age_words
from app.ui.widgets import Chip, Elided, EmptyAction, EmptyState

if TYPE_CHECKING:
    from app.core.messages.image_streams import ImageStream
    from app.core.network.watches import Look, Watch
    from app.core.robots.robot_link import RobotLink


class CameraPanel(PanelWidget):
    """The camera of the robot that was chosen, or of the first one that has a camera."""

    shows_pictures = True

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, "Camera")
        self._robot = ""
        self._topic = ""
        self._stream: ImageStream | None = None
        self._watch: Watch | None = None
        self._revision = -1
        self.rate = Elided("body", "textSecondary", least=60)
        self.header = [self.rate]
        self.chip = Chip(self.theme)
        self.chips = [self.chip]
        self.view = PictureView(self.theme, fill=True, labelled=False)
        self.view.setAccessibleName("What the robot sees")
        self.empty = EmptyState(
            self.theme,
            "camera",
            "No pictures yet",
            "Pictures appear here as soon as a robot with a camera is there.",
        )
        self.empty.set_actions(
            [EmptyAction("Use the virtual robot", lambda: context.run("robots.virtual"), "bot")]
        )
        self.pages = QStackedWidget()
        self.pages.addWidget(self.empty)
        self.pages.addWidget(self.view)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.pages)

    def refresh(self) -> None:
        fleet = self.session.fleet
        if fleet.revision != self._revision:
            self._revision = fleet.revision
            self._choose(next((link for link in self._robots() if camera_of(link) is not None), None))
        link = fleet.link(self._robot) if self._robot else None
        if self._stream is None or link is None:
            return
        self.view.take(self._stream, boxes_on(link, self._topic))
        silent_s = self._stream.silent_s
        silent = silent_s is not None and silent_s > SILENT_AFTER_S
        sentence = rate_sentence(self._stream.shown_hz, self._stream.arriving_hz)
        self.rate.setText("" if silent else sentence)
        self.chip.set(f"silent for {age_words(silent_s)}" if silent else "", "error")
        if self._stream.picture is not None:
            self.pages.setCurrentWidget(self.view)

    def _robots(self) -> Sequence[RobotLink]:
        """Those that are there, the one that a person chose to see first."""
        fleet = self.session.fleet
        shown = fleet.shown
        return [shown, *fleet.connected] if shown is not None and shown.connected else fleet.connected

    def _choose(self, link: RobotLink | None) -> None:
        camera = camera_of(link) if link is not None else None
        if link is None or camera is None:
            return  # the last picture of a robot that has gone stays, grey
        if (link.name, camera.topic) == (self._robot, self._topic) and self._stream is not None:
            return
        self.shut()
        self._robot, self._topic = link.name, camera.topic
        self._stream = self.session.images.stream(camera.topic)
        self._watch = self.session.fleet.look_at(link.name)
        self.view.clear()
        self.set_title("Camera", camera.topic)
        self.empty.say("No pictures yet", f"The next picture of {link.name} appears here.")
        self.empty.set_actions([])
        self.pages.setCurrentWidget(self.empty)

    def looks(self) -> Iterable[Look | None]:
        return (self._stream, self._watch)

    def shut(self) -> None:
        if self._stream is not None:
            self._stream.close()
        if self._watch is not None:
            self._watch.close()
        self._stream = self._watch = None
        self._revision = -1


PANEL = Panel("camera", "Camera", "camera", (), CameraPanel)
