"""Tolerances of what no scene speaks of: from a file, or from a table's sidecar; judged, told and kept."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from in_process import explore3d_main

import explore3d
from explore3d import UserError
from explore3d.scene import read_tolerances
from mapping.model import FAIL, PASS, Tolerance

TIP = 0.5e-3
CREST = 40e-6
DRAWING = """[[tolerance]]
kind = "ridge"
size = "height"
limit = "{limit}"
"""


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    """A profile over a crest of 40 um, in mm."""
    x = np.arange(-3e-3, 3e-3, 5e-6)
    reach = np.sqrt(TIP**2 - (TIP - CREST) ** 2)
    centre = np.where(np.abs(x) < reach, CREST - TIP + np.sqrt(TIP**2 - np.minimum(np.abs(x), reach) ** 2), 0.0)
    z = TIP + centre + 0.3e-6 * np.random.default_rng(4).standard_normal(len(x))
    path = tmp_path / "scan.csv"
    np.savetxt(path, 1e3 * np.column_stack([x, z]), delimiter=",", header="x [mm],z [mm]", comments="", fmt="%.9f")
    return path


def test_a_file_of_tolerances_judges_a_table(
    scan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for limit, verdict in (("20 um", "fail"), ("60 um", "pass")):
        drawing = tmp_path / f"{verdict}.toml"
        drawing.write_text(DRAWING.format(limit=limit).replace("ridge", "any"))
        out = tmp_path / verdict
        words = ["analyze", scan, "--tip-radius", f"{TIP} m", "--tip-sd", "0 m", "--tolerances", drawing, "--out", out]
        assert explore3d_main(monkeypatch, *words, "--no-report") == 0
        told = [line for line in capsys.readouterr().out.splitlines() if line.startswith(f"{verdict}: ")]
        assert len(told) == 1 and f"height of every feature: at most {limit.replace('u', 'µ')}" in told[0]
        kept = json.loads((out / "model.json").read_text())["provenance"]["tolerances"]
        assert [each["verdict"] for each in kept] == [verdict]
        again = json.loads((out / "session.json").read_text())["command"]
        assert f"--tolerances {drawing}" in again


def test_a_sidecar_says_them_and_the_option_wins(scan: Path, tmp_path: Path) -> None:
    scan.with_suffix(".toml").write_text(f'tip_radius = "{TIP} m"\ntip_sd = 0\n' + DRAWING.format(limit="20 um"))
    kind = explore3d.analyze(scan, quick=True).model.features[0].kind
    scan.with_suffix(".toml").write_text(
        f'tip_radius = "{TIP} m"\ntip_sd = 0\n' + DRAWING.format(limit="20 um").replace("ridge", kind)
    )
    assert [each.verdict for each in explore3d.analyze(scan, quick=True).judgements] == [FAIL]
    drawing = tmp_path / "drawing.toml"
    drawing.write_text(DRAWING.format(limit="60 um").replace("ridge", kind))
    judged = explore3d.analyze(scan, quick=True, tolerances=drawing).judgements
    assert [each.verdict for each in judged] == [PASS]


@pytest.mark.slow
def test_a_batch_keeps_the_verdict_of_each_log(
    scan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pq = pytest.importorskip("pyarrow.parquet")
    drawing = tmp_path / "drawing.toml"
    store = tmp_path / "store"
    words = ["batch", scan, "--tip-radius", f"{TIP} m", "--tip-sd", "0 m", "--out", store, "--quick", "--workers", "1"]
    for limit in ("20 um", "60 um"):  # the same file's name, another drawing: another run
        drawing.write_text(DRAWING.format(limit=limit).replace("ridge", "any"))
        for _ in range(2):  # what stands in the store is told as what is new
            assert explore3d_main(monkeypatch, *words, "--tolerances", drawing) == 0
            assert f"tolerances: 1 {FAIL if limit == '20 um' else PASS}" in capsys.readouterr().out
    assert explore3d_main(monkeypatch, *words) == 0
    assert sorted(map(str, pq.read_table(store / "runs")["tolerances"].to_pylist())) == ["None", FAIL, PASS]


def test_those_of_a_scene_are_read_too(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text('schema = "explore3d/scene/1"\n' + DRAWING.format(limit="1 mm"))
    assert read_tolerances(path) == (Tolerance("ridge", "height", 1e-3),)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (None, "cannot read tolerances from it: No such file"),
        ("x =", "is not TOML"),
        ("", "holds no [[tolerance]] table"),
        (DRAWING.format(limit="1 mm").replace("ridge", "rige"), "tolerance[0].kind: should be 'any', 'ridge'"),
        (DRAWING.format(limit="1 mm") + 'units = "mm"', "unknown key"),
        (DRAWING.format(limit="1 mm").replace("limit", "least").replace("1 mm", "0 m"), "give limit (at most)"),
    ],
)
def test_a_file_that_says_nothing_possible_is_one_line(
    scan: Path, tmp_path: Path, text: str | None, complaint: str
) -> None:
    path = tmp_path / "drawing.toml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(UserError) as error:
        explore3d.analyze(scan, tmp_path / "out", tip_radius=TIP, tolerances=path)
    assert complaint in str(error.value) and "drawing.toml" in str(error.value) and "\n" not in str(error.value)
    assert not (tmp_path / "out").exists()
