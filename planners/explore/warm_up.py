"""Ready: what planning loads on first use is loaded before the first move, not while a finger waits."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from mapping import Surface, Trace
from mapping.base import Base
from mapping.detection import detect
from mapping.geometry.templates import cap_height

# Half the side of the plate that is looked at, in tip radii, and samples
SIDE, WARM_UP_SAMPLES = 20.0, 400


@lru_cache
def get_ready(tip_radius: float) -> None:
    """Detect a made-up wire: loads the compiled code of detection, and scipy's optimizers for what follows."""
    import scipy.optimize  # noqa: F401

    side = SIDE * tip_radius
    corners = side * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    x = 0.5 * side * np.linspace(-1.0, 1.0, WARM_UP_SAMPLES)
    noise = 1e-3 * tip_radius * np.random.default_rng(0).standard_normal(WARM_UP_SAMPLES)
    z = tip_radius + cap_height(x, 0.1 * tip_radius, 0.05 * tip_radius, tip_radius) + noise
    detect(Trace.from_profile(x, z, tip_radius), Base(Surface(corners, [[0, 1, 2], [0, 2, 3]])))
