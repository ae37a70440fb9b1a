"""BumpShape: a round bump (sphere cap) on the base."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray
from mapping.base import Base
from mapping.inference.likelihood import Prior, Window


@dataclass(frozen=True, eq=False)
class Spot:
    """A point of the base with its tangent frame and curvature.

    Args:
        point: (3,) on the base, m.
        axes: (2, 3) unit tangents; the first along the sweep where only that direction is known.
        normal: (3,) outward unit normal.
        bends: (2,) normal curvatures of the base along the axes, 1/m.
    """

    point: FloatArray
    axes: FloatArray
    normal: FloatArray
    bends: FloatArray

    def lifted(self, place: FloatArray, height: FloatArray) -> FloatArray:
        """(W, 3) points at `height` (W,) over the base at tangent coordinates (W, 2), to second order, m."""
        sag = 0.5 * (place**2) @ self.bends
        sideways = place + height[:, None] * place * self.bends
        return np.asarray(self.point + sideways @ self.axes + (height - sag)[:, None] * self.normal)


def spot_at(point: FloatArray, normal: FloatArray, along: FloatArray, base: Base, tip: float, reach: float) -> Spot:
    """The spot of the base below a point, its curvature taken from the sag at `reach`, m."""
    foot = base.foot((point + tip * normal)[None], tip)
    center, up = foot.points[0], foot.normals[0] * np.sign(foot.normals[0] @ normal)
    first = along - (along @ up) * up
    if np.linalg.norm(first) < 1e-9:
        first = np.eye(3)[int(np.argmin(np.abs(up)))]
        first = first - (first @ up) * up
    first = first / np.linalg.norm(first)
    axes = np.stack([first, np.cross(up, first)])
    around = np.concatenate([axes, -axes]) * reach + center
    offset = base.foot(around + tip * up, tip).points - center
    across = np.einsum("ij,ij->i", offset, np.concatenate([axes, -axes]))
    sag = np.where(across > 0.5 * reach, -2.0 * (offset @ up) / np.maximum(across, 0.5 * reach) ** 2, np.nan)
    known = np.isfinite(sag.reshape(2, 2))
    bends = np.where(known, sag.reshape(2, 2), 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    return Spot(center, axes, up, bends)


@dataclass(frozen=True, eq=False)
class BumpShape:
    """Sphere caps: position (1 or 2 tangent coordinates), height and log radius.

    A lone profile knows where its crest is along itself, not how far beside it the bump's own crest lies: `free` is
    then 1, and the bump is taken to be under the profile.
    """

    window: Window
    spot: Spot
    tip_radius: float
    free: int
    priors: tuple[Prior, ...]
    start: FloatArray
    step: FloatArray

    @property
    def names(self) -> tuple[str, ...]:
        return (*("along", "across")[: self.free], "height", "log radius")

    @property
    def units(self) -> tuple[str, ...]:
        return (*("m", "m")[: self.free], "m", "ln m")

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights over the base's trace, m."""
        from mapping.geometry.templates import chain_heights

        window = self.window
        height, radius = theta[:, self.free], np.exp(theta[:, self.free + 1])
        place = np.zeros((len(theta), 2))
        place[:, : self.free] = theta[:, : self.free]
        centers = self.spot.lifted(place, height - radius)[:, None, :]
        out = np.empty((len(theta), len(window)))
        zero = np.zeros(len(window), dtype=np.int64)
        chain_heights(
            window.feet,
            window.normals,
            window.tangents,
            window.half,
            zero,
            zero,
            np.ascontiguousarray(centers),
            radius,
            np.ones(len(theta)),
            self.tip_radius,
            out,
        )
        return out
