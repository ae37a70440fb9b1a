"""Felt details: what sweeps felt to stand out of the model is in the way of ball and stem as the model is."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mapping import FloatArray, Trace
from mapping.base import Base
from planners import Refused

# Samples along so much of a sweep tell one place, in tip radii: their mean is as good as the noise allows, and on a
# crest as high as a sixth of the radius two places so far apart differ by 0.1^2 / 2 = 0.005
PLACE_SPACING = 0.1
# Room for ball and stem where there is any: a detail that is not known yet may stand out by as much, in tip radii
DETAIL_ROOM = 1.0 / 6.0
# What stands out by less is in no way's way: a way may sink by 0.05 tip radii, and is planned to sink by 0.02
STANDS_OUT = 0.03


@dataclass(eq=False)
class FeltDetails:
    """Places of the body that stand out of its model, as far as sweeps have felt them.

    A ball that rests at a height over the model rests on something: a place of the body lies a tip radius beneath the
    ball's centre, against the model's normal. Beside a crest that place is taken to be higher than it is. So does one
    that ran into something on its way.

    Args:
        base: the model.
        tip_radius: m.
    """

    base: Base
    tip_radius: float
    _places: list[FloatArray] = field(init=False, default_factory=list)
    _tree: Any = field(init=False, default=None)

    def learn(self, answer: Trace, speed: float) -> None:
        """Keep what a sweep at that speed (m/s) felt to stand out, or where a move ran into something."""
        if isinstance(answer, Refused):
            if answer.touching is not None:
                self._ran_into(answer.touching[None])
        elif len(answer):
            centers = _means(answer, PLACE_SPACING * self.tip_radius / speed)
            feet = self.base.foot(centers, self.tip_radius)
            out = feet.height > STANDS_OUT * self.tip_radius
            self._keep(centers[out] - self.tip_radius * feet.normals[out])

    def _ran_into(self, center: FloatArray) -> None:
        """Something holds up a ball there (1, 3), nobody knows how high: as high as a detail may stand out."""
        normals = self.base.foot(center, self.tip_radius).normals
        self._keep(center - (1.0 - DETAIL_ROOM) * self.tip_radius * normals)

    def _keep(self, places: FloatArray) -> None:
        if len(places):
            self._places.append(places)
            self._tree = None

    def distance(self, places: FloatArray, most: float) -> FloatArray:
        """(N,) how far places (N, 3) are from the nearest that stands out, m; infinite if farther than `most`."""
        if not self._places:
            return np.full(len(places), np.inf)
        if self._tree is None:
            from scipy.spatial import cKDTree

            self._tree = cKDTree(np.concatenate(self._places))
        return np.asarray(self._tree.query(places, distance_upper_bound=most)[0])


def _means(trace: Trace, duration: float) -> FloatArray:
    """(M, 3) mean centres over so much of a sweep each, s."""
    begin = np.flatnonzero(np.diff(np.floor(trace.t / duration), prepend=-np.inf))
    count = np.diff(begin, append=len(trace))
    return np.asarray(np.add.reduceat(trace.centers, begin) / count[:, None])
