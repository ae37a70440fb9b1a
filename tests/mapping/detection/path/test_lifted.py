"""Lifted fingers: what of a recording is no contact."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from mapping import FloatArray, Trace
from mapping.base import LaidTrace, fit_base
from mapping.detection.path import lifted

TIP, NOISE = 5e-3, 10e-6
ROWS = np.arange(5) * 3e-3


def row(y: float, forth: bool, height: FloatArray | None = None) -> FloatArray:
    """Centres along a row of 60 mm, 0.1 mm apart, m."""
    x = np.linspace(0.0, 60e-3, 601)
    z = np.full(len(x), TIP) if height is None else TIP + height
    return np.column_stack([x, np.full(len(x), y), z])[:: 1 if forth else -1]


def way(*corners: FloatArray, step: float = 0.2e-3) -> FloatArray:
    """Places along straight lines from corner to corner, without the last, m."""
    parts = []
    for begin, end in pairwise(corners):
        count = max(2, round(float(np.linalg.norm(end - begin)) / step))
        parts.append(begin + np.linspace(0.0, 1.0, count, endpoint=False)[:, None] * (end - begin))
    return np.concatenate(parts)


def recorded(rows: list[FloatArray], lift: float, step: float = 0.2e-3) -> tuple[Trace, np.ndarray]:
    """Rows with lifts between them and at both ends, and which samples were felt; all under one number."""
    up = np.array([0.0, 0.0, lift])
    parts, felt = [way(rows[0][0] + up, rows[0][0], step=step)], [False]
    for k, each in enumerate(rows):
        parts.append(each)
        following = rows[k + 1][0] if k + 1 < len(rows) else None
        ends = [each[-1], each[-1] + up] + ([] if following is None else [following + up, following])
        parts.append(way(*ends, step=step))
        felt += [True, False]
    places = np.concatenate(parts)
    places = places + np.random.default_rng(3).normal(0.0, NOISE, places.shape)
    touched = np.repeat(felt, [len(part) for part in parts])
    return Trace(np.arange(len(places)) * 4e-3, places, np.zeros(len(places), dtype=np.int64), TIP), touched


def laid(trace: Trace) -> LaidTrace:
    return LaidTrace.of(trace, fit_base(trace))


@pytest.mark.parametrize(
    ("lift", "step"),
    [(3e-3, 0.2e-3), *(pytest.param(20e-3, step, marks=pytest.mark.slow) for step in (0.2e-3, 0.03e-3))],
)
def test_paths_through_the_air_are_told_from_rows(lift: float, step: float) -> None:
    trace, felt = recorded([row(y, k % 2 == 0) for k, y in enumerate(ROWS)], lift, step)
    found = lifted(laid(trace))
    assert found is not None
    assert found.pieces == len(ROWS) + 1
    assert found.highest == pytest.approx(lift, abs=5 * NOISE)
    # half a millimetre at a row's end may go with the air, and of the air nothing stays that stands off the row
    assert (felt & ~found.felt).sum() <= 5 * 2 * len(ROWS)
    assert trace.centers[found.felt & ~felt, 2].max(initial=0.0) < TIP + 8 * NOISE
    assert found.as_walls == (lift > 2 * TIP)


def rolled(surface: FloatArray) -> FloatArray:
    """Heights of the centre over a profile with 0.1 mm between its heights, less the radius, m."""
    reach = int(TIP / 0.1e-3)
    away = np.arange(-reach, reach + 1) * 0.1e-3
    cap = np.sqrt(TIP**2 - away**2) - TIP
    padded = np.pad(surface, reach, mode="edge")
    return np.array([(padded[i : i + 2 * reach + 1] + cap).max() for i in range(len(surface))])


@pytest.mark.parametrize(
    ("height", "half_width", "noise"),
    [
        (3e-3, 12e-3, NOISE),
        (3e-3, 2e-3, 70e-6),
        (-6e-3, 12e-3, NOISE),
        pytest.param(8e-3, 12e-3, NOISE, marks=pytest.mark.slow),
        pytest.param(15e-3, 12e-3, NOISE, marks=pytest.mark.slow),
    ],
)
def test_a_block_or_a_pocket_is_felt_also_where_noise_bends_the_path(
    height: float, half_width: float, noise: float
) -> None:
    x = np.linspace(0.0, 60e-3, 601)
    surface = np.where(np.abs(x - 30e-3) < half_width, height, 0.0)
    rows = [row(y, k % 2 == 0, rolled(surface)) for k, y in enumerate(ROWS)]
    places = np.concatenate(rows)
    places = places + np.random.default_rng(3).normal(0.0, noise, places.shape)
    trace = Trace(np.arange(len(places)) * 4e-3, places, np.repeat(np.arange(len(rows)), 601), TIP)
    assert lifted(laid(trace)) is None


def test_an_inner_corner_that_is_climbed_and_left_is_felt() -> None:
    """Along the floor, up a wall, aside, down and back: the finger shifts on the floor, too, and never leaves."""
    foot, top, aside = np.array([60e-3, 0.0, TIP]), np.array([60e-3, 0.0, TIP + 40e-3]), np.array([0.0, 3e-3, 0.0])
    begin = np.array([0.0, 0.0, TIP])
    corners = [begin, foot, top, top + aside, foot + aside, begin + aside, begin + 2 * aside]
    ways = [way(*(each + 2 * k * aside for each in corners)) for k in range(4)]
    places = np.concatenate(ways)
    places = places + np.random.default_rng(3).normal(0.0, NOISE, places.shape)
    trace = Trace(np.arange(len(places)) * 4e-3, places, np.zeros(len(places), dtype=np.int64), TIP)
    on = laid(trace)
    assert on.base.kind == "polyhedron"
    assert lifted(on) is None


@pytest.mark.slow
def test_lifts_say_from_which_side_a_plate_was_felt() -> None:
    trace, felt = recorded([row(y, k % 2 == 0) for k, y in enumerate(ROWS)], 20e-3)
    below = Trace(trace.t, trace.centers * [1.0, 1.0, -1.0], trace.sweep, TIP)
    found = lifted(laid(below))
    assert found is not None
    assert found.inwards
    assert (felt & ~found.felt).sum() <= 5 * 2 * len(ROWS)


@pytest.mark.slow
def test_an_exact_path_that_rises_to_its_end_is_searched_to_its_end() -> None:
    """Without noise its lowest place within a radius is as low as itself, and was gone to for ever."""
    x = 1e-5 * np.arange(500)
    trace = Trace.from_profile(x, 0.5 * np.maximum(0.0, x - 3e-3), 5e-5)
    assert lifted(LaidTrace.of(trace, fit_base(trace))) is None
