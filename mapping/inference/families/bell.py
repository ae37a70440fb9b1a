"""BellShape: a bump of revolution whose flank runs out in a skirt, like the paper's."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from mapping import FloatArray
from mapping.inference.families.bump import Spot
from mapping.inference.families.hollow import bin_nodes
from mapping.inference.families.problem import Sizes
from mapping.inference.likelihood import Prior, Uniform, Window

# Exponents from flatter skirts than the paper's bump (1) to what cannot be told from a Gaussian.
EXPONENTS = (0.5, 30.0)


@dataclass(frozen=True, eq=False)
class BellShape:
    """Bells z = H (1 + u^2 / (p w^2))^-p: position, height, log scale w and log exponent p.

    p = 1 is the paper's bump of revolution (H = 1, w = 1/sqrt(a)); large p is a Gaussian bump. `free` is 1 for a lone
    profile: the bell is then taken to lie under it. On a curved base the ball feels heights over the base as a ball
    of curvature 1/r + k feels them over a plane.

    Reference: the paper, section 2.3.
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
        return (*("along", "across")[: self.free], "height", "log scale", "log exponent")

    @property
    def units(self) -> tuple[str, ...]:
        return (*("m", "m")[: self.free], "m", "ln m", "")

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights over the base's trace, m."""
        from mapping.geometry.templates import bell_heights

        place = np.zeros((len(theta), 2))
        place[:, : self.free] = theta[:, : self.free]
        out = np.empty((len(theta), len(self.window)))
        height = np.ascontiguousarray(theta[:, -3])
        scale, exponent = np.exp(theta[:, -2]), np.exp(theta[:, -1])
        tip = 1.0 / max(1.0 / self.tip_radius + float(self.spot.bends.mean()), 1e-3 / self.tip_radius)
        bell_heights(*self._places, place, height, scale, exponent, tip, out)
        return out

    @cached_property
    def _places(self) -> tuple[FloatArray, FloatArray]:
        """(n, nodes) tangent coordinates of the nodes of each bin, m."""
        nodes = bin_nodes(self.window) - self.spot.point
        return nodes @ self.spot.axes[0], nodes @ self.spot.axes[1]


def bell_shape(
    window: Window, spot: Spot, sizes: Sizes, tip: float, free: int, place: Prior, height: Prior
) -> BellShape:
    """Bells about a spot: any scale down to a thousandth of the disturbance, any exponent of the family."""
    scale = float(np.log(sizes.half_width))
    priors = (*(place,) * free, height, Uniform(scale - 7.0, scale + 1.5), Uniform(*np.log(EXPONENTS)))
    start = np.array([0.0] * free + [sizes.height, scale - 1.0, 0.3])
    step = np.array([0.02 * sizes.half_width] * free + [0.02 * sizes.height, 0.05, 0.1])
    return BellShape(window, spot, tip, free, priors, start, step)


def width_at_half_height(scale: ArrayLike, exponent: ArrayLike) -> FloatArray:
    """Full width of a bell on the body where it has half of its height, m."""
    p = np.asarray(exponent, dtype=np.float64)
    return np.asarray(2.0 * np.asarray(scale, dtype=np.float64) * np.sqrt(p * np.expm1(np.log(2.0) / p)))
