"""Over a model that lies far off nothing is looked for: that is said first, and no path counts as inspected."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from explore3d.jobs import analyze
from explore3d.report.findings import summary


@pytest.mark.slow
@pytest.mark.parametrize("below", [1.0, 10.0])
def test_a_model_too_low_is_told(tmp_path: Path, below: float) -> None:
    """A plate probed every 0.25 mm, with a rib across the rows; the model lies so many mm below it."""
    rng = np.random.default_rng(8)
    x, y = np.meshgrid(np.arange(0.0, 20.0, 0.25), np.linspace(0.0, 10.0, 14))
    beside = np.maximum(np.abs(x - 9.1) - 0.3, 0.0)
    z = 1.0 + np.maximum(np.sqrt(np.maximum(1.0 - beside**2, 0.0)) - 0.7, 0.0) + 0.002 * rng.standard_normal(x.shape)
    sweep = np.repeat(np.arange(len(x)), x.shape[1])
    table = np.column_stack([x.ravel(), y.ravel(), z.ravel(), sweep])
    header = "x [mm],y [mm],z [mm],sweep"
    np.savetxt(tmp_path / "points.csv", table, delimiter=",", header=header, comments="")
    box = trimesh.creation.box((30.0, 20.0, 4.0))
    box.apply_translation((10.0, 5.0, -2.0 - below))
    box.export(tmp_path / "plate.stl")
    found = analyze(
        tmp_path / "points.csv", model=tmp_path / "plate.stl", model_units="mm", tip_radius="1 mm", quick=True
    )
    assert found.deviation is not None
    assert found.path is not None
    lines = summary(found)
    if below == 1.0:
        assert [feature.kind for feature in found.model.features] == ["ridge"]
        assert found.model.features[0].height.median == pytest.approx(0.3e-3, rel=0.01)
        assert found.path.shortfall < 0.02
        assert any("too large by 1 mm" in line for line in lines)
        return
    assert not found.model.features
    assert found.path.inspected == 0.0
    assert [reason for reason, _ in found.path.left_out] == ["over a model that is wrong beyond repair"]
    assert lines[0].startswith(
        "The model is wrong: all heights over the side that faces (0, 0, 1) are too large by 10 mm"
    )
    assert sum(line == lines[0] for line in lines) == 1
    assert "no features were looked for" in lines
    assert not any("is seen with" in line for line in lines)
