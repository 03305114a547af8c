"""Input control for an image: a file, the newest image of a topic, or an address, with a thumbnail.

Typed addresses are sent unchanged; images are sent in the format of `picture_file.encode_image`.
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from PySide6.QtCore import QRectF, QSize, Qt, QTimer, QUrl, Signal
from PySide6.QtGui import QDragEnterEvent, QDropEvent, QImage, QPainter, QPainterPath, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QVBoxLayout, QWidget
from shiboken6 import isValid

from app.robots.description.description import Parameter
from app.ui.panels.robots.robots.controls.base import Control, connect, line_field
from app.ui.panels.robots.robots.controls.picture_file import decode_image, encode_image, read_picture
from app.ui.text import plain
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, label, paint
from app.ui.widgets.flow_layout import Flow
from app.ui.widgets.menus import Menu, open_below
from nep.errors import DecodeError
from nep.i18n import _

if TYPE_CHECKING:
    from app.core.messages.image_streams import ImageStream

POLL_MS = 200
THUMBNAIL_SIZE = QSize(72, 54)


class ImageSource(Protocol):
    """Source of images: topics of the session, and files."""

    def topics(self) -> Sequence[str]:
        """Return the names of available image topics."""

    def open_stream(self, topic: str) -> ImageStream:
        """Subscribe to the images of a topic; the caller closes the stream."""

    def prompt_file(self, folder: str, callback: Callable[[Path], None]) -> None:
        """Show the dialog for choosing an image file.

        Args:
            folder: Initial folder; "" for the user's pictures.
            callback: Receives the path of the file.
        """


class EmptyImageSource:
    """Null implementation of `ImageSource`, without topics and files."""

    def topics(self) -> Sequence[str]:
        """Return an empty sequence."""
        return ()

    def open_stream(self, topic: str) -> ImageStream:
        """Raise `KeyError`, because there are no topics."""
        raise KeyError(topic)

    def prompt_file(self, folder: str, callback: Callable[[Path], None]) -> None:
        """Do nothing."""


class Thumbnail(QWidget):
    """Thumbnail of an image, or an icon."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._image: QImage | None = None
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.setAccessibleName(_("Selected image"))

    @property
    def image(self) -> QImage | None:
        """Displayed image, or None."""
        return self._image

    def show_image(self, image: QImage | None) -> None:
        """Show an image, or the icon if `image` is None."""
        self._image = image
        self.update()

    def sizeHint(self) -> QSize:
        return THUMBNAIL_SIZE

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme, painter = self._theme, QPainter(self)
        rect, radius = QRectF(self.rect()), self._theme.radius("small")
        paint.box(painter, rect, radius, theme.colour("sunken"), theme.colour("border"))
        if self._image is None:
            icon_rect = QRectF(rect.center().x() - 10, rect.center().y() - 10, 20, 20)
            paint_icon(painter, icon_rect, "image", theme.colour("textTertiary"))
        else:
            inner = rect.adjusted(1, 1, -1, -1)
            shape = QPainterPath()
            shape.addRoundedRect(inner, radius - 1, radius - 1)
            painter.setClipPath(shape)
            painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
            size = self._image.size().scaled(
                inner.size().toSize(), Qt.AspectRatioMode.KeepAspectRatioByExpanding
            )
            image_rect = QRectF(0, 0, size.width(), size.height())
            image_rect.moveCenter(inner.center())
            painter.drawImage(image_rect, self._image)
        painter.end()


class PictureChoice(QWidget):
    """Control with a thumbnail, a field for the file name or address, and buttons for file and camera.

    Files can also be dropped onto the control.
    """

    changed = Signal()

    def __init__(self, theme: Theme, parameter: Parameter, pictures: ImageSource) -> None:
        super().__init__()
        self._theme, self._parameter, self._pictures = theme, parameter, pictures
        self._stream: ImageStream | None = None
        self._last_picture: object = None
        self._file: Path | None = None
        self._image: QImage | None = None
        self.error_text = ""
        self.setAccessibleName(parameter.title)
        self.setAcceptDrops(True)
        self.thumbnail = Thumbnail(theme)
        self.field = line_field(theme, parameter)
        self.field.setPlaceholderText(_("A file, a camera or an address"))
        self.choose = Button(theme, _("File"), "folder-open", size="form")
        self.choose.setAccessibleName(_("Choose a file for {value}").format(value=parameter.title))
        self.camera = Button(theme, _("Camera"), "camera", size="form")
        self.camera.setAccessibleName(_("Use a camera image for {value}").format(value=parameter.title))
        self._error_label = label("", "small", role="error", wrap=True)
        self._error_label.hide()
        self._lay_out()
        self._timer = QTimer(self)
        self._timer.setInterval(POLL_MS)
        self._timer.timeout.connect(self._poll_stream)
        self.field.textEdited.connect(self._text_edited)
        self.choose.clicked.connect(self._prompt_file)
        self.camera.clicked.connect(self._show_topic_menu)

    def _lay_out(self) -> None:
        row = Flow()
        row.addWidget(self.thumbnail)
        row.add_elastic(self.field, is_greedy=True)
        row.addWidget(self.choose)
        row.addWidget(self.camera)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(4)
        column.addLayout(row)
        column.addWidget(self._error_label)

    # -- value --------------------------------------------------------------------------------------------

    def value(self) -> str | None:
        """Return the encoded image or the typed address; None if there is neither.

        None is also returned while the next image of a selected topic is awaited.
        """
        if self._stream is not None:
            self._poll_stream()
            if self._stream.is_awaiting_image:
                return None  # the last image may have been received before the stream was suspended
        if self._image is not None:
            return encode_image(self._image, omit_prefix=self._parameter.is_bare_base64)
        return None if self._stream is not None else self.field.text().strip() or None

    def set_value(self, value: object) -> None:
        """Show a value: an encoded image (``data:`` URL), an address, a file path, or None for no image."""
        self.close_stream()
        self._clear_image()
        text = "" if value is None else str(value)
        if text.startswith("data:"):
            self._image = _image_from_url(text)
            self.thumbnail.show_image(self._image)
            self.field.setText(_("earlier image") if self._image is not None else "")
        else:
            self._text_edited(text)
            self.field.setText(text)

    # -- file ---------------------------------------------------------------------------------------------

    def _prompt_file(self) -> None:
        self._pictures.prompt_file(
            str(self._file.parent) if self._file is not None else "", self._file_selected
        )

    def _file_selected(self, path: Path) -> None:
        if isValid(self):  # the form may have been deleted while the dialog was open
            self.use_file(path)

    def use_file(self, path: Path) -> None:
        """Load an image file, or show the reason if that fails."""
        self.close_stream()
        self._file = path
        self._image, message = read_picture(path)
        self.thumbnail.show_image(self._image)
        self.field.setText(path.name if self._image is not None else str(path))
        self.field.setToolTip(plain.tip(str(path)))
        self._show_error(message)
        self.changed.emit()

    def _text_edited(self, text: str) -> None:
        self.close_stream()
        self._clear_image()
        url = QUrl(text.strip())
        path = Path(url.toLocalFile() if url.isLocalFile() else text.strip())
        if text.strip() and path.suffix and path.is_file():
            self._image, message = read_picture(path)
            self.thumbnail.show_image(self._image)
            self._show_error(message)
        self.changed.emit()

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if any(url.isLocalFile() for url in event.mimeData().urls()):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        files = [url.toLocalFile() for url in event.mimeData().urls() if url.isLocalFile()]
        if files:
            self.use_file(Path(files[0]))
            event.acceptProposedAction()

    # -- camera -------------------------------------------------------------------------------------------

    def _show_topic_menu(self) -> None:
        menu = Menu(self._theme, self)
        topics = list(self._pictures.topics())
        for topic in topics:
            menu.addAction(plain.escape_menu_text(topic)).triggered.connect(
                lambda _on=False, topic=topic: self.use_topic(topic)
            )
        if not topics:
            menu.addAction(_("No camera is publishing images")).setEnabled(False)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        open_below(menu, self.camera)

    def use_topic(self, topic: str) -> None:
        """Show the images of a topic. The action receives the image that is the newest when it starts."""
        self.close_stream()
        self._clear_image()
        self._stream = self._pictures.open_stream(topic)
        self.field.setText(_("newest image of {topic}").format(topic=topic))
        self._timer.start()
        self.changed.emit()

    def _poll_stream(self) -> None:
        stream = self._stream
        if stream is None:
            return
        picture = stream.picture
        if picture is not None and picture is not self._last_picture and not stream.is_awaiting_image:
            self._last_picture = picture
            data = picture.bgra.data
            rows, columns = picture.bgra.shape[:2]
            frame = QImage(data, columns, rows, QImage.Format.Format_RGB32)
            self._image = frame.copy()
            self.thumbnail.show_image(self._image)
        self._show_error(f"{stream.error}." if stream.error else "")

    def close_stream(self) -> None:
        """Close the stream of the topic, if any."""
        self._timer.stop()
        if self._stream is not None:
            self._stream.close()
        self._stream, self._last_picture = None, None

    def _clear_image(self) -> None:
        self._image = None
        self.thumbnail.show_image(None)
        self.field.setToolTip("")
        self._show_error("")

    def _show_error(self, message: str) -> None:
        self.error_text = message
        self._error_label.setText(message)
        self._error_label.setVisible(bool(message))


def _image_from_url(address: str) -> QImage | None:
    # Decodes an image from a ``data:`` URL.
    try:
        return decode_image(base64.b64decode(address.partition(",")[2]))
    except (ValueError, DecodeError):
        return None


def picture_control(theme: Theme, parameter: Parameter, pictures: ImageSource) -> Control:
    """Create the input control for an image parameter."""
    choice = PictureChoice(theme, parameter, pictures)
    show: Callable[[object], None] = choice.set_value
    show(parameter.default)
    return Control(
        choice,
        choice.value,
        show,
        lambda callback: connect(choice.changed, callback),
        error_text=lambda: choice.error_text,
        close=choice.close_stream,
    )
