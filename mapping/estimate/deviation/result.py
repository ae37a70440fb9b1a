"""Deviation: how the body departs from its model at long wavelengths, why, and the model with that corrected."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mapping import BoolArray, FloatArray, Trace, length_text
from mapping.base import Base, LaidTrace
from mapping.estimate.deviation.drift import Drift, SteadyDrift

# What may be wrong with a model, or with the sweeps over it; a part is where the body departs from it alone and sharply
CAUSES = ("facets", "offset", "pose", "scale", "deformation", "drift", "part")


@dataclass(frozen=True, eq=False)
class Part:
    """A place that is missing from the body, or that only the body has: nothing is looked for there.

    Args:
        points: (K, 3) places of the model where it was felt, m.
        radius: around each of them that is left out, m.
        height: the largest departure there, m; negative: missing; NaN: missing, for the finger felt nothing there.
        path: length of sweeps over it, m.
    """

    points: FloatArray
    radius: float
    height: float
    path: float

    def covers(self, points: FloatArray) -> BoolArray:
        """(N,) True for places (N, 3) of the model that belong to it."""
        from scipy.spatial import cKDTree

        distance, _ = cKDTree(self.points).query(points, distance_upper_bound=self.radius)
        return np.asarray(np.isfinite(distance))

    @property
    def width(self) -> float:
        """About how wide it is, m."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)) + self.radius)

    def sentence(self) -> str:
        """What it is, in a few words."""
        place = ", ".join(f"{1e3 * value:.4g}" for value in self.points.mean(axis=0))
        kind = "is too much" if self.height > 0 else "is missing"
        nothing = not np.isfinite(self.height)
        depth = "nothing was felt there" if nothing else f"by up to {length_text(abs(self.height), 2)}"
        return f"a part about {length_text(self.width, 2)} wide {kind} at ({place}) mm ({depth}): left out"


@dataclass(frozen=True, eq=False)
class Deviation:
    """What the model gets wrong.

    Args:
        base: the model with all corrected that can be.
        causes: of CAUSES; after facets, which are rounded out before, the one that moves the surface most first.
        instead: causes that would explain the heights as well as the first: the trace cannot tell them apart.
        shift: (3,) of the body's middle against its model, m.
        turn: angle by which it is turned, rad.
        scale: by which factor it is larger.
        offset: by which the ball, or a coat of the body, is larger than said, m.
        bent: largest smooth displacement along the normal at a place that was felt, m.
        length: over which that changes, m; 0 without one.
        lines: drift of the recording or of each sweep on its own, no part of the body; one after the other.
        parts: where the body departs from the model alone.
        rms: of the heights before, where a smooth surface joins them, by their median, m.
        left: of what remains of them, m.
        gain: logarithm of how much more probable the heights are than without a deviation.
        heights: (V,) departure at each vertex of `base`, m, positive where the body stands out of its model.
        facets: largest height of the round body over the facets that stand for it in the mesh, m; 0 if they are flat.
        unexplained: share of the felt surface that stands off the corrected model, and not on details that stand on it.
        beyond_repair: whether nothing can be looked for; `offset` is then by how much it lies off, not corrected.
        facing: (3,) unit direction that the felt side of the model faces, where an offset of a quarter of a tip radius
            or more was named; zeros else, and where it faces many.
    """

    base: Base
    causes: tuple[str, ...]
    instead: tuple[str, ...]
    shift: FloatArray
    turn: float
    scale: float
    offset: float
    bent: float
    length: float
    lines: tuple[Drift | SteadyDrift, ...]
    parts: tuple[Part, ...]
    rms: float
    left: float
    gain: float
    heights: FloatArray
    unexplained: float
    beyond_repair: bool = False
    facing: FloatArray = field(default_factory=lambda: np.zeros(3))
    facets: float = 0.0

    @property
    def of_the_model(self) -> bool:
        """True if it is the model that is wrong, and not the sweeps alone."""
        return self.causes != ("drift",)

    def without_drift(self, laid: LaidTrace) -> Trace:
        """The trace, laid on the corrected base, without the lines of its sweeps."""
        trace: Trace = laid
        for lines in self.lines:
            trace = lines.without(LaidTrace.of(trace, laid.base))
        return trace

    def outside(self, points: FloatArray) -> BoolArray:
        """(N,) True for places (N, 3) of the model that no missing or extra part takes."""
        keep = np.ones(len(points), dtype=bool)
        for part in self.parts:
            keep &= ~part.covers(points)
        return keep

    def sentence(self) -> str:
        """What is wrong and what was done about it."""
        said = [self._said(cause) for cause in self.causes if cause not in ("drift", "part")]
        said += [lines.sentence() for lines in self.lines]
        said += [part.sentence() for part in self.parts]
        if self.instead:
            said.append(f"the trace cannot tell that from: {', '.join(self.instead)}")
        if not self.of_the_model:
            return "; ".join(said)
        if self.beyond_repair:
            said.append(
                f"{100 * self.unexplained:.0f} % of what was felt fits no moved, scaled or bent model: "
                "nothing was looked for"
            )
        return f"the model is wrong: {'; '.join(said)}"

    def _said(self, cause: str) -> str:
        if cause == "pose":
            off = length_text(float(np.linalg.norm(self.shift)), 2)
            return f"the object stands {off} and {np.degrees(self.turn):.2f} degrees off it: moved"
        if cause == "facets":
            over = length_text(self.facets, 2)
            return f"its facets stand for a round body, which lies up to {over} over them: rounded out"
        if cause == "scale":
            size = "larger" if self.scale > 1.0 else "smaller"
            return f"the object is {100 * abs(self.scale - 1.0):.2g} % {size}: scaled"
        if cause == "offset":
            sign = "large" if self.offset > 0 else "small"
            facing = ", ".join(f"{value:g}" for value in np.round(self.facing, 2) + 0.0)
            side = f" over the side that faces ({facing})" if self.facing.any() else ""
            done = "further than the ball is wide: not taken off" if self.beyond_repair else "taken off"
            return (
                f"all heights{side} are too {sign} by {length_text(abs(self.offset), 2)}, as of a tip or a frame that "
                f"is not as said: {done}"
            )
        return (
            f"the object is bent by up to {length_text(self.bent, 2)} over {length_text(self.length, 2)} and more: "
            "the model was bent"
        )

    def needs(self) -> str:
        """What would make it possible to look for features, where nothing else does."""
        return (
            'a mesh of this very object where it stands, pose = "estimate" with a shift and a turn that reach it, or '
            "no mesh but a region, in which the body is found by feeling"
        )

    def record(self) -> dict[str, Any]:
        """JSON values, SI units."""
        return {
            "causes": list(self.causes),
            "instead": list(self.instead),
            "shift": self.shift.tolist(),
            "turn": self.turn,
            "scale": self.scale,
            "offset": self.offset,
            "facing": self.facing.tolist(),
            "facets": self.facets,
            "bent": self.bent,
            "length": self.length,
            "rms": self.rms,
            "left": self.left,
            "gain": self.gain,
            "unexplained": self.unexplained,
            "beyond_repair": self.beyond_repair,
            "drift": [lines.record() for lines in self.lines],
            "parts": [
                {"place": part.points.mean(axis=0).tolist(), "width": part.width, "height": part.height,
                 "path": part.path} for part in self.parts
            ],
            "sentence": self.sentence(),
        }  # fmt: skip
