"""What is told as one detail and leaves something over is told anew as the crests that explain it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from explore3d.bench.posterior.calibration import plate, record, straight_path
from explore3d.bench.posterior.counts import run_counts
from explore3d.bench.scenes import FIRST_BUILT_WITH
from mapping import Details, Feature, FloatArray, Interval, Support
from mapping.inference.configuration import Places, pursuit
from mapping.inference.configuration.configuration import Configuration, as_bell, fitted, laid, part_of
from mapping.inference.configuration.neighbourhood import neighbourhood
from mapping.inference.configuration.proposals import apart, axis_of, between, retold
from mapping.inference.configuration.pursuit import pursued
from mapping.inference.families import Surroundings
from mapping.inference.kinds import feature_trace
from mapping.instrument import Noise

TIP, SPACING = 10e-3, 0.4e-3


def _crest(axis: list[tuple[float, float]], height: float) -> Feature:
    """A wire or, of one point, a bump of a height (mm) along an axis (mm)."""
    points: FloatArray = 1e-3 * np.column_stack([np.array(axis), np.zeros(len(axis))])
    size, up = Interval(1e-3 * height, 0.8e-3 * height, 1.2e-3 * height), np.tile([0.0, 0.0, 1.0], (len(axis), 1))
    kind = "ridge" if len(axis) > 1 else "bump"
    return Feature(kind, points, up, size, size, size, Support(9.0, 9), True, 1e-4)


def _told_as(one: Feature, true: list[Feature]) -> Configuration:
    """One detail, fitted to rows 3 mm apart over true ones."""
    x, y = (each.ravel() for each in np.meshgrid(np.arange(-12e-3, 12e-3, SPACING), 3e-3 * np.arange(-4, 5)))
    feet, up = np.column_stack([x, y, 0.0 * x]), np.tile([0.0, 0.0, 1.0], (len(x), 1))
    heights = np.max([feature_trace(each, feet, up, TIP) for each in true], axis=0)
    heights += 0.05e-3 * np.random.default_rng(1).standard_normal(len(x))
    trace = record([straight_path((-12e-3, 0.0), (12e-3, 0.0))], np.zeros(4001))
    around = Surroundings(trace, plate(), Noise(0.05e-3, 0.0, 1e-3))
    sweep = np.round(y / 3e-3).astype(np.int64)
    places = Places(feet, up, heights, np.ones(len(x), dtype=np.int64), sweep, SPACING)
    place = neighbourhood([one, *true], [], places, around, 0.01)
    assert place is not None
    told = fitted([part_of(one, place)], place)
    assert told is not None
    return told


def test_two_wires_that_cross_and_were_told_as_one_are_told_anew_as_both() -> None:
    true = [_crest([(-8.0, -7.5), (8.0, 4.0)], 0.4), _crest([(-7.0, 5.0), (8.0, -2.0)], 0.3)]
    told = _told_as(_crest([(-8.0, -7.5), (0.0, 1.0), (8.0, -2.0)], 0.35), true)
    assert not told.fits
    answers = [fitted(parts, told.place) for parts in retold(told)]
    both = max((answer for answer in answers if answer is not None), key=lambda answer: answer.log_odds)
    assert both.fits and both.log_odds > told.log_odds + 50.0 and both.kinds == ("ridge", "ridge")
    ends = sorted(tuple(np.round(1e3 * end[:2]).tolist()) for part in both.parts for end in axis_of(part))
    np.testing.assert_allclose(ends, [(-8.0, -8.0), (-7.0, 5.0), (8.0, -2.0), (8.0, 4.0)], atol=1.0)


def test_a_bump_between_two_rows_is_pursued_where_it_is() -> None:
    true = [_crest([(0.0, -7.5), (0.0, 0.0)], 0.4), _crest([(4.0, 4.2)], 0.5)]
    told = _told_as(_crest([(0.0, -7.5), (0.0, 6.0)], 0.4), true)
    spots = [axis[0] for axis in pursued(told)[0].crests.axes if (axis[0] == axis[1]).all()]
    assert np.linalg.norm(1e3 * np.array(spots)[:, :2] - [4.0, 4.2], axis=1).min() < 0.5


def test_a_step_is_told_as_no_crests() -> None:
    """Fifteen ridges and bumps, one upon the other, leave what a step and a bump do, too."""
    course = [(-1.0, -14.0), (1.0, 14.0)]
    step = replace(_crest(course, 0.5), kind="step", details=Details(high_side=1.0))
    told = _told_as(step, [step, _crest([(-6.0, 0.0)], 0.5)])
    answers = pursued(told)
    assert answers and all(answer.kept == (0,) for answer in answers)


def test_what_leaves_nothing_is_not_told_anew() -> None:
    told = _told_as(_crest([(0.0, -7.5), (0.0, 6.0)], 0.4), [_crest([(0.0, -7.5), (0.0, 6.0)], 0.4)])
    assert told.is_explained and not list(retold(told))


def test_a_line_and_a_bump_that_were_told_as_two_lines_are_counted() -> None:
    case = run_counts(FIRST_BUILT_WITH + 389)
    assert case.true == 3 and not case.left_open and case.stated[3] > 0.9


def test_two_bumps_that_were_told_as_a_short_ridge_begin_where_each_is_felt() -> None:
    true = [_crest([(0.0, -1.3)], 0.4), _crest([(0.6, 1.5)], 0.3)]
    told = _told_as(_crest([(0.0, -1.0), (0.4, 1.2)], 0.35), true)
    (points,) = apart(told)
    begun = 1e3 * np.array([axis_of(part)[0, :2] for part in points])
    np.testing.assert_allclose(begun[np.argsort(begun[:, 1])], [[0.0, -1.3], [0.6, 1.5]], atol=0.7)


def test_a_groove_is_asked_between_ridges_of_any_section() -> None:
    rims = [_crest([(-8.0, y), (8.0, y)], 0.15) for y in (-2.0, 2.0)]
    told = _told_as(rims[0], rims)
    first, second = (part_of(rim, told.place) for rim in rims)
    asked = laid([as_bell(first, 0.5 * told.place.half_width), second], told.place)
    (hollow,) = [parts for parts in between(asked) if len(parts) == 3]
    assert [part.feature.kind for part in hollow] == ["ridge", "ridge", "groove"]


def test_tops_that_two_sweeps_felt_in_one_place_are_spots_there(monkeypatch: pytest.MonkeyPatch) -> None:
    feet, up = 1e-3 * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.eye(3)[2]
    tangents, runs = np.eye(3)[[0, 0, 1, 1]], np.array([0, 2, 4])
    window = SimpleNamespace(feet=feet, starts=runs, normals=np.tile(up, (4, 1)), tangents=tangents)
    around = SimpleNamespace(trace=SimpleNamespace(tip_radius=3e-3))
    place = SimpleNamespace(window=window, half_width=1e-3, around=around)
    monkeypatch.setattr(pursuit, "_tops", lambda now: (np.array([0, 2]), np.array([0.10e-3, 0.11e-3])))
    now: Any = SimpleNamespace(place=place)
    crests = pursuit.crests_of(now)
    assert len(crests) and np.isfinite(crests.axes).all() and np.isfinite(crests.heights).all()
