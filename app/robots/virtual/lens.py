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
        camera_points: Matrix = (points - np.asarray(self.position)) @ self.rotation.T
        return camera_points

    def to_pixels(self, points: Matrix) -> Matrix:
        """Project points (n, 3) in camera coordinates, all in front of the camera, to pixels (n, 2)."""
        scale = self.focal / points[:, 2]
        return np.stack(
            [points[:, 0] * scale + self.width / 2, points[:, 1] * scale + self.height / 2], axis=1
        )

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
        self, corner: Matrix, top_edge: Matrix, left_edge: Matrix, size: tuple[int, int]
    ) -> Matrix:
        """Return the homography from the pixels of a texture on a parallelogram in the room to image pixels.

        Args:
            corner: Upper left corner in room coordinates.
            top_edge: Vector of the upper side in m.
            left_edge: Vector of the left side in m.
            size: Width and height of the texture in pixels.
        """
        columns = [top_edge / size[0], left_edge / size[1], corner - np.asarray(self.position)]
        camera_columns = self.rotation @ np.stack(columns, axis=1)
        intrinsic_matrix = np.array(
            [[self.focal, 0, self.width / 2], [0, self.focal, self.height / 2], [0, 0, 1]]
        )
        homography: Matrix = intrinsic_matrix @ camera_columns
        return homography


def _clip_to_near_plane(points: Matrix) -> Matrix:
    if points[:, 2].min() >= NEAR_PLANE_M:
        return points
    if points[:, 2].max() < NEAR_PLANE_M:
        return np.empty((0, 3))
    clipped = []
    for start, end in zip(points, np.roll(points, -1, axis=0), strict=True):
        if start[2] >= NEAR_PLANE_M:
            clipped.append(start)
        if (start[2] >= NEAR_PLANE_M) != (end[2] >= NEAR_PLANE_M):
            fraction = (NEAR_PLANE_M - start[2]) / (end[2] - start[2])
            clipped.append(start + fraction * (end - start))
    return np.array(clipped)
