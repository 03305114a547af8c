"""Pinhole model of the virtual camera: projection of points in the room to pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Matrix: TypeAlias = NDArray[np.float64]
NEAR_PLANE_M = 0.06


@dataclass(frozen=True)
class Lens:
    """Pinhole camera model.

    Attributes:
        position: Position x, y, z in m.
        yaw_deg: Direction in degrees, positive to the left.
        pitch_deg: Inclination in degrees, positive downwards.
        width: Width of the image in pixels.
        height: Height of the image in pixels.
        hfov_deg: Horizontal field of view in degrees.
    """

    position: tuple[float, float, float]
    yaw_deg: float
    pitch_deg: float
    width: int = 320
    height: int = 240
    hfov_deg: float = 56.3

    @cached_property
    def focal(self) -> float:
        """Focal length in pixels."""
        return self.width / 2 / math.tan(math.radians(self.hfov_deg / 2))

    @cached_property
    def rotation(self) -> Matrix:
        """Rotation matrix from room to camera coordinates, with the rows right, down and forward."""
        yaw, up = math.radians(self.yaw_deg), math.radians(-self.pitch_deg)
        forward = np.array([math.cos(yaw) * math.cos(up), math.sin(yaw) * math.cos(up), math.sin(up)])
        right = np.array([math.sin(yaw), -math.cos(yaw), 0.0])
        return np.stack([right, np.cross(forward, right), forward])

    def to_camera(self, points: Matrix) -> Matrix:
        """Transform points (n, 3) from room to camera coordinates: right, down and forward in m."""
        seen: Matrix = (points - np.asarray(self.position)) @ self.rotation.T
        return seen

    def to_pixels(self, seen: Matrix) -> Matrix:
        """Project points (n, 3) in camera coordinates, all in front of the camera, to pixels (n, 2)."""
        scale = self.focal / seen[:, 2]
        return np.stack([seen[:, 0] * scale + self.width / 2, seen[:, 1] * scale + self.height / 2], axis=1)

    def outline(self, points: Matrix) -> Matrix:
        """Project a flat polygon to pixels, clipped to the space in front of the camera.

        Args:
            points: Corners in room coordinates, shape (m, 3).

        Returns:
            Pixels of shape (n, 2); n is 0 if nothing is in front of the camera.
        """
        clipped = _clip_to_near_plane(self.to_camera(points))
        return self.to_pixels(clipped) if len(clipped) else np.empty((0, 2))

    def texture_to_pixels(
        self, corner: Matrix, across: Matrix, along: Matrix, size: tuple[int, int]
    ) -> Matrix:
        """Return the homography from the pixels of a texture on a parallelogram in the room to image pixels.

        Args:
            corner: Upper left corner in room coordinates.
            across: Vector of the upper side in m.
            along: Vector of the left side in m.
            size: Width and height of the texture in pixels.
        """
        columns = [across / size[0], along / size[1], corner - np.asarray(self.position)]
        seen = self.rotation @ np.stack(columns, axis=1)
        half = np.array([[self.focal, 0, self.width / 2], [0, self.focal, self.height / 2], [0, 0, 1]])
        made: Matrix = half @ seen
        return made


def _clip_to_near_plane(seen: Matrix) -> Matrix:
    if seen[:, 2].min() >= NEAR_PLANE_M:
        return seen
    if seen[:, 2].max() < NEAR_PLANE_M:
        return np.empty((0, 3))
    kept = []
    for here, there in zip(seen, np.roll(seen, -1, axis=0), strict=True):
        if here[2] >= NEAR_PLANE_M:
            kept.append(here)
        if (here[2] >= NEAR_PLANE_M) != (there[2] >= NEAR_PLANE_M):
            part = (NEAR_PLANE_M - here[2]) / (there[2] - here[2])
            kept.append(here + part * (there - here))
    return np.array(kept)
