"""Posteriors in the cases that are hardest to be sane about."""

from __future__ import annotations

import time

import numpy as np
import pytest
from recorded_features import (
    CROSSINGS,
    ENDS,
    GUESS,
    SLIDES,
    TIP,
    WHITE,
    D,
    feature,
    inside,
    line,
    plate,
    record,
    wire,
)

from mapping.errors import EmptyWindowError
from mapping.inference.feature_posterior import refine, sample_posterior
from mapping.instrument.noise import Noise
from mapping.trace import Trace


@pytest.mark.slow
def test_spikes_do_not_move_the_answer():
    trace = record(CROSSINGS + SLIDES, wire(ENDS))
    centers = np.array(trace.centers)
    hit = np.random.default_rng(1).choice(len(centers), 60, replace=False)
    centers[hit, 2] += 5e-3
    spiked = Trace(trace.t, centers, trace.sweep, TIP)
    a, b = (
        refine(GUESS, t, np.random.default_rng(0), base=plate(), noise=WHITE, confirm=False) for t in (trace, spiked)
    )
    assert b.height.median == pytest.approx(a.height.median, abs=8e-6)


@pytest.mark.slow
def test_the_rest_of_a_long_log_costs_next_to_nothing():
    near = record(CROSSINGS, wire(ENDS))
    rng = np.random.default_rng(0)
    far = 0.06 + 0.03 * np.sort(rng.random(1_000_000))
    elsewhere = np.column_stack([far, np.full(len(far), 0.05), np.full(len(far), TIP)])
    count = len(elsewhere)
    rest = Trace(np.arange(count) * 1e-3, elsewhere, np.full(count, 99), TIP)
    whole = Trace.concatenate([near, rest])
    base, times, posteriors = plate(), [], []
    for trace in (near, near, whole):
        begin = time.perf_counter()
        rng = np.random.default_rng(0)
        posteriors.append(sample_posterior(GUESS, trace, rng, base=base, noise=WHITE, confirm=False))
        times.append(time.perf_counter() - begin)
    np.testing.assert_array_equal(posteriors[1].samples, posteriors[2].samples)
    assert times[2] < 3 * times[1] + 0.5


@pytest.mark.parametrize("noise", [Noise(0.0), Noise(2e-3)], ids=["no noise", "noise thrice the wire"])
def test_extreme_noise_has_a_status_and_a_sane_answer(noise):
    trace = record(CROSSINGS + SLIDES, wire(ENDS), noise)
    found = refine(GUESS, trace, np.random.default_rng(0), base=plate(), noise=noise, confirm=False)
    assert found.posterior.status in ("not needed", "converged", "chain too short")
    assert inside(found.height, D, 2e-6)
    assert found.height.high - found.height.low < (2e-6 if noise.white == 0 else D)


def test_a_wire_thinner_than_the_sample_spacing():
    # 2 um under a 10 mm ball: the disturbance is 0.4 mm wide, however thin the wire
    thin = 2e-6
    paths = [line((x, -1.5e-3), (x, 1.5e-3), 12e-6) for x in (-4e-3, 0, 4e-3)]
    trace = record(paths, wire(ENDS, thin), Noise(0.2e-6))
    guess = feature("ridge", [(-4e-3, 0.2e-3, 0), (4e-3, 0, 0)], 2e-6, 2e-6, sd=20e-6)
    found = refine(guess, trace, np.random.default_rng(0), base=plate(), noise=Noise(0.2e-6), confirm=False)
    assert inside(found.height, thin, 0.1e-6)


@pytest.mark.slow
def test_a_sweep_along_the_wire_alone_is_sane():
    trace = record([line((-30e-3, 0.1e-3), (30e-3, 0.1e-3))], wire(ENDS))
    guess = feature("ridge", [(-9e-3, 0, 0), (9e-3, 0, 0)], 0.6e-3, 0.6e-3, crossings=1)
    found = refine(guess, trace, np.random.default_rng(0), base=plate(), noise=WHITE, confirm=False)
    assert found.posterior.status in ("not needed", "converged", "chain too short")
    assert inside(found.length, 31e-3, 2e-3)


def test_one_crossing_only():
    trace = record(CROSSINGS[1:2], wire(ENDS))
    guess = feature("ridge", (-3e-3, 0.1e-3, 0), 0.6e-3, 0.6e-3, crossings=1)
    found = refine(guess, trace, np.random.default_rng(0), base=plate(), noise=WHITE, confirm=False)
    # a crossing at an angle looks like a wider and no higher wire: the height is what it is
    assert found.length.censored and inside(found.height, D, 20e-6)


@pytest.mark.slow
def test_a_feature_at_the_border_of_the_mesh():
    base = plate(half=10e-3)
    paths = [line((x, -9.9e-3), (x, 9.9e-3)) for x in (-9e-3, -3e-3, 3e-3, 9e-3)]
    trace = record(paths, wire([(-30e-3, 0, 0), (30e-3, 0, 0)]))
    found = refine(GUESS, trace, np.random.default_rng(0), base=base, noise=WHITE, confirm=False)
    assert found.length.censored and found.length.high < 21e-3 and inside(found.height, D, 5e-6)


@pytest.mark.slow
def test_a_constant_trace_bounds_the_height_from_above():
    trace = record(CROSSINGS, lambda feet: np.zeros(len(feet)))
    found = refine(GUESS, trace, np.random.default_rng(0), base=plate(), noise=WHITE, confirm=False)
    assert found.height.high < 0.1e-3
    assert found.posterior.status in ("not needed", "converged", "chain too short")


def test_three_samples_give_a_wide_answer_not_an_error():
    paths = [line((0.0, -1e-3), (0.0, 1e-3), 1e-3)]
    trace = record(paths, wire(ENDS))
    guess = feature("ridge", (0.0, 0, 0), 0.6e-3, 0.6e-3, crossings=1)
    found = refine(guess, trace, np.random.default_rng(0), base=plate(), noise=WHITE)
    assert found.height.high - found.height.low > 0.2e-3


def test_a_feature_without_a_sample_near_by_has_no_evidence_and_costs_no_other():
    trace = record(CROSSINGS, wire(ENDS))
    far = feature("ridge", [(70e-3, 70e-3, 0), (80e-3, 70e-3, 0)], D, D)
    with pytest.raises(EmptyWindowError, match="no sample of the trace"):
        sample_posterior(far, trace, np.random.default_rng(0), base=plate(), noise=WHITE)
    found = refine(far, trace, np.random.default_rng(0), base=plate(), noise=WHITE)
    assert found.posterior is None and not found.evidence.likely
    assert "no sample of the trace" in found.notes[-1]


def test_a_line_whose_course_leaves_the_base_is_kept_with_what_single_sweeps_showed():
    """A bump of 14 crossings, told as a line whose chord leaves the body, was dropped as a false alarm."""
    trace = record(CROSSINGS, wire(ENDS))
    off = feature("ridge", [(0.4, 0.4, 0), (0.42, 0.4, 0)], D, D)
    found = refine(off, trace, np.random.default_rng(0), base=plate(), noise=WHITE)
    assert found.posterior is None and found.evidence == off.evidence and found.evidence.likely
    assert found.notes[-1] == "no posterior: its axis does not lie over the base"
    assert (
        found.details.misfit == "its sizes are those that single sweeps show, for its axis does not lie over the base"
    )
