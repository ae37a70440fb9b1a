"""Lines with ends of many kinds: the traces that their lengths are judged on."""

from __future__ import annotations

import numpy as np
import pytest

from explore3d.bench.precision import LENGTHS_FORMS, lengths_trace
from explore3d.bench.precision.lengths import LENGTHS_LEVELS, LENGTHS_TIP, EndedLine
from mapping import FloatArray


def points(form: str, line: EndedLine) -> FloatArray:
    """(N, 3) points of a body over the plate: places along and across, heights, m."""
    s = np.linspace(-0.5 * line.length, 0.5 * line.length, 401)
    if "wire" in form:
        a, turn = 0.5 * line.height, np.linspace(0.0, np.pi, 361)
        places, turns = (each.ravel() for each in np.meshgrid(s, turn))
        body = np.column_stack([places, a * np.cos(turns), a + a * np.sin(turns)])
        if form == "square wire":
            return body
        rise, way = (
            each.ravel() for each in np.meshgrid(np.linspace(0.0, 0.5 * np.pi, 91), np.linspace(0, 6.283, 361))
        )
        cap = np.column_stack([np.cos(rise) * np.cos(way), np.cos(rise) * np.sin(way), np.sin(rise)])
        half = 0.5 * line.length
        return np.concatenate([body, *(a * cap + [side * half, 0.0, a] for side in (-1.0, 1.0))])
    along, across = (each.ravel() for each in np.meshgrid(s, np.linspace(-0.5 * line.width, 0.5 * line.width, 301)))
    if form == "stadium bar":
        beyond = np.maximum(np.abs(along) - 0.5 * (line.length - line.width), 0.0)
        across = across * np.sqrt(np.maximum(0.25 * line.width**2 - beyond**2, 0.0)) / (0.5 * line.width)
    return np.column_stack([along, across, np.full(len(along), line.height)])


@pytest.mark.parametrize("form", [form for form, (kind, _) in LENGTHS_FORMS.items() if kind == "ridge"])
def test_a_trace_is_the_highest_place_of_the_ball_over_all_points(form: str) -> None:
    wide = 0.6e-3 if "wire" in form else 1.6e-3
    line = EndedLine("ridge", 0.6e-3, wide, 4e-3)
    rng = np.random.default_rng(0)
    s, d = rng.uniform(-6e-3, 6e-3, 60), rng.uniform(-4e-3, 4e-3, 60)
    body = points(form, line)
    gap = (s[:, None] - body[:, 0]) ** 2 + (d[:, None] - body[:, 1]) ** 2
    arcs = body[:, 2] - LENGTHS_TIP + np.sqrt(np.maximum(LENGTHS_TIP**2 - gap, 0.0))
    true = np.maximum(arcs.max(axis=1), 0.0)
    # points 10 um apart miss the highest one by 5 um on slopes of up to a half
    np.testing.assert_allclose(LENGTHS_FORMS[form][1](line, s, d), true, atol=2.5e-6)
    assert 10 < (true > 0.0).sum() < 60


def test_seeds_make_other_lines_and_the_same_again() -> None:
    (first, one), (again, same), (second, _) = (lengths_trace("milled slot", "OU", seed) for seed in (5, 5, 6))
    assert first == again and first.length != second.length
    np.testing.assert_array_equal(one.centers, same.centers)
    dip = max(first.height, float(np.sqrt(LENGTHS_TIP**2 - (0.5 * first.width) ** 2)) - LENGTHS_TIP)
    deepest = float(one.centers[:, 2].min()) - LENGTHS_TIP
    assert dip - 6 * LENGTHS_LEVELS[0] < deepest < 0.9 * dip
