"""The certainty map of the base: which of its vertices the ball touched, bridged, or never came near."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapping.estimate import EXTRAPOLATED, Estimate
from mapping.surface import Surface

# A vertex takes the label of the nearest estimated point within this many distances between points or sweeps.
NEAR = 3.0


def base_reach(surface: Surface, estimate: Estimate) -> NDArray[np.float64]:
    """(V,) label of each vertex (mapping.estimate): that of the nearest estimated point, EXTRAPOLATED far from any."""
    from scipy.spatial import cKDTree

    from mapping.sweep_rows import pitch

    tree = cKDTree(estimate.points)
    apart = np.asarray(tree.query(estimate.points, k=[2])[0])
    reach = NEAR * max(float(np.median(apart)), pitch(estimate.points, estimate.sweep))
    distance, nearest = tree.query(surface.vertices)
    return np.where(distance <= reach, estimate.labels[nearest].astype(np.float64), float(EXTRAPOLATED))
