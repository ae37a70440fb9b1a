"""What stands off a fitted base and is wider than fine features: told once, where it is; nothing is told of noise."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from in_process import explore3d_main

from mapping import FloatArray, Trace
from mapping.base import LaidTrace, fit_base
from mapping.detection import detect
from mapping.estimate.deviation import LeftStanding, left_standing

TIP, NOISE = 2e-6, 5e-9


def hollow(x: FloatArray) -> FloatArray:
    """A parabola 100 um wide and 1.5 um deep: 50 tip radii wide, it has no edge that a tip would notice."""
    return -1.5e-6 * np.clip(1.0 - (x / 50e-6) ** 2, 0.0, None)


def bare(x: FloatArray) -> FloatArray:
    return np.zeros_like(x)


def raster(heights: Callable[[FloatArray], FloatArray], rng: np.random.Generator, reach: int = 1) -> Trace:
    """Rows of 1 mm, 20 um apart; noise is correlated over `reach` samples."""
    x, rows = np.arange(-0.5e-3, 0.5e-3, 1e-6), 11
    centers = []
    for row in range(rows):
        noise = np.convolve(rng.normal(0.0, NOISE, len(x) + reach - 1), np.ones(reach) / np.sqrt(reach), "valid")
        centers.append(np.column_stack([x, np.full_like(x, 20e-6 * row), TIP + heights(x) + noise]))
    sweep = np.repeat(np.arange(rows), len(x))
    return Trace(np.arange(len(sweep)) / 1e3, np.concatenate(centers), sweep, TIP)


def standing(trace: Trace) -> list[LeftStanding]:
    base = fit_base(trace)
    laid = LaidTrace.of(trace, base)
    detect(laid, base)
    return left_standing(laid)


@pytest.mark.slow
def test_a_wide_hollow_across_a_raster_is_one_with_its_depth_and_width() -> None:
    (found,) = standing(raster(hollow, np.random.default_rng(1)))
    assert found.sweeps == 11 and abs(found.place[0]) < 10e-6
    assert found.height == pytest.approx(-1.5e-6, rel=0.02)
    # at half of the depth of a parabola: 100 um / sqrt 2
    assert found.width == pytest.approx(70.7e-6, rel=0.05)


@pytest.mark.parametrize("reach", [1, pytest.param(20, marks=pytest.mark.slow)])
def test_of_noise_alone_nothing_is_told(reach: int) -> None:
    told = [len(standing(raster(bare, np.random.default_rng(seed), reach))) for seed in range(2)]
    assert told == [0, 0]


@pytest.mark.slow
def test_the_command_finds_it_on_a_raster_as_on_a_profile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    trace = raster(hollow, np.random.default_rng(2))
    table = tmp_path / "raster.csv"
    rows = 1e3 * (trace.centers - [0.0, 0.0, TIP])
    table.write_text("x [mm],y [mm],z [mm]\n" + "".join(f"{x:.4f},{y:.4f},{z:.7f}\n" for x, y, z in rows))
    words = ("analyze", table, "--tip-radius", "2 um", "--quick", "--out", tmp_path / "out", "--no-report")
    assert explore3d_main(monkeypatch, *words) == 0
    text = capsys.readouterr().out
    assert "1 feature found" in text and "groove-1: height -1.5" in text
    assert "stands off the base" not in text  # what is a feature is not said once more


@pytest.mark.slow
def test_a_hollow_is_not_as_deep_as_its_noisiest_place() -> None:
    """Its deepest place, of eleven sweeps, came out a quarter too deep where noise is a twelfth of the depth."""

    def shallow(x: FloatArray) -> FloatArray:
        return hollow(x) / 25.0

    (found,) = standing(raster(shallow, np.random.default_rng(2)))
    assert found.height == pytest.approx(-0.06e-6, rel=0.06)
