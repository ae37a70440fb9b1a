"""Bumps whose flank runs out, or with a flat top: each is found for what it is, and what is not known is said."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mapping import FloatArray
from mapping.assembly import assemble
from mapping.base import Base, fit_base
from mapping.detection import detect
from mapping.feature import Feature, Interval, Support
from mapping.geometry.templates import cap_height
from mapping.inference.feature_posterior import refine
from mapping.inference.joint import refine_all
from mapping.inference.kinds import feature_trace
from mapping.instrument import Noise
from mapping.surface import Surface
from mapping.trace import Trace

TIP, HIGH, WIDE = 3e-3, 0.5e-3, 2e-3
NOISE = Noise(0.02e-3)
CORNERS = np.array([[-0.1, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.1, 0], [-0.1, 0.1, 0.0]])
PLATE = Base(Surface(CORNERS, [[0, 1, 2], [0, 2, 3]]))
UP = np.array([0.0, 0.0, 1.0])
SECTIONS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "cosine": lambda u: np.where(np.abs(u) < WIDE, 0.5 * HIGH * (1.0 + np.cos(np.pi * u / WIDE)), 0.0),
    "gaussian": lambda u: HIGH * 0.5 ** ((2.0 * u / WIDE) ** 2),
}


def rolled(section: Callable[[FloatArray], FloatArray], away: FloatArray) -> FloatArray:
    """Heights (N,) of the ball at distances from the axis, by trying all of the section."""
    u = np.linspace(-11e-3, 11e-3, 44_001)
    grid, z = np.linspace(0.0, 8.5e-3, 851), section(u)
    rest = [(z[m] + np.sqrt(TIP**2 - (u[m] - x) ** 2) - TIP).max() for x in grid for m in (np.abs(u - x) < TIP,)]
    return np.interp(away, grid, rest, right=0.0)


def found_in(heights: Callable[[FloatArray], FloatArray], high: float, wide: float) -> tuple[Feature, Trace]:
    """A bump a tenth of a millimetre from where it was detected, refined."""
    y, at = np.linspace(-8e-3, 8e-3, 1600), np.linspace(-3e-3, 3e-3, 13)
    feet = np.column_stack([np.repeat(at, len(y)), np.tile(y, len(at)), np.zeros(len(at) * len(y))])
    felt = heights(np.hypot(feet[:, 0] - 0.1e-3, feet[:, 1]))
    felt += NOISE.white * np.random.default_rng(3).standard_normal(len(feet))
    sweep = np.repeat(np.arange(len(at)), len(y))
    trace = Trace(1e-3 * np.arange(len(feet), dtype=np.float64), feet + np.outer(TIP + felt, UP), sweep, TIP)
    sizes = Interval.normal(high, 0.1 * high), Interval(wide, 0.8 * wide, 1.2 * wide), Interval(0.0, 0.0, 0.0)
    guess = Feature("bump", np.zeros((1, 3)), UP[None], *sizes, Support(200.0, 9), True, 0.05e-3)
    return refine(guess, trace, np.random.default_rng(0), base=PLATE, noise=NOISE), trace


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name == "gaussian")) for name in SECTIONS]
)
def test_a_bump_without_an_edge_has_its_height_and_its_width_at_half_height(name: str) -> None:
    found, trace = found_in(lambda away: rolled(SECTIONS[name], away), HIGH, 2.0 * WIDE)
    assert found.details.misfit is None and found.details.exponent is not None
    assert found.details.exponent < -1.54 if name == "cosine" else abs(1.0 / found.details.exponent) < 0.1
    assert found.height.low - 2e-6 < HIGH < found.height.high + 2e-6 and found.height.high - found.height.low < 10e-6
    assert found.width.low < WIDE < found.width.high and found.width.high - found.width.low < 0.1e-3
    assert "its flank runs out into the base: width at half height" in found.notes
    feet = trace.centers - TIP * UP
    away = np.linalg.norm(feet[:, :2] - found.axis[0, :2], axis=1)
    traced = feature_trace(found, feet * [1.0, 1.0, 0.0], np.tile(UP, (len(feet), 1)), TIP)
    np.testing.assert_allclose(traced, rolled(SECTIONS[name], away), atol=0.02 * HIGH)


def test_where_the_ball_touches_the_top_only_cap_and_bell_stay_likely_and_that_is_said() -> None:
    high, radius = 0.3e-3, 0.6e-3
    found, _ = found_in(lambda away: cap_height(away, high, radius, TIP), high, high)
    (said,) = [note for note in found.notes if "sections that leave this trace" in note]
    assert "round" in said and "bell" in said
    assert found.height.low < high < found.height.high + 1e-6
    wide = 2.0 * np.sqrt(high * (2.0 * radius - high))
    assert found.width.low < wide < found.width.high


def test_a_ball_that_lies_on_the_base_is_taken_for_one() -> None:
    """As a wire is: of what leaves one trace the plainest counts on its own."""
    high = 0.3e-3
    found, _ = found_in(lambda away: cap_height(away, high, 0.5 * high, TIP), high, high)
    assert found.details.radius == pytest.approx(0.5 * high, rel=0.3) and not found.width.bounded
    assert found.height.low < high < found.height.high + 1e-6
    assert found.width.low < high < found.width.high


def test_a_cap_whose_flank_was_touched_stays_a_cap() -> None:
    """Beside it only one stays likely whose crest is flat where nothing tells, and that is said."""
    found, _ = found_in(lambda away: cap_height(away, HIGH, 3e-3, TIP), HIGH, 3.3e-3)
    assert found.details.exponent is None and found.details.radius == pytest.approx(3e-3, rel=0.1)
    assert [note.split(": ")[1].startswith("round") for note in found.notes] == [True]
    assert found.width.low < 3.32e-3 < found.width.high < 5e-3


@pytest.mark.parametrize("top", [1e-3, pytest.param(4e-3, marks=pytest.mark.slow)])
def test_of_a_disc_the_height_is_known_and_its_width_is_what_was_touched(top: float) -> None:
    def disc(away: FloatArray) -> FloatArray:
        return cap_height(np.maximum(away - 0.5 * top, 0.0), HIGH, 0.0, TIP)

    found, trace = found_in(disc, HIGH, top + 2e-3)
    assert found.details.misfit is None and found.details.top == pytest.approx(top, abs=0.1e-3)
    assert found.height.low - 2e-6 < HIGH < found.height.high + 2e-6 and found.height.high - found.height.low < 20e-6
    reach = float(np.sqrt(HIGH * (2.0 * TIP - HIGH)))
    assert found.width.bounded and found.width.low < top < found.width.low + 0.1e-3
    assert found.width.high == pytest.approx(top + 2.0 * reach, abs=0.1e-3)
    feet = (trace.centers - TIP * UP) * [1.0, 1.0, 0.0]
    traced = feature_trace(found, feet, np.tile(UP, (len(feet), 1)), TIP)
    np.testing.assert_allclose(traced, disc(np.hypot(feet[:, 0] - 0.1e-3, feet[:, 1])), atol=0.02 * HIGH)


@pytest.mark.parametrize(
    ("top", "run"),
    [(0.0, 4e-3), *(pytest.param(*each, marks=pytest.mark.slow) for each in ((2e-3, 2e-3), (0.5e-3, 3e-3)))],
)
def test_of_a_cone_and_a_frustum_whose_flanks_were_touched_the_foot_is_known(top: float, run: float) -> None:
    foot = top + 2.0 * run
    found, _ = found_in(
        lambda away: rolled(lambda u: HIGH * np.clip((0.5 * foot - np.abs(u)) / run, 0.0, 1.0), away), HIGH, 0.6 * foot
    )
    assert found.details.misfit is None and found.details.run is not None
    assert found.height.low - 2e-6 < HIGH < found.height.high + 2e-6 and found.height.high - found.height.low < 20e-6
    assert not found.width.censored and found.width.low - 5e-6 < foot < found.width.high + 5e-6


def test_a_profile_over_a_bar_is_a_bump_with_its_height() -> None:
    """A lone profile cannot tell a bar from a disc; a cap in its place was a twentieth too high."""
    x = 50e-6 * np.arange(600.0)
    felt = cap_height(np.maximum(np.abs(x - 10e-3) - 0.1e-3, 0.0), 0.4e-3, 0.0, 1e-3)
    felt += 3e-6 * np.random.default_rng(5).standard_normal(len(x))
    trace = Trace.from_profile(x, felt + 1e-3, 1e-3)
    base = fit_base(trace)
    (found,) = refine_all(assemble(detect(trace, base), trace, base), trace, 0, base=base)
    assert found.kind == "bump" and found.details.misfit is None
    assert found.height.low < 0.4e-3 < found.height.high and found.height.high - found.height.low < 6e-6
    assert found.width.low <= 0.21e-3 and found.width.high > 1e-3
