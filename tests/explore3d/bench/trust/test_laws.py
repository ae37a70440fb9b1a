"""Laws of error: each is what its sentence says."""

from __future__ import annotations

import numpy as np
import pytest

from explore3d.bench.trust.laws import LAWS, Level, Path

LEVEL = Level(20e-6, 1e-3)


@pytest.fixture(scope="module")
def path() -> Path:
    along = np.arange(0.0, 0.2, 50e-6)
    centers = np.concatenate([np.column_stack([along, np.full(len(along), y), 0.0 * along]) for y in range(6)])
    normals = np.tile([0.0, 0.0, 1.0], (len(centers), 1))
    return Path(centers, normals, np.repeat(np.arange(6), len(along)), 50e-6, 5e-3)


def heights(path: Path, law: str, seed: int = 1) -> np.ndarray:
    return LAWS[law].record(path, LEVEL, np.random.default_rng(seed))[1][:, 2]


@pytest.mark.parametrize("law", LAWS)
def test_a_law_records_samples_of_the_path_in_order_and_again_the_same(path: Path, law: str):
    index, centers = LAWS[law].record(path, LEVEL, np.random.default_rng(1))
    assert len(index) == len(centers) and np.isfinite(centers).all()
    assert (np.diff(index) >= 0).all() and index[0] >= 0 and index[-1] < len(path.sweep)
    # beside its normal an error is at most the play or half the step of a machine axis
    assert np.abs(centers[:, :2] - path.centers[index][:, :2]).max() <= 0.5 * LEVEL.sd * (1 + 1e-9)
    assert np.array_equal(LAWS[law].record(path, LEVEL, np.random.default_rng(1))[1], centers)
    assert not np.array_equal(LAWS[law].record(path, LEVEL, np.random.default_rng(2))[1], centers)


@pytest.mark.parametrize("law, exponent", [("white", 0.0), ("1/f^0.5", 0.5), ("1/f", 1.0), ("1/f^1.5", 1.5)])
def test_the_power_falls_as_the_law_says(path: Path, law: str, exponent: float):
    power = np.abs(np.fft.rfft(heights(path, law))[1:]) ** 2
    frequency = np.arange(1.0, len(power) + 1)
    octaves = [(2**k, 2 ** (k + 1)) for k in range(3, 13)]
    means = [np.log(power[a:b].mean()) for a, b in octaves]
    slope = np.polyfit([np.log(frequency[a:b].mean()) for a, b in octaves], means, 1)[0]
    assert slope == pytest.approx(-exponent, abs=0.15)


def test_levels_differ_by_sweep_and_along(path: Path):
    own = np.array([heights(path, "level by sweep")[part].std() for part in path.parts])
    assert own.max() > 1.5 * own.min()
    along = heights(path, "level along").reshape(-1, 200).std(axis=1)
    assert 3.0 < along.max() / along.min() < 6.0


def test_play_holds_an_axis_until_it_is_pulled(path: Path):
    hill = Path(
        path.centers + np.abs(path.centers[:, :1] - 0.1) * [0.0, 0.0, -1.0],
        path.normals,
        path.sweep,
        path.spacing,
        path.tip_radius,
    )
    index, played = LAWS["backlash"].record(hill, LEVEL, np.random.default_rng(1))
    white = LEVEL.sd * np.random.default_rng(1).standard_normal(len(index))
    behind = (played[:, 2] - white - hill.centers[:, 2])[hill.parts[0]]
    assert behind[100] == pytest.approx(-0.5 * LEVEL.sd) and behind[-100] == pytest.approx(0.5 * LEVEL.sd)


def test_gaps_and_rates_leave_samples_out(path: Path):
    gaps = LAWS["gaps"].record(path, LEVEL, np.random.default_rng(1))[0]
    longest = np.diff(gaps).max() * path.spacing
    assert 0.5 * path.tip_radius < longest < 6.0 * path.tip_radius
    rates = LAWS["rates"].record(path, LEVEL, np.random.default_rng(1))[0]
    counts = np.bincount(path.sweep[rates])
    assert (counts[::2] == 5 * counts[1::2]).all()


def test_speed_and_chance_leave_samples_unevenly_apart(path: Path):
    index = LAWS["speed"].record(path, LEVEL, np.random.default_rng(1))[0]
    steps = np.diff(index[path.sweep[index] == path.sweep[0]])
    ends, middle = np.append(steps[:10], steps[-10:]), steps[len(steps) // 2 - 5 : len(steps) // 2 + 5]
    assert ends.mean() == pytest.approx(1.0, abs=0.1) and middle.mean() == pytest.approx(4.0, abs=0.4)
    index = LAWS["by chance"].record(path, LEVEL, np.random.default_rng(1))[0]
    steps = np.diff(index[path.sweep[index] == path.sweep[0]])
    assert steps.mean() == pytest.approx(3.0, rel=0.2) and steps.std() == pytest.approx(6.0**0.5, rel=0.3)
