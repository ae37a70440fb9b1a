"""Means of runs: whatever pieces the samples come in, never over a cut or a turn, and with less noise."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from mapping.instrument.averaging import Means, RunMeans
from mapping.instrument.noise import Noise


def taken(length: int, values: np.ndarray, cut: np.ndarray, pieces: list[int]) -> tuple[Means, RunMeans]:
    """All runs of samples that come in pieces."""
    means, found = RunMeans(length), []
    for part in np.split(np.arange(len(values)), np.cumsum(pieces)[:-1]):
        found.append(means.add(values[part], cut[part]))
    found.append(means.rest())
    whole = Means(*(np.concatenate([getattr(each, name) for each in found]) for name in ("values", "first", "count")))
    return whole, means


def serpentine(rows: int, samples: int, noise: float = 0.0) -> np.ndarray:
    """(N, 4) places of rows to and fro, side by side at the distance of their samples, and the number of the row."""
    rng = np.random.default_rng(0)
    x = np.arange(samples) * 1e-6
    lines = [
        np.column_stack([x[:: 1 - 2 * (k % 2)], np.full(samples, k * 1e-6), 0 * x, 0 * x + k]) for k in range(rows)
    ]
    table = np.concatenate(lines)
    table[:, :3] += noise * rng.standard_normal((len(table), 3))
    return table


@given(st.integers(1, 40), st.lists(st.integers(1, 60), min_size=1, max_size=20), st.data())
@settings(max_examples=60, deadline=None)
def test_every_run_is_the_mean_of_neighbours_within_a_stretch(
    length: int, pieces: list[int], data: st.DataObject
) -> None:
    number = sum(pieces)
    ends = data.draw(st.sets(st.integers(0, number - 1)))
    table = np.column_stack([np.arange(number) * 1e-6, np.zeros((number, 2)), np.arange(number) ** 2.0])
    cut = np.isin(np.arange(number), list(ends))
    found, means = taken(length, table, cut, pieces)
    whole, _ = taken(length, table, cut, [number])
    assert np.array_equal(found.values, whole.values) and np.array_equal(found.count, whole.count)
    assert found.count.sum() + means.left_out == number
    stretch = np.cumsum(cut)
    for value, first, count in zip(found.values, found.first, found.count, strict=True):
        assert value == pytest.approx(table[first : first + count].mean(axis=0), rel=1e-12)
        assert np.ptp(stretch[first : first + count]) == 0
        assert length / 2 <= count < 3 * length / 2
    # what is left out are stretches of fewer than half a run
    sizes = np.bincount(stretch)
    assert means.left_out == sizes[2 * sizes < length].sum()


@pytest.mark.parametrize("noise", [0.0, 2e-7])
@pytest.mark.parametrize("length", [10, 100, 1000])
@pytest.mark.parametrize("pieces", [[51_500], [700] * 73 + [400], [20_000, 20_000, 11_500]])
def test_no_run_goes_over_a_turn(length: int, noise: float, pieces: list[int]) -> None:
    table = serpentine(50, 1030, noise)
    found, means = taken(length, table, np.zeros(len(table), dtype=bool), pieces)
    mixed = np.abs(found.values[:, 3] - np.rint(found.values[:, 3])) * found.count
    assert mixed.max() <= (2.5 if noise else 1e-9)  # samples of another row: none; with noise a turn is a bit blurred
    assert means.left_out == 0
    if 1030 % length:
        assert means.turns == 49


def test_many_turns_within_one_run_are_all_found() -> None:
    table = serpentine(50, 103)
    found, means = taken(1030, table, np.zeros(len(table), dtype=bool), [len(table)])
    assert len(found.values) == 0 and means.left_out == len(table)


def test_noise_of_the_places_is_no_turn() -> None:
    rng = np.random.default_rng(1)
    table = np.zeros((200_000, 3))
    table[:, 0] = np.arange(len(table)) * 1e-6 + 1e-4 * rng.standard_normal(len(table))  # a hundred steps of noise
    found, means = taken(1000, table, np.zeros(len(table), dtype=bool), [len(table)])
    assert means.turns == 0 and len(found.values) == 200


def test_white_noise_falls_with_the_root_and_correlated_noise_stays() -> None:
    rng, step = np.random.default_rng(2), 1e-6
    noise = Noise(3e-6, 1e-6, 1e-3)  # correlated over ten runs
    x = np.arange(400_000) * step
    z = noise.white * rng.standard_normal(len(x))
    drift, keep = np.zeros(len(x)), np.exp(-step / noise.length)
    kicks = noise.correlated * np.sqrt(1.0 - keep**2) * rng.standard_normal(len(x))
    for k in range(1, len(x)):
        drift[k] = keep * drift[k - 1] + kicks[k]
    table = np.column_stack([x, 0 * x, z, drift])
    found, _ = taken(100, table, np.zeros(len(x), dtype=bool), [len(x)])
    assert found.values[:, 2].std() == pytest.approx(noise.white / 10.0, rel=0.05)
    assert found.values[:, 3].std() == pytest.approx(drift.std(), rel=0.05)


def test_a_run_needs_a_sample() -> None:
    with pytest.raises(ValueError, match="one sample or more"):
        RunMeans(0)
