"""Lines that rows cross at a slant, or run along and hardly cross, are told as they are under rows across them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from explore3d import analyze
from mapping.model import ObjectModel

TIP, SIDE, PITCH, STEP, NOISE = 1e-3, 30e-3, 1e-3, 0.1e-3, 2e-6


def rows_over_a_line(folder: Path, degrees: float, width: float, height: float) -> ObjectModel:
    """The model of rows over a line with upright walls whose normal is so far from the rows' direction."""
    places = [
        np.column_stack([np.arange(0.0, SIDE + 1e-9, STEP)[:: 1 - 2 * (row % 2)], np.full(301, PITCH * row)])
        for row in range(31)
    ]
    x, y = np.concatenate(places).T
    slant = np.radians(degrees)
    aside = np.abs((x - 0.5 * SIDE) * np.cos(slant) + (y - 0.5 * SIDE) * np.sin(slant))
    beyond = np.clip(np.sign(height) * (aside - 0.5 * width), 0.0, TIP)
    dip = np.sqrt(TIP**2 - beyond**2) - TIP
    z = np.maximum(height + dip, 0.0) if height > 0.0 else np.maximum(dip, height)
    z = z + np.random.default_rng([1, int(10 * degrees)]).normal(0.0, NOISE, len(z))
    table = folder / "rows.csv"
    np.savetxt(table, 1e3 * np.column_stack([x, y, z]), fmt="%.5f", delimiter=",", header="x [mm],y [mm],z [mm]")
    return analyze(table, tip_radius=TIP, quick=True).model


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [0.0, 30.0, 50.0, 62.0, 75.0])
def test_a_bar_is_a_ridge(tmp_path: Path, degrees: float) -> None:
    (bar,) = rows_over_a_line(tmp_path, degrees, 1.2e-3, 0.2e-3)
    assert bar.kind == "ridge"
    # of five angles one 90 % interval may miss by half of its width; a play taken off at 50 degrees moved it by 40 um
    assert abs(bar.height.median - 0.2e-3) < bar.height.high - bar.height.low
    assert bar.width.low <= 1.25e-3 <= bar.width.high + 0.1e-3


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [0.0, 62.0])
def test_a_slot_is_as_deep_as_its_floor(tmp_path: Path, degrees: float) -> None:
    (slot,) = rows_over_a_line(tmp_path, degrees, 1.7e-3, -0.2e-3)
    assert slot.kind == "groove"
    assert slot.height.median == pytest.approx(-0.2e-3, abs=1e-6)
    assert slot.width.median == pytest.approx(1.7e-3, abs=10e-6)


def rows_along_a_groove(folder: Path, degrees: float, shift: float = 0.0, denied: bool = False) -> ObjectModel:
    """The model of rows 1.5 mm apart over a deep groove of 0.5 mm that runs at a slant to them.

    Args:
        degrees: of the slant.
        shift: by which its middle is beside a row, m.
        denied: True if that row was swept once more, and nothing was felt then.
    """
    tip, width, slant = 1.5e-3, 0.5e-3, np.radians(degrees)
    rows = [*np.arange(1.5e-3, 13.6e-3, 1.5e-3), *([7.5e-3] if denied else [])]
    x, y = (each.ravel() for each in np.meshgrid(np.arange(0.0, 0.1, 0.2e-3), rows))
    sweep = np.repeat(np.arange(len(rows)), 500)
    aside = np.abs((y - 7.5e-3 - shift) * np.cos(slant) - (x - 0.05) * np.sin(slant))
    z = np.sqrt(tip**2 - np.clip(0.5 * width - aside, 0.0, None) ** 2) - tip
    z = np.where(sweep == 9, 0.0, z) + np.random.default_rng(3).normal(0.0, 1.5e-6, len(z))
    table = folder / "along.csv"
    columns = np.column_stack([sweep, 1e3 * np.column_stack([x, y, z])])
    np.savetxt(table, columns, fmt="%.5f", delimiter=",", header="sweep,x [mm],y [mm],z [mm]", comments="")
    return analyze(table, tip_radius=tip, quick=True).model


def test_a_groove_between_rows_that_hardly_cross_it_is_one_line(tmp_path: Path) -> None:
    (groove,) = rows_along_a_groove(tmp_path, 2.9, 0.3e-3)
    assert groove.kind == "groove" and groove.evidence.crossings >= 3
    assert groove.width.median == pytest.approx(0.5e-3, rel=0.05)
    assert groove.length.censored and 60e-3 < groove.length.low < 0.1
    way = groove.axis[-1] - groove.axis[0]
    assert abs(np.degrees(np.arctan(way[1] / way[0]))) == pytest.approx(2.9, abs=0.05)


def test_what_one_row_alone_shows_plainly_is_there_with_bounds_and_a_remark(tmp_path: Path) -> None:
    (dip,) = rows_along_a_groove(tmp_path, 1.0)
    assert dip.kind == "pit" and dip.evidence.log_odds > 1000.0
    assert dip.details.misfit and "a line along that sweep" in dip.details.misfit
    assert dip.height.censored and dip.height.median == pytest.approx(-21e-6, abs=2e-6)
    assert dip.width.bounded and 0.4e-3 < dip.width.low < 0.51e-3 and dip.width.high > 10e-3


def test_what_one_sweep_shows_and_the_next_over_the_same_place_does_not_is_nothing(tmp_path: Path) -> None:
    model = rows_along_a_groove(tmp_path, 1.0, denied=True)
    assert not model.features and model.dropped
