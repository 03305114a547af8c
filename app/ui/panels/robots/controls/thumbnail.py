"""The small picture beside a field."""

from __future__ import annotations

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QImage, QPainter, QPainterPath, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint

THUMBNAIL = QSize(72, 54)


class Thumbnail(QWidget):
    """A small picture, or an icon while there is none."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._image: QImage | None = None
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.setAccessibleName("The chosen picture")

    @property
    def image(self) -> QImage | None:
        """What it shows."""
        return self._image

    def show_image(self, image: QImage | None) -> None:
        """Show another picture, or none."""
        self._image = image
        self.update()

    def sizeHint(self) -> QSize:
        return THUMBNAIL

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme, painter = self._theme, QPainter(self)
        rect, radius = QRectF(self.rect()), self._theme.radius("small")
        paint.box(painter, rect, radius, theme.colour("sunken"), theme.colour("border"))
        if self._image is None:
            square = QRectF(rect.center().x() - 10, rect.center().y() - 10, 20, 20)
            paint_icon(painter, square, "image", theme.colour("textTertiary"))
        else:
            inner = rect.adjusted(1, 1, -1, -1)
            shape = QPainterPath()
            shape.addRoundedRect(inner, radius - 1, radius - 1)
            painter.setClipPath(shape)
            painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
            size = self._image.size().scaled(
                inner.size().toSize(), Qt.AspectRatioMode.KeepAspectRatioByExpanding
            )
            place = QRectF(0, 0, size.width(), size.height())
            place.moveCenter(inner.center())
            painter.drawImage(place, self._image)
        painter.end()
