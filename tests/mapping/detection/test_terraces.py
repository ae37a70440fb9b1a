"""Terraces: edges between levels are found where they are, and what is fine on a terrace is found on it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mapping import FloatArray, Surface, Trace
from mapping.assembly import assemble
from mapping.base import Base, LaidTrace, fit_base
from mapping.detection import Detections, detect, terraced
from mapping.detection.terraces import _runs
from mapping.geometry.templates import cap_height, groove_height, step_height
from mapping.inference.joint import refine_all

TIP, NOISE, LINES = 1e-3, 5e-6, 12


def raster(height: Callable[[FloatArray], FloatArray], seed: int = 0, spacing: float = 5e-5) -> Trace:
    """Lines to and fro across what lies along y."""
    rng = np.random.default_rng(seed)
    x = np.arange(-30e-3, 30e-3, spacing)
    ways = [x if k % 2 == 0 else x[::-1] for k in range(LINES)]
    u, v = np.concatenate(ways), np.repeat(3e-3 * np.arange(LINES), len(x))
    z = TIP + height(u) + rng.normal(0.0, NOISE, len(u))
    return Trace(np.arange(len(u)) * 1e-3, np.column_stack([u, v, z]), np.repeat(np.arange(LINES), len(x)), TIP)


def found(height: Callable[[FloatArray], FloatArray], seed: int = 0) -> Detections:
    """What a raster shows, over the base that is fitted to it."""
    trace = raster(height, seed)
    return detect(trace, fit_base(trace))


def places(detections: Detections, *kinds: str) -> list[list[float]]:
    """Of each line, where (m) crossings of the kinds stand, ascending."""
    of = [[c for c in detections.crossings if c.sweep == k and c.kind in kinds] for k in range(LINES)]
    return [sorted(float(c.point[0]) for c in own) for own in of]


@pytest.mark.parametrize("height", [*(pytest.param(mm * 1e-3, marks=pytest.mark.slow) for mm in (0.05, 0.3)), 2e-3])
def test_every_line_crosses_the_step_and_nothing_else(height: float) -> None:
    detections = found(lambda x: step_height(x - 3.3e-3, height, TIP))
    assert len(detections.crossings) == LINES
    # by the middle of its arc, as wide as the ball makes it
    arc = min(np.sqrt(2 * TIP * height), TIP)
    for (place,) in places(detections, "step up", "step down"):
        assert 3.3e-3 - arc < place < 3.3e-3 + 0.2e-3
    for crossing in detections.crossings:
        assert crossing.kind == ("step up" if crossing.sweep % 2 == 0 else "step down")
        assert crossing.height == pytest.approx(height, rel=0.02)


def test_a_line_that_begins_and_ends_soon_beyond_a_block_crosses_its_edges() -> None:
    """Two radii of the table at either end were too short for a level: hollows at the lines' ends, and no edges."""
    detections = found(lambda x: step_height(28e-3 - abs(x), 0.3e-3, TIP))
    for line in places(detections, "step up", "step down"):
        assert line == pytest.approx([-28e-3, 28e-3], abs=0.2e-3)
    assert len(detections.crossings) == 2 * LINES


@pytest.mark.slow
def test_each_edge_of_a_staircase_is_crossed() -> None:
    stairs = (-15e-3, -2e-3, 17e-3)
    detections = found(lambda x: sum(step_height(x - place, 0.2e-3, TIP) for place in stairs))
    for line in places(detections, "step up", "step down"):
        assert line == pytest.approx(stairs, abs=0.7e-3)


def test_a_ridge_and_grooves_on_either_level_are_found_beside_the_edge() -> None:
    def height(x: FloatArray) -> FloatArray:
        ridge = cap_height(x - 15e-3, 0.1e-3, 0.05e-3, TIP)
        return step_height(x, 0.2e-3, TIP) + ridge + groove_height(x + 14e-3, 0.5e-3, TIP)

    detections = found(height)
    assert all(line == pytest.approx([15e-3], abs=0.05e-3) for line in places(detections, "convex"))
    assert all(line == pytest.approx([-14e-3], abs=0.05e-3) for line in places(detections, "concave"))
    assert all(len(line) == 1 for line in places(detections, "step up", "step down"))
    assert len(detections.crossings) == 3 * LINES


def test_a_bead_upon_an_edge_is_a_ridge_over_the_upper_level() -> None:
    def height(x: FloatArray) -> FloatArray:
        return np.maximum(step_height(x, 0.2e-3, TIP), 0.7e-3 - x**2 / (2.0 * (2e-3 + TIP)))

    trace = raster(height)
    base = fit_base(trace)
    features = {feature.kind: feature for feature in assemble(detect(trace, base), trace, base)}
    assert sorted(features) == ["ridge", "step"]
    assert features["ridge"].height.median == pytest.approx(0.5e-3, rel=0.05)
    assert features["step"].height.median == pytest.approx(0.2e-3, rel=0.05)


@pytest.mark.slow
def test_a_gap_between_panels_out_of_line_is_a_groove_and_a_step() -> None:
    def height(x: FloatArray) -> FloatArray:
        low, high = (step_height(side * x - 0.6e-3, TIP, TIP) - TIP for side in (-1.0, 1.0))
        return np.maximum(low, np.where(x > -0.6e-3, high + 0.1e-3, -TIP))

    trace = raster(height)
    base = fit_base(trace)
    features = {feature.kind: feature for feature in assemble(detect(trace, base), trace, base)}
    assert sorted(features) == ["groove", "step"]
    assert features["step"].height.median == pytest.approx(0.1e-3, rel=0.05)
    refined = {each.kind: each for each in refine_all([*features.values()], trace, 0, base=base, confirm=None)}
    for kind, true in (("step", 0.1e-3), ("groove", 1.2e-3)):
        size = refined[kind].height if kind == "step" else refined[kind].width
        assert size.low < true < size.high and size.high - size.low < 0.7 * true


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_a_plateau_too_narrow_for_a_terrace_has_two_edges_however_it_is_noisy(seed: int) -> None:
    detections = found(
        lambda x: np.minimum(step_height(x + 2e-3, 0.3e-3, TIP), step_height(2e-3 - x, 0.3e-3, TIP)), seed
    )
    for line in places(detections, "step up", "step down"):
        assert line == pytest.approx([-2.3e-3, 2.3e-3], abs=0.4e-3)
    assert len(detections.crossings) == 2 * LINES


@pytest.mark.parametrize("spacing", [0.3, pytest.param(0.5, marks=pytest.mark.slow), 0.9])
def test_a_step_of_a_coarse_raster_is_one_step(spacing: float) -> None:
    trace = raster(lambda x: step_height(x - 3.3e-3, 0.6e-3, TIP), spacing=spacing * TIP)
    base = fit_base(trace)
    detections = detect(trace, base)
    assert len(detections.crossings) == LINES
    (step,) = assemble(detections, trace, base)
    assert step.kind == "step"
    assert step.height.median == pytest.approx(0.6e-3, rel=0.05)


@pytest.mark.parametrize("spacing", [2.0, 5.0])
def test_bins_too_coarse_for_a_level_leave_the_profile_as_it_is(spacing: float) -> None:
    trace = raster(lambda x: step_height(x - 3.3e-3, 0.6e-3, TIP), spacing=spacing * TIP)
    base = fit_base(trace)
    assert len(base.levels) == 2
    (profile,) = next(iter(LaidTrace.of(trace, base).laid_sweeps)).heights(spacing * TIP)
    as_it_is = terraced(profile, base, TIP)
    assert as_it_is.profile is profile and not as_it_is.edges
    detect(trace, base)


def test_the_terrace_behind_stands_in_however_short_it_is() -> None:
    """The way to it is longer: it is mirrored again and again, heights that repeat one value would have no noise."""
    ramp = (21.6e-3, 25.5e-3)
    trace = raster(lambda x: 0.6e-3 * np.interp(x, ramp, (0.0, 1.0)), spacing=0.2 * TIP)
    plate = Surface(0.1 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), [[0, 1, 2], [0, 2, 3]])
    base = Base(plate, "plane", {"levels": [0.0, 0.6e-3]})
    (profile,) = next(iter(LaidTrace.of(trace, base).laid_sweeps)).heights(0.2 * TIP)
    over = terraced(profile, base, TIP)
    assert over.level is not None and len(over.edges) == 1
    way = np.isnan(over.level)
    assert way.sum() > len(way) - np.flatnonzero(way)[-1] - 1
    assert len(np.unique(over.profile.height[way])) > 0.5 * way.sum()
    assert np.abs(over.profile.height).max() < 10 * NOISE


@pytest.mark.slow
def test_a_slot_too_narrow_for_a_terrace_has_its_edges_at_its_rims() -> None:
    # the trace falls from the rim on, by an arc that ends, steep, on the floor: an edge of the body is its upper end
    detections = found(
        lambda x: np.maximum(step_height(x - 2.5e-3, 0.5e-3, TIP), step_height(-2.5e-3 - x, 0.5e-3, TIP)) - 0.5e-3
    )
    for line in places(detections, "step up", "step down"):
        assert line == pytest.approx([-2.5e-3, 2.5e-3], abs=0.45e-3)
    assert len(detections.crossings) == 2 * LINES


@pytest.mark.parametrize("second", [pytest.param(0.2e-3, marks=pytest.mark.slow), -0.12e-3])
def test_a_short_terrace_between_two_others_is_a_stair_and_its_edges_are_two_steps(second: float) -> None:
    """Three radii wide: as a detail of one level it would have to lie on the same level on both sides."""

    def height(x: FloatArray) -> FloatArray:
        top = 0.2e-3 + second
        if second > 0.0:
            return np.maximum(step_height(x, 0.2e-3, TIP), step_height(x - 3e-3, top, TIP))
        bar = np.minimum(step_height(x, 0.2e-3, TIP), step_height(3e-3 - x, 0.2e-3, TIP))
        return np.maximum(bar, step_height(x, top, TIP))

    trace = raster(height)
    base = fit_base(trace)
    detections = detect(trace, base)
    assert all(line == pytest.approx([0.0, 3e-3], abs=0.7e-3) for line in places(detections, "step up", "step down"))
    steps = sorted(assemble(detections, trace, base, proposals=()), key=lambda step: float(step.axis[:, 0].mean()))
    assert [step.kind for step in steps] == ["step", "step"]
    assert [step.height.median for step in steps] == pytest.approx([0.2e-3, abs(second)], rel=0.03)
    assert all(np.ptp(step.axis[:, 0]) < 0.5e-3 for step in steps)


@pytest.mark.parametrize(("levels", "told"), [((0, 1, 2, 3), 4), ((2, 1, 0), 3), ((0, 1, 0, 1), 0), ((0, 1, 2, 1), 0)])
def test_stairs_that_lead_on_are_levels_however_short(levels: tuple[int, ...], told: int) -> None:
    """The teeth of a saw are all shorter than a detail may be: a sweep that went on from each was taken as it was."""
    level = np.repeat(levels, 10)
    assert len(_runs(level, np.ones(len(level), dtype=bool), 20.0, 4)) == told
