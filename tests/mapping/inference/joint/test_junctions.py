"""The one place at which lines meet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from recorded_features import TIP, UP, D, feature, plate

from mapping.feature import Details, Feature, Interval
from mapping.geometry.mesh.polyline import arclengths
from mapping.inference.joint.junctions import brought_together, meetings

HALF_WIDTH = 3.7e-3


def arm(start: np.ndarray, stop: np.ndarray, sd: float = 30e-6, count: int = 9) -> Feature:
    """A refined ridge: its ends known to 0.05 mm, its course to `sd`."""
    found = feature("ridge", np.linspace(start, stop, count), D, D)
    details = Details(axis_sd=np.full(count, sd), end_intervals=np.array([[-5e-5, 5e-5]] * 2), ends_seen=(True, True))
    far = float(np.linalg.norm(np.subtract(stop, start)))
    length = Interval(far, far - 7e-5, far + 7e-5)
    return replace(found, details=details, length=length, junction=True)


def star(hub: np.ndarray, angles: tuple[float, ...] = (10.0, 130.0, 250.0)) -> list[Feature]:
    """Three arms of 30 mm as they were detected: all end in the same point."""
    ways = [np.array([np.cos(a), np.sin(a), 0.0]) for a in np.radians(angles)]
    return [arm(hub, hub + 0.03 * way) for way in ways]


def far(features: list[Feature]) -> list[Feature]:
    """The same with wrong ends at the hub: one goes 1.2 mm too far, one ends 1.5 mm short of it."""
    shifts = [-1.2e-3, 1.5e-3, 0.4e-3]
    ways = [f.axis[-1] - f.axis[0] for f in features]
    begins = [f.axis[0] + s * way / np.linalg.norm(way) for f, s, way in zip(features, shifts, ways, strict=True)]
    return [arm(begin, f.axis[-1]) for begin, f in zip(begins, features, strict=True)]


def together(refined: list[Feature], detected: list[Feature]) -> list[Feature]:
    widths = [HALF_WIDTH] * len(detected)
    return brought_together(refined, meetings(detected, widths), widths, plate(), TIP)


def test_three_arms_end_where_their_courses_cross() -> None:
    hub = np.array([2e-3, -1e-3, 0.0])
    detected = star(hub + np.array([0.4e-3, 0.3e-3, 0.0]))
    found = together(far(star(hub)), detected)
    for one, before in zip(found, star(hub), strict=True):
        np.testing.assert_allclose(one.axis[0], hub, atol=5e-6)
        np.testing.assert_array_equal(one.axis[-1], before.axis[-1])
        assert one.length.median == pytest.approx(0.03, abs=5e-6)
        # the hub is known as well as the courses that cross in it, the other end as before
        assert one.details.end_intervals[0] == pytest.approx([-4e-5, 4e-5], abs=1e-5)
        assert one.details.end_intervals[1].tolist() == [-5e-5, 5e-5]
        assert one.length.high - one.length.median == pytest.approx(np.hypot(5e-5, 4e-5), abs=1e-5)


def test_it_does_not_matter_in_which_order_the_points_of_an_axis_come() -> None:
    hub = np.zeros(3)
    detected, refined = star(hub), far(star(hub))
    turned = [replace(f, axis=f.axis[::-1], normals=f.normals[::-1]) for f in (detected[1], refined[1])]
    plain = together(refined, detected)
    found = together([refined[0], turned[1], refined[2]], [detected[0], turned[0], detected[2]])
    np.testing.assert_allclose(found[1].axis, plain[1].axis[::-1], atol=1e-12)
    assert (found[1].details.end_intervals == plain[1].details.end_intervals[::-1]).all()


def test_a_line_that_ends_on_one_that_goes_on_does_not_end_that_one() -> None:
    long = arm(np.array([-0.03, 0.2e-3, 0.0]), np.array([0.03, 0.2e-3, 0.0]))
    side = arm(np.array([1e-3, 0.0, 0.0]), np.array([1e-3, 0.03, 0.0]))
    short = arm(np.array([1e-3, 1.4e-3, 0.0]), np.array([1e-3, 0.03, 0.0]))
    found = together([long, short], [long, side])
    assert found[0] is long
    np.testing.assert_allclose(found[1].axis[0], [1e-3, 0.2e-3, 0.0], atol=5e-6)


def test_a_course_that_is_known_better_pulls_harder() -> None:
    first = arm(np.zeros(3), np.array([0.03, 0.0, 0.0]), 10e-6)
    second = arm(np.array([0.0, 0.3e-3, 0.0]), np.array([-0.03, 0.3e-3, 0.0]), 100e-6)
    third = arm(np.zeros(3), np.array([0.0, -0.03, 0.0]))
    place = together([first, second, third], star(np.zeros(3), (0.0, 180.0, 270.0)))[0].axis[0]
    assert place[1] == pytest.approx(0.3e-3 / 101, abs=2e-6)


def test_nearly_parallel_lines_keep_the_place_where_they_were_seen_to_meet() -> None:
    first = arm(np.zeros(3), np.array([0.03, 0.0, 0.0]))
    second = arm(np.zeros(3), np.array([-0.03, 1e-6, 0.0]))
    found = together([first, second], [first, second])
    np.testing.assert_allclose(found[0].axis[0], 0.0, atol=1e-6)
    # how far along they meet is known no better than before
    assert found[0].details.end_intervals[0, 1] > 2e-3


def test_lines_that_do_not_meet_and_closed_ones_are_left_alone() -> None:
    one = arm(np.array([2.5e-3, 0.0, 0.0]), np.array([0.03, 0.03, 0.0]))
    turn = np.linspace(0.0, 2.0 * np.pi, 60)
    ring = np.column_stack([0.02 * np.cos(turn) - 0.02, 0.02 * np.sin(turn), 0 * turn])
    ring[-1] = ring[0]
    closed = replace(feature("ridge", ring, D, D), junction=True)
    assert together([one, closed], [one, closed]) == [one, closed]
    # an end that was seen near another line is an end
    apart = [replace(each, junction=False) for each in star(np.zeros(3))]
    assert together(apart, apart) == apart


def test_an_end_that_was_not_seen_is_known_once_it_meets_another_line() -> None:
    hub = np.zeros(3)
    detected, refined = star(hub), far(star(hub))
    note = "the axis goes on beyond what was explored at its first and its last point: at least this long"
    open_ends = replace(refined[0].details, ends_seen=(False, False))
    refined[0] = replace(refined[0], details=open_ends, notes=("junction", note))
    found = together(refined, detected)[0]
    assert found.details.ends_seen == (True, False) and found.length.censored
    assert found.notes == ("junction", note.replace("first and its last", "last"))


def test_the_end_bends_to_the_place_over_its_last_half_width_only() -> None:
    hub = np.array([0.0, 0.2e-3, 0.0])
    detected = star(np.zeros(3), (0.0, 90.0, 270.0))
    exact = [arm(hub, f.axis[-1] + hub, 1e-6) for f in detected[1:]]
    rough = arm(np.zeros(3), np.array([0.03, 0.0, 0.0]), 300e-6, 61)
    crossing = arm(np.array([0.0, 0.2e-3, 0.0]), np.array([-0.03, 0.2e-3, 0.0]), 1e-6)
    found = together([rough, *exact, crossing], [*detected, crossing])[0]
    s = arclengths(found.axis)
    np.testing.assert_allclose(found.axis[0], hub, atol=2e-6)
    assert np.abs(found.axis[s > HALF_WIDTH, 1]).max() < 1e-12
    np.testing.assert_allclose(found.normals, np.tile(UP, (61, 1)), atol=1e-12)
