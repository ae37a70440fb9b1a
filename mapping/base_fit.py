"""The base when no mesh is given: plane, sphere, cylinder, quadric or a smooth sheet, by evidence."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from mapping.base import Base
from mapping.base_polyhedron import polyhedron
from mapping.base_shapes import FAMILIES, Cloud, Family, Fitted, sheet
from mapping.base_star import star
from mapping.base_tube import tube
from mapping.errors import TraceError
from mapping.profile_fit import fit_profile, profile_frame
from mapping.robust import OUTLIER, robust_scale
from mapping.trace import Trace

FloatArray = NDArray[np.float64]

MOST_CELLS = 4000
# The freer families, and by how many times the scatter of neighbouring cells half of all cells may miss a simple body
FREE: tuple[Family, ...] = (
    polyhedron,
    *(partial(sheet, shortest=shortest) for shortest in (5.0, 2.5)),
    *(partial(tube, waves=waves, shortest=shortest) for waves in (0, 2, 4, 6, 9) for shortest in (4.0, 2.0)),
    *(partial(star, degree=degree) for degree in (3, 5, 8, 12)),
)
EXPLAINED = 5.0


def fit_base(trace: Trace, spacing: float | None = None) -> Base:
    """The smooth body that explains most of a trace; details shorter than about eight tip radii are left out.

    A trace along one line gives a profile. Otherwise every family is fitted to the ball centres by robust
    least squares, and the one with the best truncated evidence is taken: a detail counts as an outlier, a
    further parameter must pay for itself. The base is the fitted surface's parallel, one tip radius inward.

    Which side is outside is taken from the contact normals; without them it is the side of +z for sheets
    and away from the centre for spheres and cylinders.

    Args:
        trace: ball centres in contact.
        spacing: longest side of the mesh's triangles, m, for bases that sweeps are planned on; None: as long as the
            shape allows.

    Raises:
        TraceError: fewer than three samples, or all samples in one place.
    """
    if len(trace) < 3 or not np.ptp(trace.centers, axis=0).any():
        raise TraceError(f"a base needs at least three samples in different places; found {len(trace)} samples")
    frame = profile_frame(trace)
    if frame is not None:
        surface, parameters = fit_profile(trace, frame)
        return Base(surface, "profile", dict(parameters))
    cloud = Cloud.of(trace, MOST_CELLS)
    fits = _fits(FAMILIES, cloud)
    if not any(_explains(fit, cloud) for fit in fits):
        fits += [replace(fit, last_resort=True) for fit in _fits(FREE, cloud)]
    scale, share = _noise_of(min(fits, key=lambda fitted: fitted.cost(cloud.floor)).residual, cloud.floor)
    best = min(fits, key=lambda fitted: fitted.cost(scale, share))
    return Base(best.surface(cloud, spacing), best.kind, best.parameters)


def _fits(families: Iterable[Family], cloud: Cloud) -> list[Fitted]:
    return [fitted for family in families if (fitted := family(cloud)) is not None]


def _explains(fit: Fitted, cloud: Cloud) -> bool:
    """True if most of the cells lie as near to the fitted surface as their neighbours to each other."""
    return float(np.median(np.abs(fit.residual))) < EXPLAINED * cloud.floor


def _noise_of(residual: FloatArray, floor: float) -> tuple[float, float]:
    """Scale of the cells' scatter about the freest fit, m, and the share of them that count as independent.

    Noise that is correlated along the path makes neighbours agree: by the scatter from cell to cell alone, a
    plane would be bent to follow it.
    """
    # the scatter from cell to cell is too large where sweeps are short and bend over features
    scale = max(0.5 * floor, robust_scale(residual))
    kept = np.clip(residual / scale, -OUTLIER, OUTLIER)
    correlation = float(np.clip((kept[1:] * kept[:-1]).mean() / max((kept**2).mean(), 1e-12), 0.0, 0.98))
    return scale, (1.0 - correlation) / (1.0 + correlation)
