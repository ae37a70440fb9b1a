"""Common deviation: by how much a section differs from its family is weighed once, not at each crossing anew.

The section of a detail is a little other than any of a family, and what the instrument does at a flank it does at every
one: all crossings show that alike. Were it taken for noise, which is another one at each crossing, n crossings would be
n times the evidence for whatever explains it: another wire beside, or a groove. To the trace of each detail a function
of the distance from its middle is therefore added, the same all along it: cubic B-splines with Gaussian amplitudes,
which are marginalised together with the parameters of the family (model discrepancy; Kennedy and O'Hagan, Bayesian
calibration of computer models, JRSS B 63, 2001). How large it is the data say.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mapping import BoolArray, Feature, FloatArray
from mapping.geometry.mesh import spline_design
from mapping.inference.families import TwinShape
from mapping.inference.joint import JoinedShape, stands_out
from mapping.inference.kinds import kind_of, sizes_of
from mapping.inference.likelihood import LogPosterior, Shape
from mapping.inference.sampler import linearised

# Standard deviations of the amplitudes, in heights of the detail, equally probable beforehand: none, and in steps of
# about three from the least level of misfit to a tenth, by which bars differ from caps. An amplitude whose size lies
# between two steps, off by a factor of the root of three, costs 1/2 (ln q + 1/q - 1) with q = 3 or 1/3, at most 0.45
DEVIATION_SHARES = (0.0, 0.01, 0.03, 0.1)
# Splines to a half-width of the disturbance: where nine crossings of two wires 1 mm apart were wrong by 1 % of the
# height, correlated over 0.6 mm (a sixth of a half-width), 4 left one bar by log odds of 9, 8 the wires by 2. Farther
# than two half-widths beside a detail its neighbourhood ends
SPLINES_PER_HALF_WIDTH, DEVIATION_REACH = 8.0, 2.0


@dataclass(frozen=True)
class Deviation:
    """What is gained by sections that may deviate from their families.

    Args:
        log_factor: log Bayes factor of such details against those that do not deviate.
        explained: of the squares of the whitened residual, by deviations of the likeliest size.
    """

    log_factor: float = 0.0
    explained: float = 0.0


@dataclass(frozen=True, eq=False)
class Fitted:
    """A detail at the optimum: what it is called, its family, and its parameters (P,)."""

    feature: Feature
    shape: Shape
    theta: FloatArray


def common_deviation(details: Sequence[Fitted], target: LogPosterior, fine: int, tip_radius: float) -> Deviation:
    """Weigh what all crossings of some details may show alike.

    Args:
        details: in the order of their parameters.
        target: the density of all parameters together.
        fine: parts of a bin, which the shapes lie on.
        tip_radius: m.

    Reference: linear Gaussian models as in Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006,
    section 2.7; directions of the parameters are projected out, which marginalises both together.
    """
    window = target.likelihood.window
    columns, heights = _deviations(details, window.feet, fine, tip_radius)
    if not len(columns):
        return Deviation()
    theta = np.concatenate([detail.theta for detail in details])
    residual, slopes = linearised(target, theta)
    slopes = slopes[:, (theta > target.low) & (theta < target.high)]  # what a bound holds does not give way
    scale = np.linalg.norm(slopes, axis=0)
    left, strength, _ = np.linalg.svd(slopes / np.where(scale > 0.0, scale, 1.0), full_matrices=False)
    own = left[:, strength > 1e-9 * strength.max(initial=1.0)]
    white = target.likelihood.residuals(window.height - columns)
    white = np.pad(white, ((0, 0), (0, len(residual) - white.shape[1]))).T * heights
    free, rest = white - own @ (own.T @ white), residual - own @ (own.T @ residual)
    strength, turn = np.linalg.eigh(free.T @ free)
    strength, along = np.maximum(strength, 0.0), (turn.T @ (free.T @ rest)) ** 2
    variance = np.array(DEVIATION_SHARES)[:, None] ** 2
    explained = (variance * along / (1.0 + variance * strength)).sum(axis=1)
    factors = 0.5 * explained - 0.5 * np.log1p(variance * strength).sum(axis=1)
    log_factor = float(np.logaddexp.reduce(factors) - np.log(len(factors)))
    return Deviation(log_factor, float(explained[int(np.argmax(factors))]))


def _deviations(
    details: Sequence[Fitted], feet: FloatArray, fine: int, tip_radius: float
) -> tuple[FloatArray, FloatArray]:
    """(K, n) splines of the distance from the middle of each detail where it is felt, and (K,) heights of it, m."""
    own = [JoinedShape([each.shape], len(feet), fine).templates(each.theta[None])[0] for each in details]
    crests = [heights for each, heights in zip(details, own, strict=True) if stands_out(each.shape)]
    highest = np.max(crests, axis=0) if crests else np.zeros(len(feet))
    columns, sizes = [np.zeros((0, len(feet)))], [np.zeros(0)]
    for each, heights in zip(details, own, strict=True):
        shown = heights == highest if stands_out(each.shape) else np.ones(len(feet), dtype=bool)
        half_width = sizes_of(each.feature, tip_radius).half_width
        splines = _across(each, feet, half_width, heights != 0.0, shown)
        columns.append(splines)
        sizes.append(np.full(len(splines), float(np.abs(heights).max())))
    return np.concatenate(columns), np.concatenate(sizes)


def _across(detail: Fitted, feet: FloatArray, half_width: float, felt: BoolArray, shown: BoolArray) -> FloatArray:
    """(K, n) splines over where a detail is felt, and one spline beyond, unless another one hides it there."""
    along, away = _coordinates(detail, feet)
    inside = felt & (np.abs(away) < DEVIATION_REACH * half_width)
    if not inside.any():
        return np.zeros((0, len(feet)))
    step = half_width / SPLINES_PER_HALF_WIDTH
    reach = float(np.abs(away[inside]).max()) + step
    inside = shown & (np.abs(away) < reach) & (along >= along[inside].min()) & (along <= along[inside].max())
    knots = np.arange((-reach if kind_of(detail.feature).line else 0.0) - 3.0 * step, reach + 4.0 * step, step)
    values = np.zeros((len(knots) - 4, len(feet)))
    values[:, inside] = spline_design(away[inside], knots, 3).T
    return values[values.any(axis=1)]


def _coordinates(detail: Fitted, feet: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n,) places along a detail, and distances from its middle: of a line signed, m."""
    shape: Any = detail.shape
    theta = detail.theta
    if isinstance(shape, TwinShape):
        shape, theta = shape.midway, theta[1:]
    if kind_of(detail.feature).line:
        s, lateral, _ = shape.chart.coordinates(feet)
        return s, lateral - shape.modes.lateral(theta[None, : shape.modes.count], s)[0]
    aside = np.zeros(2)
    aside[: shape.free] = theta[: shape.free]
    return np.zeros(len(feet)), np.linalg.norm(feet - shape.spot.point - aside @ shape.spot.axes, axis=1)
