"""What was found in the forms of others: read back by the libraries of those forms."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from in_process import explore3d_main
from small_profiles import TIP, write_profile
from two_features import two_features

from explore3d import load
from explore3d.jobs.analyze import Told, analyze
from explore3d.jobs.export.crate import CRATE
from explore3d.jobs.export.export import FORMS, crests_csv, crests_dxf, export


def test_crest_lines_as_a_table_hold_every_vertex() -> None:
    rows = list(csv.DictReader(io.StringIO(crests_csv(two_features()))))
    assert [(row["id"], row["vertex"]) for row in rows] == [*[("ridge-1", str(k)) for k in (1, 2, 3)], ("bump-1", "1")]
    assert (float(rows[2]["x"]), float(rows[2]["y"]), float(rows[2]["height"])) == (0.02, 0.01, 1e-3)


def test_a_drawing_has_a_layer_for_each_kind_in_millimetres() -> None:
    ezdxf = pytest.importorskip("ezdxf")
    drawing = ezdxf.read(io.StringIO(crests_dxf(two_features()).decode()))
    line, point = drawing.modelspace()
    assert not drawing.audit().errors and drawing.units == 4
    assert [tuple(each.dxf.location) for each in line.vertices][2] == (20.0, 10.0, 0.0)
    assert (line.dxf.layer, point.dxf.layer, tuple(point.dxf.location)) == ("RIDGE", "BUMP", (0.0, 20.0, 0.0))
    assert line.get_xdata("EXPLORE3D")[0].value == "ridge-1" and line.get_xdata("EXPLORE3D")[1].value == 1.0


def test_the_residual_leaves_the_features_out_and_keeps_the_rest(tmp_path: Path) -> None:
    x3pio = pytest.importorskip("x3pio")
    path = write_profile(tmp_path / "a.csv", 1)
    profile = x3pio.read(str(export(path, tmp_path / "a.x3p", Told(TIP))))
    heights = profile.layers[0].z
    assert profile.header.x.increment == pytest.approx(0.5e-6, rel=1e-3) and len(heights) == 400
    # a crest of 1 um under a parabola of 6 um radius is 2 x 3.46 um wide, 14 samples; there are two
    assert 26 <= np.isnan(heights).sum() <= 36
    assert np.nanstd(heights) == pytest.approx(10e-9, rel=0.2) and np.nanmax(heights) < 100e-9


def test_nothing_is_written_where_one_of_the_targets_cannot_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out, good, there = tmp_path / "out", tmp_path / "a.csv", tmp_path / "there.qif"
    two_features().save(out)
    there.write_text("somebody's")
    monkeypatch.setitem(FORMS, ".dxf", ("no_such_package", 'pip install "explore3d[cad]"'))
    for bad, said in (
        (tmp_path / "p.dxf", "needs no_such_package"),
        (there, "is there already"),
        (tmp_path / "p.png", "its name says no form"),
        (tmp_path / "absent" / "p.qif", "there is no folder"),
        (good, "is given twice"),
    ):
        assert explore3d_main(monkeypatch, "export", out, "--to", good, "--to", bad) == 2
        assert said in capsys.readouterr().err and not good.exists()
    assert explore3d_main(monkeypatch, "export", out, "--to", good, "--to", there, "--overwrite") == 0
    assert good.exists() and there.read_text() != "somebody's"


def test_the_record_of_a_session_names_its_files_by_their_digests(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    analyze(write_profile(tmp_path / "a.csv"), out, tip_radius=TIP, quick=True)
    assert explore3d_main(monkeypatch, "export", out, "--to", out / CRATE, "--to", tmp_path / "c.csv") == 0
    assert capsys.readouterr().out.splitlines()[0] == f"written: {out / CRATE}"
    graph = {each["@id"]: each for each in json.loads((out / CRATE).read_text())["@graph"]}
    for part in graph["./"]["hasPart"]:
        file = graph[part["@id"]]
        assert file["sha256"] == hashlib.sha256((out / file["name"]).read_bytes()).hexdigest()
    assert graph["#fingertip"]["value"] == TIP and graph["#analysis"]["endTime"]
    assert graph["#analysis"]["object"]["@id"].endswith(load(out).provenance["log_sha256"])
    assert len(graph["./"]["hasPart"]) == 5


def test_what_cannot_be_written_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    two_features().save(tmp_path / "model")
    for target, complaint in (
        ("a.step", "its name says no form; possible: NAME.csv"),
        (CRATE, "stands in that folder"),
        (f"model/{CRATE}", "is no session with a model that is whole"),
    ):
        assert explore3d_main(monkeypatch, "export", tmp_path / "model", "--to", tmp_path / target) == 2
        assert complaint in capsys.readouterr().err.splitlines()[-1]
        assert not (tmp_path / target).exists()


def test_an_export_never_replaces_a_log_a_session_or_what_nobody_gave_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out, other = tmp_path / "out", tmp_path / "crests.csv"
    analyze(write_profile(tmp_path / "a.csv"), out, tip_radius=TIP, quick=True)
    (tmp_path / "bare").mkdir()
    for name in ("model.json", "model.npz"):
        shutil.copy(out / name, tmp_path / "bare")
    (tmp_path / "bare" / "log.mcap").write_bytes(b"what was recorded")
    other.write_text("mine")
    kept = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    lost = [
        (out, out / "features.csv", "--overwrite"),
        (tmp_path / "bare", tmp_path / "bare" / "log.mcap", "--overwrite"),
        (tmp_path / "bare" / "model.json", tmp_path / "bare" / "log.mcap", "--overwrite"),
        (tmp_path / "a.csv", tmp_path / "a.csv", "--overwrite"),
        (out, other),
        (out, tmp_path / "bare"),
    ]
    for source, to, *more in lost:
        assert explore3d_main(monkeypatch, "export", source, "--to", to, *more) == 2
        assert str(to) in capsys.readouterr().err
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == kept
    assert explore3d_main(monkeypatch, "export", out, "--to", other, "--overwrite") == 0
    assert other.read_text().startswith("id,kind,")
