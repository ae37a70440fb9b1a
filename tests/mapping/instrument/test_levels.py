"""Levels of the noise along a recording, and who weighs by them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mapping import Surface, Trace
from mapping.assembly.linking import Inspections
from mapping.base import Base
from mapping.detection import detect
from mapping.inference.likelihood import Nuisance, bin_samples, build_likelihood, gather
from mapping.instrument import Levels, Noise

TIP, SD = 5e-3, 20e-6


def swept(seed: int, factor: float) -> tuple[Trace, Base]:
    """Ten sweeps of white noise, every other one so many times as loud."""
    rng = np.random.default_rng((182, seed))
    x, sweep = np.tile(np.arange(0.0, 0.1, 50e-6), 10), np.repeat(np.arange(10), 2000)
    z = TIP + SD * np.where(sweep % 2 == 1, factor, 1.0) * rng.standard_normal(len(x))
    corners = 0.2 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    base = Base(Surface(corners, np.array([[0, 1, 2], [0, 2, 3]])))
    return Trace(1e-3 * np.arange(len(x)), np.column_stack([x, 3e-3 * sweep, z]), sweep, TIP), base


def test_levels_are_those_of_sweep_and_time_and_one_where_nothing_is_known() -> None:
    levels = Levels.of([(1, np.array([0.0, 1.0]), np.array([1.0, 2.0])), (1, np.array([2.0]), np.array([3.0]))])
    assert levels is not None
    assert levels.at(np.array([1, 1, 7]), np.array([0.5, 9.0, 0.5])) == pytest.approx([1.5, 3.0, 1.0])
    assert levels.beside(0.5).at(np.array([1]), np.array([1.0])) == pytest.approx(np.sqrt(0.5 * 4.0 + 0.5))
    assert Levels.of([(1, np.zeros(1), np.full(1, 0.7)), (2, np.zeros(1), np.full(1, 0.7))]) is None
    assert Levels.of([]) is None


def test_the_law_of_a_noise_is_the_same_at_any_levels() -> None:
    levels = Levels.of([(1, np.array([0.0, 1.0]), np.array([1.0, 2.0]))])
    noise = Noise(1e-6, 2e-6, 1e-3, levels=levels)
    assert noise == Noise(1e-6, 2e-6, 1e-3) and hash(noise) == hash(Noise(1e-6, 2e-6, 1e-3))
    assert noise.scaled(2.0).levels is levels
    rounded = noise.rounded(1e-5).levels
    assert rounded is not None and rounded.at(np.array([1]), np.array([1.0]))[0] < 2.0


def test_what_is_louder_is_known_to_be_and_weighs_less() -> None:
    trace, base = swept(0, 3.0)
    found = detect(trace, base)
    assert found.noise.levels is not None and found.doubt > 1.0
    places = Inspections.of(trace, base, found.noise, [1e-3]).at(1e-3)
    loud = places.sweep % 2 == 1
    over = places.height / places.sd
    assert np.std(over[loud]) == pytest.approx(1.0, abs=0.15) and np.std(over[~loud]) == pytest.approx(1.0, abs=0.15)
    assert detect(swept(0, 1.0)[0], base).noise.levels is None


def test_a_likelihood_takes_each_bin_at_its_level() -> None:
    trace, base = swept(1, 3.0)
    noise = detect(trace, base).noise
    crest = np.column_stack([np.full(10, 0.05), 3e-3 * np.arange(10), np.full(10, TIP)])
    samples = gather(trace, base, crest, np.tile([0.0, 0.0, 1.0], (10, 1)), 8e-3)
    window = bin_samples(samples, 2e-4, noise.sd, 0.0, noise.levels)
    vague = Nuisance(1e-3, 1e-3)
    white = build_likelihood(window, noise, vague, 1e-9).residuals(np.zeros((1, len(window))))[0]
    plain = build_likelihood(replace(window, level=1.0), noise, vague, 1e-9).residuals(np.zeros((1, len(window))))[0]
    loud = window.run % 2 == 1
    for of, right in ((white, True), (plain, False)):
        assert bool(abs(np.log(of[loud].std() / of[~loud].std())) < 0.2) is right
