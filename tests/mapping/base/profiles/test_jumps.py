"""A profile that steps from one level to another: its base keeps to the longest, and the others are told."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import grey_dilation

from mapping import FloatArray, Trace
from mapping.assembly import assemble
from mapping.base import fit_base
from mapping.base.profiles.jumps import possible_jumps
from mapping.detection import detect
from mapping.geometry.templates import step_height
from mapping.inference.joint import refine_all

TIP = 2e-6
X = 1e-6 * np.arange(8000)


def rough(seed: int) -> FloatArray:
    """Roughness of 50 nm over 20 um, and noise of 10 nm, on a slightly tilted line."""
    rng = np.random.default_rng(seed)
    kernel = np.exp(-0.5 * (np.arange(-100, 101) / 20.0) ** 2)
    roughness = np.convolve(rng.standard_normal(len(X)), kernel / np.linalg.norm(kernel), "same")
    return np.asarray(3e-3 * X + 50e-9 * roughness + 10e-9 * rng.standard_normal(len(X)))


@pytest.mark.parametrize("height", [2.2e-6, *(pytest.param(h, marks=pytest.mark.slow) for h in (4.1e-6, 6.3e-6))])
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_a_step_of_a_rough_profile_is_one_step_with_its_height(height: float, seed: int) -> None:
    trace = Trace.from_profile(X, rough(seed) + step_height(X - 3e-3, height, TIP) + TIP, TIP)
    base = fit_base(trace)
    assert len(base.levels) == 2 and abs(base.levels[1]) == pytest.approx(height, abs=0.3e-6)
    found = refine_all(assemble(detect(trace, base), trace, base), trace, seed, base=base)
    (step,) = [feature for feature in found if feature.evidence.likely]
    assert step.kind == "step" and abs(step.height.median) == pytest.approx(height, abs=0.06e-6)


@pytest.mark.slow
def test_stairs_have_as_many_levels() -> None:
    stairs = sum(step_height(X - place, 3e-6, TIP) for place in (2e-3, 4e-3, 6e-3))
    base = fit_base(Trace.from_profile(X, rough(2) + stairs + TIP, TIP))
    gaps = np.diff(np.sort(base.levels))
    assert len(base.levels) == 4 and gaps == pytest.approx(3e-6, abs=0.3e-6)


@pytest.mark.parametrize("height", [0.4e-3, pytest.param(-0.1e-3, marks=pytest.mark.slow)])
def test_a_step_that_the_ball_rolls_over_is_one(height: float) -> None:
    """Lower than the ball's radius: it rises over several samples, and no two of them lie on either side of it."""
    tip, x = 0.5e-3, 50e-6 * np.arange(600)
    rng = np.random.default_rng(4)
    grid = np.arange(-1e-3, 31e-3, 5e-6)
    body = np.where(grid > 12e-3, height, 0.0)
    ball = np.sqrt(tip**2 - (5e-6 * np.arange(-99, 100)) ** 2) - tip
    felt = np.interp(x, grid, grey_dilation(body, structure=ball, mode="nearest"))
    trace = Trace.from_profile(x, felt + 2e-6 * rng.standard_normal(len(x)) + tip, tip)
    base = fit_base(trace)
    assert len(base.levels) == 2
    (step,) = refine_all(assemble(detect(trace, base), trace, base), trace, 0, base=base)
    assert step.kind == "step" and abs(step.height.median) == pytest.approx(abs(height), abs=4e-6)


def test_scratches_slopes_and_waves_are_no_steps() -> None:
    for form in (
        -8e-6 * (np.abs(X - 4e-3) < 50e-6),
        -np.maximum(0.0, 8e-6 * (1.0 - np.abs(X - 4e-3) / 30e-6)),
        20e-6 * np.clip((X - 3e-3) / 1e-3, 0.0, 1.0),
        5e-6 * np.sin(X / 0.2e-3),
    ):
        assert len(fit_base(Trace.from_profile(X, rough(3) + form + TIP, TIP)).levels) == 1


def test_few_places_tell_no_step() -> None:
    assert len(possible_jumps(np.arange(20.0), np.repeat([0.0, 1.0], 10), 1e-3, 1.0)) == 0
