"""CurveModes: low-order lateral courses of an axis about its chart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray


@dataclass(frozen=True)
class CurveModes:
    """Legendre polynomials for an open axis, Fourier modes for a closed one.

    Args:
        degree: highest degree; an open axis has degree + 1 modes, a closed one 2 degree + 1.
        middle: distance along the chart of the stretch's middle, m.
        reach: half its length, m (open: the modes are within +-1 there, and go on straight outside).
        closed: True for a closed axis.
    """

    degree: int
    middle: float
    reach: float
    closed: bool

    @property
    def count(self) -> int:
        return 2 * self.degree + 1 if self.closed else self.degree + 1

    @property
    def names(self) -> tuple[str, ...]:
        if self.closed:
            pairs = tuple(f"{kind} {k}" for k in range(1, self.degree + 1) for kind in ("cosine", "sine"))
            return ("offset", *pairs)
        return ("offset", "heading", *(f"bend {k}" for k in range(2, self.degree + 1)))[: self.count]

    @property
    def units(self) -> tuple[str, ...]:
        return tuple("rad" if name == "heading" else "m" for name in self.names)

    @property
    def scale(self) -> FloatArray:
        """(count,) change of each coefficient that moves the axis by one metre at most."""
        return np.array([1.0 / self.reach if unit == "rad" else 1.0 for unit in self.units])

    def lateral(self, coefficients: FloatArray, s: FloatArray) -> FloatArray:
        """(W, K) lateral distances at the places s (K,) for coefficients (W, count), m."""
        return np.asarray(coefficients @ self.basis(s))

    def slope(self, coefficients: FloatArray, s: float) -> FloatArray:
        """(W,) change of the lateral distance per metre along the chart."""
        return np.asarray(coefficients @ self.slopes(np.array([s]))[:, 0])

    def basis(self, s: FloatArray) -> FloatArray:
        """(count, ...) lateral distance of each mode's unit coefficient at places s."""
        x = (s - self.middle) / self.reach
        if self.closed:
            rows = [np.ones_like(x)]
            for k in range(1, self.degree + 1):
                rows += [np.cos(np.pi * k * x), np.sin(np.pi * k * x)]
            return np.stack(rows)
        inside = np.clip(x, -1.0, 1.0)
        value, slope = _legendre(self.degree, inside)
        # Straight on beyond the stretch that the data cover: a polynomial would fly off.
        bends = value[2:] + (x - inside) * slope[2:]
        return np.concatenate([np.stack([np.ones_like(x), x * self.reach])[: self.count], bends])

    def slopes(self, s: FloatArray) -> FloatArray:
        """(count, ...) change of each mode's lateral distance per metre along the chart at places s."""
        x = (s - self.middle) / self.reach
        if self.closed:
            rows = [np.zeros_like(x)]
            for k in range(1, self.degree + 1):
                turn = np.pi * k
                rows += [-turn / self.reach * np.sin(turn * x), turn / self.reach * np.cos(turn * x)]
            return np.stack(rows)
        _, slope = _legendre(self.degree, np.clip(x, -1.0, 1.0))
        return np.concatenate([np.stack([np.zeros_like(x), np.ones_like(x)])[: self.count], slope[2:] / self.reach])


def _legendre(degree: int, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Legendre polynomials 0 to degree (at least 1) and their derivatives at x: two (degree + 1, ...) arrays.

    By Bonnet's recursion: (k + 1) P_k+1 = (2 k + 1) x P_k - k P_k-1, and P'_k+1 = P'_k-1 + (2 k + 1) P_k.
    """
    value, slope = [np.ones_like(x), x], [np.zeros_like(x), np.ones_like(x)]
    for k in range(1, degree):
        value.append(((2 * k + 1) * x * value[k] - k * value[k - 1]) / (k + 1))
        slope.append(slope[k - 1] + (2 * k + 1) * value[k])
    return np.stack(value), np.stack(slope)
