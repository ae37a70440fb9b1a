"""Unseen: a crossing that claims to be clear, but that the mean heights of its own sweep do not show."""

from __future__ import annotations

import numpy as np

from mapping.crest_trace import crest_trace
from mapping.crossing import Crossing
from mapping.inspection import Inspection

# Only what is claimed to be so clear is held to account, and to this share of its claim.
CLAIM, SHARE = 20.0, 0.3


def is_unseen(crossing: Crossing, inspection: Inspection) -> bool:
    """True if a clear crossing's section is not found in the heights, neither over the base nor over those beside.

    A detection's signal-to-noise ratio is of the whole stretch that was fitted together; a slight crossing beside a
    strong one may owe all of it to the other.
    """
    if crossing.snr < CLAIM or crossing.half_width < 1.2 * inspection.spacing:
        return False
    own = inspection.of_sweep(crossing.sweep)
    heights, gap = inspection.height[own], np.linalg.norm(inspection.points[own] - crossing.point, axis=1)
    inside, beside = gap < crossing.half_width, (gap > 1.2 * crossing.half_width) & (gap < 3 * crossing.half_width)
    if not inside.any():
        return False
    shape = np.sign(crossing.height) * crest_trace(gap[inside], np.sign(crossing.height), crossing.half_width)
    level = float(np.median(heights[beside])) if beside.any() else 0.0
    sd = float(np.median(inspection.sd[own][inside]) / np.sqrt(max(shape @ shape, 1e-3)))
    seen = [np.sign(crossing.height) * (shape @ (heights[inside] - base)) / (shape @ shape) for base in (0.0, level)]
    return bool(max(seen) < SHARE * crossing.snr * sd)
