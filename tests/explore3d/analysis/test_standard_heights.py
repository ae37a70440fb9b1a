"""Heights by the standards, from a trace with its features: which sections count, and what stands in their place."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from in_process import explore3d_main

from explore3d.analysis import StandardHeight, standard_heights
from mapping import Details, Feature, Interval, Support, Surface, Trace
from mapping.base import Base, LaidTrace

TIP, DEPTH, WIDTH = 2e-6, 1.5e-6, 100e-6
HALF = 1e-3


def plate() -> Base:
    corners = np.array([[-HALF, -HALF, 0.0], [HALF, -HALF, 0.0], [HALF, HALF, 0.0], [-HALF, HALF, 0.0]])
    return Base(Surface(corners, np.array([[0, 1, 2], [0, 2, 3]])), "mesh")


def trace(heights: object, rows: int = 9) -> Trace:
    """Sweeps along x, 50 um apart, of heights over x; noise of 5 nm."""
    x = np.arange(-0.5e-3, 0.5e-3, 0.5e-6)
    rng = np.random.default_rng(2)
    centers = [
        np.column_stack([x, np.full_like(x, y), TIP + heights(x) + rng.normal(0.0, 5e-9, len(x))])  # type: ignore[operator]
        for y in 50e-6 * (np.arange(rows) - rows // 2)
    ]
    sweep = np.repeat(np.arange(rows), len(x))
    return Trace(1e-3 * np.arange(len(sweep)), np.concatenate(centers), sweep, TIP)


def line(kind: str, x: float, height: float, width: float = 0.0, **details: object) -> Feature:
    y = np.linspace(-0.9e-3, 0.9e-3, 7)
    axis = np.column_stack([np.full_like(y, x), y, np.zeros_like(y)])
    exact = [Interval(value, value, value) for value in (height, width, 1.8e-3)]
    up = np.tile([0.0, 0.0, 1.0], (len(y), 1))
    return Feature(
        kind, axis, up, *exact, Support(100.0, 9), False, 1e-7, id=f"{kind}-{x:g}", details=Details(**details)
    )  # type: ignore[arg-type]


def groove(x: np.ndarray) -> np.ndarray:
    return -DEPTH * (np.abs(x) < 0.5 * WIDTH)


def of(features: list[Feature], heights: object = groove) -> list[StandardHeight]:
    return list(standard_heights(LaidTrace.of(trace(heights), plate()), features))


def test_a_groove_with_a_flat_bottom_is_measured_by_a1_and_wolf_agrees() -> None:
    (found,) = of([line("groove", 0.0, -DEPTH, WIDTH, top=0.9 * WIDTH)])
    assert (
        (found.method, found.sections) == ("ISO 5436-1 A1", 9) and found.height is not None and found.wolf is not None
    )
    # a section knows its depth to 5 nm sqrt(1/67 + 1/267), nine of them to a third of that
    assert found.height.median == pytest.approx(-DEPTH, abs=1e-9)
    assert found.height.low < -DEPTH < found.height.high and found.height.high - found.height.low < 2e-9
    assert found.wolf.median == pytest.approx(DEPTH, rel=0.02)


def test_two_steps_that_face_each_other_bound_a_groove() -> None:
    steps = [line("step", side * 0.5 * WIDTH, DEPTH, high_side=-side) for side in (-1.0, 1.0)]
    first, second, between = of(steps)
    for one in (first, second):
        assert one.method == "parallel lines" and one.sections == 9 and one.height is not None and one.wolf is None
        assert one.height.median == pytest.approx(DEPTH, abs=5e-9)
    assert (between.id, between.method) == (f"{steps[0].id} to {steps[1].id}", "ISO 5436-1 A1")
    assert between.height is not None and between.height.median == pytest.approx(-DEPTH, abs=1e-9)


def test_what_the_tip_bridges_has_no_height_and_says_why() -> None:
    (found,) = of([line("groove", 0.0, -DEPTH, 5e-6)])
    assert found.height is None and found.sections == 0 and "bridges 1.9 µm" in found.why_not
    assert found.row()[2] == found.why_not and found.record()["height"] is None


def test_another_detail_in_the_portions_and_a_known_end_nearby_leave_no_section() -> None:
    own = line("groove", 0.0, -DEPTH, WIDTH, top=WIDTH)
    own_height = of([own, line("ridge", 1.2 * WIDTH, 1e-6, 2e-6)])[0]
    assert own_height.height is None and "nothing else" in own_height.why_not
    short = replace(own, axis=own.axis * [1.0, 0.2, 1.0], details=Details(top=WIDTH, ends_seen=(True, True)))
    (near_its_ends,) = of([short])
    assert near_its_ends.sections == 1  # only the middle sweep is 0.15 mm from both ends


def test_the_command_prints_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    x = np.arange(0.0, 2.0, 0.5e-3)
    z = 1e3 * groove(1e-3 * (x - 1.0)) + np.random.default_rng(3).normal(0.0, 5e-6, len(x))
    table = tmp_path / "groove.csv"
    table.write_text("x [mm],z [mm]\n" + "".join(f"{a:.4f},{b:.7f}\n" for a, b in zip(x, z, strict=True)))
    assert explore3d_main(monkeypatch, "roughness", table, "--tip-radius", "2 um") == 0
    text = capsys.readouterr().out
    assert "  pit-1 by ISO 5436-1 A1: -1.5 µm in 1 section; Wolf pruning height 1.5" in text
