"""Image: the pictures of one topic at their own aspect, and how many of them are shown."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QStackedWidget, QVBoxLayout

from app.ui.panels.base import Panel, PanelContext, PanelWidget
from app.ui.picture_view import PictureView
from app.ui.robot_boxes import boxes_on, owner_of
from app.ui.widgets import EmptyState, IconButton
from app.ui.widgets.menus import Menu, drop_below

if TYPE_CHECKING:
    from app.core.images import ImageStream
    from app.core.watches import Watch

CODEC = "image"


class ImagePanel(PanelWidget):
    """One picture stream; the first one that there is, until a person chooses another in the title."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, "Image")
        self._topic = ""
        self._stream: ImageStream | None = None
        self._watch: Watch | None = None
        self._watched_robot = ""
        self._revision = -1
        self.choose = IconButton(self.theme, "chevron-down", "Choose a picture topic", size=26)
        self.choose.setProperty("place", "start")
        self.choose.clicked.connect(self._show_menu)
        self.chips = [self.choose]
        self.view = PictureView(self.theme)
        self.view.setAccessibleName("Picture")
        self.empty = EmptyState(self.theme, "image", "", "")
        self.pages = QStackedWidget()
        self.pages.addWidget(self.empty)
        self.pages.addWidget(self.view)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.pages)
        self._say_nothing()

    def topics(self) -> list[str]:
        """The picture topics that there are now."""
        return [topic.name for topic in self.session.topics if topic.codec == CODEC and topic.gone_s is None]

    def show_topic(self, name: str) -> None:
        """Look at another topic."""
        if name == self._topic and self._stream is not None:
            return
        self.shut()
        self._topic = name
        self.view.clear()
        self.set_title("Image", name)
        if name:
            self._stream = self.session.images.stream(name)
            self.session.topics.mark_seen(name)
        self._say_nothing()

    def refresh(self) -> None:
        if self.session.topics.revision != self._revision:
            self._revision = self.session.topics.revision
            there = self.topics()
            self.choose.setVisible(bool(there))
            if not self._topic and there:
                self.show_topic(there[0])
        if self._stream is None:
            return
        self._look_at_robot()
        link = self.session.fleet.link(self._watched_robot) if self._watched_robot else None
        self.view.take(self._stream, boxes_on(link, self._topic) if link is not None else ())
        if self._stream.picture is not None:
            self.pages.setCurrentWidget(self.view)
        elif self._stream.error:
            self.empty.say("This can't be shown as a picture", f"{self._stream.error}.")

    def _look_at_robot(self) -> None:
        link = owner_of(self.session, self._topic)
        name = link.name if link is not None else ""
        if name != self._watched_robot:
            self._leave_robot()
            self._watched_robot = name
            if name:
                self._watch = self.session.fleet.look_at(name)

    def _say_nothing(self) -> None:
        if self._topic:
            self.empty.say("No pictures yet", f"The next picture on {self._topic} appears here.")
        else:
            self.empty.say("No pictures yet", "Pictures appear here as soon as a camera publishes them.")
        self.pages.setCurrentWidget(self.empty)

    def _show_menu(self) -> None:
        menu = Menu(self.theme, self)
        for name in self.topics():
            action = menu.addAction(name)
            action.setCheckable(True)
            action.setChecked(name == self._topic)
            action.triggered.connect(lambda _on=False, name=name: self.show_topic(name))
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        drop_below(menu, self.choose)

    def more_actions(self) -> list[QAction]:
        inspect = QAction(self.theme.icon("list-tree"), "Show in the inspector", self)
        inspect.setEnabled(bool(self._topic))
        inspect.triggered.connect(lambda: self.context.run("panel.inspector"))
        return [inspect]

    def save_state(self) -> dict[str, object]:
        return {"topic": self._topic}

    def restore_state(self, state: Mapping[str, object]) -> None:
        topic = state.get("topic")
        if isinstance(topic, str) and topic:
            self.show_topic(topic)

    def _leave_robot(self) -> None:
        if self._watch is not None:
            self._watch.close()
        self._watch, self._watched_robot = None, ""

    def shut(self) -> None:
        self._leave_robot()
        if self._stream is not None:
            self._stream.close()
            self._stream = None


PANEL = Panel("image", "Image", "image", (CODEC,), ImagePanel)
