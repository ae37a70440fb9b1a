"""TwinShape: two ridges of one section that run beside each other at one distance, as a double wire does."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mapping import FloatArray
from mapping.inference.families.problem import Sizes
from mapping.inference.families.ridge import RidgeShape
from mapping.inference.families.trapezoid import NARROWEST_PART, WIDEST_PART
from mapping.inference.likelihood import LogOfUniform, Prior

# Ridges from one of both to the other that fill the gap: the ball sinks by a 64th of what it sinks into the gap
FILLING_SIDES = tuple(np.linspace(-1.0, 1.0, 9).tolist())


@dataclass(frozen=True, eq=False)
class TwinShape:
    """A ridge twice, to either side of its course: log gap between both, and the parameters of the ridge midway.

    One parameter more than a ridge has, as a flat top is. The gap is clear: what overlaps is one line. The second ridge
    lies anywhere beside the first, as any detail does: gaps are equally probable, not their logarithms, of which half
    would be of ridges that all but touch. Of wires that lie on the base the height is the diameter: no radius is told.

    Args:
        midway: the ridge on the course between both.
        half_width: of the disturbance of one of them, m: the scale of gaps.
        lying: True of two wires that lie on the base.
        sides: where ridges run, as shares of the way from the course to either of both.
    """

    midway: RidgeShape
    half_width: float
    lying: bool = False
    sides: tuple[float, ...] = (-1.0, 1.0)

    @property
    def filled(self) -> TwinShape:
        """The same without the gap, which ridges in between fill: a bar from one to the other."""
        return replace(self, sides=FILLING_SIDES)

    @property
    def names(self) -> tuple[str, ...]:
        return ("log gap", *self.midway.names[self._told])

    @property
    def units(self) -> tuple[str, ...]:
        return ("ln m", *self.midway.units[self._told])

    @property
    def priors(self) -> tuple[Prior, ...]:
        gap = LogOfUniform(*np.log(self.half_width * np.array([NARROWEST_PART, WIDEST_PART])))
        return (gap, *self.midway.priors[self._told])

    @property
    def start(self) -> FloatArray:
        return np.concatenate([[np.log(0.2 * self.half_width)], self.midway.start[self._told]])

    @property
    def step(self) -> FloatArray:
        return np.concatenate([[0.05], self.midway.step[self._told]])

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights over the base's trace, m: the highest of all (dilation distributes over unions)."""
        return np.asarray(np.maximum.reduce([self.midway.templates(self.single(theta, side)) for side in self.sides]))

    def single(self, theta: FloatArray, side: float) -> FloatArray:
        """(W, P - 1) parameters of the ridge on one side, -1 or 1, of the course midway, or in between."""
        ridge = theta[:, 1:].copy()
        if self.lying:
            ridge = np.column_stack([ridge, np.log(0.5 * np.maximum(ridge[:, -1], np.finfo(float).tiny))])
        ridge[:, 0] += side * (0.5 * np.exp(theta[:, 0]) + np.exp(ridge[:, -1]))
        return np.ascontiguousarray(ridge)

    @property
    def _told(self) -> slice:
        """Of the ridge's parameters those that are told."""
        return slice(-1) if self.lying else slice(None)


def twin_beside(ridge: RidgeShape, sizes: Sizes, *, lying: bool = False) -> TwinShape:
    """The family on a ridge's window, with its course, its ends and its section, and their priors."""
    return TwinShape(ridge, sizes.half_width, lying)
