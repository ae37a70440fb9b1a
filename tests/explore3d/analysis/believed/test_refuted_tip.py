"""A tip told a thousand times too large is told first on the terminal and in the report, and stands in the model."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from explore3d.analyze import analyze
from explore3d.report.findings import summary, warnings
from explore3d.report.findings_section import headline


def test_a_mistake_of_the_unit_is_named(tmp_path: Path) -> None:
    rng, radius, step = np.random.default_rng(21), 2e-6, 0.1e-6
    x, z = step * np.arange(2000), np.zeros(2000)
    for place in np.linspace(20e-6, 180e-6, 6):
        tops = np.sqrt(np.maximum(radius**2 - (x - place) ** 2, 0.0)) - radius + rng.uniform(0.1e-6, 0.5e-6)
        z = np.maximum(z, tops)
    table = tmp_path / "scan.csv"
    rows = 1e6 * np.column_stack([x, z + 2e-9 * rng.standard_normal(2000)])
    np.savetxt(table, rows, fmt="%.5f", delimiter=",", header="x [um],z [um]", comments="")
    wrong = analyze(table, tip_radius="2 mm", quick=True)
    found = wrong.refuted_tip
    assert found is not None and radius < found.largest < 2.0 * radius
    assert wrong.model.provenance["refuted_tip"] == found.record()
    first, *others = [*summary(wrong), *warnings(wrong)]
    assert first.startswith(f"Warning: {found.sentence()}. ") and not any(found.sentence() in each for each in others)
    assert headline(wrong).count(found.sentence()) == 1


def test_nothing_is_said_of_a_tip_that_nothing_refutes(tmp_path: Path) -> None:
    table = tmp_path / "scan.csv"
    rows = np.column_stack([0.1 * np.arange(500), 1e-3 * np.random.default_rng(22).standard_normal(500)])
    np.savetxt(table, rows, fmt="%.5f", delimiter=",", header="x [um],z [um]", comments="")
    plain = analyze(table, tip_radius="2 um", quick=True)
    assert plain.refuted_tip is None and "refuted_tip" not in plain.model.provenance
    assert not any("no ball" in line for line in summary(plain))
