"""A bore that was recorded without contact normals is told from a shaft; a plate felt from below is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from explore3d.analyze import analyze
from explore3d.report.findings import summary
from mapping import FloatArray


def rings(radius: float, inside: bool, noise: float) -> FloatArray:
    """Centres (mm) of a ball of 2 mm on 14 circles in, or about, a cylinder with an axial wire of 0.2 mm, and noise."""
    rng, way = np.random.default_rng(6), -1.0 if inside else 1.0
    turn = np.linspace(0.0, 2.0 * np.pi, 2000, endpoint=False)
    rows = []
    for level in range(14):
        off = np.angle(np.exp(1j * (turn - 1.0)))
        center = radius + 2.0 * way
        axis = radius + 0.1 * way  # of the wire
        root = np.sqrt(np.maximum(2.1**2 - (axis * np.sin(off)) ** 2, 0.0))
        over = axis * np.cos(off) + way * root
        touched = (np.abs(off) < 0.5) & (root > 0.0) & (way * over > way * center)
        distance = np.where(touched, over, center) + noise * rng.standard_normal(len(turn))
        rows.append(np.column_stack([distance * np.cos(turn), distance * np.sin(turn), np.full(len(turn), level)]))
    return np.concatenate(rows)


def recorded(path: Path, centers: FloatArray) -> Path:
    np.savetxt(path, centers, fmt="%.5f", delimiter=",", header="x [mm],y [mm],z [mm]", comments="")
    return path


@pytest.mark.slow
@pytest.mark.parametrize(("inside", "noise"), [(True, 1e-3), (False, 3e-3)])
def test_a_wire_in_a_bore_and_one_on_a_shaft_are_both_ridges(tmp_path: Path, inside: bool, noise: float) -> None:
    found = analyze(recorded(tmp_path / "rings.csv", rings(20.0, inside, noise)), tip_radius="2 mm", quick=True)
    assert found.base.kind == "cylinder" and bool(found.base.parameters.get("hollow", False)) == inside
    (ridge,) = found.model.features
    assert ridge.kind == "ridge" and ridge.height.median == pytest.approx(0.2e-3, rel=0.02)
    assert found.refuted_tip is None
    assert (found.side is not None and found.side.turned) == inside
    assert ("wrong_side" in found.model.provenance) == inside
    assert any("felt from inside" in line for line in summary(found)) == inside


@pytest.mark.slow
def test_a_plate_whose_z_points_into_it_is_named_first(tmp_path: Path) -> None:
    x = np.arange(0.0, 20.0, 0.05)
    wire = np.maximum(1.0, 0.1 + np.sqrt(np.maximum(1.1**2 - (x - 10.0) ** 2, 0.0)))
    noise = 1e-3 * np.random.default_rng(7).standard_normal((12, len(x)))
    rows = [np.column_stack([x, np.full(len(x), y), -wire - noise[y]]) for y in range(12)]
    found = analyze(recorded(tmp_path / "below.csv", np.concatenate(rows)), tip_radius="1 mm", quick=True)
    assert found.side is not None and not found.side.turned
    assert summary(found)[0].startswith("Warning: the body seems to lie on the other side of the path")
