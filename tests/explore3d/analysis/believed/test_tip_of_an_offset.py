"""A tip said too large: heights stand off the mesh by as much, and sizes carry the doubt of the radius."""

from __future__ import annotations

import numpy as np
import pytest

from explore3d.analysis import Stages, build_model
from explore3d.log import Log
from explore3d.report.findings import summary
from mapping import Surface, Trace
from mapping.base import Base
from mapping.geometry.templates.shapes import cap_height

TIP, HEIGHT, NOISE = 3e-3, 0.12e-3, 12e-6


def plate() -> Base:
    corners = 0.03 * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    return Base(Surface(corners, np.array([[0, 1, 2], [0, 2, 3]])))


@pytest.mark.slow
@pytest.mark.parametrize("said", [1.05, 1.1])
def test_a_wire_under_a_tip_that_is_said_too_large(said: float) -> None:
    y = np.arange(-12e-3, 12e-3, 20e-6)
    rows = np.arange(-10e-3, 10.1e-3, 2e-3)
    across = np.tile(y, len(rows))
    felt = TIP + cap_height(np.abs(across), HEIGHT, 0.5 * HEIGHT, TIP)
    felt += NOISE * np.random.default_rng(4).standard_normal(len(felt))
    centers = np.column_stack([np.repeat(rows, len(y)), across, felt])
    sweep = np.repeat(np.arange(len(rows)), len(y))
    log = Log(Trace(1e-3 * np.arange(len(felt)), centers, sweep, said * TIP))
    analysis = build_model(log, None, plate(), Stages())
    assert analysis.deviation is not None and "offset" in analysis.deviation.causes
    assert analysis.model.provenance["tip_sd"] == pytest.approx(0.05 * said * TIP, rel=0.06)
    assert any("may be the tip's" in line for line in summary(analysis))
    (wire,) = analysis.model.features
    assert wire.kind == "ridge"
    assert wire.height.low < HEIGHT < wire.height.high < 1.1 * HEIGHT
