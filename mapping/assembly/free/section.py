"""Section: what one detail of a profile is, as a run of its bins, and its two flanks."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mapping import FloatArray
from mapping.base import SweepHeights
from mapping.instrument import Noise

# What follows was varied over 84 profiles of `explore3d bench profiles` on seeds of their own (100 to 111): right are
# 83 each time; heights 86 of 93 and widths 54 of 59 lie within their intervals where no other count is named.
#
# Where flanks are read. On a parabola the tangent at a share q meets the base q^2 / 8 of the half-width outside, at a
# quarter 1 %; lower, noise and the foot count for more. At 0.15 widths 51, at 0.4 53
FLANK = 0.25
# So much of the width to either side of the middle is half as high, of a V as of a slot
CORE = 0.25
# A tangent is the line through all between these shares of that height: its slope from as much above as below, within
# which a parabola's own changes by an eighth. 0.8 to 1.2: widths 55; 0.4 to 1.6: 53
ABOUT = 0.6, 1.4
# A side that rises by more than half of the height from one sample to the next is a wall: what is left has no part
# that is steeper, and no line through samples tells its place. 0.3 and 0.7 are alike
WALL = 0.5


@dataclass(frozen=True)
class Section:
    """One detail of a profile, as indices of its bins: where it leaves the base, where it returns, and its extreme."""

    piece: SweepHeights
    sign: float
    begin: int
    end: int
    top: int
    monotone: FloatArray


@dataclass(frozen=True)
class Flank:
    """A side of a section about a share of its height.

    Args:
        place: where it passes that height, m from the profile's start.
        foot: where its tangent there meets the base, m.
        foot_sd: its standard deviation, m.
        angle: of the tangent over the base, rad.
        wall: mean height of the two samples that a wall lies between, m; NaN of no wall.
    """

    place: float
    foot: float
    foot_sd: float
    angle: float
    wall: float = np.nan

    def hidden(self, tip: float, fall: float) -> float:
        """How far beside the body's own edge the foot lies, m: r tan(a/2) of a tangent.

        Round the edge of a wall the ball rolls on a circle: where it has fallen by so much (m), at most by its radius,
        it is a chord of that circle beside it.
        """
        if np.isnan(self.wall):
            return float(tip * np.tan(0.5 * self.angle))
        return float(np.sqrt(max(fall, 0.0) * (2.0 * tip - fall))) if fall < tip else tip


def flanks(section: Section, share: float, noise: Noise | None = None) -> tuple[Flank, Flank]:
    """Both sides at a share of the height; without a noise their feet have no standard deviation."""
    s = section.piece.s[section.begin : section.end + 1]
    top = section.top - section.begin
    left = _flank(s[: top + 1], section.monotone[: top + 1], share, noise)
    right = _flank(-s[top:][::-1], section.monotone[top:][::-1], share, noise)
    return left, replace(right, place=-right.place, foot=-right.foot)


def _flank(x: FloatArray, z: FloatArray, share: float, noise: Noise | None) -> Flank:
    """The line through what lies about a share of the height of a rising side, or the wall between two samples."""
    level, spacing = share * float(z[-1]), float(x[1] - x[0])
    steepest = int(np.diff(z).argmax())
    if z[steepest + 1] - z[steepest] > WALL * z[-1]:
        place = 0.5 * float(x[steepest] + x[steepest + 1])
        middle = 0.5 * float(z[steepest] + z[steepest + 1])
        return Flank(place, place, spacing / np.sqrt(12.0), 0.5 * np.pi, middle)
    after = max(int(np.argmax(z > level)), 1)
    low, high = ABOUT
    first = min(int(np.argmax(z > low * level)), after - 1)
    last = max(int(np.argmax(z > high * level)), after)
    u, rise = x[first : last + 1] - x[after], z[first : last + 1]
    lines = np.linalg.pinv(np.column_stack([np.ones_like(u), u]))
    offset, slope = lines @ rise
    slope = max(float(slope), np.finfo(float).tiny)
    sd = 0.0
    if noise is not None:
        gradient = np.array([-1.0, offset / slope]) / slope @ lines
        sd = float(np.sqrt(gradient @ noise.covariance(u - u[0]) @ gradient))
    at = float(x[after])
    return Flank(at + (level - float(offset)) / slope, at - float(offset) / slope, sd, float(np.arctan(slope)))
