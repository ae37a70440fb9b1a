"""A log of another object, or in another frame, is refused before anything is merged."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from explore3d import UserError
from explore3d.jobs.analyze import analyze, analyze_each
from explore3d.jobs.merge import merge
from explore3d.jobs.objects import not_one_object, unlike
from explore3d.log.own.record import KIND, Event, Log, base_event
from mapping.base.base import Base
from mapping.surface import Surface
from mapping.trace import Trace

R = 5e-3


def plate(half: float = 0.05, height: float = 0.0) -> Base:
    corners = np.array([[-half, -half, height], [half, -half, height], [half, half, height], [-half, half, height]])
    return Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))


def log_over(base: Base | None, shift: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Log:
    """A sweep of 60 mm over a plate with a crest of 0.6 mm in its midst, moved by `shift`."""
    x = np.linspace(-0.03, 0.03, 4000)
    bump = np.maximum(0.0, 6e-4 - x**2 / (2.0 * R))
    centers = np.column_stack([x, np.zeros_like(x), R + bump + np.random.default_rng(0).normal(0.0, 1e-4, len(x))])
    trace = Trace(1e-3 * np.arange(len(x)), centers + np.array(shift), np.zeros(len(x), dtype=np.int64), R)
    events = () if base is None else (Event(KIND, 0.0, base_event(base)),)
    return Log(trace, events=events)


def test_a_later_log_of_the_same_object_is_taken() -> None:
    assert unlike(log_over(plate()), plate()) == ""
    assert unlike(log_over(None), plate()) == ""
    assert unlike(log_over(plate(0.049)), plate()) == ""  # a mesh cut elsewhere


@pytest.mark.parametrize("shift", [(0.0, 0.0, 2e-3), (0.0, 0.0, -2e-3), (0.0, 0.2, 0.0)])
def test_samples_off_the_base_are_another_object_or_frame(shift: tuple[float, float, float]) -> None:
    complaint = unlike(log_over(None, shift), plate())
    assert "half of its samples" in complaint and "0.5 mm is possible" in complaint


def test_a_log_recorded_for_another_mesh_is_another_object() -> None:
    assert "mesh that it was recorded for" in unlike(log_over(plate(height=3e-3)), plate())


def test_a_doubtful_pose_leaves_room() -> None:
    moved = log_over(None, (0.0, 0.0, 2e-3))
    assert unlike(moved, plate()) and unlike(moved, plate(), pose_sd=1e-3) == ""


def test_files_whose_tips_places_or_bases_differ_are_no_one_object() -> None:
    assert not_one_object([log_over(plate()), log_over(plate())]) == ""
    assert not_one_object([raster_over(0), raster_over(1)]) == ""
    assert "lies in another place" in not_one_object([raster_over(0), raster_over(1, (0.2, 0.0, 0.0))])
    assert "off the base" in not_one_object([raster_over(0), raster_over(1, (0.0, 0.0, 2e-3))])
    thin = replace(raster_over(1).trace, tip_radius=1e-3)
    assert "with a tip of 1 mm, not 5 mm" in not_one_object([raster_over(0), Log(thin)])


def raster_over(seed: int, shift: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Log:
    """Five sweeps over a plate without a mesh of its own."""
    x = np.tile(np.linspace(-0.03, 0.03, 600), 5)
    y, sweep = np.repeat(np.linspace(-0.02, 0.02, 5), 600), np.repeat(np.arange(5), 600)
    z = R + np.random.default_rng(seed).normal(0.0, 1e-5, len(x))
    return Log(Trace(1e-3 * np.arange(len(x)), np.column_stack([x, y, z]) + np.array(shift), sweep, R))


def table(path: Path, log: Log) -> Path:
    np.savetxt(path, log.trace.centers, delimiter=",", header="x [m],y [m],z [m]", fmt="%.9f")
    return path


@pytest.mark.slow
def test_several_files_are_one_job_or_one_each_and_that_is_said(tmp_path: Path) -> None:
    one, other = table(tmp_path / "a.csv", raster_over(0)), table(tmp_path / "b.csv", raster_over(1))
    far = table(tmp_path / "far.csv", raster_over(2, (0.2, 0.0, 0.0)))
    told: list[str] = []
    assert len(analyze_each([one, other], tmp_path / "both", tip_radius=R, tell=told.append)) == 1
    assert len(analyze_each([one, far], tmp_path / "each", tip_radius=R, tell=told.append)) == 2
    assert len(analyze_each([one, far], tmp_path / "said", tip_radius=R, tell=told.append, same_object=True)) == 1
    assert "taken as one object" in told[0] and "each on its own" in told[1] and "--same-object" in told[1]
    assert len(told) == 2
    assert (tmp_path / "both" / "report.html").is_file() and (tmp_path / "said" / "model.json").is_file()
    assert {path.name for path in (tmp_path / "each").iterdir() if path.is_dir()} == {"a", "far"}


def test_merge_takes_a_table_as_analyze_does(tmp_path: Path) -> None:
    analyze(table(tmp_path / "a.csv", raster_over(0)), tmp_path / "model", tip_radius=R)
    merged = merge(tmp_path / "model", [table(tmp_path / "b.csv", raster_over(1))], tmp_path / "both", tip_radius=R)
    assert len(merged.provenance["merged_sha256"]) == 1
    assert (tmp_path / "both" / "features.csv").is_file() and (tmp_path / "both" / "features.parquet").is_file()
    with pytest.raises(UserError, match="--tip-radius"):
        merge(tmp_path / "model", [tmp_path / "b.csv"], tmp_path / "again")
    assert not (tmp_path / "again").exists()


def test_the_same_samples_in_another_file_are_not_merged_twice(tmp_path: Path) -> None:
    analyze(table(tmp_path / "a.csv", raster_over(0)), tmp_path / "model", tip_radius=R)
    again = tmp_path / "again.csv"
    again.write_text((tmp_path / "a.csv").read_text() + "\n")
    with pytest.raises(UserError, match=r"another file, but its samples are in the model .* already"):
        merge(tmp_path / "model", [again], tmp_path / "both", tip_radius=R)
    assert not (tmp_path / "both").exists()
