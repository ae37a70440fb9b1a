"""Splines by their knots and coefficients: importing scipy.interpolate takes longer than a fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mapping import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Spline:
    """A curve of polynomial pieces.

    Args:
        knots: (K,) ascending, the ends repeated degree times more.
        coefficients: (K - degree - 1,).
        degree: of the pieces.
    """

    knots: FloatArray
    coefficients: FloatArray
    degree: int

    def __call__(self, x: ArrayLike) -> FloatArray:
        """Values at places; beyond the ends those of the last piece."""
        places = np.asarray(x, dtype=float)
        first, basis = _basis(places.ravel(), self.knots, self.degree)
        values = np.zeros(places.size)
        for k, share in enumerate(basis):
            values += self.coefficients[first + k] * share
        return values.reshape(places.shape)

    def derivative(self) -> Spline:
        """The slope: a spline of one degree less."""
        spans = self.knots[self.degree + 1 : -1] - self.knots[1 : -self.degree - 1]
        slopes = np.diff(self.coefficients) * self.degree / spans
        return Spline(self.knots[1:-1], slopes, self.degree - 1)


def spline_design(x: FloatArray, knots: FloatArray, degree: int) -> FloatArray:
    """(N, K - degree - 1) values of each basis function at each of the (N,) places."""
    first, basis = _basis(x, knots, degree)
    matrix = np.zeros((len(x), len(knots) - degree - 1))
    matrix[np.arange(len(x))[:, None], first[:, None] + np.arange(degree + 1)] = basis.T
    return matrix


def _basis(x: FloatArray, knots: FloatArray, degree: int) -> tuple[IntArray, FloatArray]:
    """At each of (N,) places the first basis function that is not zero, (N,), and degree + 1 values from it on.

    Reference: C. de Boor, A Practical Guide to Splines, chapter X (the recurrence, in the order of FITPACK's fpbspl).
    """
    piece = np.clip(np.searchsorted(knots, x, side="right") - 1, degree, len(knots) - degree - 2)
    basis = np.zeros((degree + 1, len(x)))
    basis[0] = 1.0
    for j in range(1, degree + 1):
        before, basis[0] = basis.copy(), 0.0
        for n in range(1, j + 1):
            above, below = knots[piece + n], knots[piece + n - j]
            share = before[n - 1] / (above - below)
            basis[n - 1] += share * (above - x)
            basis[n] = share * (x - below)
    return piece - degree, basis
