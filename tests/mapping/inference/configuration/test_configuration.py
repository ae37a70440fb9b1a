"""Details that are felt together are one configuration, and the evidence decides which."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import grey_dilation

from explore3d.analysis import TrueFeature
from explore3d.bench.detection import NOISE_SOURCES
from explore3d.bench.detection.classify import noisy, touched, trial
from explore3d.bench.posterior.calibration import plate, record, straight_path
from explore3d.bench.posterior.counts import run_counts
from explore3d.bench.scenes import FIRST_BUILT_WITH, classified_body
from mapping import Details, Feature, Interval, Support, Surface, Trace
from mapping.assembly import assemble
from mapping.base import Base, LaidTrace, fit_base
from mapping.detection import detect
from mapping.inference.configuration import Places, in_words, numbers_in, share_as_told
from mapping.inference.configuration.account import (
    ENDED_EARLY,
    IN_BLOCKS,
    NOT_WEIGHED,
    _beside,
    _Block,
    _holding,
    _improved,
    _known_as,
    _laid_out,
    accounted,
)
from mapping.inference.configuration.configuration import (
    Configuration,
    Part,
    as_bar,
    as_smooth,
    fitted,
    laid,
    part_of,
)
from mapping.inference.configuration.neighbourhood import PARTS_OF_BIN, Neighbourhood, neighbourhood, window_of
from mapping.inference.configuration.proposals import (
    PROPOSALS,
    _course_of,
    as_point,
    chained,
    joined,
    smoother,
    straight,
    straight_lines,
)
from mapping.inference.configuration.search import searched
from mapping.inference.families import Crossing, GrooveShape, SmoothGrooveShape, Surroundings
from mapping.inference.joint import JoinedShape
from mapping.instrument import Noise

SLOW_PAIRS = [pytest.param(body, marks=pytest.mark.slow) for body in ("flat bar", "acute crossing", "wire over a step")]


@pytest.mark.parametrize("body", ["wires 2 mm apart", *SLOW_PAIRS])
def test_neighbours_are_told_apart_and_a_bar_is_not_taken_for_two(body: str) -> None:
    result = trial(body, "apparatus", "two ways", FIRST_BUILT_WITH)
    assert result["right"], result


@pytest.mark.slow
def test_what_stands_off_a_step_that_explains_every_detection_is_looked_for() -> None:
    result = trial("bar on a terrace", "apparatus", "two ways", FIRST_BUILT_WITH + 1)
    assert result["right"], result


def test_an_end_that_one_sweep_alone_felt_belongs_to_its_line() -> None:
    result = trial("flat bar", "apparatus", "one way", FIRST_BUILT_WITH)
    assert result["right"], result


def test_a_ring_is_closed_where_a_line_with_ends_fits_as_well() -> None:
    result = trial("O-ring", "apparatus", "two ways", FIRST_BUILT_WITH + 1)
    assert result["right"], result


def test_a_ring_under_coarse_rows_is_told_along_its_fitted_course() -> None:
    result = trial("O-ring", "none", "one way", FIRST_BUILT_WITH)  # the rules' polygon of nine corners is 6.8 mm off
    assert result["right"], result


@pytest.mark.parametrize(("body", "off"), [("burred groove", 4e-6), ("wire over a step", 90e-6)])
def test_details_together_leave_what_the_ball_feels_of_them(body: str, off: float) -> None:
    # the flank of two crests within a bin is off by 0.02 of their 0.14 mm; the wire climbs the step over half a
    # millimetre, its capsules at once: under a ball that leans by 0.3 a quarter of it is 75 um
    features = [_true(true) for true in classified_body(body, FIRST_BUILT_WITH).truth]
    place = _weighed_on(body, features)
    parts = [part_of(feature, place, 1) for feature in features]
    start = [part.start.copy() for part in parts]
    for part, own, feature in zip(parts, start, features, strict=True):
        if "log depth" in part.shape.names:
            own[-1] = np.log(-2.0 * feature.height.median)  # deeper than the ball sinks
        if "log radius" in part.shape.names:
            own[-1] = np.log(0.5 * feature.height.median)
    shape = JoinedShape([part.shape for part in parts], len(place.window), PARTS_OF_BIN)
    felt = shape.templates(np.concatenate(start)[None])[0]
    inner = np.abs(place.window.height - felt)
    # where a line ends, wires and tubes differ
    ends = np.concatenate([feature.axis[[0, -1]] for feature in features])
    away = np.min(np.linalg.norm(place.window.feet[:, None] - ends[None], axis=2), axis=1) > 4e-3
    assert np.quantile(inner[away], 0.999) < off
    # those that another block holds are felt with them all the same, whichever they are
    for k, part in enumerate(parts):
        others = [other for other in parts if other is not part]
        theirs = np.concatenate([own for m, own in enumerate(start) if m != k])
        beside = JoinedShape([part.shape], len(place.window), PARTS_OF_BIN, [o.shape for o in others], theirs)
        assert np.abs(beside.templates(np.tile(start[k], (2, 1))) - felt).max() < 1e-15


@pytest.mark.slow
def test_where_grooves_cross_is_worked_out_once_for_all_that_differs_in_other_details(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    truth = {true.kind: _true(true) for true in classified_body("burred groove", FIRST_BUILT_WITH).truth}
    groove, burr = truth["groove"], truth["ridge"]
    middle = groove.axis.mean(axis=0)
    across = replace(groove, axis=middle + np.cross(groove.axis - middle, [0.0, 0.0, 1.0]))
    place = _weighed_on("burred groove", [groove, burr])
    parts = [part_of(feature, place, 1) for feature in (groove, across, burr)]
    shape = JoinedShape([part.shape for part in parts], len(place.window), PARTS_OF_BIN)
    theta = np.concatenate([part.start for part in parts])
    batch = theta + np.diag(shape.step)
    rows, heights = [], Crossing.heights

    def counted(crossing: Crossing, taken: Any, tip: float) -> np.ndarray:
        rows.append(max(len(each[-1]) for each in taken))
        return heights(crossing, taken, tip)

    monkeypatch.setattr(Crossing, "heights", counted)
    together = shape.templates(batch)
    assert rows == [1 + len(theta) - len(parts[2].start)]
    for row, found in zip(batch, together, strict=True):
        np.testing.assert_allclose(found, shape.templates(row[None])[0], rtol=0.0, atol=1e-15)
    # and there is something to work out
    apart = sum(part.shape.templates(part.start[None])[0] for part in parts[:2])
    assert np.abs(shape.templates(theta[None])[0] - apart.reshape(-1, PARTS_OF_BIN).mean(axis=1)).max() > 1e-5


@pytest.mark.slow
def test_more_details_than_are_weighed_at_once_are_weighed_beside_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """Five wires in a row, each within the disturbance of the next, in blocks of three."""
    tip, pitch, height, count, together = 5e-3, 2.2e-3, 0.15e-3, 5, 3
    x = np.arange(-10e-3, 10e-3, 20e-6)
    wires = (np.arange(count) - 0.5 * (count - 1)) * pitch
    ball = tip + 0.5 * height
    near = np.clip(np.abs(x[:, None] - wires).min(axis=1), 0.0, np.sqrt(2.0 * tip * height))
    z = np.maximum(np.sqrt(ball**2 - near**2) + 0.5 * height - tip, 0.0)
    rng, sweeps = np.random.default_rng(5), 4
    sweep = np.repeat(np.arange(sweeps), len(x))
    centers = np.column_stack([np.tile(x, sweeps), 1.5e-3 * (sweep - 3.0), tip + np.tile(z, sweeps)])
    centers[:, 2] += 5e-6 * rng.standard_normal(len(centers))
    trace = Trace(1e-3 * np.arange(len(centers)), centers, sweep, tip)
    corners = 0.1 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    base, sizes = Base(Surface(corners, [[0, 1, 2], [0, 2, 3]])), list[int]()

    def counted(parts: Sequence[Part], *rest: Any, **named: Any) -> Configuration | None:
        sizes.append(len(parts))
        return fitted(parts, *rest, **named)

    monkeypatch.setattr(sys.modules[searched.__module__], "fitted", counted)
    monkeypatch.setattr(sys.modules[accounted.__module__], "CROWDED", together)
    features = assemble(detect(trace, base), trace, base, faint=False)
    assert [feature.kind for feature in features] == ["ridge"] * count
    assert np.abs(np.sort([feature.axis[:, 0].mean() for feature in features]) - wires).max() < 0.1e-3
    assert all(IN_BLOCKS in feature.notes for feature in features)
    # two details may be proposed beside those of a block
    assert max(sizes) <= together + 2
    # each proposal has a turn, however few fits are allowed: nothing that would be likelier was left untried
    monkeypatch.setattr(sys.modules[searched.__module__], "MOST_FITTED", 2)
    monkeypatch.setattr(sys.modules[searched.__module__], "FITS_OF_DETAIL", 1)
    bounded = assemble(detect(trace, base), trace, base, faint=False)
    assert [each.kind for each in bounded] == ["ridge"] * count
    assert not any(ENDED_EARLY in each.notes for each in bounded)
    # what is not tried is said
    monkeypatch.undo()
    monkeypatch.setattr(sys.modules[searched.__module__], "MOST_WORK", 1e-3)
    assert all(ENDED_EARLY in each.notes for each in assemble(detect(trace, base), trace, base, faint=False))
    monkeypatch.setattr(sys.modules[accounted.__module__], "MOST_WORK", 1e-3)
    assert all(NOT_WEIGHED in each.notes for each in assemble(detect(trace, base), trace, base, faint=False))


@pytest.mark.slow
def test_what_others_leave_beside_a_detail_is_none_of_its_own() -> None:
    """Four domes of braille whose disturbances do not touch, and reach into the places that each is weighed on."""
    tip, height, foot = 1.5e-3, 0.48e-3, 0.8e-3
    across = np.linspace(-foot, foot, 401)
    dome = np.sqrt(np.maximum(((foot**2 + height**2) / (2.0 * height)) ** 2 - across**2, 0.0))
    dome -= dome[0]
    away = np.linspace(0.0, 2e-3, 401)
    gap = away[:, None] - across
    ball = np.where(np.abs(gap) < tip, np.sqrt(np.maximum(tip**2 - gap**2, 0.0)) - tip, -np.inf)
    felt = np.maximum((dome + ball).max(axis=1), 0.0)
    domes = 1.25e-3 * np.array([[-1.4, -1.4], [1.4, -1.4], [-1.4, 1.4], [1.4, 1.4]]) + 0.03e-3
    x, rows = np.arange(-4.5e-3, 4.5e-3, 80e-6), np.arange(-4.5e-3, 4.5e-3, 0.3e-3)
    sweep = np.repeat(np.arange(len(rows)), len(x))
    plane = np.column_stack([np.tile(x, len(rows)), rows[sweep]])
    near = np.linalg.norm(plane[:, None] - domes, axis=2).min(axis=1)
    z = tip + np.interp(near, away, felt) + 4e-6 * np.random.default_rng(8).standard_normal(len(near))
    trace = Trace(1e-3 * np.arange(len(z)), np.column_stack([plane, z]), sweep, tip)
    corners = 0.1 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    base = Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))
    features = assemble(detect(trace, base), trace, base, faint=False)
    assert [feature.kind for feature in features] == ["bump"] * 4
    assert all(abs(feature.height.median / height - 1.0) < 0.02 for feature in features)
    assert not any(ENDED_EARLY in feature.notes for feature in features)


def test_a_line_laid_as_it_was_felt_is_asked_for_fewer_bends() -> None:
    body = "flat bar"
    (bar,) = (_true(true) for true in classified_body(body, FIRST_BUILT_WITH).truth)
    # crossings that scatter by more than their doubt: no smooth course follows them
    axis = np.linspace(bar.axis[0], bar.axis[-1], 13)
    axis[:, :2] += 6e-4 * np.random.default_rng(0).standard_normal((13, 2))
    jagged = replace(bar, axis=axis, normals=np.tile([0.0, 0.0, 1.0], (13, 1)))
    place = _weighed_on(body, [jagged])
    start = fitted([part_of(jagged, place)], place)
    assert start is not None
    others = [other for parts in smoother(start) if (other := fitted(parts, place)) is not None]
    assert len(others) == 3
    best = max(others, key=lambda other: other.log_odds)
    assert best.log_odds > start.log_odds + 5.0
    assert len(best.shape.names) < len(start.shape.names)
    # a straight line is proposed for one that bends, and for a straight one none
    points = np.linspace(bar.axis[0], bar.axis[-1], 9)
    assert len(list(straight(start, points))) == 1
    assert not list(straight(laid([part_of(bar, place)], place), points))


def test_no_crest_is_proposed_that_is_twice_as_high_as_anything_was_felt() -> None:
    """Without what the base may do under each run, a ball of any size leaves as little as a slope."""
    wires = [_true(each) for each in classified_body("wires 2 mm apart", FIRST_BUILT_WITH).truth]
    place = _weighed_on("wires 2 mm apart", wires)
    parts = [part_of(wire, place) for wire in wires]
    assert laid(parts, place).tops_are_felt
    at, highest = parts[0].shape.names.index("height"), float(np.ptp(place.window.height))
    for share, felt in ((1.9, True), (2.1, False)):
        start = parts[0].start.copy()
        start[at] = share * highest
        assert laid([replace(parts[0], start=start), *parts[1:]], place).tops_are_felt == felt


def test_a_bar_that_is_measured_is_held_beside_what_it_reaches_into() -> None:
    (true,) = classified_body("flat bar", FIRST_BUILT_WITH).truth
    bar = _true(true)
    bar = replace(bar, details=replace(bar.details, free_section=True, top=true.width))
    place = _weighed_on("flat bar", [bar])
    block = _Block([bar], [], frozenset())
    tip = place.around.trace.tip_radius
    assert _beside(block, [block], [bar], tip) == [bar]
    left = [
        float(np.abs(place.window.height - held.joined([]).templates(np.zeros((1, 0)))[0]).max())
        for held in (place, _holding([bar], place))
    ]
    assert left[0] > 0.9 * true.height > 0.2 * true.height > left[1]


def test_what_was_detected_where_others_explain_what_is_felt_is_nothing() -> None:
    (wire,) = (_true(true) for true in classified_body("ridge", FIRST_BUILT_WITH).truth)
    along = (wire.axis[-1] - wire.axis[0]) / np.linalg.norm(wire.axis[-1] - wire.axis[0])
    aside = wire.axis.mean(axis=0) + 2e-3 * np.cross(along, [0.0, 0.0, 1.0])
    edge = replace(wire, kind="step", axis=aside + 5e-3 * np.outer([-1.0, 1.0], along), normals=wire.normals[:2])
    place = _weighed_on("ridge", [edge])
    told = []
    for beside in ([], [wire]):
        block = _Block([edge], [], frozenset())
        parts, start = _laid_out(block.features, _holding(beside, place))
        told.append([each.kind for each in _improved(block, parts, start, place.around, PROPOSALS)[0]])
    assert told[0] and told[1] == []


def test_a_part_of_a_crowd_that_nothing_changed_about_is_not_weighed_twice() -> None:
    lines = [_true(each) for each in classified_body("wires 2 mm apart", FIRST_BUILT_WITH).truth]
    known = [_Block([line], [], frozenset(), cut=True) for line in lines]
    origin = {id(line): k for k, line in enumerate(lines)}
    again = _Block(lines[:1], [], frozenset((0, 1)), cut=True)
    assert _known_as(again, known, origin) is known[0]
    assert _known_as(_Block(lines, [], frozenset((0, 1)), cut=True), known, origin) is None
    known[1].changed = True
    assert _known_as(again, known, origin) is None


def test_pieces_of_a_line_are_joined_with_their_section() -> None:
    body = "burred groove"
    groove = next(_true(true) for true in classified_body(body, FIRST_BUILT_WITH).truth if true.kind == "groove")
    middle, up = groove.axis[[0, -1]].mean(axis=0), np.tile([0.0, 0.0, 1.0], (2, 1))
    pieces = [
        replace(groove, axis=np.stack([groove.axis[0], middle - 1e-3 * np.eye(3)[0]]), normals=up),
        replace(groove, axis=np.stack([middle + 1e-3 * np.eye(3)[0], groove.axis[-1]]), normals=up),
    ]
    more = replace(groove.evidence, snr=groove.evidence.snr + 1.0)  # the whole has the section of what stands out most
    pieces[0] = replace(pieces[0], evidence=more)
    place = _weighed_on(body, [groove])
    first = as_smooth([part_of(pieces[0], place)], 0, place)
    now = laid([first, part_of(pieces[1], place)], place)
    for proposal in (chained, joined):
        wholes = [parts[0] for parts in proposal(now) if len(parts) == 1]
        assert any(type(whole.shape) is SmoothGrooveShape for whole in wholes)
        smooth = next(whole for whole in wholes if type(whole.shape) is SmoothGrooveShape)
        np.testing.assert_array_equal(smooth.start[-3:], first.start[-3:])


def test_pieces_of_a_groove_are_joined_as_one_whose_walls_run_out_too() -> None:
    """Two upright grooves that lie over each other at a slant leave more of such a trace than one upright one does."""
    place, pieces = _upright_grooves((-0.3, -5.0, 0.3, 2.0), (0.3, -2.0, -0.3, 5.0))
    now = laid([part_of(piece, place, 1) for piece in pieces], place)
    whole = {type(parts[0].shape): parts for parts in chained(now) if parts[0].shape.modes.degree == 1}
    assert set(whole) == {GrooveShape, SmoothGrooveShape}
    pair, smooth = fitted(now.parts, place), fitted(whole[SmoothGrooveShape], place)
    assert pair is not None and smooth is not None and smooth.log_odds > pair.log_odds + 10.0


def test_no_lone_groove_is_asked_as_a_closed_one_whose_walls_run_out() -> None:
    place, (groove,) = _upright_grooves((0.0, -5.0, 0.0, 5.0))
    turn = np.linspace(0.0, 1.6 * np.pi, 40)
    course = 3e-3 * np.column_stack([np.cos(turn), np.sin(turn), np.zeros(40)])
    ring = replace(groove, axis=course, normals=np.tile([0.0, 0.0, 1.0], (40, 1)))
    wholes = [parts[0] for parts in chained(laid([part_of(ring, place)], place))]
    assert wholes and all(whole.feature.closed and type(whole.shape) is GrooveShape for whole in wholes)


def test_a_groove_whose_walls_run_out_ends_half_a_mouth_short_of_an_upright_one() -> None:
    place, (groove,) = _upright_grooves((0.0, -5.0, 0.0, 5.0))
    upright = part_of(groove, place, 1)
    smooth = as_smooth([upright], 0, place)
    ends = [part.start[part.shape.names.index("start") :][:2] for part in (upright, smooth)]
    half = 0.5 * np.exp(upright.start[upright.shape.names.index("log width")])
    np.testing.assert_allclose(ends[1] - ends[0], [half, -half], rtol=1e-9)
    place, (short,) = _upright_grooves((0.0, -0.3, 0.0, 0.3))
    smooth = as_smooth([part_of(short, place, 1)], 0, place)
    start, end = smooth.start[smooth.shape.names.index("start") :][:2]
    assert start == end


def _upright_grooves(*courses: tuple[float, float, float, float]) -> tuple[Neighbourhood, list[Feature]]:
    """Grooves along courses (x, y, x, y; mm) of 0.33 x 3 mm over a cosine groove 10.4 mm long, and where they lie."""
    trace, base = _cosine_groove(10e-6, 2)
    up = np.tile([0.0, 0.0, 1.0], (len(trace), 1))
    height, width = Interval(-0.33e-3, -0.35e-3, -0.3e-3), Interval(3e-3, 2e-3, 4e-3)
    length = Interval(10e-3, 9e-3, 11e-3)
    grooves = [
        Feature("groove", 1e-3 * np.array([[x, y, 0.0], [u, v, 0.0]]), up[:2], height, width, length, Support(99.0, 9),
                True, 2e-5)
        for x, y, u, v in courses
    ]  # fmt: skip
    feet, own = trace.centers - [0.0, 0.0, trace.tip_radius], slice(None, None, 10)
    samples = np.ones(len(feet[own]), dtype=np.int64)
    places = Places(feet[own] * [1.0, 1.0, 0.0], up[own], feet[own, 2], samples, trace.sweep[own], 0.2e-3)
    place = neighbourhood(grooves, [], places, Surroundings(trace, base, Noise(10e-6, 0.0, 1e-3)), 0.01)
    assert place is not None
    return place, grooves


def test_a_crest_of_no_height_stands_out_of_no_edge() -> None:
    """A round crest that touches the base where that turns down leaves it there, however low it is."""
    tip, radius, spacing = 3e-3, 1e-3, 0.1e-3
    y, x = (each.ravel() for each in np.meshgrid(np.arange(-5e-3, 5e-3, 1e-3), np.arange(-5e-3, 5e-3, spacing)))
    far = np.abs(x) / np.sqrt(2.0)
    corners = 0.02 * np.array([[0, -1, 0], [0, 1, 0], [1, 1, -1], [1, -1, -1], [-1, 1, -1], [-1, -1, -1]])
    base = Base(Surface(corners, [[0, 3, 2], [0, 2, 1], [0, 1, 4], [0, 4, 5]]))
    normals = np.column_stack([np.sign(x), np.zeros(len(x)), np.ones(len(x))]) / np.sqrt(2.0)
    feet, sweep = np.column_stack([np.sign(x) * far, y, -far]), np.round(1e3 * y).astype(np.int64)
    order = np.lexsort((x, sweep))
    feet, normals, sweep = feet[order], normals[order], sweep[order]
    trace = Trace(1e-3 * np.arange(len(feet)), feet + tip * normals, sweep, tip)
    crest = Feature("ridge", 1e-3 * np.array([[0.0, -4, 0], [0.0, 4, 0]]), np.tile([0.0, 0.0, 1.0], (2, 1)),
                    Interval(50e-6, 40e-6, 60e-6), Interval(50e-6, 20e-6, 1e-3), Interval(8e-3, 7e-3, 9e-3),
                    Support(9.0, 9), True, 1e-4)  # fmt: skip
    places = Places(feet, normals, np.zeros(len(feet)), np.ones(len(feet), dtype=np.int64), sweep, spacing)
    place = neighbourhood([crest], [], places, Surroundings(trace, base, Noise(10e-6, 0.0, 1e-3)), 0.01)
    assert place is not None
    part = part_of(crest, place, 1)
    start = part.start.copy()
    start[[part.shape.names.index(name) for name in ("height", "log radius")]] = 0.0, np.log(radius)
    flat = laid([replace(part, start=start)], place)
    assert flat.template.max() > 0.1e-3  # it reaches out of the edge
    assert flat.strength(0) == 0.0 and laid([part], place).strength(0) > 5.0


def test_pieces_are_one_course_where_they_are_nearest_and_what_runs_beside_it_leads_nowhere() -> None:
    body = "burred groove"
    groove = next(_true(true) for true in classified_body(body, FIRST_BUILT_WITH).truth if true.kind == "groove")
    place, (start, stop) = _weighed_on(body, [groove]), groove.axis[[0, -1]]
    half, along = np.linalg.norm(stop - start) / 2.0, (stop - start) / np.linalg.norm(stop - start)
    aside = 0.5 * place.half_width * np.cross(along, [0.0, 0.0, 1.0])
    # the longest, what goes on before it, and beside the longest what rules told a second time; the far end of the
    # longest is nearer to that than either piece is long
    axes = [
        start + np.array([0.7, 2.0])[:, None] * half * along,
        start + np.array([0.75, 0.0])[:, None] * half * along,
        start + np.array([1.9, 0.8])[:, None] * half * along + aside,
    ]
    now = laid([part_of(replace(groove, axis=axis), place, 1) for axis in axes], place)
    wholes = [parts[0] for parts in chained(now) if len(parts) == 1 and not parts[0].feature.closed]
    assert wholes and len(wholes) == len(list(chained(now)))
    for whole in wholes:
        np.testing.assert_allclose(sorted(whole.feature.axis[[0, -1], 0]), sorted([start[0], stop[0]]), atol=1e-4)
        assert abs(_length(whole.feature) - 2.0 * half) < 1e-4


def test_pieces_shorter_than_they_are_felt_apart_go_on_where_the_last_one_ends() -> None:
    turn = np.linspace(0.0, np.pi, 9)
    arc = 14e-3 * np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    pieces = [arc[k : k + 2] for k in (3, 0, 6, 4, 1, 7, 2, 5)]  # of 5.5 mm, felt 3.6 mm to either side
    course, used = _course_of(pieces, 3.6e-3)
    assert sorted(used) == list(range(8))
    np.testing.assert_allclose(sorted(course[[0, -1], 0]), [-14e-3, 14e-3], atol=1e-9)
    # what lies beside the middle of a piece leads nowhere
    course, used = _course_of([*pieces, 0.8 * arc[4:6]], 3.6e-3)
    assert len(used) == 9 and abs(np.linalg.norm(np.diff(course, axis=0), axis=1).sum() - 43.7e-3) < 2e-4


def _length(feature: Feature) -> float:
    return float(np.linalg.norm(np.diff(feature.axis, axis=0), axis=1).sum())


def test_samples_as_far_apart_as_places_were_felt_at_points() -> None:
    body = "flat bar"
    (bar,) = (_true(true) for true in classified_body(body, FIRST_BUILT_WITH).truth)
    place = _weighed_on(body, [bar], 100)
    part = as_bar(part_of(bar, place, 1), place, bar.width.median)
    part.start[-1] = np.log(0.02 * place.half_width)
    part.start[part.shape.names.index("end rounding")] = 0.0  # it is a box
    shape = JoinedShape([part.shape], len(place.window), PARTS_OF_BIN)
    off = np.abs(place.window.height - shape.templates(part.start[None])[0])
    # means over 0.6 mm were 25 um off where the ball leaves the base
    assert off.max() < 1e-6


def test_a_short_line_that_has_no_course_is_asked_as_the_point_that_it_may_be() -> None:
    # where a body bends the chord of a bump that is told as a line leaves it; here both ends have one foot
    height, tip = 0.4e-3, 10e-3
    x, y = (each.ravel() for each in np.meshgrid(1e-4 * np.arange(-60, 61), 1e-3 * np.arange(-5, 6)))
    points, up = np.column_stack([x, y, 0.0 * x]), np.tile([0.0, 0.0, 1.0], (len(x), 1))
    felt = np.maximum(height - (x**2 + y**2) / (2.0 * tip), 0.0)
    sweep = np.repeat(np.arange(11), 121)
    noise = Noise(1e-6, 0.0, 1e-3)
    places = Places(points, up, felt, np.ones(len(x), dtype=np.int64), sweep, 1e-4)
    trace = Trace(1e-3 * np.arange(float(len(x))), points + (tip + felt)[:, None] * up, sweep, tip)
    around = Surroundings(trace, plate(), noise)
    size = Interval(height, 0.9 * height, 1.1 * height)
    axis = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1e-3]])
    line = Feature("ridge", axis, up[:2], size, size, Interval(1e-3, 5e-4, 2e-3), Support(50.0, 5), True, 1e-4)
    features, _ = accounted([line], [], places, around, 0.01)
    assert [feature.kind for feature in features] == ["bump"]
    assert np.linalg.norm(features[0].axis[0, :2]) < 0.2e-3


def _weighed_on(body: str, features: list[Feature], every: int = 20) -> Neighbourhood:
    """What was felt of a body without noise; one of so many samples, 6 um apart, is kept."""
    scene = classified_body(body, FIRST_BUILT_WITH)
    base, trace = Base(scene.base), touched(body, "two ways", FIRST_BUILT_WITH)
    feet = (trace.centers - [0.0, 0.0, trace.tip_radius]) * [1.0, 1.0, 0.0]
    feet, height, sweep = feet[::every], trace.centers[::every, 2] - trace.tip_radius, trace.sweep[::every]
    up, samples = np.tile([0.0, 0.0, 1.0], (len(feet), 1)), np.ones(len(feet), dtype=np.int64)
    places = Places(feet, up, height, samples, sweep, every * 6e-6)
    place = neighbourhood(features, [], places, Surroundings(trace, base, Noise(1e-6, 0.0, 1e-3)), 0.01)
    assert place is not None
    return place


def _true(true: TrueFeature) -> Feature:
    up = np.tile([0.0, 0.0, 1.0], (len(true.axis), 1))
    size = Interval(true.height, *sorted((0.9 * true.height, 1.1 * true.height)))
    width = Interval(true.width or 0.0, 0.0, 1e-2)
    return Feature(
        true.kind, np.array(true.axis), up, size, width, Interval(0.0, 0.0, 0.0), Support(9.0, 9), True, 1e-4
    )


def test_a_plate_that_bears_nothing_is_given_nothing_to_explain() -> None:
    case = run_counts(FIRST_BUILT_WITH + 10)
    assert case.true == 0 and case.stated == {0: 1.0}


def test_details_that_hide_each_other_are_counted() -> None:
    # a wire of 0.34 mm with another beside it, 0.21 mm high, that the rules took for one wide one
    case = run_counts(FIRST_BUILT_WITH + 57)
    assert case.true == 3 and case.stated[3] > 0.9


@pytest.mark.parametrize(
    ("seed", "true"),
    [
        pytest.param(
            21, 5, marks=pytest.mark.slow
        ),  # a bump of 0.45 mm at the end of a wire of 0.18 mm: added as high as it stood off, it lay beneath
        (24, 3),  # two bumps that three rows feel as one line
    ],
)
def test_details_beside_others_are_counted(seed: int, true: int) -> None:
    case = run_counts(FIRST_BUILT_WITH + seed)
    assert case.true == true and case.stated[true] > 0.9


def test_a_bump_between_two_rows_is_told_where_it_is() -> None:
    # the higher of two bumps 8.6 mm apart lay on a row, where no slope leads off it, and a low ridge told the rest
    case = run_counts(FIRST_BUILT_WITH + 1014)
    assert case.true == 2 and case.stated[2] > 0.9


def test_a_line_that_may_be_a_point_is_one_half_way_along_it() -> None:
    tip, height, half = 10e-3, 0.15e-3, 1e-3
    size, up = Interval(height, height, height), np.tile([0.0, 0.0, 1.0], (2, 1))
    axis = np.array([[-half, 0.0, 0.0], [half, 0.0, 0.0]])
    line = Feature("ridge", axis, up, size, size, Interval(2.0 * half, 0.0, 1.0), Support(9.0, 9), True, 1e-4)
    point = as_point(line, tip)
    assert point is not None and point.kind == "bump"
    np.testing.assert_allclose(point.axis, [[0.0, 0.0, 0.0]])
    # as high as the line where the line ends
    assert point.height.median - half**2 / (2.0 * tip) == pytest.approx(height)
    assert as_point(replace(line, axis=3.0 * axis), tip) is None


def test_where_the_trace_hardly_decides_both_counts_are_stated() -> None:
    seed = FIRST_BUILT_WITH + 1
    scene = classified_body("wires 2 mm apart", seed)
    trace, base = (
        noisy(touched("wires 2 mm apart", "two ways", seed), NOISE_SOURCES["apparatus"], seed),
        Base(scene.base),
    )
    features = assemble(detect(trace, base), trace, base)
    stated = [feature.details.account for feature in features]
    assert stated[0] is not None and all(each == stated[0] for each in stated)
    shares = dict(stated[0])
    assert set(shares) == {"two ridges", "one ridge"} and 0.9 < sum(shares.values()) <= 1.0
    assert Details.read({"account": [list(each) for each in stated[0]]}).account == stated[0]


def test_without_proposals_the_rules_stand() -> None:
    seed = FIRST_BUILT_WITH
    scene = classified_body("wires 2 mm apart", seed)
    trace, base = (
        noisy(touched("wires 2 mm apart", "two ways", seed), NOISE_SOURCES["apparatus"], seed),
        Base(scene.base),
    )
    features = assemble(detect(trace, base), trace, base, proposals=())
    assert [feature.kind for feature in features] == ["ridge"] and features[0].details.account is None


def test_straight_lines_hold_their_points_and_no_others() -> None:
    along = np.linspace(0.0, 10.0, 8)[:, None]
    first, second = along * [1.0, 0.2, 0.0], along * [0.1, 1.0, 0.0] + [20.0, 7.3, 0.0]
    lines = straight_lines(np.concatenate([first, second]), 0.1)
    assert len(lines) == 2
    for line, points in zip(lines, (first, second), strict=True):
        assert min(np.abs(line - points[[0, -1]]).max(), np.abs(line - points[[-1, 0]]).max()) < 1e-9


def test_counts_read_as_people_say_them() -> None:
    assert in_words(("ridge", "ridge", "step")) == "two ridges and one step"
    assert in_words(()) == "nothing"
    for kinds in [(), ("bump",), ("ridge", "ridge", "step"), ("pit",) * 12]:
        assert numbers_in(in_words(kinds)) == Counter(kinds)


def test_a_feature_is_as_probable_as_the_number_that_it_belongs_to() -> None:
    (ridge,) = (_true(true) for true in classified_body("flat bar", FIRST_BUILT_WITH).truth)
    said = (("two ridges", 0.6), ("one ridge", 0.2), ("two ridges and one bump", 0.1), ("nothing", 0.1))
    ridge = replace(ridge, details=Details(account=said))
    assert share_as_told(ridge) == pytest.approx(0.7 / 0.9)
    assert share_as_told(replace(ridge, kind="bump")) == pytest.approx(0.8 / 0.9)
    assert share_as_told(replace(ridge, details=Details())) == 1.0


def test_a_bump_that_runs_out_gently_is_one_with_a_skirt_and_not_several() -> None:
    height, scale, tip = 0.3e-3, 2e-3, 10e-3
    paths = [straight_path((-20e-3, y), (20e-3, y)) for y in np.arange(-20e-3, 20e-3, 3e-3) + 1.1e-3]
    away, reach = np.linspace(0.0, 30e-3, 601), np.linspace(-9.9e-3, 9.9e-3, 1981)
    body = height * np.exp(-0.5 * ((away[:, None] + reach) / scale) ** 2)
    felt = (body + np.sqrt(tip**2 - reach**2) - tip).max(axis=1)
    heights = np.interp(np.linalg.norm(np.concatenate(paths), axis=1), away, felt)
    trace = record(paths, heights + 20e-6 * np.random.default_rng(3001).standard_normal(len(heights)))
    base = plate()
    laid = LaidTrace.of(trace, base)
    assert [feature.kind for feature in assemble(detect(laid, base), laid, base)] == ["bump"]


def test_places_without_a_sample_between_others_end_no_run() -> None:
    """Pecks that lie further apart than places: every second or third place has none."""
    count, spacing = 30, 0.2e-3
    points = np.column_stack([spacing * np.arange(count), np.zeros((count, 2))])
    samples = np.where(np.isin(np.arange(count) % 5, (0, 2)), 1, 0)
    sweep = np.where(np.arange(count) < 20, 1, 2)
    up = np.tile([0.0, 0.0, 1.0], (count, 1))
    window = window_of(Places(points, up, np.zeros(count), samples, sweep, spacing), np.ones(count, dtype=bool))
    # one run of each sweep, at the places' own distances
    np.testing.assert_array_equal(window.starts, [0, 8, 12])
    np.testing.assert_allclose(window.place[:4], spacing * np.array([0.0, 2.0, 5.0, 7.0]))
    # a place that was felt, and lies outside of the neighbourhood, ends one; what is left of three places is none
    inside = np.arange(count) != 10
    parted = window_of(Places(points, up, np.zeros(count), samples, sweep, spacing), inside)
    np.testing.assert_array_equal(parted.starts, [0, 4, 8])


def test_what_only_bounds_a_hollow_is_no_ridge() -> None:
    """A hollow that runs out like a cosine, and under a noise that hides its form: crests of no height along its rims
    hold the ball as its flanks do, and are no features."""
    for seed in (1, 4):
        trace, base = _cosine_groove(30e-6, seed)
        assert [feature.kind for feature in assemble(detect(trace, base), trace, base, faint=False)] == ["groove"]


@pytest.mark.slow
def test_a_groove_whose_walls_run_out_is_asked_as_such_before_anything_is_put_beside_it() -> None:
    trace, base = _cosine_groove(10e-6, 2)
    up = np.tile([0.0, 0.0, 1.0], (len(trace), 1))
    axis, size = 1e-3 * np.array([[0.0, -5.0, 0.0], [0.0, 5.0, 0.0]]), Interval(-0.33e-3, -0.35e-3, -0.3e-3)
    width, length = Interval(3e-3, 2e-3, 4e-3), Interval(10e-3, 9e-3, 11e-3)
    groove = Feature("groove", axis, up[:2], size, width, length, Support(99.0, 11), True, 2e-5)
    feet, height = trace.centers * [1.0, 1.0, 0.0], trace.centers[:, 2] - trace.tip_radius
    places = Places(feet, up, height, np.ones(len(trace), dtype=np.int64), trace.sweep, 20e-6)
    place = neighbourhood([groove], [], places, Surroundings(trace, base, Noise(10e-6, 0.0, 1e-3)), 0.01)
    assert place is not None
    part = part_of(groove, place)
    start = fitted([part], place)
    assert start is not None
    found = searched(start, [part], np.zeros((0, 3)))
    assert found.best.kinds == ("groove",) and found.best.log_odds > start.log_odds + 10.0
    assert isinstance(found.best.parts[0].shape, SmoothGrooveShape)


def _cosine_groove(noise: float, seed: int) -> tuple[Trace, Base]:
    """Rows over a cosine groove 10.4 mm long on a plate, felt across it by brute force."""
    tip, depth, width, sweeps = 3e-3, 0.5e-3, 3.5e-3, 16
    x, fine = np.arange(-8e-3, 8e-3, 20e-6), np.arange(-12e-3, 12e-3, 10e-6)
    ground = -0.5 * depth * (1.0 + np.cos(np.pi * np.clip(np.abs(fine) / (0.5 * width), 0.0, 1.0)))
    aside = x[:, None] - fine
    ball = np.where(np.abs(aside) < tip, np.sqrt(np.maximum(tip**2 - aside**2, 0.0)), -np.inf)
    felt = (ground + ball).max(axis=1) - tip
    corners = 0.1 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    sweep = np.repeat(np.arange(sweeps), len(x))
    y = 1e-3 * (sweep - 0.5 * (sweeps - 1))
    z = tip + np.where(np.abs(y) < 5.2e-3, np.tile(felt, sweeps), 0.0)
    z += noise * np.random.default_rng(seed).standard_normal(len(z))
    trace = Trace(1e-3 * np.arange(len(z)), np.column_stack([np.tile(x, sweeps), y, z]), sweep, tip)
    return trace, Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))


def test_a_roof_whose_gentle_flanks_are_touched_is_one_ridge() -> None:
    """From upright flanks, which are not touched, no descent leads to gentle ones: a second ridge stood for them."""
    tip, fine, rng = 0.5e-3, 2e-6, np.random.default_rng(0)
    grid, x = fine * np.arange(7500), 60e-6 * np.arange(250)
    roof = 0.2e-3 * np.clip(1.0 - np.abs(grid - 7.5e-3) / 0.5e-3, 0.0, None)
    reach = int(tip / fine) - 1
    ball = np.sqrt(tip**2 - (fine * np.arange(-reach, reach + 1)) ** 2)
    height = np.interp(x, grid, grey_dilation(roof, structure=ball, mode="nearest"))
    rows = [np.column_stack([x, np.full(len(x), 1e-3 * k), height]) for k in range(16)]
    centers = np.concatenate(rows) + 1e-7 * rng.standard_normal((16 * len(x), 1)) * np.array([0.0, 0.0, 1.0])
    trace = Trace(np.arange(len(centers)) * 1.0, centers, np.repeat(np.arange(16), len(x)), tip)
    base = fit_base(trace)
    laid_trace = LaidTrace.of(trace, base)
    (ridge,) = assemble(detect(laid_trace, base), laid_trace, base)
    assert ridge.kind == "ridge"


@pytest.mark.parametrize("body", ["burred groove", pytest.param("wire over a step", marks=pytest.mark.slow)])
def test_what_a_row_leaves_depends_on_no_other_row(body: str) -> None:
    """Batches are shared among cores: what is felt with one of them would be another thing with two."""
    features = [_true(true) for true in classified_body(body, FIRST_BUILT_WITH).truth]
    place = _weighed_on(body, features)
    parts = [part_of(feature, place, 1) for feature in features]
    step, rng = np.concatenate([part.shape.step for part in parts]), np.random.default_rng(0)
    theta = np.concatenate([part.start for part in parts]) + 5.0 * step * rng.standard_normal((12, len(step)))
    theta[::3] = theta[0]
    joined_shape = JoinedShape([part.shape for part in parts], len(place.window), PARTS_OF_BIN)
    held = JoinedShape([parts[0].shape], len(place.window), PARTS_OF_BIN, [part.shape for part in parts[1:]],
                       np.concatenate([part.start for part in parts[1:]]))  # fmt: skip
    for shape, rows in ((joined_shape, theta), (held, theta[:, : len(parts[0].start)])):
        apart = np.concatenate([shape.templates(rows[k : k + 1]) for k in range(len(rows))])
        np.testing.assert_array_equal(shape.templates(rows), apart)
