"""Few rows of a stylus on a rough and drifting surface: what they do not tell of the base, no family may make up."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from explore3d import analyze
from mapping import FloatArray, Trace
from mapping.base import Base, fit_base
from mapping.geometry.templates import step_height

STYLUS, PITCH = 2e-6, 1e-6
EDGE = 5e-3


def rows_over(height: FloatArray, rows: int, apart: float, seed: int = 5) -> Trace:
    """Rows of 10 mm with roughness of 50 nm, correlated over 20 um, and a random walk of 0.2 um to their ends."""
    rng = np.random.default_rng(seed)
    x, centers = PITCH * np.arange(len(height)), list[FloatArray]()
    for row in range(rows):
        rough = gaussian_filter1d(rng.standard_normal(len(x)), 20.0)
        noise = 1e-8 * rng.standard_normal(len(x)) + 2e-9 * np.cumsum(rng.standard_normal(len(x)))
        z = STYLUS + height + 50e-9 * rough / rough.std() + noise + 3e-3 * x
        centers.append(np.column_stack([x, np.full(len(x), apart * row), z]))
    count = rows * len(x)
    return Trace(1e-3 * np.arange(count), np.concatenate(centers), np.repeat(np.arange(rows), len(x)), STYLUS)


X = PITCH * np.arange(10000) - EDGE


def slot(width: float = 100e-6, depth: float = 12e-6) -> FloatArray:
    return step_height(np.abs(X) - 0.5 * width, depth, STYLUS) - depth


def step(height: float = 6e-6) -> FloatArray:
    return step_height(X, height, STYLUS)


def levels(base: Base) -> FloatArray:
    return np.sort(np.asarray(base.parameters.get("levels", [0.0]), dtype=np.float64))


@pytest.mark.parametrize("rows", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_two_or_three_rows_over_a_slot_are_a_plane(rows: int) -> None:
    # between them a sheet could wind as it likes, and a rod run with the rows on its two sides
    assert fit_base(rows_over(slot(), rows, 20e-6)).kind in ("plane", "quadric")


@pytest.mark.parametrize("rows", [2, *(pytest.param(rows, marks=pytest.mark.slow) for rows in (3, 8, 16))])
def test_a_step_across_rough_rows_parts_two_levels(rows: int) -> None:
    base = fit_base(rows_over(step(), rows, 30e-6))
    parted = levels(base)
    assert base.kind in ("plane", "quadric") and len(parted) == 2
    # the mean of half a row's drift is known to some 0.1 um
    assert np.diff(parted)[0] == pytest.approx(6e-6, abs=0.3e-6)


def test_a_base_goes_on_beyond_all_samples_of_long_sweeps_of_a_small_tip() -> None:
    # 30,000 samples are 4000 cells: the outermost means lie two tip radii within the ends of the path
    path = rows_over(np.zeros(10000), 3, 30e-6)
    vertices = fit_base(path).surface.vertices[:, :2]
    assert (vertices.min(axis=0) <= path.centers[:, :2].min(axis=0) - STYLUS).all()
    assert (vertices.max(axis=0) >= path.centers[:, :2].max(axis=0) + STYLUS).all()


@pytest.mark.slow
def test_rough_rows_without_a_step_have_one_level() -> None:
    for rows in (2, 3, 16):
        assert len(levels(fit_base(rows_over(np.zeros(10000), rows, 30e-6, seed=11)))) == 1


@pytest.mark.parametrize("rows", [2, pytest.param(8, marks=pytest.mark.slow)])
def test_a_slot_that_a_few_rough_rows_cross_is_found(tmp_path: Path, rows: int) -> None:
    (found,) = analyze(
        table(tmp_path / "rows.csv", rows_over(slot(), rows, 20e-6)), tip_radius=STYLUS, quick=True
    ).model
    assert found.kind == ("pit" if rows == 2 else "groove")  # two rows do not tell how long it is
    assert found.axis[:, 0].mean() == pytest.approx(EDGE, abs=2e-6)
    assert found.height.median == pytest.approx(-12e-6, abs=0.2e-6)
    assert found.width.median == pytest.approx(100e-6, abs=2e-6)


@pytest.mark.slow
def test_an_edge_between_levels_is_weighed_over_the_lower_one(tmp_path: Path) -> None:
    model = analyze(table(tmp_path / "rows.csv", rows_over(step(), 3, 20e-6)), tip_radius=STYLUS, quick=True).model
    highest = max(model, key=lambda feature: abs(feature.height.median))
    assert highest.kind == "step" and highest.axis[:, 0].mean() == pytest.approx(EDGE, abs=2e-6)
    assert highest.height.median == pytest.approx(6e-6, abs=0.1e-6)


def table(path: Path, trace: Trace) -> Path:
    columns = np.column_stack([trace.sweep, 1e3 * trace.centers])
    np.savetxt(path, columns, fmt="%.7f", delimiter=",", header="sweep,x [mm],y [mm],z [mm]", comments="")
    return path


@pytest.mark.slow
def test_an_arc_with_a_slot_is_no_plane_that_half_of_it_lies_off() -> None:
    base = fit_base(rows_over(slot() - X**2 / (2.0 * 0.3), 16, 40e-6))
    bare = np.column_stack([np.linspace(1e-3, 9e-3, 17), np.full(17, 300e-6), np.zeros(17)])
    bare = bare[np.abs(bare[:, 0] - EDGE) > 0.2e-3]
    bare[:, 2] = STYLUS - (bare[:, 0] - EDGE) ** 2 / (2.0 * 0.3) + 3e-3 * bare[:, 0]
    assert base.kind != "plane" and np.abs(base.foot(bare, STYLUS).height).max() < 1e-6
