"""Plateau end: a sweep that came down from a crest to the base, taken for a hollow in the crest's level."""

from __future__ import annotations

import numpy as np

from mapping.crossing import Crossing
from mapping.inspection import Inspection

# A hollow is felt below the base by this share of its depth ...
FELT = 0.2
# ... and a plateau stands above it by this share, within so many half-widths of the crossing.
PLATEAU, NEAR = 0.5, 2.0


def is_plateau_end(crossing: Crossing, inspection: Inspection) -> bool:
    """True if the sweep was at the base's level in the middle of a supposed hollow or crest, and off it on the other
    side beside: what was detected is the end of what the sweep ran along."""
    own = inspection.of_sweep(crossing.sweep)
    heights = np.sign(crossing.height) * inspection.height[own]
    gap = np.linalg.norm(inspection.points[own] - crossing.point, axis=1)
    middle = gap < 0.5 * crossing.half_width
    if not middle.any():
        return False
    tall = abs(crossing.height)
    beside = heights[gap < NEAR * crossing.half_width]
    felt = bool(heights[middle].mean() + 3 * inspection.sd[own][middle].mean() / np.sqrt(middle.sum()) > FELT * tall)
    return not felt and bool(np.sort(-beside)[-2:].min() > PLATEAU * tall)
