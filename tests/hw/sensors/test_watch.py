"""What tells a force from what a broken sensor sends."""

from __future__ import annotations

import numpy as np
import pytest

from hw.errors import StoppedError
from hw.sensors.watch import Sample, SampleWatch

QUIET = 0.003  # N, noise of one component
COUNTS = 400.0  # per newton


def samples(forces: np.ndarray, first: int = 0) -> list[Sample]:
    return [(first + i, *map(float, force)) for i, force in enumerate(forces)]


def noise(number: int, seed: int = 0, axes: int = 3) -> np.ndarray:
    drawn = np.round(QUIET * COUNTS * np.random.default_rng(seed).standard_normal((number, 3))) / COUNTS
    drawn[:, axes:] = 0.0
    return drawn


def watching(axes: int = 3) -> SampleWatch:
    watch = SampleWatch(16)
    watch.learn(noise(200, 1, axes), 1.0, 1e-3)
    watch.steepest = 200.0  # N/s: 20 mm/s at 10 N/mm
    return watch


def faults(watch: SampleWatch, told: list[Sample]) -> list[str]:
    return [fault for sample in told if (fault := watch.judge(sample).fault) is not None]


def kept(watch: SampleWatch, told: list[Sample]) -> list[Sample]:
    return [sample for each in told for _, sample in watch.judge(each).kept]


def test_an_hour_of_rounded_noise_is_no_fault() -> None:
    assert not faults(watching(), samples(noise(300_000, 2)))


def test_a_frozen_value_is_found_within_control_periods() -> None:
    watch = watching()
    assert not faults(watch, samples(noise(50, 3)))
    frozen = samples(np.tile(noise(1, 4), (60, 1)), 50)
    judged = [watch.judge(sample).fault for sample in frozen]
    assert next(i for i, fault in enumerate(judged) if fault) <= 25, "25 ms"


def test_axes_that_a_sensor_does_not_have_are_left_alone() -> None:
    assert not faults(watching(axes=1), samples(noise(5000, 5, axes=1)))


def test_a_sensor_that_never_changes_is_refused_before_it_is_used() -> None:
    with pytest.raises(StoppedError, match="frozen"):
        SampleWatch(16).learn(np.zeros((200, 3)), 1.0, 1e-3)


def test_a_lone_spike_is_left_out_and_a_jump_that_stays_is_a_fault() -> None:
    told = noise(100, 6)
    told[50] += 3.0
    assert [count for count, *_ in kept(watching(), samples(told))] == [*range(50), *range(51, 100)]
    told[51] += 3.0
    assert not faults(watching(), samples(told))
    told[50:] += 3.0
    assert "jumped" in faults(watching(), samples(told))[0]


def test_a_force_that_rises_as_fast_as_the_stage_presses_is_no_jump() -> None:
    told = noise(100, 7)
    told[:, 2] += np.clip(0.2 * (np.arange(100) - 50), 0.0, 4.0)
    assert not faults(watching(), samples(told))


def test_an_old_sample_again_is_no_sample() -> None:
    watch = watching()
    told = samples(noise(10, 8))
    assert kept(watch, told) == told
    assert not kept(watch, [told[-1]] * 5)
    assert not kept(watch, told[3:6])


@pytest.mark.parametrize("off", [-512, -1, 1, 2, 7, 8, 512])
def test_a_garbled_count_costs_its_sample_and_no_other(off: int) -> None:
    told = samples(noise(200, 9), 1000)
    true = list(told)
    told[50] = (told[50][0] + off, *told[50][1:])
    watch = watching()
    assert kept(watch, told) == true[:50] + true[51:]
    assert watch.judge((1200, 0.0, 0.001, 0.0)).newest == 1200


def test_after_a_pause_the_next_sample_bears_the_first_one_out() -> None:
    told = samples(noise(200, 9))
    told[150:] = [((count + 3000) % 2**16, *force) for count, *force in told[150:]]
    watch = watching()
    assert kept(watch, told[:151]) == told[:150]
    verdict = watch.judge(told[151], at=5.0)
    assert [sample for _, sample in verdict.kept] == told[150:152] and verdict.newest == 3151


def test_the_first_sample_of_all_may_be_garbled() -> None:
    told = samples(noise(100, 9), 100)
    assert kept(SampleWatch(16), [(30_000, *told[0][1:]), *told])[1:] == told


def test_a_clock_of_uneven_steps_is_followed_as_it_was_in_free_air() -> None:
    rng = np.random.default_rng(3)
    counts = np.cumsum(np.round(1000.0 + 40.0 * rng.standard_normal(2000))).astype(int)
    told = [(int(count), *map(float, force)) for count, force in zip(counts, noise(2000, 4), strict=True)]
    watch = SampleWatch(32)
    watch.learn(noise(200, 1), 1000.0, 1e-3, 40.0)
    watch.judge(told[0])
    assert kept(watch, told[1:]) == told


def test_what_goes_on_jumping_is_a_fault() -> None:
    told = noise(100, 6)
    told[50:53, 2] += (3.0, -4.0, 5.0)
    assert "jumped" in faults(watching(), samples(told))[0]


def test_no_number_and_overload_are_faults() -> None:
    for value, why in ((float("nan"), "no number"), (float("inf"), "overloaded")):
        told = samples(noise(100, 6))
        told[50] = (50, 0.0, 0.0, value)
        assert not faults(watching(), told)
        told[50:53] = [(50 + i, 0.0, 0.0, value) for i in range(3)]
        assert why in faults(watching(), told)[0]


def spoilt(number: int, seed: int) -> list[Sample]:
    """Noise over slow presses, with what a bad line or a dying sensor makes of it now and then."""
    rng = np.random.default_rng(seed)
    told = noise(number, seed) + 2e-4 * np.arange(number)[:, None]
    found = [(i % 65536, *map(float, force)) for i, force in enumerate(told)]
    for at in rng.integers(0, number, 30):
        count, x, y, z = found[at]
        found[at] = [
            (count, x + 3.0, y, z),
            (count, float("nan"), y, z),
            (count, x, float("inf"), z),
            ((count + 20_000) % 65536, x, y, z),
            found[at - 1],
        ][int(rng.integers(5))]
    for at in rng.integers(0, number, 5):
        del found[at : at + int(rng.integers(1, 20))]
    return found


@pytest.mark.parametrize("seed", range(20))
def test_a_block_is_judged_as_its_samples_are_one_by_one(seed: int) -> None:
    rng, told = np.random.default_rng(100 + seed), spoilt(3000, seed)
    each, together = watching(), watching()
    taken = 0
    while told:
        size = int(rng.integers(1, 30))
        block, told = told[:size], told[size:]
        judged = [each.judge(sample) for sample in block]
        whole = [sample for verdict in judged for _, sample in verdict.kept] == block
        counts, forces = np.array([s[0] for s in block]), np.array([s[1:] for s in block])
        found = together.judge_all(counts, forces, (0.1, -0.2, 0.3))
        if found is None:
            assert [together.judge(sample) for sample in block] == judged
            continue
        taken += 1
        assert whole and judged[-1].fault is None
        assert found[0] == judged[-1].newest
        assert found[1] == pytest.approx(np.linalg.norm(forces - (0.1, -0.2, 0.3), axis=1).max())
    assert taken > 50
