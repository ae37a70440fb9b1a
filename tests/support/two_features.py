"""A plate with a ridge of three vertices and a bump, for what is written of a model."""

from __future__ import annotations

import numpy as np

from mapping import Feature, Interval, Support, Surface
from mapping.base import Base
from mapping.model import ObjectModel

PLATE = Base(Surface(0.05 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), [[0, 1, 2], [0, 2, 3]]))


def two_features() -> ObjectModel:
    """Sizes of 1 mm, each with a standard deviation of 10 um."""
    size, up = Interval.normal(1e-3, 1e-5), np.array([0.0, 0.0, 1.0])
    axes = {"ridge": np.array([[0.0, 0, 0], [0.01, 0, 0], [0.02, 0.01, 0]]), "bump": np.array([[0.0, 0.02, 0]])}
    features = [
        Feature(kind, axis, np.tile(up, (len(axis), 1)), size, size, size, Support(9.0, 3), True, 1e-6)
        for kind, axis in axes.items()
    ]
    return ObjectModel.attach(PLATE, features)
