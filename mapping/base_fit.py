"""The base when no mesh is given: plane, sphere, cylinder, quadric or a smooth sheet, by evidence."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapping.base import Base
from mapping.base_shapes import FAMILIES, Cloud, Fitted
from mapping.errors import TraceError
from mapping.profile_fit import fit_profile, profile_frame
from mapping.robust import OUTLIER, robust_scale
from mapping.trace import Trace

FloatArray = NDArray[np.float64]

MOST_CELLS = 4000


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
    fits: list[Fitted] = [fitted for family in FAMILIES if (fitted := family(cloud)) is not None]
    scale, share = _noise_of(min(fits, key=lambda fitted: fitted.cost(cloud.floor)).residual, cloud.floor)
    best = min(fits, key=lambda fitted: fitted.cost(scale, share))
    return Base(best.surface(cloud, spacing), best.kind, best.parameters)


def _noise_of(residual: FloatArray, floor: float) -> tuple[float, float]:
    """Scale of the cells' scatter about the freest fit, m, and the share of them that count as independent.

    Noise that is correlated along the path makes neighbours agree: by the scatter from cell to cell alone, a
    plane would be bent to follow it.
    """
    scale = max(floor, robust_scale(residual))
    kept = np.clip(residual / scale, -OUTLIER, OUTLIER)
    correlation = float(np.clip((kept[1:] * kept[:-1]).mean() / max((kept**2).mean(), 1e-12), 0.0, 0.98))
    return scale, (1.0 - correlation) / (1.0 + correlation)
