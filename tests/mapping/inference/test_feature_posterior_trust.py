"""Posteriors that can be trusted: bounds reached, two samplers that agree, intervals that cover."""

from __future__ import annotations

import time
from dataclasses import replace

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

from explore3d.bench.posterior.calibration import Case, campaign, noise_of, run_case
from explore3d.bench.posterior.calibration_verdicts import verdicts
from mapping.errors import SamplerError
from mapping.feature import Support
from mapping.geometry.templates.shapes import cap_height, groove_height, rim_height, step_height
from mapping.inference import feature_posterior
from mapping.inference.families.problem import Surroundings
from mapping.inference.feature_posterior import pose_problem, refine, sample_posterior, solve_problem
from mapping.inference.sampler.ensemble import sample_ensemble
from mapping.inference.sampler.importance import importance_sample
from mapping.inference.sampler.laplace import find_optima, laplace
from mapping.inference.sampler.psis import resample
from mapping.instrument.noise import Noise
from mapping.trace import Trace


@pytest.mark.parametrize(
    "diameter", [D, pytest.param(0.2e-3, marks=pytest.mark.slow), pytest.param(1e-3, marks=pytest.mark.slow)]
)
def test_location_reaches_the_cramer_rao_bound(diameter):
    """The sd of a wire's place from one crossing against sigma/D sqrt(3 spacing x_c / 8) (theory section 6).

    The bound is of the mean over the noise: single traces are 5 to 8 % luckier or less lucky (of 40), twelve together
    2 %. A slope of the base takes (x_c/W)^3 of the information in a window that reaches W = 2.9 x_c to either side,
    which is 2 % of the standard deviation.
    """
    spacing, noise = 12e-6, Noise(0.2e-3 * diameter / D)
    guess = feature("bump", (-3e-3, 0.1e-3, 0), 0.9 * diameter, 0.9 * diameter, crossings=1)
    variances = []
    for seed in range(12):
        trace = record(CROSSINGS[1:2], wire(ENDS, diameter), noise, seed)
        assert len(pose_problem(guess, Surroundings(trace, plate(), noise)).window) > 80
        rng = np.random.default_rng(0)
        posterior = sample_posterior(guess, trace, rng, base=plate(), noise=noise, confirm=False)
        variances.append(posterior.draws("along").var())
    bound = noise.white / diameter * np.sqrt(3 * spacing * np.sqrt(2 * TIP * diameter) / 8)
    assert np.sqrt(np.mean(variances)) == pytest.approx(bound, rel=0.10)


def test_no_chain_confirms_what_the_evidence_makes_a_false_alarm(monkeypatch):
    """Not even where its draws cannot be trusted; what is there is confirmed."""
    asked = []

    def chain(*_, **__):
        asked.append(True)
        raise SamplerError("not in this test")

    monkeypatch.setattr(feature_posterior, "TRUSTED_K_HAT", 0.0)
    monkeypatch.setattr(feature_posterior, "sample_ensemble", chain)
    guess = feature("bump", (-3e-3, 0.1e-3, 0), D, D, crossings=1)

    def solved(truth):
        around = Surroundings(record(CROSSINGS[1:2], truth, WHITE), plate(), WHITE)
        return solve_problem(pose_problem(guess, around), np.random.default_rng(0), confirm=False)

    nothing = solved(lambda feet: np.zeros(len(feet)))
    assert not asked and nothing.chain is None and not nothing.posterior.trusted
    with pytest.raises(SamplerError):
        solved(wire(ENDS))
    assert asked


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["ridge", "bump", "step"])
def test_emcee_and_importance_sampling_agree_closely_in_regular_cases(kind):
    """Means within 0.1 and spreads within 5 %, from 20 000 effective draws each.

    Spreads from 5 to 95 %: a wire may be as thin as it likes, and the standard deviation of 20 000 logarithms of its
    radius is 4 % uncertain.
    """
    problem = regular_problem(kind)
    rng = np.random.default_rng(0)
    optima = find_optima(problem.target, problem.beginnings)
    fast = [importance_sample(problem.target, [laplace(problem.target, o) for o in optima], rng) for _ in range(8)]
    draws, weights = np.concatenate([each.draws for each in fast]), np.concatenate([each.weights for each in fast]) / 8
    mean = weights @ draws
    sd = np.sqrt(weights @ (draws - mean) ** 2)
    starts = fast[0].draws[resample(rng, fast[0].weights, 40)]
    chain = sample_ensemble(problem.target, starts, rng, max_steps=4000)
    longer = [sample_ensemble(problem.target, starts, rng, max_steps=4000) for _ in range(4)]
    samples = np.concatenate([each.samples for each in (chain, *longer)])
    assert max(each.k_hat for each in fast) < 0.5
    np.testing.assert_array_less(np.abs(samples.mean(axis=0) - mean) / sd, 0.1)
    draws = draws[resample(rng, weights, 200_000)]
    spreads = [np.ptp(np.quantile(each, [0.05, 0.95], axis=0), axis=0) for each in (samples, draws)]
    np.testing.assert_allclose(spreads[0] / spreads[1], 1.0, atol=0.05)


def regular_problem(kind):
    if kind == "bump":
        paths = [line((x, -9e-3), (x, 9e-3)) for x in (-1.5e-3, 0.5e-3)] + [line((-9e-3, 0.0), (9e-3, 0.0))]
        guess, truth = (
            feature("bump", (0, 0, 0), 0.4e-3, 1e-3),
            lambda feet: cap_height(np.linalg.norm(feet, axis=1), 0.5e-3, 2e-3, TIP),
        )
    elif kind == "step":
        paths, guess = CROSSINGS, feature("step", [(-9e-3, 0, 0), (9e-3, 0, 0)], 0.35e-3, 0.0)
        truth = lambda feet: step_height(feet[:, 1] - 0.2e-3, 0.4e-3, TIP)  # noqa: E731
    else:
        paths, guess, truth = CROSSINGS + SLIDES, GUESS, wire(ENDS)
    return pose_problem(guess, Surroundings(record(paths, truth), plate(), WHITE))


@pytest.mark.slow
def test_ten_million_samples_are_read_in_seconds():
    # 9.6e6 samples of a long crossing and 4e5 that matter: one look at the boxes of blocks decides
    near = record([line((x, -12e-3), (x, 12e-3), 0.25e-6) for x in (-9e-3, -3e-3, 3e-3, 9e-3)], wire(ENDS))
    count = 10_000_000 - len(near)
    far = np.column_stack([np.linspace(0.05, 0.09, count), np.full(count, 0.05), np.full(count, TIP)])
    whole = Trace.concatenate([near, Trace(np.arange(count) * 1e-3, far, np.full(count, 99), TIP)])
    guess = replace(GUESS, evidence=Support(50.0, 4))
    begin = time.perf_counter()
    found = refine(guess, whole, np.random.default_rng(0), base=plate(), noise=WHITE, confirm=False)
    assert len(whole) == 10_000_000 and time.perf_counter() - begin < 20.0
    assert found.posterior.status in ("not needed", "converged")
    assert inside(found.height, D, 1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["ridge", "bump", "groove", "pit", "step"])
def test_intervals_cover_and_ranks_are_uniform(kind):
    rows = [run_case(case) for case in campaign([kind], 60)]  # 300 of those of docs/posterior_calibration.md
    for name, verdict in verdicts(rows).items():
        assert verdict.coverage == pytest.approx(0.9, abs=0.05), name
        assert verdict.p_value > 1e-4, name


@pytest.mark.slow
def test_a_white_likelihood_on_correlated_noise_fails_the_same_test():
    rows = [run_case(Case("bump", "ell 1 mm", i, assumed="white")) for i in range(60)]
    assert noise_of("ell 1 mm", np.random.default_rng(0)).correlated > 0
    assert verdicts(rows)["along"].coverage < 0.7


MIRRORED = [line((x, -12e-3), (x, 12e-3)) for x in (-32e-3, -16e-3, 0.0, 16e-3, 32e-3)]
BUMP_PATHS = [line((x, -9e-3), (x, 9e-3)) for x in (-1.5e-3, 0.5e-3)] + [line((-9e-3, 0.0), (9e-3, 0.0))]
PROFILE = [line((-10e-3, 0), (10e-3, 0))]
FELT = {
    "wire": (GUESS, CROSSINGS + SLIDES, wire(ENDS), WHITE),
    "ends between sweeps, mirrored": (
        feature("ridge", [(-16e-3, 0, 0), (16e-3, 0, 0)], 0.6e-3, 0.6e-3, crossings=3),
        MIRRORED,
        wire([(-24e-3, 0, 0), (24e-3, 0, 0)]),
        Noise(5e-6),
    ),
    "ends never seen": (GUESS, CROSSINGS, wire([(-80e-3, 0, 0), (80e-3, 0, 0)]), WHITE),
    "bump": (
        feature("bump", (0, 0, 0), 0.4e-3, 1e-3),
        BUMP_PATHS,
        lambda feet: cap_height(np.linalg.norm(feet, axis=1), 0.5e-3, 2e-3, TIP),
        WHITE,
    ),
    "lone profile": (
        feature("bump", (0, 0, 0), 0.4e-3, 1e-3),
        PROFILE,
        lambda feet: cap_height(feet[:, 0], 0.5e-3, 3e-3, TIP),
        WHITE,
    ),
    "step": (
        feature("step", [(-9e-3, 0, 0), (9e-3, 0, 0)], 0.35e-3, 0.0),
        CROSSINGS,
        lambda feet: step_height(feet[:, 1] - 0.2e-3, 0.4e-3, TIP),
        WHITE,
    ),
    "pit": (
        feature("pit", (0.2e-3, 0.1e-3, 0), -0.1e-3, 3e-3),
        BUMP_PATHS,
        lambda feet: rim_height(2e-3 - np.linalg.norm(feet, axis=1), TIP, depth=0.1e-3),
        Noise(10e-6),
    ),
    "groove": (
        feature("groove", [(-9e-3, 0.1e-3, 0), (9e-3, 0, 0)], -0.1e-3, 2.5e-3),
        CROSSINGS + SLIDES,
        lambda feet: np.maximum(
            groove_height(feet[:, 1], 3e-3, TIP),
            rim_height(np.minimum(feet[:, 0] + 14e-3, 15e-3 - feet[:, 0]), TIP),
        ),
        Noise(10e-6),
    ),
}


QUICK = ("ends between sweeps, mirrored", "bump")


@pytest.mark.parametrize(
    "what", [each if each in QUICK else pytest.param(each, marks=pytest.mark.slow) for each in FELT]
)
def test_numbers_that_differ_by_rounding_alone_give_the_same_posterior(what):
    """Positions in mm and in um differ by their last bits: medians within 1e-6 standard deviations."""
    guess, paths, height_at, noise = FELT[what]
    trace = record(paths, height_at, noise)
    rounded = trace.centers * (1.0 + 1e-12 * np.random.default_rng(3).standard_normal(trace.centers.shape))
    one, other = (
        sample_posterior(guess, each, np.random.default_rng(0), base=plate(), noise=noise, confirm=False)
        for each in (trace, replace(trace, centers=rounded))
    )
    assert one.status == other.status
    off = np.abs(np.median(one.samples, axis=0) - np.median(other.samples, axis=0)) / one.samples.std(axis=0)
    assert off.max() < 1e-6
