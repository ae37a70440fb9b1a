"""An analysis lays its trace on the base once: counted over all its stages."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from explore3d.analysis.build_model import build_model
from explore3d.analysis.method import Work
from explore3d.analysis.stages import Stages
from explore3d.analysis.truth import TrueFeature
from explore3d.bench.scenes.plate_sweeps import DIAMETER, plate, sweeps, wire
from explore3d.log.own.record import Log
from mapping.assembly import inspection
from mapping.base import laid_trace
from mapping.base.base import Base


def test_an_analysis_lays_hardly_more_points_than_samples_and_looks_at_no_height_twice(monkeypatch):
    laid, profiles, inspected = [], Counter(), Counter()
    foot, heights, looked = Base.foot, laid_trace.height_profiles, inspection.inspect

    def counted_foot(self, centers, tip_radius):
        laid.append(len(np.asarray(centers)))
        return foot(self, centers, tip_radius)

    def counted_heights(number, trace, s, base, spacing, *kept):
        profiles[number, spacing] += 1
        return heights(number, trace, s, base, spacing, *kept)

    def counted_look(trace, base, noise, spacing):
        inspected[spacing] += 1
        return looked(trace, base, noise, spacing)

    monkeypatch.setattr(inspection, "inspect", counted_look)
    monkeypatch.setattr(Base, "foot", counted_foot)
    monkeypatch.setattr(laid_trace, "height_profiles", counted_heights)
    places = np.linspace(-30e-3, 30e-3, 10)
    trace = sweeps(wire(), white=0.1e-3, places=places, spacing=5e-6, half=20e-3)
    axis = np.array([[-50e-3, 0.0, 0.0], [50e-3, 0.0, 0.0]])
    monkeypatch.setattr(Work, "truth", (TrueFeature("ridge", axis, DIAMETER, DIAMETER, 0.1),))
    analysis = build_model(Log(trace), None, plate(), Stages())
    (ridge,) = analysis.model.features
    assert ridge.height.median == pytest.approx(DIAMETER, rel=0.03)
    assert len(analysis.time_curve) > 1  # the curve looks at the features eight times over
    assert sum(laid) <= 1.05 * len(trace)
    assert max(profiles.values()) == 1 and max(inspected.values()) == 1
    # one width of bins for detection, one for lines of crossings, one for lines that no sweep shows, and one for the
    # blocks that the model itself is held against
    assert len({spacing for _, spacing in profiles}) <= 4
