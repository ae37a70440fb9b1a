"""A radius of the tip that is told too large is refuted by how sharply the trace bends; the right one is not."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from mapping import FloatArray, Trace
from mapping.base import LaidTrace, fit_base
from mapping.estimate.envelope import RefutedTip, refuted_tip

STEP, SAMPLES, NOISE = 0.02, 6000, 5e-4  # in true radii of the ball
INNER = sys.modules["mapping.estimate.envelope.refuted_tip"]


def pins(rng: np.random.Generator, highest: float, aside: bool = True, step: float = STEP) -> FloatArray:
    """Heights of a ball of radius 1 over a plate with pins, round on top, passed at any distance: exact, no noise."""
    x, z = step * np.arange(SAMPLES), np.zeros(SAMPLES)
    count = int(0.15 * x[-1])
    places = rng.uniform(0.0, x[-1], count)
    passed = aside * rng.uniform(-1.2, 1.2, count) * min(1.0, np.sqrt(2.0 * highest))
    tops, own = highest * rng.uniform(0.1, 1.0, count), rng.choice([0.0, 0.05, 0.2], count)
    for place, away, top, a in zip(places, passed, tops, own, strict=True):
        square = (1.0 + a) ** 2 - (x - place) ** 2 - away**2
        z = np.maximum(z, top - a - 1.0 + np.sqrt(np.maximum(square, 0.0)))
    return z


def asked(heights: FloatArray, told: float, tip_sd: float = 0.0, step: float = STEP) -> RefutedTip | None:
    """What a profile says of a told radius."""
    x = step * np.arange(len(heights))
    trace = Trace(np.arange(len(x)) * 1.0, np.column_stack([x, 0.0 * x, heights]), np.zeros(len(x), dtype=int), told)
    flat = Trace(trace.t, np.column_stack([x, 0.0 * x, 0.0 * x]), trace.sweep, told)
    return refuted_tip(LaidTrace.of(trace, fit_base(flat)), tip_sd)


def bursts(rng: np.random.Generator, samples: int = SAMPLES) -> FloatArray:
    """Spikes and runs of 10 to 30 levels among white noise, 40 of each."""
    errors = rng.standard_normal(samples)
    errors[rng.integers(0, samples, 40)] += 20.0 * rng.standard_normal(40)
    for begin in rng.integers(0, samples - 40, 40):
        errors[begin : begin + rng.integers(10, 40)] += rng.uniform(10.0, 30.0) * rng.choice([-1.0, 1.0])
    return errors


@pytest.mark.parametrize("highest", [0.05, 0.3, 1.5])
@pytest.mark.parametrize("factor", [3.0, 10.0, 1000.0])
def test_a_radius_told_too_large_is_refuted_and_the_true_one_is_left(highest: float, factor: float) -> None:
    rng = np.random.default_rng([1, int(100 * highest)])
    found = asked(pins(rng, highest) + NOISE * rng.standard_normal(SAMPLES), factor)
    assert found is not None and found.told == factor and found.places >= 3
    assert 1.0 < found.largest < min(2.9, factor)
    assert found.chance < 1e-4


def test_twice_the_radius_is_refuted_where_much_is_fine_and_the_noise_low() -> None:
    rng = np.random.default_rng(2)
    found = asked(pins(rng, 0.3) + 1e-4 * rng.standard_normal(SAMPLES), 2.0)
    assert found is not None and 1.0 < found.largest < 2.0


@pytest.mark.parametrize("highest", [0.05, 0.3, 1.5])
@pytest.mark.parametrize("noise", [0.0, 1e-4, 2e-3])
def test_the_right_radius_is_not_refuted_nor_one_that_is_too_small(highest: float, noise: float) -> None:
    for seed in range(4):
        rng = np.random.default_rng([3, seed, int(100 * highest)])
        heights = pins(rng, highest) + noise * rng.standard_normal(SAMPLES)
        assert asked(heights, 1.0) is None
        assert asked(heights, 0.1) is None


def test_a_doubt_that_covers_the_true_radius_leaves_it() -> None:
    rng = np.random.default_rng(4)
    heights = pins(rng, 0.3) + NOISE * rng.standard_normal(SAMPLES)
    assert asked(heights, 3.0, tip_sd=0.05) is not None
    assert asked(heights, 3.0, tip_sd=0.6) is None
    assert asked(heights, 3.0, tip_sd=3.0) is None


@pytest.mark.parametrize("told", [1.0, 10.0, 1000.0])
def test_spikes_and_bursts_refute_no_tip(told: float) -> None:
    for seed in range(6):
        assert asked(5e-3 * bursts(np.random.default_rng([5, seed])), told) is None


def test_spikes_and_bursts_hide_no_wrong_tip() -> None:
    rng = np.random.default_rng(6)
    found = asked(pins(rng, 0.3) + NOISE * bursts(rng), 100.0)
    assert found is not None and 1.0 < found.largest < 2.9


def test_one_place_refutes_nothing() -> None:
    rng, x = np.random.default_rng(7), STEP * np.arange(SAMPLES)
    crest = np.maximum(0.0, np.sqrt(np.maximum(1.0 - (x - 60.0) ** 2, 0.0)) - 0.9)
    assert asked(crest + NOISE * rng.standard_normal(SAMPLES), 1000.0) is None


def test_the_unit_of_length_does_not_matter() -> None:
    rng = np.random.default_rng(8)
    heights = pins(rng, 0.3) + NOISE * rng.standard_normal(SAMPLES)
    plain, small = asked(heights, 4.0), asked(heights * 2.0**-20, 4.0 * 2.0**-20, step=STEP * 2.0**-20)
    assert plain is not None and small is not None
    assert small.places == plain.places and small.largest == pytest.approx(plain.largest * 2.0**-20, rel=1e-9)


@pytest.mark.parametrize(("step", "highest"), [(0.005, 2.0), (0.01, 2.0), (0.05, 2.0), (0.2, 0.5)])
def test_means_over_blocks_bend_no_more_than_the_share_that_is_allowed_for(step: float, highest: float) -> None:
    """Without noise, and passed right over their tops, every bend is on a circle of the ball's radius, less that."""
    heights = pins(np.random.default_rng(9), highest, aside=False, step=step)
    x = step * np.arange(SAMPLES)
    trace = Trace(x, np.column_stack([x, 0.0 * x, heights]), np.zeros(SAMPLES, dtype=int), 1.0)
    base = fit_base(Trace(x, np.column_stack([x, 0.0 * x, 0.0 * x]), trace.sweep, 1.0))
    path, size, sharpest = INNER._Path(LaidTrace.of(trace, base).laid_sweeps[0], base), 1, 0.0
    while size * step <= 1.0:
        path.bent(size)
        scale = path.scales[-1]
        sharpest = max(sharpest, (2.0 * scale.rise[scale.usable] / scale.product[scale.usable]).max())
        size *= 2
    assert 0.9 < sharpest < 1.0 + INNER.MEANS_BEND_MORE


def test_no_pins_lean_a_ball_more_often_than_is_reckoned_with() -> None:
    """Theory equation 4.19: pins of one height, passed at any distance, drawn at random."""
    away = np.random.default_rng(10).uniform(0.0, 1.0, 400_000)
    cosine = np.sqrt(1.0 - away**2)
    for c, h in [(0.1, 0.01), (0.5, 0.02), (0.5, 0.3), (0.7, 0.05), (0.7, 2.0)]:
        allowed = 1.0 - np.sqrt((1.0 - c**2) / (1.0 - max(0.0, c - h) ** 2))
        shares = []
        for height in [*np.linspace(0.02, 1.0, 50), 1.0 - max(0.0, c - h)]:
            above = height - (1.0 - cosine)
            passed = above > 0.0
            shares.append(float((passed & (cosine < c) & (above <= h)).sum() / passed.sum()))
        assert max(shares) == pytest.approx(allowed, rel=0.05)
