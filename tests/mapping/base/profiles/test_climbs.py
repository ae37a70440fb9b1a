"""A profile that climbs from one level to another over a run: a slanted step, or form where it is wide."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import grey_dilation

from mapping import Feature, FloatArray, Trace
from mapping.assembly import assemble
from mapping.base import Base, LaidTrace, fit_base
from mapping.detection import detect
from mapping.inference.joint import refine_all

TIP, NOISE, FINE = 0.5e-3, 1e-6, 5e-6
X, GRID = 50e-6 * np.arange(600), FINE * np.arange(-400, 6400)


def traced(body: FloatArray, seed: int = 0, tip: float = TIP) -> Trace:
    """A ball that was drawn over heights at GRID, by brute force."""
    reach = int(tip / FINE) - 1
    ball = np.sqrt(tip**2 - (FINE * np.arange(-reach, reach + 1)) ** 2) - tip
    felt = np.interp(X, GRID, grey_dilation(body, structure=ball, mode="nearest"))
    return Trace.from_profile(X, felt + NOISE * np.random.default_rng(seed).standard_normal(len(X)) + tip, tip)


def ramp(height: float, run: float, place: float = 13e-3) -> FloatArray:
    return height * np.clip((GRID - place) / run + 0.5, 0.0, 1.0)


def found(trace: Trace) -> tuple[tuple[Feature, ...], Base]:
    base = fit_base(trace)
    return refine_all(assemble(detect(trace, base), trace, base), trace, 0, base=base, confirm=None), base


@pytest.mark.parametrize(
    ("height", "run"),
    [(0.3e-3, 2e-3), (-0.1e-3, 0.8e-3), *(pytest.param(*each, marks=pytest.mark.slow) for each in ((0.4e-3, 3.5e-3),))],
)
def test_a_slanted_step_is_one_with_its_height_and_climb(height: float, run: float) -> None:
    (step,), base = found(traced(ramp(height, run)))
    assert step.kind == "step" and step.details.misfit is None and len(base.levels) == 2
    # twice the half-width of the interval: two tests in a hundred would fail by chance at the interval itself
    for size, true in ((step.height, abs(height)), (step.width, run)):
        low, high = sorted((abs(size.low), abs(size.high)))
        assert 1.5 * low - 0.5 * high < true < 1.5 * high - 0.5 * low
        assert high - low < 0.1 * true


def test_an_upright_step_has_no_climb() -> None:
    (step,), base = found(traced(np.where(GRID > 13e-3, 0.3e-3, 0.0)))
    assert not base.climbs and step.details.run is None and step.width.high == 0.0


def test_a_slope_that_is_wider_than_details_is_form() -> None:
    trace = traced(ramp(0.3e-3, 6e-3))
    told, base = found(trace)
    assert not told and len(base.levels) == 1
    (slope,) = base.parameters["slopes"]  # type: ignore[misc]
    assert slope["height"] == pytest.approx(0.3e-3, abs=3e-6)  # type: ignore[index,call-overload]
    assert slope["width"] == pytest.approx(6e-3, rel=0.01)  # type: ignore[index,call-overload]
    assert np.abs(LaidTrace.of(trace, base).feet().height).max() < 6.0 * NOISE


@pytest.mark.parametrize("depth", [-0.5e-3, 0.5e-3])
def test_what_slanted_flanks_lead_to_and_back_from_is_a_detail(depth: float) -> None:
    trapezoid = depth * np.clip((5e-3 - np.abs(GRID - 14e-3)) / 2e-3, 0.0, 1.0)
    (detail,), base = found(traced(trapezoid))
    assert detail.kind == ("bump" if depth > 0.0 else "pit") and len(base.levels) == 1
    assert detail.height.median == pytest.approx(depth, abs=5e-6) and detail.width.median == pytest.approx(
        10e-3, abs=50e-6
    )


def test_slanted_stairs_keep_their_levels() -> None:
    base = fit_base(traced(ramp(0.2e-3, 1e-3, 9e-3) + ramp(0.1e-3, 2e-3, 20e-3)))
    assert np.diff(np.sort(base.levels)) == pytest.approx(np.diff(np.sort([0.0, 0.2e-3, 0.3e-3])), abs=2e-6)
    assert [run for _, run in base.climbs] == pytest.approx([1e-3, 2e-3], rel=0.02)
