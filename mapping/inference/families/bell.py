"""BellShape and BellRidgeShape: bumps and lines whose flanks run out into the base, from a cosine to the paper's bump
and beyond."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike

from mapping import FloatArray
from mapping.geometry.templates import smooth_outline
from mapping.inference.curves import Chart, CurveModes, Mouth, laid_beyond, mouths_of, opened
from mapping.inference.families.bump import BumpShape, Spot
from mapping.inference.families.nodes import bin_nodes, line_nodes
from mapping.inference.families.problem import Sizes
from mapping.inference.families.ridge import RidgeShape
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


@dataclass(frozen=True, eq=False)
class BellRidgeShape:
    """Lines with the section of a bell: lateral modes, places of the ends, height, log half width at half height,
    taper k.

    An end is where the crest ends: half of a bump of revolution with the line's section.

    Reference: theory equations 2.7 and 4.10b.
    """

    window: Window
    chart: Chart
    modes: CurveModes
    tip_radius: float
    priors: tuple[Prior, ...]
    start: FloatArray
    step: FloatArray

    @property
    def names(self) -> tuple[str, ...]:
        ends = () if self.chart.closed else ("start", "end")
        return (*self.modes.names, *ends, "height", "log half width", "taper")

    @property
    def units(self) -> tuple[str, ...]:
        ends = () if self.chart.closed else ("m", "m")
        return (*self.modes.units, *ends, "m", "ln m", "")

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights over the base's trace, m."""
        from mapping.geometry.templates import smooth_line_heights

        first = self.modes.count
        closed = np.tile([-1e300, 1e300], (len(theta), 1))
        ends = (
            closed
            if self.chart.closed
            else opened(self.chart, self.modes, theta[:, : self.modes.count], theta[:, first : first + 2])
        )
        courses = np.ascontiguousarray(theta[:, :first])
        section = [np.ascontiguousarray(each) for each in (theta[:, -3], np.exp(theta[:, -2]), theta[:, -1])]
        out = np.empty((len(theta), len(self.window)))
        smooth_line_heights(*self._places, courses, ends, *section, self.tip_radius, out)
        outline = partial(smooth_outline, *section)
        laid_beyond(self.mouths, out, theta, self.names, self.tip_radius, outline, fades=True)
        return out

    @cached_property
    def mouths(self) -> tuple[Mouth, ...]:
        """Where edges of the body cut it off."""
        return mouths_of(self.window, self.chart, self.modes, self.tip_radius)

    @cached_property
    def _places(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        return line_nodes(self.window, self.chart, self.modes, self.tip_radius)


def bell_ridge_beside(ridge: RidgeShape, sizes: Sizes) -> BellRidgeShape:
    """The family on a ridge's window, with its course, its ends, its height, and the priors of bells beside a cap."""
    rounded = int(not ridge.chart.closed)  # an end is round: its rounding is no parameter
    shared = [k for k in range(len(ridge.names) - 1) if not (rounded and k == ridge.modes.count)]
    priors = (*(ridge.priors[k] for k in shared), ridge.priors[-1], Uniform(*BELL_TAPERS))
    start = np.array([*ridge.start[shared], np.log(sizes.half_width) - 1.0, 0.1])
    step = np.array([*ridge.step[shared], 0.05, 0.1])
    return BellRidgeShape(ridge.window, ridge.chart, ridge.modes, ridge.tip_radius, priors, start, step)


def bell_section(half: ArrayLike, taper: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Scales w, m, and exponents p = 1/k of bells of a half width at half height, m, and a taper k."""
    k = np.asarray(taper, dtype=np.float64)
    k = np.where(np.abs(k) < LEAST_TAPER, LEAST_TAPER, k)
    return np.asarray(half / np.sqrt(np.expm1(k * np.log(2.0)) / k)), np.asarray(1.0 / k)


def width_at_half_height(scale: ArrayLike, exponent: ArrayLike) -> FloatArray:
    """Full width of a bell on the body where it has half of its height, m."""
    p = np.asarray(exponent, dtype=np.float64)
    return np.asarray(2.0 * np.asarray(scale, dtype=np.float64) * np.sqrt(p * np.expm1(np.log(2.0) / p)))


def bell_widths(draws: FloatArray, tip: float) -> tuple[FloatArray, FloatArray]:
    """(S,) widths, m, between which lines of draws (S, P) have half of their height, as far as a ball on a plane knows:
    both the bell's own where the ball touches its flanks there."""
    from mapping.geometry.templates import half_ways_touched

    out = np.empty((len(draws), 2))
    section = (np.ascontiguousarray(each) for each in (draws[:, -3], np.exp(draws[:, -2]), draws[:, -1]))
    half_ways_touched(*section, tip, out)
    return 2.0 * out[:, 0], 2.0 * out[:, 1]
