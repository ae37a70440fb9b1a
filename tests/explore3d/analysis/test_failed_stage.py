"""A stage that cannot do its work costs what it makes, not what the others made."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from in_process import explore3d_main
from small_profiles import write_profile

from explore3d.analysis import method
from mapping import EnvelopeError


def test_a_trace_without_a_surface_keeps_its_features_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def contradicting(*_: Any, **__: Any) -> None:
        raise EnvelopeError("every contact lies inside another ball")

    monkeypatch.setattr(method, "estimate_surface", contradicting)
    out = tmp_path / "out"
    words = ("analyze", write_profile(tmp_path / "a.csv", 1), "--tip-radius", "2 um", "--out", out)
    assert explore3d_main(monkeypatch, *words) == 0
    text = capsys.readouterr().out
    assert "Warning: there is no estimated surface: every contact lies inside another ball." in text
    assert "features found" in text and (out / "model.json").exists()
    assert "there is no estimated surface" in (out / "report.html").read_text()
