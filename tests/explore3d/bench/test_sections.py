"""Lines that are no half-cylinder: what is said of their sizes is true, a bound, or remarked upon."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from explore3d.bench import bench_sections, section_lines, section_trial
from explore3d.bench.posterior.counts import drawn
from explore3d.bench.scenes import FIRST_BUILT_WITH, SECTION_BODIES, dilated, section_body
from explore3d.bench.sections import JUDGED_OPEN, JUDGED_RIGHT, is_stated
from mapping.geometry.templates import cap_height

SEED = FIRST_BUILT_WITH + 1  # five sweeps


def test_what_is_built_with_and_what_is_reported_differ() -> None:
    built, reported = (section_body("rectangle", seed) for seed in (FIRST_BUILT_WITH, 0))
    assert reported.height == 0.4e-3 and reported.widths == (2e-3, 2e-3)
    assert built.height != reported.height


def test_half_way_up_bars_are_as_wide_as_their_flanks_say() -> None:
    sizes = {
        name: section_body(name, 0).width_half_way for name in ("wire", "trapezoid", "triangle", "V-scratch", "cosine")
    }
    expected = {"wire": 0.65e-3, "trapezoid": 1.7e-3, "triangle": 0.4e-3, "V-scratch": 1.5e-3, "cosine": 1.5e-3}
    assert sizes == pytest.approx(expected, abs=4e-6)


def test_dilation_by_brute_force_finds_the_closed_form_of_a_wire() -> None:
    u = np.linspace(-6e-3, 6e-3, 301)
    wire = section_body("wire", 0)
    np.testing.assert_allclose(
        dilated(wire.profile, wire.half, u, 10e-3), cap_height(u, 0.65e-3, 0.325e-3, 10e-3), atol=1e-6
    )


@pytest.mark.slow
def test_a_bar_gets_its_height_and_bounds_of_its_width(tmp_path: Path) -> None:
    store = tmp_path / "sections.jsonl"
    (record,) = bench_sections(["trapezoid"], ["white"], range(SEED, SEED + 1), store)
    assert record["judged"] == "bounded" and record["height_judged"] == "true"
    assert record["sizes"]["width"][1] < record["true_widths"][0] < record["sizes"]["width"][2]
    # what is in the store is not run again
    assert list(bench_sections(["trapezoid"], ["white"], range(SEED, SEED + 1), store)) == [record]
    lines = list(section_lines([record]))
    assert lines[1].startswith("trapezoid,white,10,1,100,0,1,0,0,0,0,0,100,")
    assert lines[-1] == "remarks on sections of a family that the house has: 0 of 1"


def test_what_was_said_to_be_likely_is_undecided_and_no_error() -> None:
    feature = drawn(np.random.default_rng(0))

    def said(*account: tuple[str, float]) -> list:
        return [replace(feature, details=replace(feature.details, account=account or None))] * 2

    close = said(("two ridges", 0.55), ("one ridge", 0.4), ("one groove", 0.05))
    assert is_stated(close, ["ridge"]) and is_stated(close, ["ridge", "ridge"]) and not is_stated(close, ["groove"])
    assert not is_stated(close, ["bump"])
    assert not is_stated(said(("two ridges", 0.95), ("one ridge", 0.05)), ["ridge"])
    # a further feature that nobody doubts is one too many
    assert not is_stated([*close, feature], ["ridge"]) and not is_stated(said(), ["ridge"])


@pytest.mark.slow
@pytest.mark.parametrize("body", [name for name in SECTION_BODIES if name != "rectangle"])
def test_no_line_gets_sizes_that_are_wrong_and_sure(body: str) -> None:
    # whether five sweeps crossed a bar with filleted edges or two crests this noise lets nobody tell (theory, 5.3)
    open_ = JUDGED_OPEN if body == "filleted" else ()
    record = section_trial(body, "white", SEED)
    assert record["judged"] in JUDGED_RIGHT + open_, record


@pytest.mark.slow
def test_a_line_that_grows_is_remarked_upon() -> None:
    record = section_trial("taper", "white", SEED)
    assert record["flagged"] and "its height varies along it" in " ".join(record["notes"])


@pytest.mark.slow
def test_two_burrs_beside_a_crack_are_two_ridges_and_neither_a_bar_nor_a_play_of_the_axes() -> None:
    record = section_trial("crack with burrs", "10um", FIRST_BUILT_WITH + 2)
    assert record["kinds"] == ["ridge", "ridge"] and not record["flagged"], record
    assert record["sizes"]["height"][0] == pytest.approx(record["true_height"], rel=0.01)
