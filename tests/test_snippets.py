"""The Python of the README and the documents runs as it is printed (test_extending.py: docs/extending.md)."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reported_wire import BASE, TIP, ridge, sweeps
from small_profiles import write_profile

from explore3d.scene.examples import copy_example
from hw.move import Move
from mapping.model.object_model import ObjectModel
from mapping.posterior import Posterior

ROOT = Path(__file__).resolve().parents[1]
# Not installed for the tests: what asks for them runs where they are
OTHERS = ("arviz", "polars")


def snippets(page: Path) -> list[str]:
    return re.findall(r"^```python\n(.*?)^```", page.read_text("utf-8"), re.MULTILINE | re.DOTALL)


def a_wire_and_a_scan(folder: Path) -> dict[str, Any]:
    """What `explore3d init wire --example wire_on_plate` wrote, and a recording."""
    copy_example("wire_on_plate", folder / "wire")
    write_profile(folder / "scan.csv")
    return {}


def a_session(folder: Path) -> dict[str, Any]:
    draws = np.random.default_rng(1).normal([6.5e-4, 6.5e-4], 1e-5, (200, 2))
    posterior = Posterior(("height", "width"), ("m", "m"), draws, 5.0, 0.3, "converged", "200 draws")
    about = {"tip_radius": TIP}
    ObjectModel.attach(BASE, (replace(ridge(), posterior=posterior),), provenance=about).save(folder / "out")
    return {}


def a_move_and_its_trace(folder: Path) -> dict[str, Any]:
    trace = next(part for _, part in sweeps().sweeps())
    move = Move(trace.centers[[0, -1]], np.tile([0.0, 0.0, -1.0], (2, 1)), speed=0.03, force=1.0)
    return {"text": 'title = "a wire"\n', "move": move, "trace": trace}


def some_scans(folder: Path) -> dict[str, Any]:
    (folder / "scans").mkdir()
    for seed in range(2):
        write_profile(folder / "scans" / f"{seed}.csv", seed)
    return {}


PREPARED: dict[str, Callable[[Path], dict[str, Any]]] = {
    "README.md": a_wire_and_a_scan,
    "batch.md": some_scans,
    "log.md": a_move_and_its_trace,
    "model.md": a_session,
}


def run_snippets(page: Path, names: dict[str, Any]) -> None:
    """One after another, in the folder where we are; what one has made is there for the next."""
    for number, snippet in enumerate(snippets(page), 1):
        needed = set(re.findall(r"^import (\w+)", snippet, re.MULTILINE)) & {*OTHERS}
        for other in needed:
            pytest.importorskip(other)
        exec(compile(snippet, f"{page.name}, snippet {number}", "exec"), {"__name__": "snippet"} | names)


def test_no_page_with_python_is_forgotten() -> None:
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    assert {page.name for page in pages if snippets(page)} == {*PREPARED, "extending.md"}
    # a block in another dress would be passed over
    other = re.compile(r"^[ \t]*(?:```|~~~)[ \t]*(?:py|python3|Python|pycon)[ \t]*$|^[ \t]+```python", re.MULTILINE)
    assert [page.name for page in pages if other.search(page.read_text("utf-8"))] == []


@pytest.mark.parametrize("name", [pytest.param("batch.md", marks=pytest.mark.slow), "log.md", "model.md"])
def test_what_is_printed_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    run_snippets(ROOT / "docs" / name, PREPARED[name](tmp_path))


@pytest.mark.slow
def test_the_readme_runs_and_prints_what_stands_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = ROOT / "README.md"
    monkeypatch.chdir(tmp_path)
    run_snippets(page, PREPARED[page.name](tmp_path))
    size = r"(ridge-1) ([\d.]+) mm \(([\d.]+) to ([\d.]+)\)"
    told = re.search(f"# {size}", page.read_text("utf-8"))
    said = re.search(f"^{size}$", capsys.readouterr().out, re.MULTILINE)
    assert told and said
    # another processor draws other samples of the posterior: 1 um, a tenth of the interval
    assert [float(each) for each in said.groups()[1:]] == pytest.approx(list(map(float, told.groups()[1:])), abs=1e-3)
