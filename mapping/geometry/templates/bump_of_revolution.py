"""The paper's bump: z = 1/(1 + a u^2) turned about z, with its curvatures and parallel surface in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mapping import FloatArray, IntArray, MappingError, Surface


@dataclass(frozen=True)
class BumpOfRevolution:
    """f(u, v) = (u cos v, u sin v, 1/(1 + a u^2)): a crest of height 1 over a plane, sharper for larger a.

    Lengths are in units of the crest's height; scale the results for another height.

    Args:
        sharpness: the paper's a, positive; curvature 2 a at the crest.

    Raises:
        MappingError: a sharpness that is not positive and finite.

    Reference: the paper, section 2.3 and equations 9 to 11, with the misprints of theory section 2 mended.
    """

    sharpness: float = 15.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.sharpness) and self.sharpness > 0):
            raise MappingError(f"the bump's sharpness a must be positive and finite; found {self.sharpness!r}")

    def height(self, u: ArrayLike) -> FloatArray:
        """Height of the body at distance u (N,) from its axis."""
        return np.asarray(1.0 / self._d(u))

    def curvatures(self, u: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Curvature along the meridian and around it, positive where the body bulges out."""
        u, a, c, d = np.asarray(u, dtype=np.float64), self.sharpness, self._c(u), self._d(u)
        return 2 * a * (1 - 3 * a * u**2) / (c * d) ** 3, 2 * a / (c * d**2)

    def normal(self, u: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Radial and axial component of the outward unit normal (the paper's equation 9; theory equation 2.3)."""
        u, c, d = np.asarray(u, dtype=np.float64), self._c(u), self._d(u)
        return 2 * self.sharpness * u / (c * d**2), 1.0 / c

    def parallel(self, u: ArrayLike, tip_radius: float) -> tuple[FloatArray, FloatArray]:
        """Distance from the axis and height of the parallel surface at tip_radius.

        Reference: the paper's equation 11, corrected: theory equation 2.6.
        """
        radial, axial = self.normal(u)
        return np.asarray(u, dtype=np.float64) + tip_radius * radial, self.height(u) + tip_radius * axial

    def caustics(self, tip_radius: float) -> FloatArray:
        """Distances u > 0 where 1 + r k changes sign along the meridian: none, or two."""
        from scipy.optimize import brentq

        deepest = self.most_concave
        if self._opening(deepest, tip_radius) >= 0:
            return np.zeros(0)
        inflection = 1.0 / np.sqrt(3 * self.sharpness)
        # Far out k falls off as 6 / (a u^4): beyond this distance 1 + r k is positive.
        outside = max(2 * deepest, 2 * float((6 * tip_radius / self.sharpness) ** 0.25))

        def opening(u: float) -> float:
            return self._opening(u, tip_radius)

        inner = brentq(opening, float(inflection), deepest, xtol=1e-15 * deepest, rtol=1e-14)
        return np.array([inner, brentq(opening, deepest, outside, xtol=1e-15 * deepest, rtol=1e-14)])

    def interference(self, tip_radius: float, tolerance: float = 1e-14) -> tuple[float, float] | None:
        """The two distances u between which the meridian's plane motion of the ball never touches, or None.

        For the convex crest over a plane there is none: the ball skips the foot between a point of the
        flank and a point of the plain whose parallel curves cross. `tolerance` is relative.
        """
        from scipy.optimize import brentq

        pair = self.caustics(tip_radius)
        if len(pair) == 0:
            return None
        inner, outer = pair
        within = tolerance * float(inner)

        def beyond(u: float) -> float:
            """The point of the plain whose centre stands over the centre of the flank's point u."""
            place = self.parallel(u, tip_radius)[0]
            far = 2 * outer + tip_radius
            if self.parallel(outer, tip_radius)[0] >= place:  # at the start of the flank both are one, but for rounding
                return float(outer)
            return float(brentq(lambda w: float(self.parallel(w, tip_radius)[0] - place), outer, far, xtol=within))

        def gap(u: float) -> float:
            return float(self.parallel(u, tip_radius)[1] - self.parallel(beyond(u), tip_radius)[1])

        # The flank's branch covers the swallowtail between its own caustic and the place of the outer caustic.
        place = float(self.parallel(outer, tip_radius)[0])
        start = brentq(lambda u: float(self.parallel(u, tip_radius)[0] - place), 0.0, inner, xtol=within)
        flank = float(brentq(gap, start, inner, xtol=within))
        return flank, beyond(flank)

    @property
    def most_concave(self) -> float:
        """Distance u of the most concave point of the meridian."""
        from scipy.optimize import minimize_scalar

        unit = 1.0 / np.sqrt(self.sharpness)
        # A sharp bump is a steep needle: its foot bends where the slope is about 1, at u^3 = 2 / a.
        bounds = (unit / np.sqrt(3), max(4 * unit, 2 * float(np.cbrt(2 / self.sharpness))))
        found = minimize_scalar(
            lambda u: float(self.curvatures(u)[0]), bounds=bounds, options={"xatol": 1e-12 * bounds[0]}
        )
        return float(found.x)

    def mesh(self, radius: float = 1.0, rings: int = 100, sectors: int = 200) -> Surface:
        """The bump out to `radius` as an open triangle mesh: rings * sectors + 1 vertices, all on the surface.

        Raises:
            MappingError: fewer than 1 ring or 3 sectors, or a radius that is not positive.
        """
        if rings < 1 or sectors < 3 or not radius > 0:
            raise MappingError(
                f"the bump's mesh needs rings >= 1, sectors >= 3, radius > 0; found {rings}, {sectors}, {radius}"
            )
        u = radius * np.arange(1, rings + 1) / rings
        v = 2 * np.pi * np.arange(sectors) / sectors
        ring = np.stack(
            [
                np.outer(u, np.cos(v)),
                np.outer(u, np.sin(v)),
                np.broadcast_to(self.height(u)[:, None], (rings, sectors)),
            ],
            axis=-1,
        ).reshape(-1, 3)
        return Surface(np.vstack([[[0.0, 0.0, 1.0]], ring]), _polar_faces(rings, sectors))

    def _d(self, u: ArrayLike) -> FloatArray:
        return np.asarray(1.0 + self.sharpness * np.asarray(u, dtype=np.float64) ** 2)

    def _c(self, u: ArrayLike) -> FloatArray:
        u = np.asarray(u, dtype=np.float64)
        return np.asarray(np.hypot(1.0, 2 * self.sharpness * u / self._d(u) ** 2))

    def _opening(self, u: float, tip_radius: float) -> float:
        return float(1 + tip_radius * self.curvatures(u)[0])


def _polar_faces(rings: int, sectors: int) -> IntArray:
    """Counter-clockwise faces of a disc: a fan round vertex 0, then strips between rings."""
    here, following = np.arange(sectors), (np.arange(sectors) + 1) % sectors
    fan = np.column_stack([np.zeros(sectors, dtype=np.int64), 1 + here, 1 + following])
    strips = [fan]
    for ring in range(rings - 1):
        inner, outer = 1 + ring * sectors, 1 + (ring + 1) * sectors
        strips.append(np.column_stack([inner + here, outer + here, outer + following]))
        strips.append(np.column_stack([inner + here, outer + following, inner + following]))
    return np.vstack(strips)
