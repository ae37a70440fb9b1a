"""Closing: does a line return to its own beginning?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapping.inspection import Inspection
from mapping.polyline import arclengths

FloatArray = NDArray[np.float64]

# A gap longer than this share of the line, or than so many half-widths of its disturbance, does not close.
LONGEST_SHARE, LONGEST_GAP = 0.5, 6.0
# How much longer than the gap the arc over it is, for one that turns by a right angle.
ARC = 1.3


def closes(axis: FloatArray, height: float, half_width: float, inspection: Inspection) -> bool:
    """True if a smooth arc from the last point of an axis (K, 3) back to the first is not denied by what was felt."""
    gap = float(np.linalg.norm(axis[-1] - axis[0]))
    if len(axis) < 4 or gap > min(LONGEST_SHARE * arclengths(axis)[-1], LONGEST_GAP * half_width):
        return False
    out, back = axis[-1] - axis[-2], axis[1] - axis[0]
    out, back = ARC * gap * out / np.linalg.norm(out), ARC * gap * back / np.linalg.norm(back)
    t = np.linspace(0.0, 1.0, 25)[2:-2, None]
    # Hermite's cubic between the ends, along the headings there
    arc = (2 * t**3 - 3 * t**2 + 1) * axis[-1] + (t**3 - 2 * t**2 + t) * out
    arc += (3 * t**2 - 2 * t**3) * axis[0] + (t**3 - t**2) * back
    return not inspection.denies(arc, height, 0.25 * half_width)
