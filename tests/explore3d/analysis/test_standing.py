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
