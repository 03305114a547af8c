"""Drawing of textured parallelograms in the perspective of the virtual camera, with OpenCV."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from app.robots.virtual.lens import Lens, Matrix

Picture: TypeAlias = NDArray[np.uint8]
_SHIFT = 4  # fractional bits of polygon corners


class Texture:
    """Image with mipmap levels.

    Args:
        picture: Image of shape (height, width, 3) in BGR, or (height, width, 4) with straight alpha.
    """

    def __init__(self, picture: Picture) -> None:
        self.has_alpha = picture.shape[2] == 4
        if self.has_alpha:
            picture = _premultiply_alpha(picture)
        self.levels = [picture]
        while min(picture.shape[:2]) > 8 and len(self.levels) < 6:
            size = (max(1, picture.shape[1] // 2), max(1, picture.shape[0] // 2))
            picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
            self.levels.append(picture)

    def level_for(self, texels_per_pixel: float) -> Picture:
        """Return the mipmap level for a scale.

        Args:
            texels_per_pixel: Number of texels of the full image per screen pixel.
        """
        level = round(np.log2(max(1.0, texels_per_pixel)))
        return self.levels[min(int(level), len(self.levels) - 1)]


def _premultiply_alpha(picture: Picture) -> Picture:
    alpha = picture[:, :, 3:].astype(np.uint16)
    colour = (picture[:, :, :3].astype(np.uint16) * alpha + 127) // 255
    return np.concatenate([colour, alpha], axis=2).astype(np.uint8)


class Canvas:
    """Image that is rendered with the painter's algorithm: draw distant objects first.

    Args:
        lens: Camera model.
    """

    def __init__(self, lens: Lens) -> None:
        self.lens = lens
        self.picture: Picture = np.zeros((lens.height, lens.width, 3), dtype=np.uint8)

    def fill(self, points: Matrix, colour: tuple[int, int, int]) -> None:
        """Draw a polygon in one colour.

        Args:
            points: Corners in room coordinates, shape (n, 3).
            colour: Colour as BGR.
        """
        outline = self.lens.outline(points)
        if len(outline) >= 3:
            cv2.fillConvexPoly(self.picture, _to_fixed_point(outline), colour, cv2.LINE_AA, _SHIFT)

    def draw_texture(
        self, texture: Texture, corner: Sequence[float], top_edge: Sequence[float], left_edge: Sequence[float]
    ) -> None:
        """Draw a texture on a parallelogram.

        Args:
            texture: Texture.
            corner: Upper left corner in room coordinates.
            top_edge: Vector of the upper side in m.
            left_edge: Vector of the left side in m.
        """
        start, right, down = (
            np.asarray(vector, dtype=np.float64) for vector in (corner, top_edge, left_edge)
        )
        outline = self.lens.outline(np.stack([start, start + right, start + right + down, start + down]))
        box = self._clipped_bounds(outline)
        if box is None:
            return
        x0, y0, x1, y1 = box
        area = max(1.0, abs(float(cv2.contourArea(outline.astype(np.float32)))))
        full_shape = texture.levels[0].shape
        level = texture.level_for(float(np.sqrt(full_shape[0] * full_shape[1] / area)))
        matrix = self.lens.texture_to_pixels(start, right, down, (level.shape[1], level.shape[0]))
        matrix = np.array([[1, 0, -x0], [0, 1, -y0], [0, 0, 1]], dtype=np.float64) @ matrix
        if abs(np.linalg.det(matrix)) < 1e-9:
            return
        mode = cv2.BORDER_CONSTANT if texture.has_alpha else cv2.BORDER_REPLICATE
        warped = cv2.warpPerspective(
            level, matrix, (x1 - x0, y1 - y0), flags=cv2.INTER_LINEAR, borderMode=mode
        )
        target = self.picture[y0:y1, x0:x1]
        mask = np.zeros(target.shape[:2], dtype=np.uint8)
        cv2.fillConvexPoly(mask, _to_fixed_point(outline - (x0, y0)), 255, cv2.LINE_8, _SHIFT)
        if texture.has_alpha:
            _blend(target, np.asarray(cv2.copyTo(warped, mask), dtype=np.uint8))
        else:
            cv2.copyTo(warped, mask, target)

    def _clipped_bounds(self, outline: Matrix) -> tuple[int, int, int, int] | None:
        if len(outline) < 3:
            return None
        low, high = np.floor(outline.min(axis=0)), np.ceil(outline.max(axis=0)) + 1
        x0, y0 = max(0, int(max(low[0], 0))), max(0, int(max(low[1], 0)))
        x1, y1 = int(min(high[0], self.lens.width)), int(min(high[1], self.lens.height))
        return (x0, y0, x1, y1) if x1 > x0 and y1 > y0 else None


def _blend(target: Picture, overlay: Picture) -> None:
    transparency = cv2.merge([255 - overlay[:, :, 3]] * 3)
    background = cv2.multiply(target, transparency, scale=1 / 255)
    cv2.add(background, overlay[:, :, :3], dst=target)


def _to_fixed_point(outline: Matrix) -> NDArray[np.int32]:
    # Clip: OpenCV uses 16.16 fixed point; the near plane keeps visible corners below this.
    limited = np.clip(outline, -32000.0, 32000.0)
    return np.round(limited * (1 << _SHIFT)).astype(np.int32)
