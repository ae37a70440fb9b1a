"""Streaming a log: the same crossings as in memory, whole sweeps, bounded pieces, and going on after a break."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from explore3d.analysis.stages import Stages
from explore3d.bench.scenes.long_log import WIRE_RADIUS, write_long_log
from explore3d.jobs import condense as module
from explore3d.jobs.condense import Condensed, condense
from explore3d.log.own.reader import read_log
from explore3d.log.own.record import read_base
from explore3d.log.own.stream import LogStream, count_samples, head, large_log
from mapping.assembly.assemble import assemble
from mapping.base.base import Base
from mapping.base.height_profile import arclength
from mapping.detection.detect import detect

SAMPLES, CHUNK = 60_000, 12_000


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("log") / "log.mcap"
    write_long_log(path, SAMPLES, wires=1)
    return path


def base_of(log: Path) -> Base:
    base = read_base(head(log)[1])
    assert base is not None
    return base


def test_pieces_are_whole_sweeps_and_together_the_log(log: Path):
    whole = read_log(log).trace
    pieces = list(LogStream(log).sweeps(CHUNK))
    assert len(pieces) > 3
    assert max(len(piece) for piece in pieces) < 2 * CHUNK
    np.testing.assert_array_equal(np.concatenate([piece.centers for piece in pieces]), whole.centers)
    for before, after in pairwise(pieces):
        assert before.sweep[-1] != after.sweep[0]


def test_a_log_says_how_many_samples_it_holds_without_being_read(log: Path):
    assert abs(count_samples(log) - SAMPLES) <= 0.2 * SAMPLES
    assert large_log(log) is None


def test_a_streamed_log_shows_the_same_crossings(log: Path):
    base = base_of(log)
    whole = detect(read_log(log).trace, base)
    found = condense(LogStream(log), base, None, chunk=CHUNK)
    assert found.samples == SAMPLES
    assert len(whole.crossings) > 2
    places, streamed = (np.array([c.point for c in d.crossings]) for d in (whole, found.detections))
    np.testing.assert_allclose(streamed, places, atol=0.1e-3)
    assert found.detections.noise.sd == pytest.approx(whole.noise.sd, rel=0.05)
    assert found.detections.inspected_length == pytest.approx(whole.inspected_length, rel=0.01)


def test_all_samples_near_a_crossing_are_kept_and_its_range_counts_in_them(log: Path, monkeypatch):
    monkeypatch.setattr(module, "KEPT_BACKGROUND_SAMPLES", 500)
    monkeypatch.setattr(module, "CROSSING_REACH", 0.1)
    found = condense(LogStream(log), base_of(log), None, chunk=CHUNK)
    assert len(found.trace) < 0.8 * SAMPLES
    parts = dict(found.trace.sweeps())
    for crossing in found.detections.crossings:
        own = parts[crossing.sweep].centers[crossing.start : crossing.stop]
        middle = own[len(own) // 2]
        assert np.linalg.norm(middle[:2] - crossing.point[:2]) < 4e-3
        assert np.median(np.linalg.norm(np.diff(own[:, :2], axis=0), axis=1)) < 10e-6


def test_a_broken_off_search_goes_on_where_it_stopped(log: Path, tmp_path: Path, monkeypatch):
    base, searched = base_of(log), []

    def counted(trace, *arguments, **settings):
        searched.append(len(trace))
        if len(searched) == 3:
            raise KeyboardInterrupt
        return detect(trace, *arguments, **settings)

    monkeypatch.setattr(module, "detect", counted)
    with pytest.raises(KeyboardInterrupt):
        condense(LogStream(log), base, tmp_path, chunk=CHUNK)
    resumed = condense(LogStream(log), base, tmp_path, chunk=CHUNK)
    count = len(list(LogStream(log).sweeps(CHUNK)))
    assert len(searched) == count + 1  # the one that was broken off is done again, none else
    monkeypatch.setattr(LogStream, "sweeps", None)  # the whole is there: the log is not read again
    same(resumed, condense(LogStream(log), base, tmp_path, chunk=CHUNK))
    monkeypatch.undo()
    monkeypatch.setattr(module, "detect", counted)
    assert len(searched) == count + 1
    condense(LogStream(log), base, tmp_path, chunk=CHUNK, false_alarms_per_metre=0.1)
    assert len(searched) == 2 * count + 1  # other settings: searched anew


def same(one: Condensed, other: Condensed) -> None:
    np.testing.assert_array_equal(one.trace.centers, other.trace.centers)
    assert one.detections.noise == other.detections.noise
    assert (one.complete, one.recovered) == (other.complete, other.recovered)
    assert [(e.kind, e.t) for e in one.events] == [(e.kind, e.t) for e in other.events]
    for a, b in zip(one.detections.crossings, other.detections.crossings, strict=True):
        np.testing.assert_array_equal(a.point, b.point)
        assert (a.start, a.stop, a.height, a.kind) == (b.start, b.stop, b.height, b.kind)


def test_one_sample_in_sixty_is_enough_between_the_crossings(tmp_path: Path, monkeypatch):
    (axis,) = write_long_log(tmp_path / "log.mcap", 400_000, wires=1)
    monkeypatch.setattr(module, "KEPT_BACKGROUND_SAMPLES", 400_000 // 60)
    base = base_of(tmp_path / "log.mcap")
    found = condense(LogStream(tmp_path / "log.mcap"), base, None)
    assert len(found.trace) < found.samples / 2
    (ridge,) = assemble(found.detections, found.trace, base)
    assert ridge.evidence.crossings == len(found.detections.crossings) >= 10
    assert ridge.height.median == pytest.approx(2 * WIRE_RADIUS, abs=0.02e-3)
    ends = ridge.axis[[0, -1]] if ridge.axis[0, 0] < ridge.axis[-1, 0] else ridge.axis[[-1, 0]]
    assert np.linalg.norm((ends - axis)[:, :2], axis=1).max() < 1e-3


def test_lengths_along_a_sweep_survive_samples_left_out_of_it(log: Path):
    base = base_of(log)
    _, sweep = next(read_log(log).trace.sweeps())
    keep = np.r_[0:900:60, 900:1500, 1500 : len(sweep) : 60]
    whole, part = arclength(sweep, base), arclength(sweep.select(keep), base)
    assert np.abs(part - (whole[keep] - whole[0])).max() < 0.1e-3  # half the noise


@pytest.mark.slow
def test_a_streamed_analysis_finds_the_wire_and_leaves_no_chunks_behind(log: Path, tmp_path: Path):
    from explore3d.jobs.analyze import analyze
    from explore3d.jobs.session import Session
    from explore3d.jobs.streaming import analyze_stream

    out = tmp_path / "out"
    with Session(out) as session:
        streamed = analyze_stream(log, session, Stages(), chunk=CHUNK)
    assert not (tmp_path / "out.chunks").exists()
    assert (out / "report.html").is_file()
    assert any("samples were searched" in each.reason for each in streamed.left_out)
    (found,), (whole,) = streamed.model.features, analyze(log).model.features
    assert found.height.median == pytest.approx(whole.height.median, abs=0.05e-3)
    assert found.length.median == pytest.approx(whole.length.median, abs=1e-3)
