"""PitShape: round hollows, in which the ball rests on the rim or on the bottom."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mapping import FloatArray
from mapping.inference.families.bump import Spot
from mapping.inference.families.nodes import point_nodes
from mapping.inference.likelihood import Prior, Window


@dataclass(frozen=True, eq=False)
class PitShape:
    """Round pits with an upright wall and a flat bottom: position, log width of the mouth, log depth.

    `free` is 1 for a lone profile: the pit is then taken to lie under it.
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
        return (*("along", "across")[: self.free], "log width", "log depth")

    @property
    def units(self) -> tuple[str, ...]:
        return (*("m", "m")[: self.free], "ln m", "ln m")

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights (negative) over the base's trace, m."""
        from mapping.geometry.templates import pit_heights

        place = np.zeros((len(theta), 2))
        place[:, : self.free] = theta[:, : self.free]
        out = np.empty((len(theta), len(self.window)))
        width, depth = np.exp(theta[:, -2]), np.exp(theta[:, -1])
        pit_heights(*self._places, self.spot.bends, place, width, depth, self.tip_radius, out)
        return out

    @cached_property
    def _places(self) -> tuple[FloatArray, FloatArray]:
        return point_nodes(self.window, self.spot, self.tip_radius)
