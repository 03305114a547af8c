"""View of an image stream: fitted or zoomed, with detections and the value of the hovered pixel."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from PySide6.QtCore import QPointF, QRectF, QSize, QSizeF, Qt
from PySide6.QtGui import QColor, QFont, QImage, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.ui.pictures.annotations import paint_annotations, paint_colour_bar
from app.ui.pictures.boxes import DetectionBox, paint_box
from app.ui.pictures.placement import PicturePlacement
from app.ui.text.numbers import age_text
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from nep.i18n import _

if TYPE_CHECKING:
    from app.core.messages.annotations import AnnotationShape
    from app.core.messages.image_streams import ImageStream
    from app.core.messages.picture import Picture, Pixel

STALE_AFTER_S = 2.0
LABEL_MARGIN = 8
MIN_SHARP_SCALE = 2.0  # screen pixels per image pixel from which pixels are drawn with sharp edges
STATS_INTERVAL_S = 1.0  # a rate or age that changes with every image would be unreadable
MAX_AGE_S = 3600.0
BLUR_SIZE = QSize(16, 12)
BACKGROUND_DIM_COLOUR, STALE_DIM_COLOUR = QColor(0, 0, 0, 110), QColor(0, 0, 0, 140)
ICON_SIZE = 28.0


def rate_text(shown_hz: float | None, arriving_hz: float | None) -> str:
    """Format frame rates, such as ``60 fps (30 shown)``; "" if the rate of the stream is unknown.

    Args:
        shown_hz: Rate of painted images; None if unknown.
        arriving_hz: Rate of received images; None if unknown.
    """
    if arriving_hz is None:
        return ""
    displayed_hz = min(shown_hz, arriving_hz) if shown_hz is not None else 0.0
    return _("{arriving} fps ({shown} shown)").format(shown=round(displayed_hz), arriving=round(arriving_hz))


class RateText:
    """Formatter for the frame rates of a stream, whose text changes at most once a second.

    A text that changes with every image would be unreadable.

    Args:
        clock: Monotonic clock in seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._text, self._text_changed_s = "", 0.0

    def for_stream(self, stream: ImageStream) -> str:
        """Return the current text for a stream."""
        text, now = rate_text(stream.displayed_hz, stream.arriving_hz), self._clock()
        if text != self._text and (
            not self._text or not text or now - self._text_changed_s >= STATS_INTERVAL_S
        ):
            self._text, self._text_changed_s = text, now
        return self._text

    def clear(self) -> None:
        """Clear the text before another stream is shown."""
        self._text = ""


def pixel_text(x: int, y: int, pixel: Pixel | None) -> str:
    """Format a pixel, such as ``(16, 8)  196 198 190  #C4C6BE``.

    Args:
        x: Column of the pixel.
        y: Row of the pixel.
        pixel: Colour as RGB, or the value of a single channel; None if unknown.
    """
    if pixel is None:
        return f"({x}, {y})"
    if isinstance(pixel, int | float):
        return f"({x}, {y})  {pixel:.6g}" if isinstance(pixel, float) else f"({x}, {y})  {pixel}"
    red, green, blue = pixel
    return f"({x}, {y})  {red} {green} {blue}  #{red:02X}{green:02X}{blue:02X}"


class PictureView(QWidget):
    """Widget that shows the newest image of a stream.

    Call `show_image` on every refresh; only changes are repainted.
    """

    def __init__(
        self,
        theme: Theme,
        *,
        fills_view: bool = False,
        has_label: bool = True,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        # `fills_view`: the image fills the view, without borders, if at most a quarter is cut off. Without a
        # label, a stream without new images is reported in the centre.
        super().__init__()
        self._clock = clock
        self._theme = theme
        self._fills_view, self._has_label = fills_view, has_label
        self.placement = PicturePlacement()
        self._picture: Picture | None = None
        self._image: QImage | None = None
        self._grey: QImage | None = None  # grey version of the last image, shown while the stream is silent
        self._boxes: tuple[DetectionBox, ...] = ()
        self._annotations: tuple[AnnotationShape, ...] = ()
        self._rate = self._state = self._age = ""
        self._rates = RateText(clock)
        self._is_stale = False  # the last image is shown because no new one arrives
        self.mouse_position: QPointF | None = None  # position of the mouse if it is over the image
        self._age_updated_s = -STATS_INTERVAL_S  # time of the last update of the age
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(80, 60)

    # -- content ------------------------------------------------------------------------------------------

    @property
    def label_text(self) -> str:
        """Text of the label at the lower left; "" without an image."""
        picture = self._picture
        if picture is None:
            return ""
        hovered_pixel = self._hovered_pixel_text()
        size = "" if self._state else f"{picture.width}\u00d7{picture.height}"
        zoom = f"{round(self.scale() * 100)} %" if self.placement.zoom is not None else ""
        details = (hovered_pixel, zoom) if hovered_pixel else (size, zoom, "" if self._state else self._age)
        return "  ".join(part for part in (self._state or self._rate, *details) if part)

    @property
    def boxes(self) -> tuple[DetectionBox, ...]:
        """Bounding boxes of detections on the current image."""
        return self._boxes

    @property
    def annotations(self) -> tuple[AnnotationShape, ...]:
        """Annotations on the current image."""
        return self._annotations

    @property
    def picture(self) -> Picture | None:
        """Current image, or None."""
        return self._picture

    def clear(self) -> None:
        """Remove the image and its label from the view."""
        self._picture = self._image = self._grey = None
        self._boxes, self._annotations = (), ()
        self._rate = self._state = self._age = ""
        self._rates.clear()
        self._is_stale = False
        self.update()

    def show_image(
        self,
        stream: ImageStream,
        boxes: tuple[DetectionBox, ...] = (),
        annotations_for: Callable[[int, int], tuple[AnnotationShape, ...]] | None = None,
    ) -> None:
        """Show the newest image of a stream.

        Bounding boxes and annotations don't change while the stream is frozen.

        Args:
            stream: Stream of images.
            boxes: Bounding boxes of detections on the image.
            annotations_for: Returns the annotations for an image of the given width and height; None for
                none.
        """
        previous_text, previous_state = (
            self.label_text,
            (self._boxes, self._annotations, self._is_stale, self._state),
        )
        picture, displayed, silent_s = stream.picture, self._picture, stream.silent_s
        self._rate = self._rates.for_stream(stream)
        now = self._clock()
        if picture is not None and (now - self._age_updated_s >= STATS_INTERVAL_S or not self._age):
            self._age, self._age_updated_s = _age_text(stream.stamp_age_s), now
        self._is_stale = not stream.is_frozen and silent_s is not None and silent_s > STALE_AFTER_S
        if stream.is_frozen:
            self._state = _("Frozen {age} ago").format(age=age_text(stream.age_s))
        elif self._is_stale:
            self._state = _("Last image {age} ago").format(age=age_text(stream.age_s))
        else:
            self._state = ""
        if picture is not self._picture and picture is not None:
            self._picture = picture
            if (
                displayed is None or picture.bgra is not displayed.bgra
            ):  # unless a camera repeats the same image
                rows, columns = picture.bgra.shape[:2]
                # QImage does not copy the bytes: self._picture keeps them alive.
                self._grey = None
                self._image = QImage(
                    picture.bgra.data, columns, rows, 4 * columns, QImage.Format.Format_RGB32
                )
                self.update()
            if not stream.is_frozen:
                stream.count_painted()
        if not stream.is_frozen or picture is not displayed:
            self._boxes = boxes  # boxes on a frozen image don't change
            displayed = self._picture
            self._annotations = (
                annotations_for(displayed.width, displayed.height)
                if annotations_for is not None and displayed is not None
                else ()
            )
        stream.set_size(self._requested_size())
        if (self._boxes, self._annotations, self._is_stale, self._state) != previous_state:
            self.update()
        self._update_label(previous_text)

    def _update_label(self, previous_text: str) -> None:
        text = self.label_text
        if text != previous_text:
            self.setAccessibleDescription(text)
            if self._has_label:
                top = self._label_top()
                self.update(0, top, self.width(), self.height() - top)

    def _requested_size(self) -> tuple[int, int] | None:
        # Size of the image in screen pixels; None if all image pixels are needed.
        if self.mouse_position is not None:
            return None
        ratio = self.devicePixelRatioF()
        size = self.area().size() if self._picture is not None else QSizeF(self.size())
        if self.placement.rotation_deg % 180:
            size = size.transposed()
        return round(size.width() * ratio), round(size.height() * ratio)

    def sizeHint(self) -> QSize:
        return QSize(320, 240)

    def picture_size(self) -> QSizeF:
        """Return the size of the image in image pixels; without an image, the size of the view."""
        picture = self._picture
        return QSizeF(picture.width, picture.height) if picture is not None else QSizeF(self.size())

    def area(self) -> QRectF:
        """Return the rectangle of the rotated image, which may exceed the view; without image, the view."""
        if self._picture is None:
            return QRectF(self.rect())
        return self.placement.area(QSizeF(self.size()), self.picture_size(), fills_view=self._fills_view)

    def scale(self) -> float:
        """Return the number of device pixels per image pixel."""
        rotated_width = self.placement.rotated_size(self.picture_size()).width()
        return self.area().width() / max(1.0, rotated_width) * self.devicePixelRatioF()

    def pixel_at(self, position: QPointF) -> tuple[int, int] | None:
        """Return the column and row of the image pixel at a point of the view; None outside of the image."""
        picture = self._picture
        if picture is None:
            return None
        fraction = self.placement.to_picture(position, self.area())
        if not (-1e-9 <= fraction.x() < 1 and -1e-9 <= fraction.y() < 1):
            return None
        x, y = int(fraction.x() * picture.width + 1e-6), int(fraction.y() * picture.height + 1e-6)
        return min(x, picture.width - 1), min(y, picture.height - 1)

    def _hovered_pixel_text(self) -> str:
        picture = self._picture
        pixel = self.pixel_at(self.mouse_position) if self.mouse_position is not None else None
        return pixel_text(*pixel, picture.pixel(*pixel)) if pixel is not None and picture is not None else ""

    # -- painting -----------------------------------------------------------------------------------------

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        area, view = self.area(), QRectF(self.rect())
        image = self._grey_image() if self._is_stale and not self._has_label else self._image
        if image is None or not area.contains(view):
            if image is None or not self._fills_view:
                painter.fillRect(self.rect(), QColor("black"))
            else:
                paint_blurred_background(painter, view, image)
        if image is not None:
            self._paint_image(painter, area, image)
        if self._is_stale and not self._has_label:
            paint_stale(painter, self._theme, view, self._state)
        elif self._is_stale:
            painter.fillRect(area, QColor(90, 90, 90, 150))
        else:
            to_view = self.placement.to_view(area)
            for box in self._boxes:
                paint_box(painter, self._theme, to_view.mapRect(box.rect), box)
            if self._annotations:
                paint_annotations(
                    painter, self._theme, to_view, self.scale() / self.devicePixelRatioF(), self._annotations
                )
        if self._has_label and self._picture is not None and self._picture.scale is not None:
            paint_colour_bar(painter, self._theme, view, self._picture.scale)
        if self._has_label and self.label_text:
            self._paint_label(painter)
        painter.end()

    def _grey_image(self) -> QImage | None:
        if self._grey is None and self._image is not None:
            self._grey = to_greyscale(self._image)
        return self._grey

    def _paint_image(self, painter: QPainter, area: QRectF, image: QImage) -> None:
        is_smooth = self.scale() < MIN_SHARP_SCALE
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform, is_smooth)
        placement = self.placement
        if (
            not placement.rotation_deg
            and not placement.is_flipped_horizontally
            and not placement.is_flipped_vertically
        ):
            painter.drawImage(area, image)  # fast path of Qt
            return
        painter.save()
        painter.setTransform(placement.to_view(area), True)
        painter.drawImage(QRectF(0, 0, 1, 1), image)
        painter.restore()

    def _label_font(self) -> QFont:
        font = self._theme.font("small")
        font.setWeight(font.Weight.Medium)
        return font

    def _label_top(self) -> int:
        height = max(20.0, paint.height_of(self._label_font()) + 4)
        return math.floor(self.height() - LABEL_MARGIN - height)

    def _paint_label(self, painter: QPainter) -> None:
        font = self._label_font()
        height = max(20.0, paint.height_of(font) + 4)
        width = min(paint.width_of(font, self.label_text) + 16, self.width() - 2 * LABEL_MARGIN)
        tag = QRectF(LABEL_MARGIN, self.height() - LABEL_MARGIN - height, width, height)
        paint.box(painter, tag, 4, QColor(0, 0, 0, 190))
        paint.text_line(painter, tag.adjusted(8, 0, -4, 0), self.label_text, font, QColor("white"))


def paint_blurred_background(painter: QPainter, view: QRectF, image: QImage) -> None:
    """Fill the view with a blurred and darkened copy of an image, instead of black borders."""
    ignore, smooth = Qt.AspectRatioMode.IgnoreAspectRatio, Qt.TransformationMode.SmoothTransformation
    painter.save()
    painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
    painter.drawImage(view, image.scaled(BLUR_SIZE, ignore, smooth))
    painter.restore()
    painter.fillRect(view, BACKGROUND_DIM_COLOUR)


def to_greyscale(image: QImage) -> QImage:
    """Return a greyscale copy of the image."""
    return image.convertToFormat(QImage.Format.Format_Grayscale8)


def paint_stale(painter: QPainter, theme: Theme, view: QRectF, text: str) -> None:
    """Darken the view and paint a camera icon with a text in the middle, for a stream without new images."""
    painter.fillRect(view, STALE_DIM_COLOUR)
    font = theme.font("bodyLarge")
    font.setWeight(font.Weight.DemiBold)
    line_height = paint.height_of(font)
    has_icon = view.height() >= ICON_SIZE + line_height + 12
    middle = view.center()
    if has_icon:
        icon_rect = QRectF(0, 0, ICON_SIZE, ICON_SIZE)
        icon_rect.moveCenter(QPointF(middle.x(), middle.y() - line_height / 2 - 2))
        paint_icon(painter, icon_rect, "camera", QColor("white"))
    top = middle.y() + ICON_SIZE / 2 - line_height / 2 + 4 if has_icon else middle.y() - line_height / 2
    text_rect = QRectF(view.left() + 8, top, view.width() - 16, line_height + 2)
    paint.text_line(painter, text_rect, text, font, QColor("white"), paint.CENTRE)


def _age_text(age_s: float | None) -> str:
    # Age of the image; "" if it has no time stamp or the clock is wrong.
    return age_text(age_s) if age_s is not None and 0 <= age_s < MAX_AGE_S else ""
