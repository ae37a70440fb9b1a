"""Inspected: which faces of the base are free of features above which height, and where the ball touched it at all."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mapping import FloatArray, Surface, Trace, length_text
from mapping.base import Base, LaidTrace
from mapping.detection import Detections, found_heights
from mapping.estimate.envelope import Estimate
from mapping.estimate.sweeps import EXTRAPOLATED, pitch
from mapping.geometry.mesh import asked_part

# Places that tell which of the surface was touched
MOST_SURFACE_CELLS = 20_000
# Heights that the record states the inspected share for, in detection limits
STATED = (1.0, 1.5, 2.0, 3.0, 5.0, 10.0)
# Where no height is asked for, those are told that hold on so much of what sweeps came near: the limit itself holds
# only where a sweep passes, on no area
TOLD_SHARES = (("half", 0.5), ("nine tenths", 0.9))
# Where less of the surface than this is inspected for the height asked for, the height is told for which so much is
WELL_INSPECTED = 0.95


@dataclass(frozen=True, eq=False)
class Inspected:
    """What the sweeps say about the places where nothing was found.

    Args:
        height: (F,) m: a sharp crest at least so high anywhere on the face would have been found; infinity where
            no sweep passed within a tip radius.
        place, area: (N,) the same at places all over what was to be inspected, m, and what each stands for, m^2;
            without those where a fitted base goes on beyond what was felt.
        limit: height found where a sweep crosses it, m.
        probability: with which all this holds.
        asked: height of the smallest feature that the scene asks for, m, or None.
    """

    height: FloatArray
    place: FloatArray
    area: FloatArray
    limit: float
    probability: float
    asked: float | None = None

    @classmethod
    def of(
        cls,
        trace: Trace,
        base: Base,
        detections: Detections,
        asked: float | None,
        region: tuple[FloatArray, FloatArray] | None = None,
        sides: FloatArray | None = None,
    ) -> Inspected:
        """What a trace inspected of a base, by the noise and the threshold of its detection.

        Args:
            region, sides: what was to be inspected lies in it, and faces one of them (see `asked_part`); all, if that
                is nothing.
        """
        limit = detections.detection_limit
        if base.kind == "profile":  # a strip as wide as one likes: all of it lies under the one sweep
            height = np.full(len(base.surface.faces), limit)
            return cls(height, height, base.surface.face_areas, limit, detections.probability, asked)
        places, _ = LaidTrace.of(trace, base).touched(MOST_SURFACE_CELLS)
        if not np.isfinite(limit):
            places = places[:0]
        found = found_heights(base.surface, places, trace.tip_radius, limit)
        part = asked_part(base.surface, region, sides)
        if part is not None and part is not base.surface:
            found = replace(found_heights(part, places, trace.tip_radius, limit), face=found.face)
        # what a fit added beyond the samples is no part of a body that was asked to be inspected
        told = np.isfinite(found.place)
        if told.any():
            told[~told] = ~base.beyond(found.points[~told], trace.tip_radius)
            return cls(found.face, found.place[told], found.area[told], limit, detections.probability, asked)
        return cls(found.face, found.place, found.area, limit, detections.probability, asked)

    def share(self, height: float) -> float:
        """Share of the area on which every crest at least `height` m high would have been found."""
        return float(self.area[self.place <= height].sum() / self.area.sum())

    def above(self, share: float) -> float:
        """Height above which every crest would have been found on that share of what sweeps came near, m."""
        near = np.isfinite(self.place)
        order = np.argsort(self.place[near], kind="stable")
        area = np.cumsum(self.area[near][order])
        return float(self.place[near][order][np.searchsorted(area, share * area[-1])]) if len(area) else float("inf")

    @property
    def untouched(self) -> float:
        """Share of the area that no sweep came near."""
        return float(self.area[~np.isfinite(self.place)].sum() / self.area.sum())

    def record(self) -> dict[str, Any]:
        """JSON values: the share of the area that is inspected for features above some heights, m."""
        heights = [self.limit * step for step in STATED] if np.isfinite(self.limit) else []
        heights += [] if self.asked is None else [self.asked]
        return {
            "probability": self.probability,
            "detection_limit": self.limit,
            "shares": [{"height": height, "share": self.share(height)} for height in sorted(heights)],
            "untouched": self.untouched,
        }

    def sentence(self) -> str:
        """The same for people."""
        if not np.isfinite(self.limit if self.asked is None else self.asked):
            return "The trace is too short to say what it inspected."
        if self.asked is None:
            told = [f"{name} of it above {length_text(self.above(share), 2)}" for name, share in TOLD_SHARES]
            sentence = f"Of the surface that sweeps came near, sharp features are found on {' and on '.join(told)}"
        else:
            sentence = (
                f"{100 * self.share(self.asked):.1f} % of the surface is inspected for sharp features above "
                f"{length_text(self.asked, 2)}"
            )
            near = 1.0 - self.untouched
            if self.share(self.asked) < WELL_INSPECTED <= near:
                height = length_text(self.above(WELL_INSPECTED / near), 2)
                sentence += f", {100 * WELL_INSPECTED:.0f} % above {height}"
        sentence += f", with a probability of at least {100 * self.probability:.0f} % each."
        if self.untouched > 5e-4:
            sentence += f" No sweep came near {100 * self.untouched:.1f} % of it."
        return sentence


# A vertex takes the label of the nearest estimated point within this many distances between points or sweeps.
TOUCHED_REACH = 3.0


def base_reach(surface: Surface, estimate: Estimate) -> dict[str, FloatArray]:
    """Fields (V,) of a model at its vertices, those of the nearest estimated point.

    Returns:
        `reach`: its label, EXTRAPOLATED far from any; `below` and `above`: what is proven of it, m, infinite far
        from any.
    """
    from scipy.spatial import cKDTree

    tree = cKDTree(estimate.points)
    apart = np.asarray(tree.query(estimate.points, k=[2])[0])
    reach = TOUCHED_REACH * max(float(np.median(apart)), pitch(estimate.points, estimate.sweep))
    distance, nearest = tree.query(surface.vertices)
    near = distance <= reach
    return {
        "reach": np.where(near, estimate.labels[nearest].astype(np.float64), float(EXTRAPOLATED)),
        "below": np.where(near, estimate.below[nearest], np.inf),
        "above": np.where(near, estimate.above[nearest], np.inf),
    }
