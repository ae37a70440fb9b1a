"""PosteriorProblem: one feature's posterior, posed: what is known beforehand, which samples matter, and the density."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

from mapping import Feature, FloatArray, Trace
from mapping.base import Base
from mapping.geometry.mesh import distances
from mapping.inference.likelihood import (
    Beside,
    Likelihood,
    LogPosterior,
    Nuisance,
    Shape,
    Window,
    bin_samples,
    build_likelihood,
    gather,
)
from mapping.instrument import Noise

# Bins of x_c/30 cost under 1 % of every standard deviation (theory equation 8.1); windows reach 3 x_c to either side
# of the crest.
WINDOW_BINS_PER_HALF_WIDTH = 30.0
WINDOW_REACH = 3.0
# More bins than this are made coarser: a long ridge has information to spare.
MOST_BINS = 4000
# Noise below this share of the height no longer hides what a smoothed path and wide bins do to flanks and kinks (2 um
# of a wire of 0.65 mm felt by a stage that moves by steps): the path stays as it is, and twice as many bins are taken.
PRECISE = 0.01
# What shape and base leave out, as a share of the feature's height: noise below it is not assumed.
MODEL_FLOOR = 1e-4


@dataclass(frozen=True, eq=False)
class Sizes:
    """Preliminary sizes of a feature, from its detection.

    Args:
        height: height or depth of its disturbance on the trace, m, positive.
        height_sd: standard deviation of that, m.
        radius: radius of a protruding section; half the width of a hollow one, m.
        half_width: half of the disturbance on the trace, m.
        position_sd: of the crest, m.
    """

    height: float
    height_sd: float
    radius: float
    half_width: float
    position_sd: float


@dataclass(frozen=True, eq=False)
class Surroundings:
    """All that a feature's posterior is conditioned on beside the feature itself.

    Args:
        trace: the whole trace.
        base: the global model.
        noise: of a sample.
        others: features near by.
        tip_sd: standard deviation of the tip's radius about the trace's, m; above 0 it becomes a parameter.
    """

    trace: Trace
    base: Base
    noise: Noise
    others: Sequence[Feature] = ()
    tip_sd: float = 0.0

    def nuisance(self, height: float, rise: float = 0.0) -> Nuisance:
        """What the base may do under each run of bins about a detail of a height (m), beside steps that rise (m).

        A base of several levels was fitted to them: what it leaves of a slope is noise. Were it free, it would stand
        for a step in the little of both levels that a window holds.
        What a step leaves is told over its low side, and a run that is on its high one alone is felt over that: the
        base under it lies as deep as the step rises.
        """
        vague = 3.0 * max(height, self.noise.sd)
        offset = max(vague, 3.0 * rise)
        if len(self.base.levels) > 1:
            return Nuisance(offset, self.noise.sd, self.noise.sd)
        return Nuisance(offset, vague, 0.0 if self.base.kind == "mesh" else 0.3 * height)


@dataclass(frozen=True, eq=False)
class PosteriorProblem:
    """A posed posterior.

    Args:
        feature: what was detected.
        sizes: its preliminary sizes.
        target: the density of the shape's parameters.
        noise: the noise in its likelihood.
        nuisance: prior of the base under each run.
        beginnings: (M, P) places to start the search for the optimum from.
        misfit: standard deviations of chi-square by which the best shape's residual exceeds the noise that was given,
            where the noise had to be raised for that; 0 where the shape fits.
    """

    feature: Feature
    sizes: Sizes
    target: LogPosterior
    noise: Noise
    nuisance: Nuisance
    beginnings: FloatArray
    misfit: float = 0.0

    @classmethod
    def posed(
        cls,
        feature: Feature,
        sizes: Sizes,
        shape: Shape,
        window: Window,
        around: Surroundings,
        beginnings: FloatArray,
        beside: Beside | None,
        rise: float,
    ) -> Self:
        """With the noise of the surroundings, and what neighbours leave beside the feature, steps of a rise (m) too."""
        nuisance = around.nuisance(sizes.height, rise)
        likelihood = _likelihood(window, around.noise, nuisance, sizes.height, None)
        return cls(feature, sizes, LogPosterior(shape, likelihood, beside), around.noise, nuisance, beginnings)

    @property
    def window(self) -> Window:
        return self.target.likelihood.window

    def under(self, noise: Noise, inflation: FloatArray | None = None) -> PosteriorProblem:
        """The same problem under another noise, or with more variance for some bins."""
        likelihood = _likelihood(self.window, noise, self.nuisance, self.sizes.height, inflation)
        return replace(self, noise=noise, target=self.target.with_likelihood(likelihood))


def window_for(crest: FloatArray, normals: FloatArray, sizes: Sizes, around: Surroundings) -> Window:
    """The bins near a crest polyline (K, 3) on the base, lifted by the caller to the ball's centre, m; its normals."""
    return window_of_all(crest, normals, [sizes], around)


def window_of_all(crest: FloatArray, normals: FloatArray, sizes: Sequence[Sizes], around: Surroundings) -> Window:
    """The bins near the crests of some features (K, 3), lifted to the ball's centre, m; their normals: wide enough for
    the widest of them, and fine enough for the narrowest."""
    reach = max(window_reach(each, around.trace.tip_radius) for each in sizes)
    samples = gather(around.trace, around.base, crest, normals, reach)
    narrowest = min(each.half_width for each in sizes)
    width, noise = narrowest / WINDOW_BINS_PER_HALF_WIDTH, around.noise.sd
    highest = max(each.height for each in sizes)
    precise = noise <= PRECISE * highest
    # a bin across a kink, where slopes differ by 2 h / x_c, lies off it by an eighth of its width times that: as much
    # as noise of PRECISE hides of bins of x_c / 30
    width *= min(max(noise / highest, MODEL_FLOOR) / PRECISE, 1.0)
    most, smooth_over = (2 * MOST_BINS, 0.0) if precise else (MOST_BINS, narrowest)
    window = bin_samples(samples, width, noise, smooth_over, around.noise.levels)
    if len(window) > most:
        coarser = min(width * len(window) / most, narrowest / 8.0)
        window = bin_samples(samples, coarser, noise, smooth_over, around.noise.levels)
    return window


def window_reach(sizes: Sizes, tip_radius: float) -> float:
    """How far from its crest a feature's window reaches, m."""
    # beside a wide detail the base is told within as much as beside a thin one of its height: what stands farther off
    # is another's
    thin = float((2.0 * tip_radius * sizes.height) ** 0.5)
    return min(WINDOW_REACH * sizes.half_width, sizes.half_width + WINDOW_REACH * thin) + 2.0 * sizes.position_sd


def _likelihood(
    window: Window, noise: Noise, nuisance: Nuisance, height: float, inflation: FloatArray | None
) -> Likelihood:
    return build_likelihood(window, noise, nuisance, MODEL_FLOOR * height, inflation)


# An end at which a line meets another lies that near to where it was detected, in half-widths: what the other one
# covers does not tell it
MEETING_REACH = 0.5


def touches(end: FloatArray, other: Feature, half_width: float) -> bool:
    """True if a line whose end (3,) this is meets another feature there."""
    return len(other.axis) > 1 and bool(distances(end[None], other.axis)[0] < MEETING_REACH * half_width)
