"""The axis error against time."""

from __future__ import annotations

import numpy as np

from explore3d.analysis import TrueFeature
from explore3d.analysis.time_curve import time_curve
from mapping import ObjectModel, Surface, Trace, detect
from mapping.base import Base

PLATE = Surface(0.03 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), [[0, 1, 2], [0, 2, 3]])
TIP = 10e-3


def test_where_nothing_was_detected_there_is_no_curve() -> None:
    base, x = Base(PLATE), np.linspace(-0.02, 0.02, 2000)
    centers = np.column_stack([x, 0.0 * x, TIP + 1e-5 * np.random.default_rng(1).standard_normal(len(x))])
    trace = Trace(1e-3 * np.arange(len(x)), centers, np.zeros(len(x), dtype=np.int64), TIP)
    detections = detect(trace, base)
    assert detections.crossings == ()
    model = ObjectModel.attach(base, (), provenance={})
    truth = [TrueFeature("bump", [0.0, 0.02, 0.0], 1e-3)]
    assert time_curve(detections, trace, model, truth, lambda share: None) == ()
