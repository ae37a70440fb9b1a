"""What stands off the base is told once: as a feature, or as what no feature accounts for."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from explore3d.analysis import ABSORBED
from explore3d.jobs import analyze


def test_what_became_a_feature_is_not_told_as_left_standing_too(tmp_path: Path) -> None:
    x = np.arange(0.0, 20e-3, 2e-6)
    z = np.random.default_rng(5).normal(0.0, 20e-9, len(x))
    for place, height, width in ((4e-3, 2e-6, 20e-6), (9e-3, -0.25e-6, 60e-6), (15e-3, 1e-6, 30e-6)):
        z += height * np.exp(-0.5 * ((x - place) / width) ** 2)
    np.savetxt(tmp_path / "scan.csv", 1e3 * np.column_stack([x, z]), delimiter=",", header="x [mm],z [mm]", comments="")
    found = analyze(tmp_path / "scan.csv", tip_radius="2 um", quick=True)
    assert sorted(round(1e3 * feature.axis[0, 0]) for feature in found.model.features) == [4, 15]
    (told,) = (each.reason for each in found.left_out if each.stage == ABSORBED)
    assert told.startswith("a hollow") and " at (9.0" in told


def test_a_slot_along_the_rows_is_a_feature_that_says_so_and_no_step_beside_it(tmp_path: Path) -> None:
    tip, rng = 3e-3, np.random.default_rng(5)
    x = np.arange(0.0, 40e-3, 0.2e-3)
    rows = []
    for k in range(31):
        y = 1e-3 * k
        inside = np.clip(3.25e-3 - abs(y - 15.2e-3), 0.0, tip)
        z = tip - min(tip - np.sqrt(tip**2 - inside**2), 0.3e-3) + rng.normal(0.0, 10e-6, len(x))
        rows.append(np.column_stack([x, np.full(len(x), y), z, np.full(len(x), k)]))
    table = np.concatenate(rows) * [1e3, 1e3, 1e3, 1.0]
    np.savetxt(tmp_path / "scan.csv", table, delimiter=",", header="x [mm],y [mm],z [mm],sweep", comments="")
    found = analyze(tmp_path / "scan.csv", tip_radius="3 mm", quick=True)
    (slot,) = found.model.features
    assert slot.kind == "groove" and abs(slot.width.median - 6.5e-3) < 40e-6
    (told,) = (each.reason for each in found.left_out if each.stage == ABSORBED)
    assert told.startswith("the groove at (") and "runs along the sweeps" in told


def test_a_slope_that_the_base_follows_is_said(tmp_path: Path) -> None:
    """It rises by 0.3 mm over 6 mm, under a ball of 0.5 mm: no step is as wide."""
    x = 0.05 * np.arange(600)
    z = 0.3 * np.clip((x - 13.0) / 6.0 + 0.5, 0.0, 1.0) + 1e-3 * np.random.default_rng(0).standard_normal(len(x))
    np.savetxt(tmp_path / "slope.csv", np.column_stack([x, z]), delimiter=",", header="x [mm],z [mm]", comments="")
    analysis = analyze(tmp_path / "slope.csv", tip_radius="0.5 mm", quick=True)
    assert not analysis.model.features
    assert any(" by 0.3 mm over 6 mm" in each.reason for each in analysis.left_out)
