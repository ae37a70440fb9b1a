"""An analysis lays its trace on the base once: counted over all its stages."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from explore3d.analysis.build_model import build_model
from explore3d.analysis.method import Work, detected, deviated, kept_over_base, made_sound
from explore3d.analysis.roughness import roughness_of
from explore3d.analysis.stages import Stages
from explore3d.analysis.truth import TrueFeature
from explore3d.bench.scenes.plate_sweeps import DIAMETER, plate, scaled, sweeps, wire
from explore3d.log.own.record import Log
from explore3d.report import write_report
from mapping import Trace
from mapping.assembly.linking import inspection
from mapping.base import laid_trace
from mapping.base.base import Base
from mapping.base.laid_trace import LaidTrace
from mapping.detection import RAW_SAMPLES


@pytest.fixture
def laid(monkeypatch):
    """How many points were laid on a base, call by call."""
    counts, foot = [], Base.foot

    def counted_foot(self, centers, tip_radius):
        counts.append(len(np.asarray(centers)))
        return foot(self, centers, tip_radius)

    monkeypatch.setattr(Base, "foot", counted_foot)
    return counts


def test_of_few_samples_each_is_laid_once_and_hardly_any_mean(laid):
    trace = sweeps(wire(), white=0.02e-3, spacing=0.1e-3)
    work = Work(Log(trace), None, plate(), Stages())
    for stage in (deviated, kept_over_base, made_sound, detected):
        stage(work, lambda share: None)
    assert len(work.detections.crossings) == len(work.laid.laid_sweeps)
    assert sum(laid) <= 1.01 * len(trace)


def test_roughness_lays_nothing_that_is_laid_already(monkeypatch):
    trace = sweeps(
        lambda feet: np.zeros(len(feet)), white=0.02e-3, places=np.array([0.0, 1e-3]), spacing=0.1e-3, half=20e-3
    )
    laid = LaidTrace(trace, plate())
    laid.feet()

    def refused(self, centers, tip_radius):
        raise AssertionError(f"{len(centers)} places are laid again")

    monkeypatch.setattr(Base, "foot", refused)
    found = roughness_of(laid, (), 0.02e-3, 2.5e-3, 0.5e-3)
    assert found is not None and found.profile["Rq"].low < 0.02e-3


@pytest.mark.slow
def test_what_is_measured_for_roughness_too_is_laid_sample_by_sample_once_its_pictures_included(laid, tmp_path):
    # the courses of what is found are laid out on some 4,300 places, however many samples there are
    trace = scaled(sweeps(wire(), white=0.02e-3, spacing=8e-6, half=80e-3), 0.5)
    assert len(trace) > RAW_SAMPLES
    felt = replace(plate(at=(0.0, 0.0, 0.1e-3)), kind="plane")  # by few sweeps, and not quite where it is
    analysis = build_model(Log(trace), None, felt, Stages())
    assert analysis.roughness is not None and analysis.model.features
    assert analysis.base is not felt  # it was fitted again to all that was felt on it
    write_report(analysis, tmp_path)
    assert sum(laid) <= 1.05 * len(trace)


def test_an_analysis_lays_hardly_more_points_than_samples_and_looks_at_no_height_twice(monkeypatch, laid):
    profiles, inspected = Counter(), []
    heights, looked = laid_trace.height_profiles, inspection.inspect

    def counted_heights(number, trace, s, base, spacing, *kept):
        profiles[number, spacing] += 1
        return heights(number, trace, s, base, spacing, *kept)

    def counted_look(trace, base, noise, spacings):
        inspected.append(list(spacings))
        return looked(trace, base, noise, spacings)

    monkeypatch.setattr(inspection, "inspect", counted_look)
    monkeypatch.setattr(laid_trace, "height_profiles", counted_heights)
    places = np.linspace(-30e-3, 30e-3, 10)
    trace = sweeps(wire(), white=0.1e-3, places=places, spacing=5e-6, half=20e-3)
    axis = np.array([[-50e-3, 0.0, 0.0], [50e-3, 0.0, 0.0]])
    monkeypatch.setattr(Work, "truth", (TrueFeature("ridge", axis, DIAMETER, DIAMETER, 0.1),))
    analysis = build_model(Log(trace), None, plate(), Stages())
    (ridge,) = analysis.model.features
    assert ridge.height.median == pytest.approx(DIAMETER, rel=0.03)
    assert len(analysis.time_curve) > 1  # the curve looks at the features seven times over
    assert sum(laid) <= 1.05 * len(trace)
    assert max(profiles.values()) == 1 and len(inspected) == 1
    # one width of bins for detection, one for lines of crossings, one for lines that no sweep shows, and one for the
    # blocks that the model itself is held against
    assert len({spacing for _, spacing in profiles}) <= 4


def test_with_its_report_an_analysis_of_a_profile_lays_hardly_more_points_than_samples(laid, tmp_path):
    tip, x = 2e-6, np.arange(0.0, 10e-3, 0.5e-6)
    crest = 1e-6 * np.maximum(0.0, 1.0 - ((x - 4e-3) / 30e-6) ** 2)
    trace = Trace.from_profile(x, tip + crest + 2e-9 * np.random.default_rng(3).standard_normal(len(x)), tip)
    analysis = build_model(Log(trace), None, None, Stages())
    assert analysis.model.features
    write_report(analysis, tmp_path)
    assert sum(laid) <= 1.05 * len(trace)
