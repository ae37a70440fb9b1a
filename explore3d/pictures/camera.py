"""Camera: a pinhole whose rays and projection agree to the pixel."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mapping import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera.

    Args:
        eye, target, up: (3,) positions, m, and the direction that is up in the picture.
        width, height: of the picture, pixels.
        field: vertical field of view, rad.
    """

    eye: FloatArray
    target: FloatArray
    up: FloatArray
    width: int
    height: int
    field: float = 0.5

    @classmethod
    def facing(cls, points: FloatArray, direction: FloatArray, width: int, height: int, margin: float = 1.06) -> Camera:
        """The camera that looks against `direction` (3,) and has all points (N, 3) in view, at most `height` high."""
        target = 0.5 * (points.min(axis=0) + points.max(axis=0))
        camera = cls(target + direction / np.linalg.norm(direction), target, _upright(direction), width, height)
        right, up, forward = camera.frame
        tangent = np.tan(0.5 * camera.field) / margin
        # Centre what is seen: perspective moves the middle of the picture off the middle of the box.
        distance = 0.0
        for _ in range(4):
            local = (points - target) @ np.stack([right, up, forward]).T
            need = [np.abs(local[:, 1]) / tangent, np.abs(local[:, 0]) / (tangent * width / height)]
            distance = float((np.maximum(*need) - local[:, 2]).max())
            seen = local[:, :2] / (distance + local[:, 2:])
            shift = 0.5 * (seen.min(axis=0) + seen.max(axis=0)) * distance
            target = target + shift[0] * right + shift[1] * up
        camera = cls(target - distance * forward, target, _upright(direction), width, height)
        return camera._cropped(points, margin)

    def _cropped(self, points: FloatArray, margin: float) -> Camera:
        """The camera without the empty stripes above and below the points; pixels keep their size."""
        rows = np.abs(self.project(points)[0][:, 1] + 0.5 - 0.5 * self.height)
        height = min(self.height - self.height % 8, 8 * int(np.ceil(2 * margin * float(rows.max()) / 8)))
        return replace(self, height=height, field=2 * float(np.arctan(0.5 * height * self.pixel)))

    @cached_property
    def frame(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Unit vectors to the right, up, and forward."""
        forward = (self.target - self.eye) / np.linalg.norm(self.target - self.eye)
        right = np.cross(forward, self.up)
        right /= np.linalg.norm(right)
        return right, np.cross(right, forward), forward

    @property
    def pixel(self) -> float:
        """Size of a pixel at distance one."""
        return float(2.0 * np.tan(0.5 * self.field) / self.height)

    def rays(self, row: IntArray, column: IntArray) -> FloatArray:
        """(N, 3) directions through the middles of pixels (N,), of forward component one; row 0 is the top."""
        right, up, forward = self.frame
        x = (column + 0.5 - 0.5 * self.width) * self.pixel
        y = (0.5 * self.height - row - 0.5) * self.pixel
        return np.asarray(forward + x[:, None] * right + y[:, None] * up)

    def project(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Column and row (N, 2) in pixels, the middle of the first pixel at 0, and depth (N,) along forward, m."""
        local = (points - self.eye) @ np.stack(self.frame).T
        depth = local[:, 2]
        safe = np.where(depth > 0, depth, np.nan) * self.pixel
        column = 0.5 * self.width - 0.5 + local[:, 0] / safe
        row = 0.5 * self.height - 0.5 - local[:, 1] / safe
        return np.column_stack([column, row]), depth


def _upright(direction: FloatArray) -> FloatArray:
    """z is up in the picture, unless the camera looks along it: then y is."""
    unit = direction / np.linalg.norm(direction)
    return np.array([0.0, 1.0, 0.0]) if abs(unit[2]) > 0.98 else np.array([0.0, 0.0, 1.0])
