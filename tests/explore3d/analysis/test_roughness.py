"""Roughness of a trace: beside its features, over its form, of a raster; and why a trace has none."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from changed_scans import NOISE, PITCH, TIP, scan
from in_process import explore3d_main

from explore3d.analysis import Stages, build_model
from explore3d.analysis.roughness import reach_above
from explore3d.log.own.record import Log
from mapping import Details, Feature, Interval, Support
from mapping.inference.kinds import sizes_of
from mapping.trace import Trace

RMS = 30e-9


def rough(shape: tuple[int, int], rng: np.random.Generator) -> np.ndarray:
    """White heights of RMS."""
    return RMS * rng.standard_normal(shape)


def raster(rows: int = 25, columns: int = 500, step: float = 4e-6) -> Log:
    """Rows over a tilted plane, 4 um apart both ways, every other backwards."""
    rng = np.random.default_rng(7)
    x, heights = step * np.arange(columns), rough((rows, columns), rng)
    parts = []
    for k in range(rows):
        line = np.column_stack([x, np.full(columns, step * k), TIP + heights[k] + 1e-3 * x])
        parts.append(line[:: 1 if k % 2 == 0 else -1])
    centers = np.concatenate(parts)
    return Log(Trace(1e-3 * np.arange(len(centers)), centers, np.repeat(np.arange(rows), columns), TIP))


def profile(crests: int) -> Log:
    """A profile of nine pitches over so many crests."""
    places = PITCH * (2.5 + 2.0 * np.arange(crests))
    return scan(places, np.full(crests, 1e-6), np.random.default_rng(3), count=9)


def test_a_profile_is_as_rough_as_its_noise_beside_the_crests() -> None:
    log = profile(crests=3)
    found = build_model(log, None, None, Stages(quick=True, forced=("roughness",), cutoffs=(0.08e-3, None))).roughness
    assert found is not None and found.sections >= 5 and found.short_cutoff == 2.5e-6
    white = build_model(log, None, None, Stages(quick=True, forced=("roughness",), cutoffs=(0.08e-3, 1e-6))).roughness
    assert white is not None and white.profile["Rq"].low < NOISE < 1.2 * white.profile["Rq"].high
    assert found.profile["Rq"].median < white.profile["Rq"].median
    assert found.why_no_areal == "1 sweep is no raster"


def test_a_raster_has_areal_parameters_too() -> None:
    found = build_model(
        raster(), None, None, Stages(quick=True, forced=("roughness",), cutoffs=(0.04e-3, None))
    ).roughness
    assert found is not None and found.squares >= 20 and not found.why_no_areal
    assert found.areal["Sq"].median == pytest.approx(RMS, rel=0.08)
    # of white heights the mean line takes 2 w - sum w^2 = w (2 - 1 / sqrt 2), for the Gaussian's weight w at a sample
    weight = 4.0 / (0.18739 * 40.0 * np.sqrt(2.0 * np.pi))
    assert found.profile["Rq"].median == pytest.approx(RMS * np.sqrt(1.0 - weight * (2.0 - np.sqrt(0.5))), rel=0.05)
    assert found.areal["Sz"].median > 4.0 * RMS
    assert json.dumps(found.record()["parameters"]["Sq"])


def test_a_trace_that_cannot_tell_says_why() -> None:
    short = build_model(raster(rows=6, columns=80), None, None, Stages(quick=False))
    left = {each.stage: each.reason for each in short.left_out}
    assert short.roughness is None and "no sweep is long enough for 5 sections of 80 µm" in left["roughness"]


def test_the_command_prints_a_table_and_refuses_what_it_cannot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.csv"
    centers = 1e3 * profile(crests=1).trace.centers[:, [0, 2]]
    np.savetxt(path, centers, delimiter=",", header="x [mm],z [mm]", comments="", fmt="%.9f")
    words = ["roughness", path, "--tip-radius", f"{TIP} m", "--cutoff"]
    assert explore3d_main(monkeypatch, *words, "0.08 mm") == 0
    told = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in told[:7]] == ["Ra", "Rq", "Rz", "Rsk", "Rku", "Rsm", "Wa"]
    assert " ".join(told[7:]).startswith("Taken off before the filters: a straight line. Gaussian L-filter of 80 µm")
    assert explore3d_main(monkeypatch, *words, "0.08 mm", "--json") == 0
    assert json.loads(capsys.readouterr().out)["cutoff"] == pytest.approx(0.08e-3)
    for more, complaint in (
        (["8 mm"], "a shorter --cutoff may do"),
        (["0.08 mm", "--short-cutoff", "0.5 um"], "needs samples at most 0.25 µm apart"),
        (["nothing"], "--cutoff: "),
    ):
        assert explore3d_main(monkeypatch, *words, *more) == 2
        assert complaint in capsys.readouterr().err.splitlines()[-1]


def test_what_runs_out_of_a_bump_is_none_of_the_roughness() -> None:
    height, none = Interval(1e-4, 0.9e-4, 1.1e-4), Interval(0.0, 0.0, 0.0)
    cap = Feature(
        "bump", np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]), height, height, none, Support(9.0, 3), True, 0.0
    )
    bell = replace(cap, details=Details(scale=3e-4, exponent=1.0))
    half_width = sizes_of(cap, 1e-3).half_width
    assert reach_above(cap, 1e-6, 1e-3) == half_width
    # z = H / (1 + (u / w)^2) is 4 um high at 5 w, and a ball feels no less
    assert 1.5e-3 < reach_above(bell, 3.5e-6, 1e-3) < 2e-3
    assert reach_above(bell, 1.0, 1e-3) == half_width
