"""Curvature: principal curvatures of a surface at its points, each with its standard deviation."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapping import BoolArray, FloatArray

# Who may have answered a vertex
METHOD_NAMES = ("jet", "libigl")
# Standard deviations that k1 and k2 are apart from which on they hardly mix: 1e-3 of the variance is left
DISTINCT = 16.0


@dataclass(frozen=True, eq=False)
class Curvature:
    """Principal curvatures, positive where the body bulges outward.

    Args:
        k1, k2: (V,) curvatures, 1/m, k1 >= k2; NaN where there is no trustworthy value.
        d1, d2: (V, 3) unit principal directions; NaN where k1 and k2 differ by less than their noise (umbilics
            have no direction) or have no value.
        sd: (V,) standard deviation of the curvatures, 1/m; NaN where the method does not know.
        valid: (V,) True where the values can be trusted.
        answered_by: (V,) "jet" or "libigl", "" where there is no value; empty if only one method was asked.
        apart: (V,) larger difference of both methods' k1 and k2, 1/m, NaN where one has no value; empty as above.
        remarks: sentences on what could not be asked, and why.
    """

    k1: FloatArray
    k2: FloatArray
    d1: FloatArray
    d2: FloatArray
    sd: FloatArray
    valid: BoolArray
    answered_by: NDArray[np.str_] = field(default_factory=lambda: np.zeros(0, dtype="<U6"))
    apart: FloatArray = field(default_factory=lambda: np.zeros(0))
    remarks: tuple[str, ...] = ()

    def record(self) -> dict[str, Any]:
        """How many vertices each method answered, and how far they are apart (median, p95, 1/m) where both did."""
        both = self.apart[np.isfinite(self.apart)]
        apart = {"median": float(np.median(both)), "p95": float(np.quantile(both, 0.95))} if len(both) else None
        return {
            "vertices": len(self.k1),
            "valid": int(self.valid.sum()),
            "answered_by": {name: int((self.answered_by == name).sum()) for name in METHOD_NAMES},
            "compared": len(both),
            "apart": apart,
            "remarks": list(self.remarks),
        }

    def sentence(self, tip_radius: float) -> str:
        """Which method answered, and how far the methods are apart where both did, over the tip's own curvature 1/r."""
        record = self.record()
        by = record["answered_by"]
        said = f"Curvature at {record['valid']} of {record['vertices']} vertices: {by['jet']} by local jets, "
        said += f"{by['libigl']} by libigl's quadratic fits"
        if record["apart"] is None:
            return f"{said}; the two could not be compared."
        median, p95 = (record["apart"][name] * tip_radius for name in ("median", "p95"))
        compared = f"at {record['compared']} vertices where both were asked"
        return f"{said}; {compared} they differ by {median:.2g}/r (median) and {p95:.2g}/r (95th percentile)."

    @property
    def largest(self) -> FloatArray:
        """(V,) the curvature of larger absolute value, 1/m."""
        return np.where(np.abs(self.k1) >= np.abs(self.k2), self.k1, self.k2)


def from_operators(operators: FloatArray, bases: FloatArray, error: FloatArray, valid: BoolArray) -> Curvature:
    """Curvatures from symmetric shape operators (V, 3) = (a, b, c) in tangent bases (V, 2, 3).

    Args:
        error: (V,) root mean square of the Frobenius norm of the operators' errors, 1/m.
    """
    a, b, c = operators.T
    mean, half = 0.5 * (a + c), np.hypot(0.5 * (a - c), b)
    angle = 0.5 * np.arctan2(2 * b, a - c)
    d1 = np.cos(angle)[:, None] * bases[:, 0] + np.sin(angle)[:, None] * bases[:, 1]
    d2 = -np.sin(angle)[:, None] * bases[:, 0] + np.cos(angle)[:, None] * bases[:, 1]
    umbilic = ~(half > np.sqrt(0.5) * np.nan_to_num(error, nan=0.0) + 0.5e-9 * np.abs(mean)) | ~valid
    d1[umbilic], d2[umbilic] = np.nan, np.nan
    k1, k2 = np.where(valid, mean + half, np.nan), np.where(valid, mean - half, np.nan)
    return Curvature(k1, k2, d1, d2, np.where(valid, principal_sd(half, error), np.nan), valid)


def principal_sd(half: FloatArray, error: FloatArray) -> FloatArray:
    """(V,) standard deviation of either principal curvature, 1/m.

    Half of the error's square is that of the mean curvature, a quarter that of each of the two other parts of the
    operator (theory section 9). Where k1 and k2 are far apart, one of these only turns the directions; at an umbilic
    both drive them apart.

    Args:
        half: (V,) half of k1 - k2, as found, 1/m.
        error: (V,) root mean square of the Frobenius norm of the operator's error, 1/m.
    """
    from scipy.special import ive

    part = np.divide(error, np.sqrt(8.0))  # standard deviation of each of the two parts
    known = np.isfinite(half) & (part > 0)
    # what noise drives k1 and k2 apart by is taken off
    apart = np.sqrt(np.maximum(np.divide(half, part, out=np.zeros_like(part), where=known) ** 2 - 2.0, 0.0))
    apart = np.minimum(apart, DISTINCT)
    y = 0.25 * apart**2
    mean = np.sqrt(0.5 * np.pi) * ((1.0 + 2.0 * y) * ive(0, y) + 2.0 * y * ive(1, y))  # of a Rice distribution
    return np.asarray(part * np.sqrt(4.0 + 2.0 * apart * (apart - mean)))
