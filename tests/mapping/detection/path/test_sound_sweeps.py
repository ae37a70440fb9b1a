"""The ledger of the path: whatever numbers its sweeps bear, a path is inspected as if they were right."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from explore3d.bench.scenes import TIP_RADIUS, plate, wire
from mapping import Feature, FloatArray, IntArray, Trace
from mapping.assembly import assemble
from mapping.base import fit_base
from mapping.detection import detect
from mapping.detection.path import PathLedger, path_ledger, sound_sweeps
from mapping.geometry.templates import step_height

ROUND = 2.0 * np.pi + 0.1
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Drawn:
    """How a path is drawn and felt; lengths in m."""

    spacing: float
    length: float
    pitch: float
    lines: int
    white: float
    seed: int
    corner: float = 0.0  # radius of rounded corners


# The cuts were built on these; the others were drawn afterwards, and judge
BUILT_ON = Drawn(12e-6, 24e-3, 3e-3, 9, 0.1e-3, 7)
ALSO_BUILT_ON = Drawn(8e-6, 19e-3, 1.4e-3, 12, 0.15e-3, 102)
JUDGED_ON = (
    Drawn(17e-6, 31e-3, 2.2e-3, 11, 0.05e-3, 101),
    Drawn(40e-6, 40e-3, 5e-3, 7, 0.02e-3, 103, corner=2e-3),
    Drawn(10e-6, 21e-3, 1.7e-3, 10, 0.13e-3, 104),
    Drawn(25e-6, 27e-3, 2.6e-3, 8, 0.07e-3, 105, corner=0.8e-3),
)


def along(corners: object, spacing: float) -> tuple[FloatArray, FloatArray]:
    """Places (N, 2) at equal steps of a polyline, m, and how far along each is."""
    knots = np.asarray(corners, dtype=np.float64)
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(knots, axis=0), axis=1))])
    at = np.arange(0.0, s[-1], spacing)
    return np.column_stack([np.interp(at, s, knots[:, 0]), np.interp(at, s, knots[:, 1])]), at


def rounded(corners: object, radius: float) -> FloatArray:
    """A polyline whose corners are replaced by the parabolas that touch it a radius before and after."""
    knots = np.asarray(corners, dtype=np.float64)
    if radius == 0.0:
        return knots
    u = np.linspace(0.0, 1.0, 40)[:, None]
    pieces = [knots[:1]]
    for a, b, c in zip(knots[:-2], knots[1:-1], knots[2:], strict=True):
        begin, end = (b + (other - b) * min(radius / np.linalg.norm(other - b), 0.5) for other in (a, c))
        pieces.append((1 - u) ** 2 * begin + 2 * u * (1 - u) * b + u**2 * end)
    return np.concatenate([*pieces, knots[-1:]])


def serpentine(of: Drawn) -> tuple[FloatArray, IntArray]:
    ends = 0.5 * of.length * np.array([-1, 1, 1, -1])
    corners = [[of.pitch * (k - (of.lines - 1) / 2), y] for k in range(of.lines) for y in ends[2 * (k % 2) :][:2]]
    places, _ = along(rounded(corners, of.corner), of.spacing)
    line = np.round(places[:, 0] / of.pitch + (of.lines - 1) / 2).astype(np.int64)
    between = np.abs(places[:, 0] - of.pitch * (line - (of.lines - 1) / 2)) > 0.05 * of.pitch
    way = np.floor(places[:, 0] / of.pitch + (of.lines - 1) / 2).astype(np.int64)
    return places, np.where(between, 2 * way + 1, 2 * line)


def zigzag(of: Drawn) -> tuple[FloatArray, IntArray]:
    corners = [[of.pitch * (k - of.lines / 2), 0.5 * of.length * (-1) ** k] for k in range(of.lines + 1)]
    places, s = along(corners, of.spacing)
    return places, np.floor(s / np.hypot(of.pitch, of.length)).astype(np.int64)


def spiral(of: Drawn) -> tuple[FloatArray, IntArray]:
    """Laps that are numbered from above the wire to above the wire, half a lap each."""
    angle = np.linspace(0.5 * np.pi, 7.5 * np.pi, 100_000)
    radius = 2e-3 + of.pitch * angle / (2 * np.pi)
    places, _ = along(np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]), of.spacing)
    turned = np.unwrap(np.arctan2(places[:, 1], places[:, 0])) - 0.5 * np.pi
    return places, np.floor(np.maximum(turned, 0.0) / np.pi).astype(np.int64)


def passes(of: Drawn) -> tuple[FloatArray, IntArray]:
    places, s = along([[0.0, 0.5 * of.length * (-1) ** k] for k in range(21)], of.spacing)
    return places, np.floor(s / of.length).astype(np.int64)


PATHS = {"serpentine": serpentine, "zigzag": zigzag, "spiral": spiral, "20 passes to and fro": passes}


def traced(places: FloatArray, of: Drawn, number: IntArray | None = None, t: FloatArray | None = None) -> Trace:
    """The path over a plate with a wire on it along x, under one number unless they are given."""
    feet = np.column_stack([places, np.zeros(len(places))])
    height = wire()(feet) + of.white * np.random.default_rng(of.seed).standard_normal(len(feet))
    centers = feet + (TIP_RADIUS + height)[:, None] * UP
    times = 2e-4 * np.arange(float(len(feet))) if t is None else t
    return Trace(times, centers, np.zeros(len(feet)) if number is None else number, TIP_RADIUS)


def inspected(trace: Trace) -> tuple[PathLedger, tuple[Feature, ...]]:
    base = plate()
    sound = sound_sweeps(trace, base)
    found = detect(sound.trace, base)
    return path_ledger(sound, found), assemble(found, sound.trace, base)


@pytest.mark.parametrize(
    "of",
    (JUDGED_ON[0], *(pytest.param(of, marks=pytest.mark.slow) for of in (BUILT_ON, ALSO_BUILT_ON, *JUDGED_ON[1:]))),
    ids=lambda of: f"seed {of.seed}",
)
@pytest.mark.parametrize("name", PATHS)
def test_a_path_under_one_number_is_inspected_and_shows_what_it_shows_with_numbers(name: str, of: Drawn) -> None:
    places, number = PATHS[name](of)
    ledger, found = inspected(traced(places, of))
    base, numbered = plate(), traced(places, of, number)
    expected = assemble(detect(numbered, base), numbered, base)
    length = of.spacing * len(places)
    # arclength goes by chords that may cut one per cent, more where a lap is small
    assert ledger.recorded == pytest.approx(length, rel=0.03)
    assert ledger.inspected > 0.98 * ledger.recorded
    assert [feature.kind for feature in found] == [feature.kind for feature in expected]
    assert len(found) == 1
    assert found[0].height.median == pytest.approx(expected[0].height.median, rel=0.05)
    ends, others = (np.sort(feature[0].axis[[0, -1], 0]) for feature in (found, expected))
    assert ends == pytest.approx(others, abs=0.5 * of.pitch)


def test_sweeps_that_are_numbered_well_are_the_very_same_trace() -> None:
    places, number = serpentine(BUILT_ON)
    base = plate()
    laid = sound_sweeps(traced(places, BUILT_ON, number), base).trace
    assert sound_sweeps(laid, base).trace is laid


@pytest.mark.parametrize("height", [0.7, 3.0])
def test_a_wall_that_the_ball_is_lifted_over_cuts_no_sweep(height: float) -> None:
    x = np.arange(-30e-3, 30e-3, 0.05 * TIP_RADIUS)
    centers = np.column_stack(
        [x, np.zeros_like(x), TIP_RADIUS + step_height(x - 3e-3, height * TIP_RADIUS, TIP_RADIUS)]
    )
    trace = Trace(np.arange(len(x)) * 1e-3, centers, np.zeros(len(x), dtype=np.int64), TIP_RADIUS)
    assert sound_sweeps(trace, plate()).cuts == ()


def test_a_finger_set_down_elsewhere_begins_another_sweep() -> None:
    places, number = serpentine(BUILT_ON)
    lines = number % 2 == 0  # without the ways from line to line
    sound = sound_sweeps(traced(places[lines], BUILT_ON), plate())
    assert sound.cuts == (("jump", BUILT_ON.lines - 1),)
    cuts = np.flatnonzero(np.diff(sound.trace.sweep))
    assert cuts.tolist() == np.flatnonzero(np.diff(number[lines])).tolist()


@pytest.mark.parametrize("few", [3, 4, 7])
def test_a_few_samples_felt_elsewhere_are_a_sweep_of_their_own(few: int) -> None:
    # fewer than a block, and not in a line: a machine that is stopped leaves so many
    places, _ = along([[0.0, 0.0], [24e-3, 0.0]], BUILT_ON.spacing)
    elsewhere = np.array([12e-3, 15e-3]) + BUILT_ON.spacing * np.random.default_rng(0).standard_normal((few, 2))
    sound = sound_sweeps(traced(np.concatenate([places, elsewhere]), BUILT_ON), plate())
    assert sound.cuts == (("jump", 1),)
    assert (sound.trace.sweep[-few:] != sound.trace.sweep[0]).all()


def test_a_gap_that_the_times_tell_of_is_no_cut_and_no_path() -> None:
    places, _ = along([[0.0, -12e-3], [0.0, 12e-3]], BUILT_ON.spacing)
    kept = np.abs(places[:, 1] - 5e-3) > 2e-3
    sound = sound_sweeps(traced(places[kept], BUILT_ON, t=2e-4 * np.flatnonzero(kept)), plate())
    assert sound.cuts == ()
    ledger = path_ledger(sound, detect(sound.trace, plate()))
    assert ledger.recorded == pytest.approx(20e-3, rel=0.01)
    assert ledger.inspected > 0.98 * ledger.recorded


@pytest.mark.parametrize("round_", [0.6, 1.0, 1.1])
def test_an_arc_and_a_circuit_stay_whole(round_: float) -> None:
    angle = np.linspace(0.0, 2 * np.pi * round_, 2000)
    places, _ = along(5e-3 * np.column_stack([np.cos(angle), np.sin(angle)]), BUILT_ON.spacing)
    assert sound_sweeps(traced(places, BUILT_ON), plate()).cuts == ()


def test_a_circuit_along_a_border_stays_whole() -> None:
    border = 12e-3 * np.array([[0.3, -1], [1, -1], [1, 1], [-1, 1], [-1, -1], [0.4, -1]])
    places, _ = along(border, BUILT_ON.spacing)
    assert sound_sweeps(traced(places, BUILT_ON), plate()).cuts == ()


def test_a_number_that_comes_again_is_another_sweep() -> None:
    places, number = serpentine(BUILT_ON)
    sound = sound_sweeps(traced(places, BUILT_ON, number % 2), plate())
    runs = [number for number, _ in sound.trace.sweeps()]
    assert len(set(runs)) == len(runs) == 2 * BUILT_ON.lines - 1


def test_readings_thrown_off_for_a_moment_cut_nothing() -> None:
    places, number = serpentine(BUILT_ON)
    trace = traced(places, BUILT_ON, number)
    centers = trace.centers.copy()
    centers[1000::5000] += [4e-3, 0.0, 1e-3]
    assert sound_sweeps(replace(trace, centers=centers), plate()).cuts == ()


def test_a_finger_that_waits_where_it_turns_is_cut_there_once() -> None:
    there, _ = along([[0.0, -12e-3], [0.0, 12e-3]], BUILT_ON.spacing)
    places = np.concatenate([there, np.repeat(there[-1:], 1500, axis=0), there[::-1]])
    places = places + 1e-6 * np.random.default_rng(8).standard_normal(places.shape)
    sound = sound_sweeps(traced(places, BUILT_ON), plate())
    assert sound.cuts == (("turn", 1),)
    cut = int(np.flatnonzero(np.diff(sound.trace.sweep))[0])
    assert len(there) - 200 < cut < len(there) + 1700


def test_what_lies_beyond_the_base_is_in_the_account() -> None:
    places, number = serpentine(BUILT_ON)
    sound = sound_sweeps(traced(places, BUILT_ON, number), plate())
    ledger = path_ledger(sound, detect(sound.trace, plate()), beyond=len(places) // 4)
    assert ledger.is_short
    assert dict(ledger.left_out)["beyond the base's border"] == pytest.approx(0.2 * ledger.recorded, rel=0.01)
    assert ledger.recorded == pytest.approx(ledger.inspected + sum(length for _, length in ledger.left_out), rel=1e-3)


@pytest.mark.parametrize("seed", [201, 202, 203])
def test_ten_samples_a_sweep_are_used_for_what_they_are_worth(seed: int) -> None:
    """The ball of 10 mm feels the wire over 7 mm: samples 2.4 mm apart are three on it, on each of nine lines."""
    of = replace(BUILT_ON, spacing=2.4e-3, white=0.02e-3, seed=seed)
    lines = [[[of.pitch * (k - 4), y] for y in np.linspace(-12e-3, 12e-3, 10)[:: (-1) ** k]] for k in range(of.lines)]
    ledger, found = inspected(traced(np.concatenate(lines), of))
    assert ledger.shortfall < 0.02
    assert [feature.kind for feature in found] == ["ridge"]


def test_readings_that_were_not_felt_have_their_own_reason() -> None:
    places, number = serpentine(BUILT_ON)
    trace = traced(places, BUILT_ON, number)
    centers = trace.centers.copy()
    off = np.zeros(len(trace), dtype=bool)
    for begin in range(1000, len(trace) - 1000, 4000):
        off[begin : begin + 200] = True
    centers[off, 2] += 2e-3  # a wall that no ball draws
    sound = sound_sweeps(replace(trace, centers=centers), plate())
    found = detect(sound.trace, plate())
    felt = np.ones(len(trace), dtype=bool)
    felt[list(found.unfelt)] = False
    assert (~felt)[off].mean() > 0.9
    kept = sound.trace.within(felt)
    left_out = dict(path_ledger(sound, detect(kept, plate()), felt=felt).left_out)
    (own,) = (length for reason, length in left_out.items() if "no ball of this radius" in reason)
    assert own == pytest.approx(BUILT_ON.spacing * (~felt).sum(), rel=0.2)
    before = dict(path_ledger(sound, detect(kept, plate())).left_out)
    (ends,) = (length for reason, length in before.items() if "ends of sweeps" in reason)
    assert left_out.get("ends of sweeps, and pieces too short for the smallest crest", 0.0) < 0.2 * ends


def test_a_helix_about_a_body_is_cut_once_a_round_where_nothing_was_felt() -> None:
    radius, angle = 20e-3, np.arange(0.0, 8.0 * np.pi, 2e-3)
    away = np.abs(np.angle(np.exp(1j * (angle - 1.3)))) * radius
    out = radius + np.sqrt(np.maximum((2e-3 + 0.1e-3) ** 2 - away**2, 2e-3**2))  # over a wire along the axis
    out += 1e-6 * np.random.default_rng(3).standard_normal(len(angle))
    centers = np.column_stack([out * np.cos(angle), out * np.sin(angle), 2e-3 * angle / (2 * np.pi)])
    trace = Trace(2e-4 * np.arange(float(len(angle))), centers, np.zeros(len(angle)), 2e-3)
    base = fit_base(trace)
    assert base.kind == "cylinder"
    once = trace.select(slice(0, int(2.2 * np.pi / 2e-3)))
    assert sound_sweeps(once, base).cuts == ()
    begins = np.flatnonzero(np.diff(sound_sweeps(trace, base).trace.sweep)) + 1
    assert 3 <= len(begins) <= 7
    assert (np.diff(angle[[0, *begins, -1]]) < ROUND).all()
    assert (away[begins] > 1e-3).all()
