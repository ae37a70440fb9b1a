"""Smooth axis: the simplest curve through the crossings of a ridge that their uncertainty allows."""

from __future__ import annotations

import numpy as np

from mapping import CourseError, FloatArray, lengths

# Two half circles that meet in an S lie off their best polynomials by 4.7 % of their radius at degree 8, by 0.9 % at
# 16; a course takes a degree only where it pays for itself
HIGHEST_DEGREE = 16
# Errors of N places at even distances come out up to 2.6 to 3.5 times as large between them through a polynomial of
# degree 2 sqrt(N), N from 16 to 64, but 14 times at 3 sqrt(N), and 123 times at N - 2 of 16 (sums of the weights of all
# places, the largest over the stretch). Of few places that allows less than 8, which may be tried of any
STABLE_SHARE, ALWAYS_TRIED = 2.0, 8
# A fit whose typical square residual exceeds this many variances follows the axis at no degree: the axis is kept.
POOR = 9.0
# Degrees of freedom of the residuals' tails, and the median of chi-square with two.
RESIDUAL_TAIL_FREEDOM, MEDIAN = 4.0, 1.386
REWEIGHTING_ROUNDS = 8


def smooth_axis(axis: FloatArray, sd: float, most: int = HIGHEST_DEGREE, least: int = 1) -> tuple[FloatArray, int]:
    """A polyline (K', D) along polynomials (closed axis: Fourier series) of the degree with the best evidence.

    Args:
        axis: (K, D) crossings in order, in space or in the plane, m; first equals last if closed.
        sd: standard deviation of a crossing, m.
        most, least: degrees to try; a single one is taken whether it fits or not.

    Returns:
        The smoothed polyline and its degree; the axis itself and the highest degree if none fits.

    Raises:
        CourseError: all crossings are in one place, or one is nowhere.
    """
    closed = len(axis) > 3 and bool(np.array_equal(axis[0], axis[-1]))
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(axis, axis=0), axis=1))])
    points = len(axis) - 1 if closed else len(axis)
    most = min((points - 2) // 2 if closed else points - 2, most)
    most = min(most, max(ALWAYS_TRIED, int(STABLE_SHARE * np.sqrt(points))))
    lowest = min(least, most)
    if most < 1:
        return axis, 1
    if not 0.0 < s[-1] < np.inf:
        raise CourseError(f"a course needs crossings in two places; found {len(axis)} in one, or one that is nowhere")
    x = s / s[-1] * 2.0 - 1.0
    dense = np.linspace(-1.0, 1.0, max(2, 4 * len(axis), 65 if closed else 2))
    best, best_cost, best_misfit = lowest, np.inf, np.inf
    for degree in range(lowest, most + 1):
        coefficients, square = _fit(axis[:points], x[:points], degree, closed, sd)
        # All coordinates but one are across the axis; that one is the order of the crossings, not a datum.
        freedom = (axis.shape[1] - 1.0) * len(coefficients)
        cost = float(
            ((RESIDUAL_TAIL_FREEDOM + 2.0) * np.log1p(square / RESIDUAL_TAIL_FREEDOM)).sum()
        ) + freedom * float(np.log(points))
        if cost < best_cost:
            best, best_cost, best_misfit = degree, cost, float(np.median(square)) / MEDIAN
            curve = _design(dense, degree, closed) @ coefficients
    if best_misfit > POOR and most > lowest:
        return axis, most
    if closed:
        curve[-1] = curve[0]
    return curve, best


def _fit(axis: FloatArray, places: FloatArray, degree: int, closed: bool, sd: float) -> tuple[FloatArray, FloatArray]:
    """Coefficients of the curve through crossings, and their squared distances across it in variances.

    A sweep that grazes the axis places its crossing up to a half width along it: residuals have Student's tails, and
    those along the curve are taken out by moving the crossing along it.
    """
    weight, gap = np.ones(len(axis)), 2.0 / len(axis)
    for _ in range(REWEIGHTING_ROUNDS if len(axis) > 3 else 1):
        # beside the places as well, at once: three times as many take hardly longer
        design, ahead, behind = np.split(
            _design(np.concatenate([places, places + 1e-5, places - 1e-5]), degree, closed), 3
        )
        root = np.sqrt(weight)[:, None]
        coefficients = np.linalg.lstsq(root * design, root * axis, rcond=None)[0]
        velocity = (ahead - behind) @ coefficients
        speed = np.maximum(lengths(velocity) / 2e-5, np.finfo(float).tiny)
        tangent = velocity / (2e-5 * speed[:, None])
        residual = axis - design @ coefficients
        along = np.einsum("ij,ij->i", residual, tangent)
        square = ((residual - along[:, None] * tangent) ** 2).sum(axis=1) / sd**2
        weight = (RESIDUAL_TAIL_FREEDOM + 2.0) / (RESIDUAL_TAIL_FREEDOM + square)
        places = places + np.clip(along / speed, -0.5 * gap, 0.5 * gap)
        if not closed:
            places = np.clip(places, -1.0, 1.0)
    return np.asarray(coefficients), np.asarray(square)


def _design(x: FloatArray, degree: int, closed: bool) -> FloatArray:
    if not closed:
        return np.asarray(np.polynomial.legendre.legvander(x, degree))
    waves = [f(np.pi * k * x) for k in range(1, degree + 1) for f in (np.cos, np.sin)]
    return np.column_stack([np.ones_like(x), *waves])
