"""Terraces: a plate that stands on several levels is a plate, whatever share of it stands higher."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from explore3d.bench.scenes import FIRST_BUILT_WITH, section_trace
from mapping import FloatArray, Trace
from mapping.base import Base, fit_base
from mapping.base.quadrics import Cloud, Fitted
from mapping.base.terraces import terraced_plane
from mapping.geometry.templates import step_height

TIP, NOISE = 1e-3, 5e-6
EDGE = 3.3e-3


def raster(height: Callable[[FloatArray, FloatArray], FloatArray], seed: int = 0) -> Trace:
    """Twelve lines of 60 mm, 3 mm apart, over a tilted plate."""
    rng = np.random.default_rng(seed)
    x, lines = np.arange(-0.03, 0.03, 1e-4), np.arange(12)
    u, v = (grid.ravel() for grid in np.meshgrid(x, 3e-3 * lines, indexing="xy"))
    z = TIP + 0.01 * u - 0.02 * v + height(u, v) + rng.normal(0.0, NOISE, len(u))
    return Trace(np.arange(len(u)) * 1e-3, np.column_stack([u, v, z]), np.repeat(lines, len(x)), TIP)


def levels(base: Base) -> list[float]:
    found = base.parameters.get("levels", [0.0])
    assert isinstance(found, list)
    return sorted(float(value) for value in found if isinstance(value, float))


@pytest.mark.parametrize(
    "height", [0.05e-3, 4e-3, 12e-3, *(pytest.param(height, marks=pytest.mark.slow) for height in (0.3e-3, 2e-3))]
)
def test_a_plate_with_a_step_is_a_plane_on_two_levels(height: float) -> None:
    base = fit_base(raster(lambda u, v: step_height(u - EDGE, height, TIP)))
    assert base.kind == "plane"
    # along the plate's normal
    assert levels(base) == pytest.approx([0.0, height / np.sqrt(1.0 + 0.01**2 + 0.02**2)], abs=0.2 * NOISE)
    # the plane is the level with more of the path, to the noise of all of it
    low = np.column_stack([np.linspace(-0.03, 0.0, 7), np.full(7, 0.01), np.zeros(7)])
    low[:, 2] = TIP + 0.01 * low[:, 0] - 0.02 * low[:, 1]
    assert np.abs(base.foot(low, TIP).height).max() < 0.5 * NOISE
    # half of the sweeps foretell the others: what the plane does not explain is a feature
    assert base.known and base.missed == pytest.approx(NOISE, rel=0.5)


def test_a_staircase_stands_on_as_many_levels_as_it_has() -> None:
    places = (-15e-3, -2e-3, 17e-3)
    base = fit_base(raster(lambda u, v: sum(step_height(u - place, 0.2e-3, TIP) for place in places)))
    assert base.kind == "plane"
    assert np.diff(levels(base)) == pytest.approx([0.2e-3] * 3, abs=0.2 * NOISE)


def test_a_curved_body_keeps_its_curvature_beside_a_step() -> None:
    base = fit_base(raster(lambda u, v: 0.5 * u**2 + step_height(u - 7e-3, 0.2e-3, TIP)))
    assert base.kind == "quadric"
    assert levels(base) == pytest.approx([0.0, 0.2e-3], abs=0.4 * NOISE)


@pytest.mark.slow
def test_a_disc_with_a_rim_is_a_plane_on_two_levels() -> None:
    """A quarter of the path lies on the rim and on flanks: even from cell to cell, it made the noise seem so, too, and
    an extrusion, which explained less, took less to pay for."""
    rng = np.random.default_rng(1)
    x, lines = np.arange(-15e-3, 15e-3, 60e-6), np.arange(61)
    u, v = (grid.ravel() for grid in np.meshgrid(x, -15e-3 + 0.5e-3 * lines))
    away = np.hypot(u, v)
    rim = 1e-3 + step_height(away - 11e-3, 0.1e-3, TIP)
    z = TIP + np.where(away > 11.5e-3, step_height(12e-3 - away, 1.1e-3, TIP), rim)
    centers = np.column_stack([u, v, z]) + rng.normal(0.0, 2e-6, (len(u), 3))
    base = fit_base(Trace(np.arange(len(u)) * 4e-3, centers, np.repeat(lines, len(x)), TIP))
    assert base.kind == "plane"
    assert levels(base) == pytest.approx([0.0, 1e-3], abs=1e-6)


def test_what_goes_up_and_down_smoothly_has_no_levels() -> None:
    base = fit_base(raster(lambda u, v: 0.3e-3 * np.sin(u / 9e-3)))
    assert base.kind == "sheet" and levels(base) == [0.0]
    assert not base.known  # a sheet follows what it is fitted to


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2, 3))])
def test_a_bare_plate_has_one_level(seed: int) -> None:
    base = fit_base(raster(lambda u, v: 0.0 * u, seed))
    assert base.kind == "plane" and levels(base) == [0.0]


def test_a_plate_whose_noise_wanders_is_not_foretold() -> None:
    rng = np.random.default_rng(5)
    walk = np.cumsum(rng.normal(0.0, 2e-6, 12 * 600))
    base = fit_base(raster(lambda u, v: walk))
    assert not base.known


def test_two_crests_side_by_side_are_no_level() -> None:
    """Between them the ball comes down by a third: the trace stays for long at about one height, and passes through."""
    base = fit_base(section_trace("crack with burrs", "10um", FIRST_BUILT_WITH + 2))
    assert base.kind == "plane" and levels(base) == [0.0]


def test_rows_on_levels_that_no_sweep_climbs_may_be_those_of_any_body() -> None:
    def fitted(height: Callable[[FloatArray, FloatArray], FloatArray]) -> Fitted:
        found = terraced_plane(Cloud.of(raster(height), 2000))
        assert found is not None
        return found

    assert fitted(lambda u, v: step_height(u - EDGE, 0.3e-3, TIP)).explains
    # lines along waves stand where these are level, each for itself
    assert not fitted(lambda u, v: 2e-3 * np.round(np.sin(v / 5e-3))).explains


def test_a_sawtooth_stands_on_as_many_levels_as_it_has_teeth() -> None:
    """Cells an eighth of the extent apart are nearly a tooth apart, too: the slope between them is none of the plate's,
    and all of it seemed one level that scatters widely. A body that bends over the teeth stood for it."""

    def teeth(u: FloatArray, v: FloatArray) -> FloatArray:
        return 0.025 * u - sum(step_height(u - place, 0.1e-3, TIP) for place in np.arange(-25e-3, 30e-3, 8.5e-3))

    cloud = Cloud.of(raster(teeth), 4000)
    found = terraced_plane(cloud)
    assert found is not None and len(np.atleast_1d(found.parameters["levels"])) == 8
    assert np.median(np.abs(found.residual)) < 2.0 * cloud.scale
