"""The noise of a whole trace, from a few stretches of it."""

from __future__ import annotations

import numpy as np

from mapping import Trace
from mapping.base import Base
from mapping.inference.likelihood import distance_along
from mapping.instrument import Noise, estimate_noise

STRETCHES = 8
STRETCH = 2048


def noise_of_trace(trace: Trace, base: Base) -> Noise:
    """Level and correlation of the noise of a trace over its base; the cost does not grow with the trace.

    A trace too short to tell (fewer than 16 samples) counts as without noise: the floor of the shape model rules.
    """
    if len(trace) < 16:
        return Noise(0.0)
    firsts = np.unique(np.linspace(0, max(len(trace) - STRETCH, 0), STRETCHES).astype(np.int64))
    residuals, places, end = [], [], 0.0
    for first in firsts:
        part = trace.select(slice(int(first), int(first) + STRETCH))
        for _, sweep in part.sweeps():
            feet = base.foot(sweep.centers, trace.tip_radius)
            along = distance_along(
                feet.points, float(np.std(np.diff(feet.height)) / np.sqrt(2)) if len(sweep) > 2 else 0.0
            )
            residuals.append(feet.height)
            # A jump between stretches tells the estimator that they do not adjoin.
            places.append(along + end + 1e3 * trace.tip_radius)
            end = float(places[-1][-1])
    return estimate_noise(np.concatenate(residuals), np.concatenate(places))
