"""Outliers: what no ball on any surface can give is left out and listed; what a ball can give never is."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.arrays import FloatArray
from mapping.base.base import Base
from mapping.detection.cap_fit import CUSP
from mapping.detection.detect import Detections, detect
from mapping.detection.outliers import BLOCKS, LEAST_OUT, LONGEST_RUN, OUT, _allowed_bend, _out
from mapping.geometry.templates import cap_height, rim_height, step_height
from mapping.surface import Surface
from mapping.trace import Trace

TIP, STEP, LENGTH, SWEEPS, WHITE = 10e-3, 20e-6, 0.1, 4, 0.05e-3
S = np.arange(int(LENGTH / STEP)) * STEP
PLATE = Base(Surface([[-0.2, -0.2, 0], [0.2, -0.2, 0], [0.2, 0.2, 0], [-0.2, 0.2, 0]], [[0, 1, 2], [0, 2, 3]]))
BURST = slice(2000, 2030)


def sweeps(seed: int, shape: FloatArray) -> FloatArray:
    """(SWEEPS, N) heights with white noise; the shape (N,) in the second sweep."""
    heights = WHITE * np.random.default_rng([12, seed]).standard_normal((SWEEPS, len(S)))
    heights[1] += shape
    return heights


def found(heights: FloatArray) -> Detections:
    y = np.repeat(np.linspace(-0.04, 0.04, SWEEPS), len(S))
    centers = np.column_stack([np.tile(S - 0.5 * LENGTH, SWEEPS), y, TIP + heights.ravel()])
    return detect(Trace(np.arange(len(y)) * 2e-4, centers, np.repeat(np.arange(SWEEPS), len(S)), TIP), PLATE)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_burst_is_left_out_where_it_is_and_listed(sign: float) -> None:
    burst = np.zeros(len(S))
    burst[BURST] = sign * 0.3e-3
    result = found(sweeps(0, burst))
    assert result.crossings == ()
    inside = np.arange(len(S))[BURST] + len(S)
    assert len(np.setdiff1d(inside, result.unfelt)) <= 4
    # a block of 27 samples sees it first, and reaches as far beyond
    assert len(np.setdiff1d(result.unfelt, inside)) <= 27
    assert any("bend sharper than the ball" in sentence for sentence in result.left_out)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_burst_that_the_noise_nearly_hides_is_no_detail(sign: float) -> None:
    # its ends bend by no more than noise and ball may, but it is higher than a ball's trace so narrow can be
    burst = np.zeros(len(S))
    burst[2000:2022] = sign * 6.0 * WHITE
    result = found(sweeps(3, burst))
    assert result.crossings == ()
    told = [said for said in result.left_out if "not felt" in said]
    assert len(told) == 1 and ("draws nothing so narrow" in told[0] or "bend sharper" in told[0])


def test_readings_that_do_not_change_are_left_out_and_listed() -> None:
    heights = sweeps(1, np.zeros(len(S)))
    heights[1, 3000:3040] = heights[1, 3000]
    result = found(heights)
    assert set(range(len(S) + 3001, len(S) + 3040)) <= set(result.unfelt)
    assert any("do not change" in sentence for sentence in result.left_out)


def test_flat_places_of_a_path_without_noise_are_not_stuck() -> None:
    # bent over more than half of it, so that differences are of the size of the bends, and level for the rest
    bent = np.where(S < 0.06, 1e-3 * np.cos(2 * np.pi * S / 0.06), 1e-3)
    result = found(np.tile(bent, (SWEEPS, 1)))
    assert not result.unfelt and not any("do not change" in sentence for sentence in result.left_out)


@pytest.mark.parametrize("height", [0.3e-3, 2e-3])
def test_crests_and_notches_of_a_ball_are_not_left_out(height: float) -> None:
    # two sharp crests side by side: between them the trace bends up as sharply as can be
    half_width = np.sqrt(2 * TIP * height)
    arcs = [height - (S - place) ** 2 / (2 * TIP) for place in (0.05, 0.05 + 0.8 * half_width)]
    result = found(sweeps(2, np.maximum(np.max(arcs, axis=0), 0.0)))
    assert result.unfelt == ()
    assert {c.sweep for c in result.crossings} == {1}


def test_the_best_cap_of_a_cusp_is_so_much_higher_than_a_crest_so_wide() -> None:
    x = np.linspace(-1.0, 1.0, 4001)
    cusp, widths = (1.0 - np.abs(x)) ** 2, np.linspace(0.5, 0.8, 301)
    caps = np.maximum(1.0 - (x / widths[:, None]) ** 2, 0.0)
    k = int(((caps @ cusp) ** 2 / np.einsum("ij,ij->i", caps, caps)).argmax())
    height = float(caps[k] @ cusp / (caps[k] @ caps[k]))
    assert height / widths[k] ** 2 == pytest.approx(CUSP, rel=0.01)


@pytest.mark.parametrize("width", [2e-3, 4e-3, 8e-3])
def test_a_dip_between_two_rims_is_felt(width: float) -> None:
    # narrower than a crest so high, for it is a cusp
    away = np.maximum(width - np.abs(S - 0.05), 0.0)
    result = found(sweeps(4, np.sqrt(TIP**2 - away**2) - TIP))
    assert result.unfelt == () and not any("not felt" in said for said in result.left_out)
    assert [(c.sweep, c.kind) for c in result.crossings] == [(1, "concave")]


@pytest.mark.parametrize("noise", [0.0, 1e-4, 5e-3])
@pytest.mark.parametrize("height", [0.3, 0.6, 0.8, 0.95, 0.99, 2.0])
def test_steps_of_any_height_are_felt_from_end_to_end(height: float, noise: float) -> None:
    # samples far apart: the arc about the edge bends the heights the more the steeper it is
    x = np.arange(-30e-3, 30e-3, 0.05 * TIP)
    heights = step_height(x - 3e-3, height * TIP, TIP) + noise * TIP * np.random.default_rng(4).standard_normal(len(x))
    centers = np.column_stack([x, np.zeros_like(x), TIP + heights])
    result = detect(Trace(np.arange(len(x)) * 1e-3, centers, np.zeros(len(x), dtype=np.int64), TIP), PLATE)
    assert result.unfelt == () and not any("not felt" in said for said in result.left_out)
    (crossing,) = result.crossings
    assert crossing.kind == "step up" and crossing.height == pytest.approx(height * TIP, rel=0.03)


@pytest.mark.parametrize("step", [5e-4, 5e-3, 5e-2])
@pytest.mark.parametrize("height", [0.3, 0.9, 0.99, 1.5])
def test_no_block_of_what_a_ball_traces_stands_above_its_opening(height: float, step: float) -> None:
    x = np.arange(-1.6, 1.6, step)
    bodies = {
        "step": step_height(x - 0.3 * step, height, 1.0),
        "blades": np.maximum(cap_height(x, height, 0.0, 1.0), cap_height(x - 0.4, 0.8 * height, 0.0, 1.0)),
        "pit": rim_height(1.2 - np.abs(x - 0.3 * step), 1.0, height),
    }
    for name, heights in bodies.items():
        sums = np.concatenate([[0.0], np.cumsum(heights)])
        for size in (size for size in BLOCKS if size * step < LONGEST_RUN):
            means = (sums[size:] - sums[:-size]) / size
            bend = 2 * means[size:-size] - means[: -2 * size] - means[2 * size :]
            at = np.flatnonzero(bend > 1e-9)
            allowed = _allowed_bend(means, at + size, size, step, np.zeros(len(at)), 1.0)
            assert (bend[at] <= allowed + 1e-12).all(), (name, size)


def test_a_hole_in_level_ground_stands_below_its_opening() -> None:
    # the ball sinks into nothing that has no rounded brim: before and behind the hole no circle fits
    heights = np.zeros(201)
    heights[100] = -0.05
    at = np.array([99, 101])
    bend = 2 * heights[at] - heights[at - 1] - heights[at + 1]
    allowed = _allowed_bend(heights, at, 1, 2e-3, np.zeros(2), 1.0)
    assert (allowed < 0.01 * bend).all()


def test_places_of_crossings_count_all_samples() -> None:
    crest = np.maximum(0.3e-3 - (S - 0.08) ** 2 / (2 * TIP), 0.0)
    crest[BURST] += 0.4e-3
    (crossing,) = found(sweeps(3, crest)).crossings
    assert abs(0.5 * (crossing.start + crossing.stop) * STEP - 0.08) < 0.3e-3


def test_single_samples_are_out_where_more_are_than_a_gaussian_law_lets() -> None:
    rng = np.random.default_rng(1)
    wrongly = [_out(np.random.default_rng(seed).standard_normal(5000)) for seed in range(100)]
    assert all(limit == OUT for limit in wrongly)
    assert LEAST_OUT <= _out(rng.standard_t(3, 5000)) < 5.0
