"""Lines through crossings that lie about at random: whatever comes of them, it is lines."""

from __future__ import annotations

import numpy as np

from mapping.assembly.lines import Around, line_features
from mapping.assembly.linking.inspection import Inspection
from mapping.base.base import Base
from mapping.detection.crossing import Crossing
from mapping.detection.detect import Detections
from mapping.instrument.noise import Noise
from mapping.surface import Surface

TIP, HEIGHT = 0.01, 0.65e-3
WIDTH = float(np.sqrt(2 * TIP * HEIGHT))


def crossed_at(place: np.ndarray, sweep: int) -> Crossing:
    up, along = np.array([0.0, 0, 1]), np.array([1.0, 0, 0])
    return Crossing(
        sweep, 0.0, place, up, along, "convex", HEIGHT, 1e-6, 1e-5, WIDTH, 100.0, 50.0, True, start=0, stop=1
    )  # fmt: skip


def test_a_lone_point_between_meeting_places_is_no_line():
    corners = 0.2 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    base = Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))
    for seed in range(5):
        rng = np.random.default_rng(seed)
        places = np.column_stack([rng.uniform(0, 8 * WIDTH, (12, 2)), np.zeros(12)])
        inspection = Inspection(places, np.full(12, HEIGHT), np.full(12, 1e-6), np.arange(12), 1e-3)
        crossings = [crossed_at(place, k) for k, place in enumerate(places)]
        detections = Detections(tuple(crossings), Noise(1e-6), 3, 1e-5, 0.95, 5.0, 1.0)
        found = line_features(crossings, "ridge", Around(inspection, base, detections, TIP))
        assert all(len(line.axis) > 1 and line.length.median > 0 for line in found)
