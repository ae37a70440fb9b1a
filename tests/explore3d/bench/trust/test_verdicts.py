"""Trust: recordings are counted rightly, and one of them is analysed end to end."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from explore3d.bench.trust.case import BUILDING, REPORTED_TRUST, bench_trust, recordings_of, trust_records
from explore3d.bench.trust.paths import TRUST_BODIES, bare_path, wired_path, wires_on
from explore3d.bench.trust.verdicts import VERDICT_HEAD, body_verdicts, law_verdicts, poisson_range, write_trust
from explore3d.cli.bench import bench
from mapping.geometry.mesh import nearest_on
from mapping.geometry.templates import chain_height


def record(law: str, often: int, crossings: int, wires: bool = False) -> dict:
    common = {
        "of": "building",
        "law": law,
        "body": "plane",
        "number": 0,
        "wires": wires,
        "level": 1e-5,
        "cpu": 2.0,
        "tip": 4e-3,
    }
    common |= {"crossings": crossings, "metres": 2.0, "features": [], "warnings": [], "limit": 3e-5}
    if wires:
        inside = {name: [True, False] for name in ("place", "height", "width", "length", "crossing")}
        return common | {"found": 2, "missed": 1, "invented": 1, "inside": inside}
    return common | {"often": often, "often_metres": 2.0, "put": 30, "put_found": 27}


def test_both_sets_have_nothing_in_common():
    assert not set(BUILDING.tips) & set(REPORTED_TRUST.tips) and not set(BUILDING.sizes) & set(REPORTED_TRUST.sizes)
    # ten thousand recordings of each case apart
    assert abs(BUILDING.first_seed - REPORTED_TRUST.first_seed) > 10_000


def test_counts_of_a_law_are_added():
    records = [record("white", 1, 0), record("white", 3, 1), record("white", 0, 0, wires=True), record("1/f", 9, 9)]
    white, pink = law_verdicts(records)
    assert (white.name, white.recordings, white.wired) == ("white", 2, 1)
    assert white.often == (4, 4.0) and white.seldom == (1, 4.0) and white.limit == pytest.approx(3.0)
    assert white.recovered == (54, 60) and white.found == (2, 3) and white.inside["place"] == (1, 2)
    assert white.cpu == pytest.approx(1.0) and not white.row[2].endswith(("!", "?"))
    (plane,) = body_verdicts(records)
    assert plane.name == "plane, 4 mm" and plane.often == (13, 6.0) and plane.wired == 1
    assert pink.row[2].endswith(" ?") and pink.row[3].endswith(" !")  # 4.5 a metre for 1, and for 0.01


def test_the_range_of_a_rate_holds_as_often_as_it_says():
    rng = np.random.default_rng(1)
    ranges = [poisson_range(int(count), 3.0) for count in rng.poisson(6.0, 2000)]
    assert 0.9 <= np.mean([low <= 2.0 <= high for low, high in ranges]) < 0.97


def test_every_body_is_its_own_base_and_wires_stand_on_it():
    for name in ("plane", "cylinder"):
        path, base = bare_path(name, BUILDING.sizes[0], BUILDING.tips[1])
        assert np.abs(base.foot(path.centers, path.tip_radius).height).max() < 1e-9
        wired, base, truth, crests = wired_path(name, BUILDING.sizes[0], BUILDING.tips[1], (1, 2))
        crest = base.foot(wired.centers, wired.tip_radius).height.max()
        assert crest == pytest.approx(max(each.height for each in truth), rel=0.02)
        # sweeps cross a wire where the ball's centre is over it, not where its foot on facets of a degree is
        drawn = wires_on(TRUST_BODIES[name](BUILDING.sizes[0]), BUILDING.tips[1], (1, 2))
        for at, wire in zip(crests, drawn, strict=True):
            beside = np.linalg.norm(np.cross(at - wire.axis, wire.up), axis=1).max()
            assert beside < (1e-9 if name == "plane" else 1.01 * wire.diameter * np.sin(np.radians(0.5)))
    assert len(TRUST_BODIES) == 4


@pytest.mark.slow
def test_a_wire_is_as_high_as_it_stands_over_the_facets_of_a_round_body():
    wired, base, truth, _ = wired_path("sphere", BUILDING.sizes[0], BUILDING.tips[1], (1, 2))
    feet = base.foot(wired.centers, wired.tip_radius)
    for wire in truth:
        near = np.linalg.norm(feet.points - nearest_on(feet.points, wire.axis)[0], axis=1) < 0.5e-3
        tops = [feet.height[near & (wired.sweep == sweep)].max(initial=0.0) for sweep in range(12)]
        crossed = [top for top in tops if top > 0.9 * wire.height]
        # the round body's own surface lies 2 um over its facets
        assert np.mean(crossed) == pytest.approx(wire.height, abs=0.3e-6) and wire.height - wire.width > 1.5e-6


def test_a_wire_is_felt_as_the_round_one_that_its_height_is_held_against():
    tip = BUILDING.tips[1]
    wired, base, truth, _ = wired_path("plane", BUILDING.sizes[0], tip, (1, 2))
    feet = base.foot(wired.centers, tip)
    for wire in truth:
        crest = wire.axis[[0, -1]] + [0.0, 0.0, 0.5 * wire.height]
        round_one = chain_height(feet.points, feet.normals, crest, 0.5 * wire.height, tip)
        under = round_one > 0.0
        # as many samples tell of its height; a tenth of what they leave in doubt under the least level of both sets
        known = min(BUILDING.levels[0], REPORTED_TRUST.levels[0]) * tip / np.sqrt(under.sum())
        assert abs((feet.height - round_one)[under].mean()) < 0.1 * known


def test_a_recording_is_analysed_once_and_told(tmp_path: Path):
    store = tmp_path / "trust.jsonl"
    bare, wired = recordings_of(2.0, 0)
    assert (bare, wired) == (1, 0)
    (found,) = bench_trust("building", ["white"], ["plane"], bare, wired, store)
    assert found["metres"] > 2.0 and found["crossings"] == 0 and found["put_found"] >= 24
    assert not list(bench_trust("building", ["white"], ["plane"], bare, wired, store))
    page, text, figures = write_trust(trust_records(store), "building", tmp_path / "out")
    assert all(name in text.read_text() for name in VERDICT_HEAD) and "<table" in page.read_text()
    assert json.loads(figures.read_text())["verdicts"][0]["name"] == "white"


@pytest.mark.parametrize("option, word", [("--laws", "pink"), ("--bodies", "cube"), ("--set", "mine")])
def test_what_is_not_known_is_said_before_anything_runs(tmp_path: Path, option: str, word: str):
    done = CliRunner().invoke(bench, ["trust", "--store", str(tmp_path / "s.jsonl"), option, word])
    assert done.exit_code != 0 and f"{option}: unknown {word!r}; possible:" in str(done.exception)
