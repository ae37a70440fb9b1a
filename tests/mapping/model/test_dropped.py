"""What was detected and is no feature of the model stays in its record."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mapping import Details, Dropped, Feature, Interval, Support
from mapping.detection import Crossing
from mapping.model import dropped_crossings, dropped_features


def crossing(x: float, snr: float = 9.0) -> Crossing:
    up, along = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    return Crossing(
        1, 0.0, np.array([x, 0.0, 0.0]), up, along, "convex", 1e-4, 1e-5, 1e-5, 1e-3, 60.0, snr, True, 0, 10
    )


def bump(x: float, log_odds: float) -> Feature:
    height = Interval(1e-4, 0.9e-4, 1.1e-4)
    axis, up = np.array([[x, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]])
    evidence = Support(9.0, 1, log_odds=log_odds)
    return Feature("bump", axis, up, height, height, Interval(0.0, 0.0, 0.0), evidence, True, 1e-5)


def test_a_crossing_that_no_feature_accounts_for_is_kept_with_its_place_and_the_reason() -> None:
    (lone,) = dropped_crossings([crossing(0.0), crossing(8e-3, 30.0)], [bump(1e-4, 50.0)], 10e-3)
    assert lone.snr == 30.0 and lone.point[0] == 8e-3 and lone.log_odds is None
    assert lone.reason.endswith("the nearest, a bump, is 7.9 mm away")
    half = crossing(8e-3)
    (lone,) = dropped_crossings([half], [], 10e-3, [half])
    assert lone.reason.startswith("sweeps begin or end on it")
    assert dropped_crossings([], [], 10e-3) == ()
    assert len(dropped_crossings([crossing(0.0)], [], 10e-3)) == 1


def test_a_row_beside_a_bump_that_runs_out_felt_its_flank() -> None:
    # the paper's bump falls to a tenth of its height at three half widths, where no cap of its width is felt any more
    wide = replace(bump(0.0, 50.0), details=Details(scale=3e-3, exponent=1.0), width=Interval(6e-3, 6e-3, 6e-3))
    flank, tall = crossing(7e-3), crossing(7e-3)
    flank = replace(flank, height=2e-5)
    assert dropped_crossings([flank], [wide], 10e-3) == ()
    assert [each.height for each in dropped_crossings([flank, tall], [wide], 10e-3)] == [tall.height]
    # a cap of that width leaves nothing there, and a hollow is no flank
    assert len(dropped_crossings([flank], [bump(0.0, 50.0)], 10e-3)) == 1
    assert len(dropped_crossings([replace(flank, height=-2e-5)], [wide], 10e-3)) == 1


def test_a_ball_in_the_corner_before_a_ridges_end_stands_on_that_end_though_its_foot_is_on_the_wall() -> None:
    """A wall at x = 0, and on the floor a half-buried wire of 0.3 mm that ends 3.44 mm from it; the ball has 3 mm."""
    tip, radius, end, off = 3e-3, 3e-4, 3.44e-3, 1.5e-4
    height, length = Interval(radius, radius, radius), Interval(2e-2, 2e-2, 2e-2)
    axis = np.array([[end, 0.0, 0.0], [end + 2e-2, 0.0, 0.0]])
    up, evidence = np.tile([0.0, 0.0, 1.0], (2, 1)), Support(50.0, 9, log_odds=50.0)
    details = Details(radius=radius)
    wire = Feature("ridge", axis, up, height, height, length, evidence, True, 1e-5, details=details)
    # so high the ball stands over the floor that it touches the wire's end, off the wall
    high = np.sqrt((tip + radius) ** 2 - (end - tip - off) ** 2)
    wall = replace(crossing(0.0), normal=np.array([1.0, 0.0, 0.0]), height=off)
    before, beside = (replace(wall, point=np.array([0.0, y, high])) for y in (0.0, 2e-3))
    assert np.linalg.norm(before.point - axis[0]) > 4e-3  # farther than anything of it reaches on the floor
    assert dropped_crossings([before], [wire], tip) == ()
    # 2 mm beside it the ball is 0.5 mm off the wire: something else lifted it
    assert [each.point[1] for each in dropped_crossings([before, beside], [wire], tip)] == [2e-3]


def test_a_feature_that_hardly_anything_speaks_for_is_kept_with_its_odds() -> None:
    (dropped,) = dropped_features([bump(0.0, 0.3), replace(bump(1.0, 0.0), evidence=Support(3.0, 1))])
    assert isinstance(dropped, Dropped) and dropped.log_odds == 0.3 and "log odds 0.3" in dropped.reason


def test_lone_crossings_that_were_felt_together_are_told_as_one_at_the_plainest() -> None:
    near, nearer = (replace(crossing(0.0), sweep=k, point=np.array([0.0, 0.8e-3 * k, 0.0])) for k in (2, 3))
    beside = [replace(near, snr=12.0), nearer]
    hollow, far = replace(crossing(0.0), sweep=4, kind="concave"), crossing(5e-3, 20.0)
    together, other, alone = dropped_crossings([crossing(0.0, 8.0), *beside, hollow, far], [], 10e-3)
    assert together.crossings == 3 and together.snr == np.sqrt(8.0**2 + 12.0**2 + 9.0**2)
    assert together.point[1] == 1.6e-3 and (other.kind, other.crossings, alone.crossings) == ("concave", 1, 1)
