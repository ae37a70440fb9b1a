"""Estimate: what a trace says about the body, and where it says nothing for certain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapping import FloatArray, IntArray, Surface, length_text
from mapping.estimate.sweeps import BRIDGED, EXTRAPOLATED, LABELS, TOUCHED


@dataclass(frozen=True, eq=False)
class Estimate:
    """The estimated surface of a trace.

    Args:
        surface: its mesh, whose vertices are `points`, or None where there is none: a single sweep, or
            too few samples.
        points: (N, 3) points of the estimated surface, m; in the order of the trace, bridged points
            inserted between the contacts that bound them.
        normals: (N, 3) outward unit normals of the ball there: the direction from the point to `centers`.
        centers: (N, 3) centre of the ball that bounds each point, m.
        labels: (N,) TOUCHED: the body is proven to be within the tolerance of the point; BRIDGED: the ball rests on
            two places and the body lies somewhere below; EXTRAPOLATED: all others, between or beyond the samples.
        sample: (N,) index of the trace's sample that each point comes from, -1 for inserted points.
        sweep: (N,) number of the sweep.
        across: (N,) curvature of the traced surface across the sweeps, 1/m, positive where it bulges out;
            NaN where the neighbouring sweeps do not tell.
        below: (N,) the body is proven to come within this distance of the point, m; inf where nothing proves it.
        above: (N,) the body is proven not to stand out above the point by more than this, m: 0 on the envelope of the
            balls; inf where nothing proves it.
        sd: standard deviation of a point along its normal, m; zero for a trace taken as exact.
        tolerance: within which touched points are proven to be, m.

    The surface of the body lies between `below` under a point and `above` over it (theory section 4.8).
    """

    surface: Surface | None
    points: FloatArray
    normals: FloatArray
    centers: FloatArray
    labels: NDArray[np.int8]
    sample: IntArray
    sweep: IntArray
    across: FloatArray
    below: FloatArray
    above: FloatArray
    sd: float = 0.0
    tolerance: float = 0.0

    def __post_init__(self) -> None:
        for name in _OF_POINTS:
            getattr(self, name).setflags(write=False)

    @classmethod
    def unproven(
        cls,
        points: FloatArray,
        normals: FloatArray,
        centers: FloatArray,
        labels: NDArray[np.int8],
        sample: IntArray,
        sweep: IntArray,
        across: FloatArray,
    ) -> Estimate:
        """Points without a mesh of which nothing is proven yet."""
        unknown = np.full(len(points), np.inf)
        return cls(None, points, normals, centers, labels, sample, sweep, across, unknown, unknown.copy())

    @classmethod
    def joined(cls, parts: Sequence[Estimate]) -> Estimate:
        """The points of one or more estimates one after another, without a mesh."""
        of_points: dict[str, Any] = {
            name: np.concatenate([getattr(part, name) for part in parts]) for name in _OF_POINTS
        }
        return replace(parts[0], surface=None, **of_points)

    def fraction(self, label: int) -> float:
        """Share of the points that carry a label."""
        return float(np.mean(self.labels == label)) if len(self.labels) else 0.0

    def select(self, index: IntArray) -> Estimate:
        """The points of these indices, without a mesh."""
        of_points: dict[str, Any] = {name: getattr(self, name)[index] for name in _OF_POINTS}
        return replace(self, surface=None, **of_points)

    def with_resting(self, points: FloatArray, owners: IntArray) -> Estimate:
        """This estimate with bridged points (K, 3) added, each where balls of three points `owners` (K, 3) meet."""
        first = owners[:, 0]
        arm = self.centers[first] - points
        length = np.maximum(np.linalg.norm(arm, axis=1, keepdims=True), np.finfo(float).tiny)
        return Estimate(
            None,
            np.vstack([self.points, points]),
            np.vstack([self.normals, arm / length]),
            np.vstack([self.centers, self.centers[first]]),
            np.concatenate([self.labels, np.full(len(points), BRIDGED, dtype=np.int8)]),
            np.concatenate([self.sample, np.full(len(points), -1)]),
            np.concatenate([self.sweep, self.sweep[first]]),
            np.concatenate([self.across, np.full(len(points), np.nan)]),
            np.concatenate([self.below, np.full(len(points), np.inf)]),
            np.concatenate([self.above, np.full(len(points), np.inf)]),
            self.sd,
            self.tolerance,
        )

    def certainty(self) -> dict[str, float | None]:
        """JSON values: shares of the labels, the tolerance, m, and quantiles of what is proven below the points, m."""
        if len(self.points) == 0:
            return {}
        middle, most = np.quantile(self.below, [0.5, 0.95], method="higher")
        shares = {LABELS[label]: self.fraction(label) for label in (TOUCHED, BRIDGED, EXTRAPOLATED)}
        return shares | {
            "tolerance": self.tolerance,
            "below_median": float(middle) if np.isfinite(middle) else None,
            "below_95": float(most) if np.isfinite(most) else None,
        }

    def sentence(self) -> str:
        """What is proven of the estimated surface, for people."""
        shares = [f"{100 * self.fraction(label):.0f} % {LABELS[label]}" for label in (TOUCHED, BRIDGED, EXTRAPOLATED)]
        ball = float(np.linalg.norm(self.centers - self.points, axis=1).max(initial=0.0))
        if self.tolerance >= ball:
            # wherever a ball rests something touches it: that much is known without its neighbours
            apart = f"The sweeps lie too far apart to prove to better than the ball's radius, {length_text(ball, 2)},"
            return f"Of the estimated surface {', '.join(shares)}. {apart} where between them the body is."
        half = float(np.quantile(self.below, 0.5, method="higher")) if len(self.points) else float("inf")
        known = f"and within {length_text(half, 2)} of half of all points" if np.isfinite(half) else ""
        touched = f"whatever its form, the body comes within {length_text(self.tolerance, 2)} of what is touched"
        proven = " ".join(part for part in (touched, known) if part)
        return f"Of the estimated surface {', '.join(shares)}. Proven is: {proven}; closer sweeps prove more."


_OF_POINTS = ("points", "normals", "centers", "labels", "sample", "sweep", "across", "below", "above")
