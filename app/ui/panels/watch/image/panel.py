"""Image panel: images of one topic in their aspect ratio, with the frame rate."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QPoint, Qt, QUrl
from PySide6.QtGui import QAction, QGuiApplication, QImage, QKeySequence, QResizeEvent
from PySide6.QtWidgets import QAbstractButton, QVBoxLayout, QWidget

from app.core.messages.image_style import PLAIN, PictureStyle, parse_style
from app.core.networks.networks import topic_label
from app.intents import Inspect, ShowConsole
from app.ui.intents import ExportRecording, RecordTopic
from app.ui.other_programs import open_externally
from app.ui.panels.base import Blocker, Panel, PanelContext, PanelWidget, paused_blocker
from app.ui.panels.home import RowHome, TabHome
from app.ui.panels.watch.image.actions import PictureActions
from app.ui.panels.watch.image.overlays import Overlays
from app.ui.panels.watch.image.point_bar import PointBar
from app.ui.panels.watch.image.snapshot import SnapshotJob
from app.ui.panels.watch.image.style_bar import StyleBar
from app.ui.pictures.boxes import boxes_in_camera, robot_of_camera
from app.ui.pictures.clicks import ClickablePicture
from app.ui.pictures.placement import PicturePlacement
from app.ui.text import plain
from app.ui.widgets import EmptyAction, EmptyState, IconButton
from app.ui.widgets.menus import Menu, open_below
from nep.i18n import _, lazy

if TYPE_CHECKING:
    from app.core.messages.image_streams import ImageStream
    from app.core.network.watches import Suspendable, Watch
    from nep.messages.message import Message

CODEC = "image"
ALL_BUTTONS_WIDTH = 320
MAX_SAVED_VIEWS = 200


class ImagePanel(PanelWidget):
    """Panel with the images of one topic: the first available one until the user selects another."""

    shows_video = True

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, _("Image"))
        self._topic = ""
        self._stream: ImageStream | None = None
        self._watch: Watch | None = None
        self._watched_robot = ""
        self._placements: dict[str, PicturePlacement] = {}
        self._styles: dict[str, PictureStyle] = {}
        self.overlays = Overlays(self.session)
        self._revision = (-1, -1)
        self._has_image: bool | None = None
        self.choose_button = IconButton(self.theme, "chevron-down", _("Choose an image topic"), size=26)
        self.choose_button.setProperty("place", "start")
        self.choose_button.clicked.connect(self._show_menu)
        self.chips = [self.choose_button]
        self.view = ClickablePicture(self.theme)
        self.view.setAccessibleName(_("Image"))
        self.view.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.view.customContextMenuRequested.connect(self._show_actions)
        self._make_actions()
        self.empty = EmptyState(self.theme, "image", "", "")
        self.pages = self.make_page_stack(self.empty, self._make_content())
        self.setFocusProxy(self.view)
        self._update_empty_state()

    def _make_content(self) -> QWidget:
        self.style_bar = StyleBar(self.theme, lambda: self.view.picture)
        self.style_bar.changed.connect(self._set_picture_style)
        self.style_bar.hide()
        self.style_button.toggled.connect(self.style_bar.setVisible)
        self.point_bar = PointBar(self.context, self.view)
        self.point_bar.exited.connect(lambda: self._publish_points(is_active=False))
        self.view.clicked.connect(self.point_bar.send)
        self.content = QWidget()
        column = QVBoxLayout(self.content)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(self.point_bar)
        column.addWidget(self.view, 1)
        column.addWidget(self.style_bar)
        return self.content

    def _set_picture_style(self, style: object) -> None:
        if isinstance(style, PictureStyle):
            self._styles[self._topic] = style
            if self._stream is not None:
                self._stream.set_style(style)

    def _make_actions(self) -> None:
        own_callbacks = {
            "freeze": self._toggle_freeze,
            "save": self.save_image,
            "copy": self.copy_image,
            "point": lambda: self._publish_points(is_active=not self.point_bar.is_on),
        }
        self.actions_of = PictureActions(self.theme, self.view, own_callbacks)
        self._inspect_action = QAction(self.theme.icon("list-tree"), _("Open in the Inspector"), self)
        self._inspect_action.triggered.connect(self._inspect)
        self._sequence_action = QAction(self.theme.icon("film"), _("Record a sequence"), self)
        self._sequence_action.triggered.connect(self.save_sequence)
        self._separator = QAction(self)
        self._separator.setSeparator(True)
        self.job = SnapshotJob(self, lambda: self.session.settings.pictures_folder)
        self.job.saved.connect(self._on_saved)
        self.job.copied.connect(self._on_copied)
        self.job.failed.connect(self._on_failed)
        self.fit_button = IconButton(self.theme, "maximize", _("Fit image"), "0", size=26)
        self.freeze = IconButton(
            self.theme, "snowflake", _("Freeze this image"), "Space", checkable=True, size=26
        )
        self.save_button = IconButton(self.theme, "download", _("Save as PNG"), "S", size=26)
        self.fit_button.clicked.connect(self.view.fit_to_view)
        self.freeze.toggled.connect(self._set_frozen)
        self.save_button.clicked.connect(self.save_image)
        style_name = _("Brightness, contrast and colours")
        self.style_button: IconButton = IconButton(
            self.theme, "sliders-horizontal", style_name, checkable=True, size=26
        )
        self.layers_button = IconButton(self.theme, "layers", _("Annotations from messages"), size=26)
        self.layers_button.clicked.connect(self._show_layers)
        self.header = [self.fit_button, self.style_button, self.layers_button, self.freeze, self.save_button]

    def topics(self) -> list[str]:
        """Return the keys of the available image topics: first Studio's own network, then other networks."""
        all_topics = self.world.all_topics
        return [topic.key for topic in all_topics if topic.codec == CODEC and topic.gone_s is None]

    def show_topic(self, name: str) -> None:
        """Switch to another topic, or to none if the name is empty."""
        if name == self._topic and self._stream is not None:
            return
        self._close_stream()
        if name != self._topic:
            self._restore_view_of(name)
        self._topic = name
        self.view.clear()
        self.point_bar.set_image_topic(name)
        self.freeze.setChecked(False)
        self.set_title(_("Image"), topic_label(name))
        if name:
            self._stream = self.world.images.stream(name)
            self._stream.set_style(self._styles.get(name, PLAIN))
            self.style_bar.show_style(self._styles.get(name, PLAIN))
            self.world.mark_seen(name)
        self._update_empty_state()

    def source_changed(self) -> None:
        topic = self._topic
        self._close_stream()
        self._stream, self._revision = None, (-1, -1)
        self.overlays.restart()
        is_replaying = self.session.replay is not None  # Space plays and pauses the replay in this case
        self.actions_of["freeze"].setShortcut(
            QKeySequence() if is_replaying else QKeySequence(Qt.Key.Key_Space)
        )
        if topic:
            self.show_topic(topic)

    def _restore_view_of(self, topic: str) -> None:
        # Zoom, rotation and image settings are remembered per topic.
        if len(self._placements) >= MAX_SAVED_VIEWS:
            self._placements.clear()
            self._styles.clear()
        self.view.placement = self._placements.setdefault(topic, PicturePlacement())
        self.actions_of.update_checks()

    def refresh(self) -> None:
        revision = self.world.topics.revision, self.world.networks.revision
        if revision != self._revision:
            self._revision = revision
            topics = self.topics()
            self.choose_button.setVisible(bool(topics))
            if not self._topic and topics:
                self.show_topic(topics[0])
        self.point_bar.refresh()
        if self._stream is None:
            return
        self._watch_robot()
        link = self.session.fleet.link(self._watched_robot) if self._watched_robot else None
        boxes = boxes_in_camera(link, self._topic) if link is not None else ()
        self.view.show_image(self._stream, boxes, self.overlays.annotations_for)
        self.style_bar.refresh()
        if self._stream.picture is not None:
            self._show_page(has_image=True)
        elif self._stream.error:
            self.empty.set_texts(
                _("Can't show the message as an image"), f"{self._stream.error}.", "circle-x"
            )
            open_message = EmptyAction(_("Open the message"), self._inspect, "list-tree")
            self.empty.set_actions([open_message, self.doctor_action(self._topic)])
        # the playhead is before the topic's first image
        elif not self.world.is_live and self._has_image:
            self.view.clear()
            self._update_empty_state()

    def _watch_robot(self) -> None:
        # live detections don't belong on recorded images
        link = robot_of_camera(self.session, self._topic) if self.world.is_live else None
        name = link.name if link is not None else ""
        if name != self._watched_robot:
            self._close_robot_watch()
            self._watched_robot = name
            if name:
                self._watch = self.session.fleet.watch_sensors(name)

    def _update_empty_state(self) -> None:
        if self._topic:
            hint = _("The next image on {topic} appears here.").format(topic=topic_label(self._topic))
            self.empty.set_texts(_("No images yet"), hint, "image")
            self.empty.set_actions([self.doctor_action(self._topic)])
        else:
            hint = _("Images appear here as soon as a camera publishes them.")
            self.empty.set_texts(_("No images yet"), hint, "image")
            robot = EmptyAction(_("Use the virtual robot"), lambda: self.context.run("robots.virtual"), "bot")
            self.empty.set_actions([robot, self.doctor_action()])
        self._show_page(has_image=False)

    def _show_page(self, *, has_image: bool) -> None:
        if self._has_image is has_image:
            return
        self._has_image = has_image
        self.pages.setCurrentWidget(self.content if has_image else self.empty)
        self.actions_of.set_enabled(has_image)
        self._fit_title()

    def _fit_title(self) -> None:
        # Buttons that don't fit are available in the "more" menu.
        for button in (self.freeze, self.style_button, self.layers_button):
            button.setVisible(self._has_image is True)
        for button in (self.fit_button, self.save_button):
            button.setVisible(
                self._has_image is True and self.width() >= self.theme.scaled(ALL_BUTTONS_WIDTH)
            )

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit_title()

    # -- user actions -------------------------------------------------------------------------------------

    def awaited_topic(self) -> str:
        return self._topic if self.view.picture is None else ""

    def blockers(self) -> list[Blocker]:
        is_frozen = self.freeze.isChecked()
        return [paused_blocker(self.title(), lambda: self.freeze.setChecked(False))] if is_frozen else []

    def _toggle_freeze(self) -> None:
        self.freeze.setChecked(not self.freeze.isChecked())

    def _publish_points(self, *, is_active: bool) -> None:
        self.point_bar.set_active(is_active)
        self.actions_of["point"].setChecked(is_active)

    def _set_frozen(self, is_frozen: bool) -> None:
        self.actions_of["freeze"].setChecked(is_frozen)
        if self._stream is not None:
            self._stream.set_frozen(is_frozen)

    def save_image(self) -> None:
        """Save the image as PNG at its original size."""
        message = self._message()
        if message is not None:
            self.job.save(message)

    def save_sequence(self) -> None:
        """Start recording the images or, if a recording is open, show the export of its images."""
        replay = self.session.replay
        if replay is None:
            self.context.request(RecordTopic(self._topic))
        else:
            self.context.request(ExportRecording(replay.path))

    def copy_image(self) -> None:
        """Copy the image to the clipboard at its original size."""
        message = self._message()
        if message is not None:
            self.job.copy(message)

    def _message(self) -> Message | None:
        return self.view.picture.message if self.view.picture is not None else None

    def _on_saved(self, path: str) -> None:
        folder = QUrl.fromLocalFile(str(Path(path).parent))
        message = _("Saved {file}").format(file=Path(path).name)
        self.context.show_toast(message, _("Open folder"), lambda: open_externally(folder))

    def _on_copied(self, image: QImage) -> None:
        QGuiApplication.clipboard().setImage(image)
        size = f"{image.width()}\u00d7{image.height()}"
        self.context.show_toast(_("Copied the image, {size}").format(size=size))

    def _on_failed(self, reason: str) -> None:
        message = _("can't save the image: {reason}").format(reason=reason)
        self.session.console.add("error", "image", message)
        self.session.alerts.raise_alert(
            "snapshot", "error", _("Can't save the image."), reason, button=_("Open the console"),
            intent=ShowConsole(),
        )  # fmt: skip

    def _show_actions(self, position: QPoint) -> None:
        menu = Menu(self.theme, self)
        menu.addActions(self.more_actions())
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.popup(self.view.mapToGlobal(position))

    def _inspect(self) -> None:
        self.context.request(Inspect(self._topic))

    def _show_layers(self) -> None:
        menu = Menu(self.theme, self)
        for name in self.overlays.choices():
            action = menu.addAction(plain.escape_menu_text(topic_label(name)))
            action.setCheckable(True)
            action.setChecked(name in self.overlays.selected_topics)
            action.toggled.connect(lambda is_visible, name=name: self.overlays.set_visible(name, is_visible))
        if menu.isEmpty():
            menu.addAction(_("No topic has image annotations")).setEnabled(False)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        open_below(menu, self.layers_button)

    def _show_menu(self) -> None:
        menu = Menu(self.theme, self)
        for name in self.topics():
            action = menu.addAction(plain.escape_menu_text(topic_label(name)))
            action.setCheckable(True)
            action.setChecked(name == self._topic)
            action.triggered.connect(lambda _on=False, name=name: self.show_topic(name))
        if menu.isEmpty():  # Qt shows no empty menu, and would never delete it
            menu.addAction(_("No camera is publishing images")).setEnabled(False)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        open_below(menu, self.choose_button)

    def more_actions(self) -> list[QAction]:
        for action in (self._inspect_action, self._sequence_action):
            action.setEnabled(bool(self._topic))
        is_replaying = self.session.replay is not None
        self._sequence_action.setText(
            _("Save the sequence as files") if is_replaying else _("Record a sequence")
        )
        return [*self.actions_of.menu_actions(), self._separator, self._sequence_action, self._inspect_action]

    def save_state(self) -> dict[str, object]:
        return {
            "topic": self._topic,
            "place": self.view.placement.to_json(),
            "look": self.style_bar.picture_style.to_json(),
            "tune": self.style_button.isChecked(),
            "layers": list(self.overlays.selected_topics),
            "point": self.point_bar.to_json(),
        }

    def restore_state(self, state: Mapping[str, object]) -> None:
        topic = state.get("topic")
        if isinstance(topic, str) and topic:
            self.show_topic(topic)
        self.view.placement.restore(state.get("place"))
        self.actions_of.update_checks()
        self._set_picture_style(style := parse_style(state.get("look")))
        self.style_bar.show_style(style)
        self.style_button.setChecked(state.get("tune") is True)
        self.point_bar.restore(state.get("point"))
        self.actions_of["point"].setChecked(self.point_bar.is_on)
        layers = state.get("layers")
        for name in layers if isinstance(layers, list) else ():
            if isinstance(name, str):
                self.overlays.set_visible(name, is_visible=True)

    def _close_robot_watch(self) -> None:
        if self._watch is not None:
            self._watch.close()
        self._watch, self._watched_robot = None, ""

    def freeze_button(self) -> QAbstractButton:
        return self.freeze

    def suspendables(self) -> Iterable[Suspendable | None]:
        return (self._stream, self._watch, *self.overlays.suspendables())

    def dispose(self) -> None:
        self.point_bar.dispose()
        self._close_stream()
        self.overlays.close()

    def _close_stream(self) -> None:
        self.job.wait()
        self._close_robot_watch()
        if self._stream is not None:
            self._stream.close()
            self._stream = None


PANEL = Panel(
    "image",
    lazy("Image"),
    "image",
    (CODEC,),
    ImagePanel,
    allows_multiple=True,
    home=(TabHome("behaviour", "camera"), RowHome("developer", 2, 0, 380)),
)
