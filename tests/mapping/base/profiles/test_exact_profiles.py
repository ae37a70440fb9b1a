"""Steps and climbs of profiles without any noise, or with hardly any beside their height."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import Feature, FloatArray, Trace
from mapping.assembly import assemble
from mapping.base import Base, LaidTrace, fit_base
from mapping.detection import detect
from mapping.geometry.templates import step_height
from mapping.inference.joint import refine_all

X = 20e-6 * np.arange(2000)


def profile(tip: float, *steps: tuple[float, float, float], noise: float = 0.0) -> Trace:
    """Steps at places, of heights, over runs, m."""
    felt = sum((step_height(X - place, height, tip, run) for place, height, run in steps), np.zeros(len(X)))
    return Trace.from_profile(X, felt + noise * np.random.default_rng(0).standard_normal(len(X)) + tip, tip)


def found(trace: Trace) -> tuple[tuple[Feature, ...], Base]:
    base = fit_base(trace)
    laid = LaidTrace.of(trace, base)
    return assemble(detect(laid, base), laid, base), base


def heights(features: tuple[Feature, ...]) -> FloatArray:
    return np.array([abs(feature.height.median) for feature in features])


@pytest.mark.parametrize("tip", [0.5e-3, pytest.param(2e-3, marks=pytest.mark.slow)])
@pytest.mark.parametrize("noise", [0.0, pytest.param(1e-8, marks=pytest.mark.slow), 1e-6])
def test_of_a_step_far_higher_than_the_noise_the_levels_are_as_far_apart_as_they_are(tip: float, noise: float) -> None:
    """The frame leans by a twentieth: what is upright in it is 5 um more than the step is high."""
    features, base = found(profile(tip, (17.3e-3, 2e-3, 0.0), noise=noise))
    assert abs(base.levels[1]) == pytest.approx(2e-3, abs=1e-9 + 0.2 * noise)
    assert [feature.kind for feature in features] == ["step"]
    assert heights(features) == pytest.approx([2e-3], rel=1e-3)


@pytest.mark.parametrize("tip", [0.5e-3, pytest.param(2e-3, marks=pytest.mark.slow)])
def test_exact_stairs_are_as_many_steps(tip: float) -> None:
    features, base = found(profile(tip, (12e-3, 0.3e-3, 0.0), (25e-3, 0.2e-3, 0.0)))
    assert len(base.levels) == 3 and [feature.kind for feature in features] == ["step", "step"]
    assert heights(features) == pytest.approx([0.3e-3, 0.2e-3], rel=1e-3)


@pytest.mark.parametrize("tip", [0.5e-3, pytest.param(2e-3, marks=pytest.mark.slow)])
def test_an_exact_climb_is_one(tip: float) -> None:
    (step,), base = found(profile(tip, (18e-3, 0.3e-3, 1.5e-3)))
    assert step.kind == "step" and step.details.run == pytest.approx(1.5e-3, rel=1e-3)
    assert len(base.levels) == 2


@pytest.mark.slow
def test_the_place_of_an_exact_step_is_told_and_no_run() -> None:
    """A mean of two samples beside a kink lies off it by more than such a step leaves."""
    trace = profile(2e-3, (17.05e-3, 0.3e-3, 0.0))
    features, base = found(trace)
    (step,) = refine_all(features, trace, 0, base=base)
    assert step.width.high == 0.0 and step.height.median == pytest.approx(0.3e-3, abs=1e-8)
