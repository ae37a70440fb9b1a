"""The empirical null: noise as fitted costs nothing; noise that is not the same everywhere is weighed as measured."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.special import ndtr, ndtri, stdtrit

from hw.simulated.noise_source import ornstein_uhlenbeck
from mapping.arrays import FloatArray
from mapping.base.base import Base
from mapping.base.height_profile import SweepHeights
from mapping.detection import quiet_noise
from mapping.detection.detect import Detections, detect, expected_limit
from mapping.detection.empirical_null import _heavier_tail, _outputs, seen
from mapping.detection.filters.matched_filter import build_bank
from mapping.detection.level_kernels import expected_level, level_likelihood
from mapping.detection.local_level import local_levels
from mapping.instrument.noise import Noise
from mapping.surface import Surface
from mapping.trace import Trace

TIP, STEP, LENGTH, SWEEPS, WHITE = 10e-3, 20e-6, 0.1, 10, 0.05e-3
S = np.arange(int(LENGTH / STEP)) * STEP
PLATE = Base(Surface([[-0.2, -0.2, 0], [0.2, -0.2, 0], [0.2, 0.2, 0], [-0.2, 0.2, 0]], [[0, 1, 2], [0, 2, 3]]))
WIRE = 0.1e-3


def white(rng: np.random.Generator) -> FloatArray:
    return WHITE * rng.standard_normal((SWEEPS, len(S)))


def level_by_sweep(rng: np.random.Generator) -> FloatArray:
    return np.exp(0.5 * rng.standard_normal((SWEEPS, 1))) * white(rng)


def one_over_f(rng: np.random.Generator) -> FloatArray:
    f = np.fft.rfftfreq(4 * len(S))
    f[0] = f[1]
    spectrum = (rng.standard_normal((SWEEPS, len(f))) + 1j * rng.standard_normal((SWEEPS, len(f)))) * f**-0.5
    heights = np.fft.irfft(spectrum, axis=1)[:, : len(S)]
    return np.asarray(WHITE * heights / heights.std())


def wandering(rng: np.random.Generator) -> FloatArray:
    """White, and a walk that goes on from sweep to sweep: each stands at a level of its own, and hardly leaves it."""
    steps = rng.standard_normal(SWEEPS * len(S))
    return white(rng) + WHITE * np.cumsum(steps).reshape(SWEEPS, -1) / np.sqrt(4 * len(S))


def found(law: Callable[[np.random.Generator], FloatArray], seed: int, height: float = 0.0) -> Detections:
    """What is detected at one false alarm a metre on a metre of plate, a wire of that height across every sweep."""
    z = law(np.random.default_rng([11, seed]))
    if height:
        reach, ball = np.sqrt(2 * TIP * height), TIP + 0.5 * height
        x = np.clip(S - 0.6 * LENGTH, -reach, reach)
        z = z + np.maximum(0.5 * height - TIP + np.sqrt(ball**2 - x**2), 0.0) * (np.abs(S - 0.6 * LENGTH) < reach)
    y = np.repeat(np.linspace(-0.04, 0.04, SWEEPS), len(S))
    centers = np.column_stack([np.tile(S - 0.5 * LENGTH, SWEEPS), y, TIP + z.ravel()])
    trace = Trace(np.arange(len(y)) * 2e-4, centers, np.repeat(np.arange(SWEEPS), len(S)), TIP)
    return detect(trace, PLATE, false_alarms_per_metre=1.0)


@pytest.mark.slow
def test_a_path_without_noise_is_no_quieter_than_rounding() -> None:
    def every_other_silent(rng: np.random.Generator) -> FloatArray:
        return white(rng) * (np.arange(SWEEPS) % 2)[:, None]

    crossings = found(every_other_silent, 0, WIRE).crossings
    assert [crossing.sweep for crossing in crossings] == list(range(SWEEPS))
    # in silent sweeps a crest of 0.1 mm over the rounding of 0.1 nm of all the samples under it
    silent = [crossing.snr for crossing in crossings if crossing.sweep % 2 == 0]
    assert len(silent) >= SWEEPS // 2 and max(silent) < 1e6 * np.sqrt(2 * np.sqrt(2 * TIP * WIRE) / STEP)


@pytest.mark.filterwarnings("error")
def test_where_nothing_scatters_the_rounding_is_the_level() -> None:
    """A mean over levels that differ by 24 powers of ten comes out as nothing, and nothing by nothing tells nothing."""
    bank = build_bank(Noise(1.0), 1.0, 1.0, 12.0, 100.0, 0)
    height, quiet = np.random.default_rng(1).standard_normal(2000), np.ones(2000, dtype=bool)
    height[1000:] = 0.0
    local = np.repeat([1.0, 1e-24], 1000)
    assert seen(local, bank.filters[0].half_width / bank.spacing)[-1] == 0.0
    outputs = _outputs(height, quiet, local, bank, 0, 1e-6)
    assert np.isfinite(outputs[:10]).all() and np.isnan(outputs[-10:]).all()


def test_what_lies_in_the_middle_of_every_sweep_is_not_taken_for_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(quiet_noise, "RAW_SAMPLES", 500 * SWEEPS)

    def wide(rng: np.random.Generator) -> FloatArray:
        crest = 0.5e-3 * np.maximum(0.0, 1.0 - ((S - 0.5 * LENGTH) / (0.1 * LENGTH)) ** 2)
        return np.tile(crest, (SWEEPS, 1))

    noise = found(wide, 0).noise
    assert noise.white < 1e-6 * TIP and noise.correlated == 0.0


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_where_most_of_the_path_lies_on_wires_the_noise_is_that_of_the_rest(seed: int) -> None:
    """As of a finger that explores: some sweeps all over a plate, and many short ones across a wire."""
    rng, step, noise = np.random.default_rng(seed), 50e-6, 0.2e-3
    reach, ball = np.sqrt(2 * TIP * 0.65e-3), TIP + 0.325e-3
    lengths = [0.1] * 12 + [0.015] * 120
    centers, sweeps = [], []
    for number, length in enumerate(lengths):
        x = np.arange(-0.5 * length, 0.5 * length, step)
        near = np.clip(x, -reach, reach)
        z = np.maximum(0.325e-3 - TIP + np.sqrt(ball**2 - near**2), 0.0) + noise * rng.standard_normal(len(x))
        y = rng.uniform(-0.04, 0.04)
        centers.append(np.column_stack([x, np.full(len(x), y), TIP + z]))
        sweeps.append(np.full(len(x), number))
    trace = Trace(np.arange(sum(map(len, sweeps))) * 2e-4, np.concatenate(centers), np.concatenate(sweeps), TIP)
    found = detect(trace, PLATE)
    # of 35,000 blocks of a sample or two a half is quiet, which knows the level to 0.6 %
    assert found.noise.white == pytest.approx(noise, rel=0.02)
    assert found.noise.correlated < 0.1 * noise
    assert len(found.crossings) == len(lengths)


def test_white_noise_needs_no_scale_of_its_own_and_nothing_is_said() -> None:
    assert found(white, 0).remarks == ()


@pytest.mark.parametrize("law", [level_by_sweep, one_over_f])
def test_noise_of_another_law_gives_no_more_than_thrice_the_false_alarms_asked_for_and_is_told(
    law: Callable[[np.random.Generator], FloatArray],
) -> None:
    # ten and twenty a metre when the fitted law is taken at its word
    runs = [found(law, seed) for seed in range(2)]
    assert sum(len(run.crossings) for run in runs) <= 3 * sum(run.inspected_length for run in runs)
    told = ["scatter otherwise than the fitted noise says" in " ".join(run.remarks) for run in runs]
    # where the law has the terms that the noise has, there is nothing to tell
    assert all(said or run.noise.further for said, run in zip(told, runs, strict=True))
    assert all(told) if law is level_by_sweep else all(run.noise.further for run in runs)


@pytest.mark.slow
def test_beside_a_crest_in_noise_that_wanders_there_is_no_pit() -> None:
    """A sweep that stands off the base does so under a crest, too: the base there would be a pit as wide as the crest,
    with a step down and a step up at its ends, and the next one beside it."""
    runs = [found(wandering, seed, 8 * WHITE) for seed in range(4)]
    beside = [c for run in runs for c in run.crossings if abs(c.point[0] - 0.1 * LENGTH) > np.sqrt(2 * TIP * 8 * WHITE)]
    assert not any(c.is_step for c in beside)
    assert len(beside) <= 3 * sum(run.inspected_length for run in runs)


def test_a_wire_that_stands_out_is_still_found_where_the_level_differs_by_sweep() -> None:
    crossings = [c for c in found(level_by_sweep, 3, WIRE).crossings if abs(c.point[0] - 0.1 * LENGTH) < 1.5e-3]
    assert len({c.sweep for c in crossings}) >= 9


@pytest.mark.parametrize(("length", "seed"), [(0.0, 0), (1e-3, 2)])
def test_a_few_sweeps_that_are_noisy_over_all_of_their_length_hold_no_details(length: float, seed: int) -> None:
    """One in ten with ten times the noise: nothing of it is quiet under the noise of the others, and few are asked."""
    rng, count, sweeps = np.random.default_rng([12, seed]), 500, 40
    along = np.linspace(-25e-3, 25e-3, count)
    z = rng.standard_normal((sweeps, count))
    if length:
        z = ornstein_uhlenbeck(rng, (count, sweeps), 0.1e-3 / length, 1.0).T
    z *= np.where(np.arange(sweeps) % 10 == 7, 20e-6, 2e-6)[:, None]
    y = np.repeat(1e-3 * np.arange(sweeps) - 20e-3, count)
    trace = Trace(
        np.arange(len(y)) * 1e-3,
        np.column_stack([np.tile(along, sweeps), y, 2e-3 + z.ravel()]),
        np.repeat(np.arange(sweeps), count),
        2e-3,
    )
    detections = detect(trace, PLATE)
    assert not detections.crossings and len(detections.remarks) == 1


@pytest.mark.parametrize("prior", [(0.0, 0.0, 2.0), (0.3, 0.0, 2.0), (0.0, 1.0, 4.0), (0.1, 0.3, 8.0)])
@pytest.mark.parametrize("cells", [1, 5, 40])
def test_the_linear_filter_of_the_level_agrees_with_the_full_covariance(cells, prior):
    rng = np.random.default_rng(cells)
    read, error = rng.normal(size=cells), rng.uniform(0.1, 0.5, cells)
    error[2:3] = np.inf
    lag = np.abs(np.subtract.outer(np.arange(cells), np.arange(cells)))
    covariance = prior[0] + prior[1] * np.exp(-lag / prior[2])
    known = np.isfinite(error)
    inner = covariance[np.ix_(known, known)] + np.diag(error[known])
    answer = np.linalg.solve(inner, read[known])
    likelihood = -0.5 * (read[known] @ answer + np.linalg.slogdet(inner)[1])
    np.testing.assert_allclose(level_likelihood(read, error, *prior), likelihood, rtol=1e-11)
    expected = expected_level(read, error, *prior)
    np.testing.assert_allclose(expected[:, 0], covariance[:, known] @ answer, atol=1e-12)
    left = covariance - covariance[:, known] @ np.linalg.solve(inner, covariance[known])
    np.testing.assert_allclose(expected[:, 1], np.diag(left), atol=1e-12)


def test_heavier_tails_raise_the_threshold_by_what_they_are_and_gaussian_ones_by_nothing() -> None:
    rng = np.random.default_rng(1)
    for seed in range(20):
        assert _heavier_tail(np.random.default_rng(seed).standard_normal(3000), 3000.0, 5.0) == 1.0
    told = _heavier_tail(rng.standard_t(6, 40_000), 40_000.0, 5.0)
    # by the quantiles of both laws, each over its own core
    right = stdtrit(6.0, float(ndtr(-5.0))) / stdtrit(6.0, 0.25) / (5.0 / ndtri(0.75))
    assert told == pytest.approx(right, rel=0.15) and right > 1.5


def test_positions_in_steps_of_the_noise_still_tell_its_level() -> None:
    rng, bank = np.random.default_rng(1), build_bank(Noise(1.0), 1.0, 1.0, 12.0, 100.0, 0)
    quiet = [np.ones(4000, dtype=bool)] * 4
    level = np.exp(0.5 * np.sin(np.arange(4000) / 300.0))
    exact = [level * rng.standard_normal(4000) for _ in quiet]
    heights = [np.round(2.0 * each) / 2.0 for each in exact]
    index, nowhere = np.arange(4001), np.zeros((4000, 3))
    profiles = [SweepHeights(0, 0.0, 1.0, each, 1.0, index, index[1:] * 1.0, nowhere) for each in heights]
    told = local_levels(profiles, heights, quiet, bank)
    assert 0.0 < told.doubt < 0.1 and told.doubt_over(1e6) < 0.01 * told.doubt
    # rounding to steps of half the noise adds a twelfth of their square
    off = np.log(np.concatenate(told.variance) / (np.tile(level**2, 4) + 0.25 / 12.0))
    assert abs(off.mean()) < 0.1 and off.std() < 3.0 * np.sqrt(told.doubt)


def _even(rng: np.random.Generator) -> FloatArray:
    return np.arange(0.0, 0.12, 50e-6)


def _by_chance(rng: np.random.Generator) -> FloatArray:
    return np.sort(rng.uniform(0.0, 0.12, 2400))


def _four_times_as_fast(rng: np.random.Generator) -> FloatArray:
    s = [0.0]
    while s[-1] < 0.12:
        s.append(s[-1] + 20e-6 + 60e-6 * float(np.sin(np.pi * s[-1] / 0.12)) ** 2)
    return np.array(s)


@pytest.mark.parametrize(("places", "worse"), [(_even, 1.05), (_by_chance, 1.3), (_four_times_as_fast, 1.2)])
def test_samples_that_come_unevenly_are_as_noisy_as_others(
    places: Callable[[np.random.Generator], FloatArray], worse: float
) -> None:
    """A hand, or a machine that speeds up: bins of several samples and of none are no noise of another law."""
    rng, white = np.random.default_rng(5), 1e-6
    centers, sweeps = [], []
    for number in range(12):
        x = places(rng)
        centers.append(np.column_stack([x, np.full(len(x), 2e-3 * number), TIP + white * rng.standard_normal(len(x))]))
        sweeps.append(np.full(len(x), number))
    count = sum(map(len, sweeps))
    trace = Trace(np.arange(float(count)), np.concatenate(centers), np.concatenate(sweeps), TIP)
    found = detect(trace, PLATE)
    assert found.remarks == () and not found.crossings
    np.testing.assert_allclose(found.noise.sd, white, rtol=0.05)
    usual = expected_limit(Noise(white), 50e-6, TIP)
    assert 0.95 * usual < found.detection_limit < worse * usual
