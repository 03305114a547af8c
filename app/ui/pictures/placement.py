"""Placement of an image in its view: zoom, position, rotation and mirroring. Independent of widgets.

Positions in the image are fractions of the size of the received image, from 0 to 1 starting at the upper left
corner; positions in the view are in logical pixels.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from PySide6.QtCore import QPointF, QRectF, QSizeF
from PySide6.QtGui import QTransform

MIN_ZOOM, MAX_ZOOM = 0.02, 64.0
MAX_FILL_RATIO = 1.34


@dataclass(slots=True)
class PicturePlacement:
    """Placement of an image in a view.

    Attributes:
        zoom: Logical pixels per image pixel, or None to fit the view.
        centre: Point at the centre of the view, as fractions of the rotated image.
        rotation_deg: Clockwise rotation in degrees.
        is_flipped_horizontally: True if the image is mirrored horizontally.
        is_flipped_vertically: True if the image is mirrored vertically.
    """

    zoom: float | None = None
    centre: tuple[float, float] = (0.5, 0.5)
    rotation_deg: int = 0
    is_flipped_horizontally: bool = False
    is_flipped_vertically: bool = False

    # -- geometry -----------------------------------------------------------------------------------------

    def rotated_size(self, picture: QSizeF) -> QSizeF:
        """Return the size of the rotated image in image pixels."""
        return picture.transposed() if self.rotation_deg % 180 else picture

    def fit_zoom(self, view: QSizeF, picture: QSizeF, *, fills_view: bool = False) -> float:
        """Return the zoom that fits the image into the view.

        Args:
            view: Size of the view.
            picture: Size of the image.
            fills_view: True to fill the view instead, if the shapes of view and image are similar; the edges
                of the image are cut off.
        """
        rotated = self.rotated_size(picture)
        x_scale, y_scale = (
            view.width() / max(1.0, rotated.width()),
            view.height() / max(1.0, rotated.height()),
        )
        scale = min(x_scale, y_scale)
        if fills_view and scale > 0 and max(x_scale, y_scale) / scale < MAX_FILL_RATIO:
            return max(x_scale, y_scale)
        return scale

    def area(self, view: QSizeF, picture: QSizeF, *, fills_view: bool = False) -> QRectF:
        """Return the rectangle of the rotated image in the view; arguments as for `fit_zoom`.

        The rectangle may exceed the view. It leaves a gap only if the image is smaller than the view.
        """
        scale = self.zoom if self.zoom is not None else self.fit_zoom(view, picture, fills_view=fills_view)
        rotated = self.rotated_size(picture) * scale
        x, y = self.centre if self.zoom is not None else (0.5, 0.5)
        left = _offset(view.width(), rotated.width(), x)
        top = _offset(view.height(), rotated.height(), y)
        return QRectF(left, top, rotated.width(), rotated.height())

    def orientation(self) -> QTransform:
        """Return the transform from the image to the rotated and mirrored image, both in fractions."""
        transform = QTransform()
        transform.translate(0.5, 0.5)
        transform.scale(-1 if self.is_flipped_horizontally else 1, -1 if self.is_flipped_vertically else 1)
        transform.rotate(self.rotation_deg)
        transform.translate(-0.5, -0.5)
        return transform

    def to_view(self, area: QRectF) -> QTransform:
        """Return the transform from fractions of the image to the view.

        Args:
            area: Rectangle of the rotated image in the view.
        """
        transform = QTransform()
        transform.translate(area.x(), area.y())
        transform.scale(area.width(), area.height())
        return self.orientation() * transform

    def to_picture(self, position: QPointF, area: QRectF) -> QPointF:
        """Convert a point in the view to fractions of the image; below 0 or above 1 outside the image.

        Args:
            position: Point in the view.
            area: Rectangle of the rotated image in the view.
        """
        inverse, _is_invertible = self.to_view(area).inverted()
        return inverse.map(position)

    # -- commands of the user -----------------------------------------------------------------------------

    def zoom_at(self, factor: float, position: QPointF, view: QSizeF, picture: QSizeF) -> None:
        """Zoom by a factor; the image point at ``position`` (in the view) stays in place."""
        area = self.area(view, picture)
        old_zoom = area.width() / max(1.0, self.rotated_size(picture).width())
        min_zoom = min(MIN_ZOOM, self.fit_zoom(view, picture))
        new_zoom = min(MAX_ZOOM, max(min_zoom, old_zoom * factor))
        fraction_x = (position.x() - area.x()) / max(1e-9, area.width())
        fraction_y = (position.y() - area.y()) / max(1e-9, area.height())
        rotated = self.rotated_size(picture) * new_zoom
        self.zoom = new_zoom
        self.centre = (
            fraction_x + (view.width() / 2 - position.x()) / max(1e-9, rotated.width()),
            fraction_y + (view.height() / 2 - position.y()) / max(1e-9, rotated.height()),
        )
        self._clamp_centre(view, picture)

    def move(self, dx: float, dy: float, view: QSizeF, picture: QSizeF) -> None:
        """Move the image by a distance in px. An image that is fitted to the view stays in place."""
        area = self.area(view, picture)
        if self.zoom is None:
            return
        self.centre = (
            (view.width() / 2 - area.x() - dx) / max(1e-9, area.width()),
            (view.height() / 2 - area.y() - dy) / max(1e-9, area.height()),
        )
        self._clamp_centre(view, picture)

    def set_zoom(self, zoom: float | None) -> None:
        """Set the zoom in logical pixels per image pixel, or None to fit the view."""
        self.zoom = zoom if zoom is None else min(MAX_ZOOM, max(MIN_ZOOM, zoom))
        if zoom is None:
            self.centre = (0.5, 0.5)

    def rotate(self, degrees: int) -> None:
        """Rotate the image clockwise by a multiple of 90 degrees."""
        quarter = -degrees if self.is_flipped_horizontally != self.is_flipped_vertically else degrees
        self.rotation_deg = (self.rotation_deg + quarter) % 360
        if degrees % 180:
            x, y = self.centre
            self.centre = (1 - y, x) if degrees % 360 == 90 else (y, 1 - x)
        elif degrees % 360:
            self.centre = (1 - self.centre[0], 1 - self.centre[1])

    def flip(self, *, is_horizontal: bool) -> None:
        """Mirror the image.

        Args:
            is_horizontal: True to mirror horizontally, False to mirror vertically.
        """
        x, y = self.centre
        if is_horizontal:
            self.is_flipped_horizontally, self.centre = not self.is_flipped_horizontally, (1 - x, y)
        else:
            self.is_flipped_vertically, self.centre = not self.is_flipped_vertically, (x, 1 - y)

    def _clamp_centre(self, view: QSizeF, picture: QSizeF) -> None:
        # Normalizes the centre, so that the next movement starts where the image is displayed.
        area = self.area(view, picture)
        self.centre = (
            (view.width() / 2 - area.x()) / max(1e-9, area.width()),
            (view.height() / 2 - area.y()) / max(1e-9, area.height()),
        )

    # -- saved with the layout ----------------------------------------------------------------------------

    def to_json(self) -> dict[str, object]:
        """Return the placement as a JSON object, which is saved with the layout."""
        return {
            "zoom": self.zoom,
            "centre": list(self.centre),
            "turned": self.rotation_deg,
            "across": self.is_flipped_horizontally,
            "down": self.is_flipped_vertically,
        }

    def restore(self, saved: object) -> None:
        """Restore a placement from the result of `to_json`; invalid values are ignored."""
        if not isinstance(saved, Mapping):
            return
        zoom, centre, rotation_deg = saved.get("zoom"), saved.get("centre"), saved.get("turned")
        if isinstance(zoom, (int, float)) and not isinstance(zoom, bool) and zoom > 0:
            self.set_zoom(float(zoom))
            if (
                isinstance(centre, list)
                and len(centre) == 2
                and all(isinstance(n, (int, float)) for n in centre)
            ):
                self.centre = (float(centre[0]), float(centre[1]))
        if rotation_deg in {0, 90, 180, 270}:
            self.rotation_deg = int(rotation_deg)
        self.is_flipped_horizontally, self.is_flipped_vertically = (
            saved.get("across") is True,
            saved.get("down") is True,
        )


def _offset(view_length: float, length: float, centre: float) -> float:
    # Offset of `length` that puts `centre` into the middle without leaving a gap.
    if length <= view_length:
        return (view_length - length) / 2
    return min(0.0, max(view_length - length, view_length / 2 - centre * length))
