"""BellShape: a bump of revolution whose flank runs out into the base, from a cosine to the paper's bump and beyond."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from mapping import FloatArray
from mapping.inference.families.bump import BumpShape, Spot
from mapping.inference.families.hollow import bin_nodes
from mapping.inference.families.problem import Sizes
from mapping.inference.likelihood import Prior, Uniform, Window

# From flanks that end as those of smooth hollows do to skirts that are flatter than the paper's bump (taper 1)
BELL_TAPERS = (-0.65, 2.0)
# A taper nearer to 0 is a Gaussian, and said as the exponent 1/k of this one
LEAST_TAPER = 1e-5


@dataclass(frozen=True, eq=False)
class BellShape:
    """Bells z = H (1 + k u^2 / w^2)^(-1/k): position, height, log half width at half height, taper k.

    k = 1 is the paper's bump of revolution (H = 1, w = 1/sqrt(a)), 0 a Gaussian bump, -0.4 nearly a cosine. `free` is 1
    for a lone profile: the bell is then taken to lie under it. It stands on a ball of the base's mean curvature.

    Reference: the paper, section 2.3; theory equations 2.7 and 4.10b.
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
        return (*("along", "across")[: self.free], "height", "log half width", "taper")

    @property
    def units(self) -> tuple[str, ...]:
        return (*("m", "m")[: self.free], "m", "ln m", "")

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights over the base's trace, m."""
        from mapping.geometry.templates import bell_heights

        spot, place = self.spot, np.zeros((len(theta), 2))
        place[:, : self.free] = theta[:, : self.free]
        standing = spot.lifted(place, np.zeros(len(theta))), spot.normals(place), float(spot.bends.mean())
        height, taper = (np.ascontiguousarray(theta[:, column]) for column in (-3, -1))
        out = np.empty((len(theta), len(self.window)))
        section = height, np.exp(theta[:, -2]), taper
        bell_heights(self._nodes, self.window.normals, *standing, *section, self.tip_radius, out)
        return out

    @cached_property
    def _nodes(self) -> FloatArray:
        return bin_nodes(self.window)


def bell_beside(cap: BumpShape, sizes: Sizes) -> BellShape:
    """Bells on a cap's window, about its spot: as wide at half height as a ball that lies on the base, unless the data
    say otherwise, and of any taper."""
    priors = (*cap.priors, Uniform(*BELL_TAPERS))
    start = np.array([*cap.start[:-1], np.log(sizes.half_width) - 1.0, 0.1])
    step = np.array([*cap.step[:-1], 0.05, 0.1])
    return BellShape(cap.window, cap.spot, cap.tip_radius, cap.free, priors, start, step)


def bell_section(half: ArrayLike, taper: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Scales w, m, and exponents p = 1/k of bells of a half width at half height, m, and a taper k."""
    k = np.asarray(taper, dtype=np.float64)
    k = np.where(np.abs(k) < LEAST_TAPER, LEAST_TAPER, k)
    return np.asarray(half / np.sqrt(np.expm1(k * np.log(2.0)) / k)), np.asarray(1.0 / k)


def width_at_half_height(scale: ArrayLike, exponent: ArrayLike) -> FloatArray:
    """Full width of a bell on the body where it has half of its height, m."""
    p = np.asarray(exponent, dtype=np.float64)
    return np.asarray(2.0 * np.asarray(scale, dtype=np.float64) * np.sqrt(p * np.expm1(np.log(2.0) / p)))
