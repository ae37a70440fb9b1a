"""Spots and short lines told apart by the heights of all places around."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.assembly.linking.inspection import Inspection
from mapping.assembly.points import outline
from mapping.detection.crossing import Crossing
from mapping.geometry.mesh.polyline import distances
from mapping.geometry.templates.small_heights import crest_trace

WIDTH = 3.6e-3


def seen(axis, height: float, angle: float, sd: float = 2e-5, seed: int = 0) -> tuple[list[Crossing], Inspection]:
    """Crossed sweeps 4 mm apart over a crest along an axis, and the crossings near it."""
    rng = np.random.default_rng(seed)
    lines = []
    for turn in (angle, angle + np.pi / 2):
        way, side = np.array([np.cos(turn), np.sin(turn), 0]), np.array([-np.sin(turn), np.cos(turn), 0])
        for offset in np.arange(-12e-3, 12.1e-3, 4e-3) + rng.uniform(0, 4e-3):
            lines.append((offset * side + np.arange(-0.016, 0.016, 5e-4)[:, None] * way, way))
    points = np.concatenate([line for line, _ in lines])
    sweep = np.repeat(np.arange(len(lines)), [len(line) for line, _ in lines])
    truth = crest_trace(distances(points, np.asarray(axis)), height, WIDTH)
    felt = truth + sd * rng.standard_normal(len(points))
    crossings = []
    for number, (line, way) in enumerate(lines):
        own = truth[sweep == number]
        k = int(np.abs(own).argmax())
        if abs(own[k]) > 0.1 * abs(height):
            crossings.append(
                Crossing(
                    number,
                    0.0,
                    line[k],
                    np.array([0, 0, 1.0]),
                    way,
                    "convex" if height > 0 else "concave",
                    float(own[k]),
                    1e-5,
                    1e-5,
                    WIDTH,
                    0.0,
                    30.0,
                    True,
                    0,
                    1,
                )
            )
    return crossings, Inspection(points, felt, np.full(len(points), sd), sweep, 5e-4)


@pytest.mark.parametrize("height", [0.65e-3, -0.65e-3])
@pytest.mark.parametrize("angle", [0.0, 0.7, 1.2])
def test_a_round_crest_is_a_spot_at_its_own_place(angle, height):
    crossings, inspection = seen([[4e-4, -3e-4, 0]], height, angle)
    spot = outline(crossings, inspection, WIDTH)
    assert spot.length == 0.0
    np.testing.assert_allclose(spot.center, [4e-4, -3e-4, 0], atol=1.5e-4)
    np.testing.assert_allclose([spot.height, spot.half_width], [height, WIDTH], rtol=0.03 if height > 0 else 0.12)


@pytest.mark.parametrize("height", [0.65e-3, -0.65e-3])
@pytest.mark.parametrize("angle", [0.0, 0.7, 1.2])
def test_a_crest_longer_than_wide_is_a_line_of_its_own_length(angle, height):
    crossings, inspection = seen([[-3e-3, 1e-3, 0], [3e-3, 1e-3, 0]], height, angle)
    line = outline(crossings, inspection, WIDTH)
    assert abs(line.length - 6e-3) < 0.5e-3
    assert abs(line.heading[0]) > 0.99
