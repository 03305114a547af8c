"""Pictures of a stream at their own aspect on black, with boxes around what was recognised."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from PySide6.QtCore import QPointF, QRect, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QImage, QMouseEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.ui.theme import Theme
from app.ui.widgets import paint
from app.ui.words import age_words

if TYPE_CHECKING:
    from app.core.images import ImageStream, Picture

SILENT_AFTER_S = 2.0
LABEL_EDGE = 8
# Boxes lie on pictures, whatever the theme: two bright colours with dark words.
BOX_COLOURS = ("#FFC53D", "#5FD4F4", "#7BE0A0", "#F79AC0")
BOX_INK = "#1C1B19"


@dataclass(frozen=True, slots=True)
class Box:
    """Something that was recognised: its words, its confidence (0 to 1 or None), its place as shares."""

    words: str
    confidence: float | None
    place: QRectF
    kind: int = 0


def boxes_of(detections: object, kind: int = 0) -> tuple[Box, ...]:
    """The boxes in a detections sensor's value; whatever is none is left out."""
    if not isinstance(detections, Mapping):
        return ()
    width, height = _number(detections.get("width")), _number(detections.get("height"))
    items = detections.get("items")
    if not width or not height or not isinstance(items, Sequence) or isinstance(items, str):
        return ()
    found = []
    for item in items:
        place = item.get("box") if isinstance(item, Mapping) else None
        if isinstance(item, Mapping) and isinstance(place, Sequence) and len(place) == 4:
            x, y, w, h = (_number(part) or 0.0 for part in place)
            area = QRectF(x / width, y / height, w / width, h / height)
            found.append(Box(str(item.get("name", "")), _number(item.get("confidence")), area, kind))
    return tuple(found)


def rate_sentence(shown_hz: float | None, arriving_hz: float | None) -> str:
    """``shown 30 of 60/s``; empty while neither is known."""
    if arriving_hz is None:
        return ""
    shown = min(shown_hz, arriving_hz) if shown_hz is not None else 0.0
    return f"shown {round(shown)} of {round(arriving_hz)}/s"


class PictureView(QWidget):
    """The newest picture of a stream; `take` is called at each refresh and paints only what is new."""

    def __init__(self, theme: Theme, *, fill: bool = False, labelled: bool = True) -> None:
        """``fill`` lets the picture fill the view where its edges may be cut by a tenth."""
        super().__init__()
        self._theme = theme
        self._fill, self._labelled = fill, labelled
        self._picture: Picture | None = None
        self._image: QImage | None = None
        self._boxes: tuple[Box, ...] = ()
        self._words = ""
        self._silent = ""
        self._under_mouse = ""
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(80, 60)
        self.setMouseTracking(True)

    @property
    def words(self) -> str:
        """The label at the lower left."""
        return "  ".join(part for part in (self._silent or self._words, self._under_mouse) if part)

    @property
    def boxes(self) -> tuple[Box, ...]:
        """What is marked now."""
        return self._boxes

    def clear(self) -> None:
        """Show nothing."""
        self._picture = self._image = None
        self._boxes = ()
        self._words = self._silent = ""
        self.update()

    def take(self, stream: ImageStream, boxes: tuple[Box, ...] = ()) -> None:
        """Show what the stream has now."""
        picture = stream.picture
        silent_s = stream.silent_s
        silent = silent_s is not None and silent_s > SILENT_AFTER_S
        state = f"Last picture, {age_words(silent_s)} old" if silent else ""
        words = rate_sentence(stream.shown_hz, stream.arriving_hz)
        if picture is not None:
            words = f"{words}  {picture.width}\u00d7{picture.height}".strip()
        changed = (state, words, boxes) != (self._silent, self._words, self._boxes)
        if picture is not self._picture and picture is not None:
            self._picture = picture
            # QImage does not copy the bytes: self._picture keeps them.
            self._image = QImage(
                picture.bgra.data,
                picture.width,
                picture.height,
                4 * picture.width,
                QImage.Format.Format_RGB32,
            )
            stream.shown()
            changed = True
        self._silent, self._words, self._boxes = state, words, boxes
        if changed:
            self.setAccessibleDescription(self.words)
            self.update()

    def sizeHint(self) -> QSize:
        return QSize(320, 240)

    def area(self) -> QRectF:
        """Where the picture is painted; it may reach beyond the view when it fills it."""
        if self._image is None:
            return QRectF(self.rect())
        size = self._image.size()
        across, down = self.width() / size.width(), self.height() / size.height()
        scale = min(across, down)
        if self._fill and max(across, down) / scale < 1.34:
            scale = max(across, down)
        width, height = size.width() * scale, size.height() * scale
        return QRectF((self.width() - width) / 2, (self.height() - height) / 2, width, height)

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        area = self.area()
        if not area.contains(QRectF(self.rect())):
            painter.fillRect(self.rect(), QColor("black"))
        if self._image is not None:
            painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
            painter.drawImage(area, self._image)
        if self._silent:
            painter.fillRect(area, QColor(90, 90, 90, 150))
        else:
            for box in self._boxes:
                self._paint_box(painter, area, box)
        if (self._labelled or self._silent) and self.words:
            self._paint_label(painter)
        painter.end()

    def _paint_box(self, painter: QPainter, area: QRectF, box: Box) -> None:
        place = QRectF(
            area.x() + box.place.x() * area.width(),
            area.y() + box.place.y() * area.height(),
            box.place.width() * area.width(),
            box.place.height() * area.height(),
        )
        colour = QColor(BOX_COLOURS[box.kind % len(BOX_COLOURS)])
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.setPen(QPen(colour, 2.5))
        painter.drawRoundedRect(place, 2, 2)
        words = box.words if box.confidence is None else f"{box.words} {box.confidence:.2f}"
        font = self._theme.font("caption")
        font.setWeight(QFont.Weight.DemiBold)
        width = paint.width_of(font, words) + 12
        top = place.top() - 19 if place.top() - 19 >= 0 else place.top()
        tag = QRectF(place.left() - 1.25, top, width, 18)
        paint.box(painter, tag, 2, colour)
        paint.words(painter, tag.adjusted(6, 0, 0, 0), words, font, QColor(BOX_INK))

    def _paint_label(self, painter: QPainter) -> None:
        font = self._theme.font("small")
        font.setWeight(QFont.Weight.Medium)
        width = min(paint.width_of(font, self.words) + 16, self.width() - 2 * LABEL_EDGE)
        tag = QRectF(LABEL_EDGE, self.height() - LABEL_EDGE - 20, width, 20)
        paint.box(painter, tag, 4, QColor(0, 0, 0, 190))
        paint.words(painter, tag.adjusted(8, 0, -4, 0), self.words, font, QColor("white"))

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        self._say_pixel(event.position())

    def leaveEvent(self, _event: object) -> None:
        self._under_mouse = ""
        self.update()

    def _say_pixel(self, at: QPointF) -> None:
        words = ""
        area = self.area()
        if self._image is not None and self._labelled and area.contains(at):
            x = int((at.x() - area.x()) / area.width() * self._image.width())
            y = int((at.y() - area.y()) / area.height() * self._image.height())
            if QRect(0, 0, self._image.width(), self._image.height()).contains(x, y):
                pixel = self._image.pixelColor(x, y)
                words = f"({x}, {y})  {pixel.red()} {pixel.green()} {pixel.blue()}"
        if words != self._under_mouse:
            self._under_mouse = words
            self.update()


def _number(value: object) -> float | None:
    good = isinstance(value, (int, float)) and not isinstance(value, bool)
    return float(value) if good else None  # type: ignore[arg-type]
