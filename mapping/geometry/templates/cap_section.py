"""Section: sizes of a round cross-section that stands out of the base."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mapping import FloatArray


def width_of_cap(height: ArrayLike, radius: ArrayLike) -> FloatArray:
    """Full width of a round section of crest height H and radius a: 2 a where its widest place is above the base."""
    crest, a = np.asarray(height, dtype=np.float64), np.asarray(radius, dtype=np.float64)
    chord = 2.0 * np.sqrt(np.clip(crest * (2.0 * a - crest), 0.0, None))
    return np.asarray(np.where(crest < a, chord, 2.0 * a))


def radius_of_cap(height: float, width: float) -> float:
    """Radius a of the section with crest height H and full width w: the inverse of `width_of_cap`."""
    half = 0.5 * width
    return half if height >= half else 0.5 * (half**2 + height**2) / height
