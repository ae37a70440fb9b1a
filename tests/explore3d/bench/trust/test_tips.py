"""Tips that are not as said: what they feel of a wire is what a dilation by brute force says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from explore3d.bench.trust.case import BUILDING
from explore3d.bench.trust.laws import Level
from explore3d.bench.trust.paths import bare_path, plane, wires_on
from explore3d.bench.trust.tip_cases import bench_tips, tip_table
from explore3d.bench.trust.tips import FORCE_NOISE, PRESSED_WITH, WRONG_TIPS, recorded
from explore3d.cli.bench import bench

SAID, RADIUS = 4e-3, 0.1e-3


def beneath(tip: str, x: np.ndarray) -> np.ndarray:
    """How far the tip reaches below its reference at distances x from its axis."""
    size = {"2 % larger": 1.02, "10 % smaller": 0.9}.get(tip, 1.0) * SAID
    ball = np.sqrt(size**2 - x**2)
    if tip == "worn":
        return np.minimum(ball, np.sqrt(size**2 - (0.1 * size) ** 2))
    return 0.95 * ball if tip == "elliptic" else ball


@pytest.mark.parametrize("tip", ["as said", "2 % larger", "10 % smaller", "worn", "elliptic", "yielding"])
def test_a_wire_is_felt_as_its_dilation(tip: str):
    across = np.linspace(-RADIUS, RADIUS, 20_001)
    top = np.sqrt(RADIUS**2 - across**2)
    distance = np.linspace(0.0, 0.3 * SAID, 31)
    brute = [(top + beneath(tip, away + across)).max() for away in distance]
    assert np.abs(WRONG_TIPS[tip].felt(SAID, RADIUS, distance) - brute).max() < 1e-9


def test_a_finger_that_yields_is_recorded_deeper_by_what_it_is_pressed_with():
    said, level = BUILDING.tips[0], Level(1e-12, BUILDING.tips[0])
    path, wires = bare_path("plane", 0.045, said)[0], wires_on(plane(0.045), said, (1,))
    stiff, yielding = (recorded(WRONG_TIPS[name], said, path, wires, level, np.random.default_rng(1))
                       for name in ("as said", "yielding"))  # fmt: skip
    assert stiff.force is None and yielding.force is not None
    given_way = stiff.centers - yielding.centers
    assert given_way[:, 2].mean() == pytest.approx(0.05 * said, rel=0.02)
    # all that is left is what the sensor is off by
    left = given_way - 0.05 * said / PRESSED_WITH * yielding.force
    assert left.std() == pytest.approx(0.05 * said * FORCE_NOISE, rel=0.02)
    assert WRONG_TIPS["yielding"].offset(said) == pytest.approx(-0.05 * said)


@pytest.mark.slow
def test_a_tip_said_too_small_is_named(tmp_path: Path):
    (found,) = bench_tips("building", ["5 % larger"], 1, tmp_path / "tips.jsonl")
    assert "offset" in found["causes"] and found["told_offset"] == pytest.approx(0.05 * found["said"], rel=0.02)
    assert found["found"] == 3 and found["invented"] == 0
    assert "| 5 % larger | 1 | +0.050 | 100 % of 1 |" in tip_table([found])


def test_a_tip_that_is_not_known_is_said_before_anything_runs(tmp_path: Path):
    done = CliRunner().invoke(bench, ["tips", "--store", str(tmp_path / "s.jsonl"), "--tips", "square"])
    assert done.exit_code != 0 and "--tips: unknown 'square'; possible:" in str(done.exception)
