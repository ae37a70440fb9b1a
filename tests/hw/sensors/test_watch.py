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
    return [fault for sample in told if (fault := watch.judge(sample)[2]) is not None]


def test_an_hour_of_rounded_noise_is_no_fault() -> None:
    assert not faults(watching(), samples(noise(300_000, 2)))


def test_a_frozen_value_is_found_within_control_periods() -> None:
    watch = watching()
    assert not faults(watch, samples(noise(50, 3)))
    frozen = samples(np.tile(noise(1, 4), (60, 1)), 50)
    judged = [watch.judge(sample)[2] for sample in frozen]
    assert next(i for i, fault in enumerate(judged) if fault) <= 25, "25 ms"


def test_axes_that_a_sensor_does_not_have_are_left_alone() -> None:
    assert not faults(watching(axes=1), samples(noise(5000, 5, axes=1)))


def test_a_sensor_that_never_changes_is_refused_before_it_is_used() -> None:
    with pytest.raises(StoppedError, match="frozen"):
        SampleWatch(16).learn(np.zeros((200, 3)), 1.0, 1e-3)


def test_a_lone_spike_is_left_out_and_a_jump_that_stays_is_a_fault() -> None:
    told = noise(100, 6)
    told[50] += 3.0
    watch = watching()
    kept = [watch.judge(sample)[1] for sample in samples(told)]
    assert kept.count(False) == 1 and not kept[50]
    told[50:] += 3.0
    assert "jumped" in faults(watching(), samples(told))[0]


def test_a_force_that_rises_as_fast_as_the_stage_presses_is_no_jump() -> None:
    told = noise(100, 7)
    told[:, 2] += np.clip(0.2 * (np.arange(100) - 50), 0.0, 4.0)
    assert not faults(watching(), samples(told))


def test_an_old_sample_again_is_no_sample() -> None:
    watch = watching()
    told = samples(noise(10, 8))
    assert all(watch.judge(sample)[1] for sample in told)
    assert not any(watch.judge(told[-1])[1] for _ in range(5))
    assert not watch.judge(told[3])[1]


def test_a_garbled_count_costs_one_sample_and_a_pause_one_more() -> None:
    told = samples(noise(200, 9))
    told[50] = (told[50][0] + 512, *told[50][1:])
    told[150:] = [((count + 3000) % 2**16, *force) for count, *force in told[150:]]
    watch = watching()
    judged = [watch.judge(sample) for sample in told]
    assert [i for i, (_, sound, _) in enumerate(judged) if not sound] == [50, 150]
    assert not any(fault for _, _, fault in judged)
    assert judged[-1][0] == 3199


def test_what_goes_on_jumping_is_a_fault() -> None:
    told = noise(100, 6)
    told[50:53, 2] += (3.0, -4.0, 5.0)
    assert "jumped" in faults(watching(), samples(told))[0]


def test_no_number_and_overload_are_faults() -> None:
    assert "no number" in faults(watching(), [(0, 0.0, 0.0, float("nan"))])[0]
    assert "overloaded" in faults(watching(), [(0, 0.0, 0.0, float("inf"))])[0]


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
        counts, forces = np.array([s[0] for s in block]), np.array([s[1:] for s in block])
        found = together.judge_all(counts, forces, (0.1, -0.2, 0.3))
        if found is None:
            assert [together.judge(sample) for sample in block] == judged
            continue
        taken += 1
        assert all(sound and fault is None for _, sound, fault in judged)
        assert found[0] == judged[-1][0]
        assert found[1] == pytest.approx(np.linalg.norm(forces - (0.1, -0.2, 0.3), axis=1).max())
    assert taken > 50
