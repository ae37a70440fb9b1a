"""Tips that are not as said: what ones of another radius or form feel of round wires on a plate, exactly.

A tip of revolution that stands upright over a plate feels a round wire of the radius a as its own outline, grown by a
ball of that radius, stands over the wire's axis: the dilation of a segment by convex bodies. Nothing of the house's
contact takes part in that.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from explore3d.bench.trust.laws import Level, Path, shared, white
from explore3d.bench.trust.paths import Wire
from mapping import FloatArray, Trace

# Angles of the outline's normals against the axis of the tip, rad: what lies between is taken linearly, which is off
# by r (5e-5)^2 / 8; a wire as high as WIRE_DIAMETERS is left at 0.4
STEEPEST_NORMAL, ANGLES = 1.0, 20_000
# What the finger presses with, N; how that varies along the path (share, and length in tip radii); by which share it
# presses less on top of a wire; and the standard deviation of what the sensor says of it, N
PRESSED_WITH, PRESSED_VARIES, VARIES_OVER, SOFTER_ON_WIRES, FORCE_NOISE = 1.0, 0.05, 3.0, 0.2, 0.01

# Distances (K,) from the axis and heights (K,) over the tip's reference at which its outline, turned upside down, has
# normals at the angles (K,) to the axis, m, for the radius that is said
Outline = Callable[[float, FloatArray], tuple[FloatArray, FloatArray]]


@dataclass(frozen=True)
class Tip:
    """One way in which a tip is not what is said of it.

    Args:
        sentence: what it is, in units of the radius that is said.
        outline: of the tip.
        yields: by how much of that radius PRESSED_WITH moves it against what is recorded.
    """

    sentence: str
    outline: Outline
    yields: float = 0.0

    def height(self, said: float) -> float:
        """How high its reference stands over a bare plate, m."""
        return float(self.outline(said, np.zeros(1))[1][0])

    def offset(self, said: float) -> float:
        """By how much heights over a bare plate are too large, m."""
        return self.height(said) - said * (1.0 + self.yields)

    def felt(self, said: float, radius: float, distance: FloatArray) -> FloatArray:
        """(N,) heights of the reference over the axis of a wire of a radius at distances (N,) from it, m; -inf beyond
        the tip."""
        angle = np.linspace(0.0, STEEPEST_NORMAL, ANGLES)
        away, height = self.outline(said, angle)
        away, height = away + radius * np.sin(angle), height + radius * np.cos(angle)
        return np.asarray(np.interp(distance, np.append(0.0, away), np.append(height[0], height), right=-np.inf))


def _ball(share: float) -> Outline:
    """A ball whose radius is so many times what is said."""
    return lambda said, angle: (share * said * np.sin(angle), share * said * np.cos(angle))


def _worn(share: float) -> Outline:
    """A ball with a flat of this share of its radius across."""

    def outline(said: float, angle: FloatArray) -> tuple[FloatArray, FloatArray]:
        edge = np.maximum(angle, np.arcsin(0.5 * share))
        return said * np.sin(edge), said * np.cos(edge)

    return outline


def _elliptic(share: float) -> Outline:
    """An ellipsoid as wide as is said, and so many times as high."""

    def outline(said: float, angle: FloatArray) -> tuple[FloatArray, FloatArray]:
        across, up = np.sin(angle), share * np.cos(angle)
        return said * across / np.hypot(across, up), said * share * up / np.hypot(across, up)

    return outline


WRONG_TIPS: dict[str, Tip] = {
    "as said": Tip("a ball of the radius that is said", _ball(1.0)),
    "2 % larger": Tip("a ball 2 % larger than said", _ball(1.02)),
    "2 % smaller": Tip("a ball 2 % smaller than said", _ball(0.98)),
    "5 % larger": Tip("a ball 5 % larger than said", _ball(1.05)),
    "5 % smaller": Tip("a ball 5 % smaller than said", _ball(0.95)),
    "10 % larger": Tip("a ball 10 % larger than said", _ball(1.1)),
    "10 % smaller": Tip("a ball 10 % smaller than said", _ball(0.9)),
    "worn": Tip("a ball with a flat of a fifth of its radius across, as 2 mm of a ball of 10 mm", _worn(0.2)),
    "elliptic": Tip("an ellipsoid as wide as said and 5 % lower", _elliptic(0.95)),
    "yielding": Tip(
        "a ball on a finger that 1 N moves by a twentieth of its radius, as 2 N/mm one of 10 mm; it presses with 1 N, "
        "which varies by 5 % along the path and by 20 % on wires; forces recorded",
        _ball(1.0),
        0.05,
    ),
}


def recorded(tip: Tip, said: float, path: Path, wires: Sequence[Wire], level: Level, rng: np.random.Generator) -> Trace:
    """What is recorded of a tip that comes down on a plate with wires at the places of a path, in white noise."""
    height, risen = np.zeros(len(path.sweep)), np.zeros(len(path.sweep))
    slope = np.zeros((len(path.sweep), 2))
    for wire in wires:
        begin, along = wire.axis[0, :2], wire.axis[-1, :2] - wire.axis[0, :2]
        share = np.clip((path.centers[:, :2] - begin) @ along / (along @ along), 0.0, 1.0)
        away = path.centers[:, :2] - begin - share[:, None] * along
        distance = np.linalg.norm(away, axis=1)
        radius = 0.5 * wire.diameter
        over = radius + tip.felt(said, radius, distance) - tip.height(said)
        on = over > height
        step = 1e-4 * said
        fall = tip.felt(said, radius, distance[on] + step) - tip.felt(said, radius, distance[on])
        slope[on] = (fall / step / np.maximum(distance[on], step))[:, None] * away[on]
        height[on], risen[on] = over[on], over[on] / wire.diameter
    centers = np.column_stack([path.centers[:, :2], tip.height(said) + height])
    force = None
    if tip.yields:
        varies = PRESSED_VARIES * shared(path, VARIES_OVER * said, rng)
        pressed = PRESSED_WITH * (1.0 + varies - SOFTER_ON_WIRES * risen)
        force = pressed[:, None] * np.column_stack([-slope, np.ones(len(slope))])
        centers = centers - tip.yields * said / PRESSED_WITH * force
        force = force + FORCE_NOISE * rng.standard_normal(force.shape)
    centers = centers + white(path, level, rng)[:, None] * [0.0, 0.0, 1.0]
    return Trace(path.t, centers, path.sweep, said, force=force)
