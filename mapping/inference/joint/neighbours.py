"""Neighbours: where features that disturb one another's traces are likeliest together, and how sure that leaves each.

A posterior holds the neighbours of a feature where they are known to be. They are known no better than from the same
trace: where two domes of braille share a valley, each may be higher if the other is lower. Searched for one after the
other, each beside the last guesses of the rest, such domes creep towards where they are likeliest; together they are
there at once, and their Gaussian says what the posterior of each lacks, by the law of total variance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mapping import EmptyWindowError, Feature, FloatArray, Posterior
from mapping.geometry.mesh import arclengths, resample
from mapping.inference import described_at
from mapping.inference.families import (
    MODEL_FLOOR,
    PosteriorProblem,
    Surroundings,
    tells_of_line,
    window_of_all,
)
from mapping.inference.joint.joined_shape import JoinedShape
from mapping.inference.kinds import LineKind, PointKind, feature_trace, felt_beside, kind_of, sizes_of
from mapping.inference.likelihood import LogPosterior, Nuisance, Shape, Window, build_likelihood
from mapping.inference.sampler import find_optima, laplace, linearised, root_of

# More features than that are laid out in blocks: the time of a search grows with the square of their number. Eight
# domes on 3,000 bins, begun with no width, took 0.8 to 2.4 s; the configurations are weighed in blocks of ten, too
MOST_TOGETHER = 10
# Points of a crest, in half-widths w of what it disturbs: half-way between two of them a place at the window's edge,
# 3 w away, seems farther off than it is by (w / 8)^2 / (6 w) = 0.003 w
CREST_SPACING = 0.25


@dataclass(frozen=True, eq=False)
class NeighboursDoubt:
    """What a feature's neighbours would leave beside it if they were else.

    Args:
        near: the neighbours, as they are likeliest.
        moved: each of them with one of its M parameters moved, and its number.
        root: (M, Q) root of the covariance of these parameters, in what each was moved by.
        tip: radius of the fingertip, m.
    """

    near: Sequence[Feature]
    moved: Sequence[tuple[int, Feature]]
    root: FloatArray
    tip: float

    def widened(self, problem: PosteriorProblem, posterior: Posterior, rng: np.random.Generator) -> Posterior:
        """The draws of a posterior that holds the neighbours, with what it lacks thereby: their optimum goes with them,
        to first order."""
        window = problem.window
        traces = [self._trace(feature, window) for feature in self.near]

        def beside(traces: Sequence[FloatArray]) -> LogPosterior:
            return replace(problem.target, beside=felt_beside(problem.feature, self.near, traces, window.feet))

        still = beside(traces)
        best = posterior.samples[int(np.argmax(still.log_density(posterior.samples)))]
        residual, jacobian = linearised(still, best)
        changes = np.empty((len(residual), len(self.moved)))
        for column, (number, feature) in enumerate(self.moved):
            other = [*traces]
            other[number] = self._trace(feature, window)
            changes[:, column] = beside(other).residuals(best[None])[0] - residual
        response = -laplace(still, best, scanned=False).covariance @ jacobian.T @ changes @ self.root
        normal = rng.standard_normal((len(posterior.samples), response.shape[1]))
        samples = np.clip(posterior.samples + normal @ response.T, still.low, still.high)
        return replace(posterior, samples=samples)

    def _trace(self, feature: Feature, window: Window) -> FloatArray:
        return feature_trace(feature, window.feet, window.normals, self.tip)


@dataclass(frozen=True, eq=False)
class Together:
    """Features that disturb one another's traces, at the optimum of all.

    Args:
        detected: as they were detected.
        shapes: the families that they were searched in, over one window.
        target: the density of all parameters in a row.
        theta: (P,) where that is highest.
        around: what they were felt in.
    """

    detected: Sequence[Feature]
    shapes: Sequence[Shape]
    target: LogPosterior
    theta: FloatArray
    around: Surroundings

    @cached_property
    def features(self) -> list[Feature]:
        """The features there, without intervals."""
        return [self._described(k, self.theta[own]) for k, own in enumerate(self._columns)]

    def doubt_beside(self, k: int) -> NeighboursDoubt:
        """What the neighbours of the k-th leave open."""
        others = [m for m in range(len(self.shapes)) if m != k]
        moved = [(others.index(m), feature) for m in others for feature in self._varied[m]]
        rest = np.concatenate([np.arange(self._columns[m].start, self._columns[m].stop) for m in others])
        root = self._root[rest] / self._sds[rest, None]
        return NeighboursDoubt([self.features[m] for m in others], moved, root, self.around.trace.tip_radius)

    @cached_property
    def _covariance(self) -> FloatArray:
        return laplace(self.target, self.theta, scanned=False).covariance

    @cached_property
    def _root(self) -> FloatArray:
        return root_of(self._covariance)

    @cached_property
    def _sds(self) -> FloatArray:
        """(P,) by how much each parameter is moved: what it is known to, up to its bounds."""
        sds = np.sqrt(np.diag(self._covariance))
        up, down = self.target.high - self.theta, self.theta - self.target.low
        return np.where(up >= down, np.minimum(sds, np.maximum(up, 0.0)), -np.minimum(sds, down))

    @cached_property
    def _varied(self) -> list[list[Feature]]:
        """Of each feature itself with one of its parameters moved, for each of them."""
        return [
            [self._described(k, self.theta[own] + move) for move in np.diag(self._sds[own])]
            for k, own in enumerate(self._columns)
        ]

    @property
    def _columns(self) -> list[slice]:
        shape = self.target.shape
        assert isinstance(shape, JoinedShape)
        return shape.columns

    def _described(self, k: int, theta: FloatArray) -> Feature:
        feature, around = self.detected[k], self.around
        target = LogPosterior(self.shapes[k], self.target.likelihood)
        sizes = sizes_of(feature, around.trace.tip_radius)
        problem = PosteriorProblem(feature, sizes, target, around.noise, Nuisance(0.0, 0.0), theta[None])
        return described_at(theta, problem, around.base)


def laid_together(features: Sequence[Feature], around: Surroundings) -> Together | None:
    """Features where they are likeliest together; None if one of them has no family, or no sample is near.

    Args:
        features: that disturb one another's traces, as they were detected.
        around: trace, base, noise, and others near by, which are held as they are.
    """
    if not all(_has_course(feature) for feature in features):
        return None
    sizes = [sizes_of(feature, around.trace.tip_radius) for feature in features]
    noise = around.noise.rounded(around.trace.resolution)
    held = [other for other in around.others if _has_course(other)]
    try:
        window = _window(features, replace(around, noise=noise))
        shapes = [_shape_on(window, feature, around) for feature in features]
        theirs = [_shape_on(window, other, around) for other in held]
    except EmptyWindowError:
        return None
    height = max(size.height for size in sizes)
    nuisance = replace(around, noise=noise).nuisance(height)
    starts = np.concatenate([np.zeros(0), *(shape.start for shape in theirs)])
    joined = JoinedShape(shapes, len(window), 1, theirs, starts)
    target = LogPosterior(joined, build_likelihood(window, noise, nuisance, MODEL_FLOOR * height))
    return Together(features, shapes, target, find_optima(target, joined.start[None])[0], around)


def _shape_on(window: Window, feature: Feature, around: Surroundings) -> Shape:
    """The first family of a feature's kind over a window."""
    kind = kind_of(feature)
    if isinstance(kind, LineKind):
        return kind.shape_on(window, feature, around)[0]
    assert isinstance(kind, PointKind)
    return kind.shape_on(window, feature, around)


def _has_course(feature: Feature) -> bool:
    """True of a point that has a family, or of a line of two points or more."""
    kind = kind_of(feature)
    return kind.sampled and (len(feature.axis) > 1 or not kind.line)


def _window(features: Sequence[Feature], around: Surroundings) -> Window:
    """The bins near some features that tell of all of them."""
    tip = around.trace.tip_radius
    sizes = [sizes_of(feature, tip) for feature in features]
    crests = list[FloatArray]()
    for feature, size in zip(features, sizes, strict=True):
        both = np.hstack([feature.axis, feature.normals])
        count = int(np.ceil(arclengths(feature.axis)[-1] / (CREST_SPACING * size.half_width))) + 1
        crests.append(resample(both, count) if len(both) > 1 else both)
    points, normals = np.hsplit(np.concatenate(crests), 2)
    window = window_of_all(points + tip * normals, normals, sizes, around)
    for feature, size in zip(features, sizes, strict=True):
        kind = kind_of(feature)
        if kind.line and not kind.has_ends and not feature.closed:
            window = window.only(tells_of_line(feature.axis, feature.normals, window.feet, window.run, size.half_width))
    return window
