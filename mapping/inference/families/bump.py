"""BumpShape: a round bump (sphere cap) on the base."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray
from mapping.base import Base
from mapping.inference.likelihood import Prior, Window

# Height over the base that a spot is looked for from, in tip radii
SPOT_LIFT = 0.01
# Feet that a spot's paraboloid is laid through: directions, and distances in its reach; and the cosine by which the
# normal of one may lean from that of the spot
SPOT_DIRECTIONS, SPOT_SHARES, SPOT_LEAN = 12, (0.4, 0.7, 1.0), 0.5


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

    def normals(self, place: FloatArray) -> FloatArray:
        """(W, 3) outward unit normals at tangent coordinates (W, 2), to first order."""
        leaning = self.normal + (place * self.bends) @ self.axes
        return np.asarray(leaning / np.linalg.norm(leaning, axis=1, keepdims=True))


def spot_at(point: FloatArray, normal: FloatArray, along: FloatArray, base: Base, tip: float, reach: float) -> Spot:
    """The spot of the base below a point; its normal and curvatures are those of a paraboloid over `reach`, m.

    The paraboloid is laid through feet all around: on a mesh each of them tells its own facet, all of them the body.
    """
    # from near by: a normal that is not the facet's would lead a ball's centre to the foot of another place
    foot = base.foot((point + SPOT_LIFT * tip * normal)[None], tip)
    center, up = foot.points[0], foot.normals[0] * np.sign(foot.normals[0] @ normal)
    axes = _tangents(up, along)
    turn = 2.0 * np.pi * np.arange(SPOT_DIRECTIONS) / SPOT_DIRECTIONS
    disc = np.concatenate([share * reach * np.column_stack([np.cos(turn), np.sin(turn)]) for share in SPOT_SHARES])
    feet = base.foot(center + disc @ axes + tip * up, tip)
    offset = feet.points - center
    # a foot on another side of the body, or over an edge, says nothing of this one
    own = (feet.normals @ up > SPOT_LEAN) & (np.linalg.norm(offset, axis=1) < 2.0 * reach)
    if own.sum() < SPOT_DIRECTIONS:
        return Spot(center, axes, up, np.zeros(2))
    for _ in range(2):  # in the frame of the foot's facet, then in its own
        u, v = (offset[own] @ axes.T).T
        design = np.column_stack([np.ones_like(u), u, v, -0.5 * u**2, -0.5 * v**2, -u * v])
        _, lean_u, lean_v, *bends, _ = np.linalg.lstsq(design, offset[own] @ up, rcond=None)[0]
        found = Spot(center, axes, up, np.array(bends))
        up = up - lean_u * axes[0] - lean_v * axes[1]
        up /= np.linalg.norm(up)
        axes = _tangents(up, along)
    return found


def _tangents(up: FloatArray, along: FloatArray) -> FloatArray:
    """(2, 3) unit tangents, the first as near to a direction as it may be."""
    first = along - (along @ up) * up
    if np.linalg.norm(first) < 1e-9:
        first = np.eye(3)[int(np.argmin(np.abs(up)))]
        first = first - (first @ up) * up
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(up, first)])


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
