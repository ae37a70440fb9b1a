"""Inspected: which faces of the base are free of features above which height, and where the ball touched it at all."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mapping import FloatArray, Surface, Trace, length_text
from mapping.base import Base, LaidTrace
from mapping.detection import Detections, FoundHeights, found_heights
from mapping.estimate.envelope import Estimate
from mapping.estimate.sweeps import EXTRAPOLATED, pitch
from mapping.geometry.mesh import asked_part

# Distance along a sweep of the places that tell what it touched, in tip radii: halfway between two of them the ball
# lies 1/3200 of its radius higher over what it touches than it was
TOUCHED_SPACING = 0.05
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
        found: places all over what was to be inspected, and what is lost at each: by how much a crest there is felt
            lower than one that a sweep crosses; without those where a fitted base goes on beyond what was felt.
        limit: height found where a sweep crosses it, m.
        probability: with which all this holds.
        asked: height of the smallest feature that the scene asks for, m, or None.
    """

    height: FloatArray
    found: FoundHeights
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
        seen: Collection[int] | None = None,
    ) -> Inspected:
        """What a trace inspected of a base, by the noise and the threshold of its detection.

        Args:
            region, sides: what was to be inspected lies in it, and faces one of them (see `asked_part`); all, if that
                is nothing.
            seen: numbers of the sweeps on which something would have been seen; None: all.
        """
        limit = detections.detection_limit
        if base.kind == "profile":  # a strip as wide as one likes: all of it lies under the one sweep
            height = np.full(len(base.surface.faces), limit)
            middle = base.surface.vertices[base.surface.faces].mean(axis=1)
            none = np.zeros(len(height))  # above the limit; that may be infinite
            found = FoundHeights(none, none, base.surface.face_areas, middle, base.surface.face_normals)
            return cls(height, found, limit, detections.probability, asked)
        laid = LaidTrace.of(trace, base)
        if seen is not None and not (kept := np.isin(laid.sweep, list(seen))).all():
            laid = laid.within(kept)
        touched = touched_places(laid)
        found = found_heights(base.surface, *touched, trace.tip_radius)
        part, face = asked_part(base.surface, region, sides), found.face
        if part is not None and part is not base.surface:
            found = found_heights(part, *touched, trace.tip_radius)
        # what a fit added beyond the samples is no part of a body that was asked to be inspected
        told = np.isfinite(found.place)
        if told.any():
            told[~told] = ~base.beyond(found.points[~told], trace.tip_radius)
            found = found.at(told)
        return cls(limit + face, found, limit, detections.probability, asked)

    @property
    def place(self) -> FloatArray:
        """(N,) m: a sharp crest at least so high at each place would have been found."""
        return self.limit + self.found.place

    @property
    def area(self) -> FloatArray:
        """(N,) that each place stands for, m^2."""
        return self.found.area

    def counted(self) -> Inspected:
        """The same without where the places are, which takes three quarters of its memory: nobody asks any more."""
        nowhere = np.zeros((0, 3))
        return replace(self, found=replace(self.found, points=nowhere, normals=nowhere))

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


def touched_places(laid: LaidTrace) -> tuple[FloatArray, FloatArray]:
    """Places of the base that a trace touched, and unit directions from there to the ball's centre, both (M, 3)."""
    if not len(laid):
        return np.zeros((0, 3)), np.zeros((0, 3))
    path = sum(float(sweep.arclength[-1]) for sweep in laid.laid_sweeps)
    return laid.touched(1 + int(path / (TOUCHED_SPACING * laid.tip_radius)))


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
