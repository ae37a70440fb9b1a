"""Found features are matched to the true ones, and their errors are what was put in."""

import numpy as np
import pytest

from explore3d.analysis.truth import TrueFeature, compare
from mapping.base.base import Base
from mapping.feature import Feature, Interval, Support
from mapping.model.object_model import ObjectModel
from mapping.surface import Surface

TIP = 0.01
BASE = Base(Surface([[0.0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0]], [[0, 1, 2], [0, 2, 3]]))


def found(kind: str, axis: list[list[float]], height: float = 6.5e-4) -> Feature:
    points = np.array(axis)
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    return Feature(
        kind,
        points,
        np.tile([0.0, 0, 1], (len(points), 1)),
        Interval.normal(height, 2e-5),
        Interval.normal(6e-4, 2e-5),
        Interval.normal(length, 2e-4),
        Support(20.0, 9),
        True,
        1e-5,
    )


def rows(features: list[Feature], truth: list[TrueFeature]):  # type: ignore[no-untyped-def]
    return compare(ObjectModel.attach(BASE, features), truth, TIP)


WIRE = TrueFeature("ridge", [[0.02, 0.05, 0], [0.08, 0.05, 0]], 6.5e-4, 6.5e-4)
BUMP = TrueFeature("bump", [[0.05, 0.02, 0]], 3e-4)


def test_a_shifted_ridge_has_that_shift_as_its_axis_error() -> None:
    (row,) = rows([found("ridge", [[0.021, 0.0502, 0], [0.079, 0.0502, 0]])], [WIRE])
    assert (row.status, row.axis_rms, row.axis_max) == ("found", pytest.approx(2e-4), pytest.approx(2e-4))
    assert row.length_error == pytest.approx(-2e-3) and row.length_inside is False
    assert row.end_error == pytest.approx(np.hypot(1e-3, 2e-4))
    assert row.height_inside is True and row.height_error == pytest.approx(0.0)
    assert row.width_error == pytest.approx(-5e-5) and row.width_inside is False


def test_the_direction_of_an_axis_does_not_matter() -> None:
    forth = rows([found("ridge", [[0.02, 0.0502, 0], [0.08, 0.05, 0]])], [WIRE])[0]
    back = rows([found("ridge", [[0.08, 0.05, 0], [0.02, 0.0502, 0]])], [WIRE])[0]
    assert back.end_error == pytest.approx(forth.end_error) == pytest.approx(2e-4)
    assert back.axis_rms == pytest.approx(forth.axis_rms)


def test_running_past_the_end_is_an_error_of_length_not_of_the_axis() -> None:
    (row,) = rows([found("ridge", [[0.02, 0.05, 0], [0.09, 0.05, 0]])], [WIRE])
    assert row.axis_max == pytest.approx(0.0, abs=1e-12)
    assert row.length_error == pytest.approx(0.01)


def test_missed_and_invented_features_are_told_apart() -> None:
    result = rows(
        [found("bump", [[0.05, 0.08, 0]], 3e-4), found("ridge", [[0.02, 0.05, 0], [0.08, 0.05, 0]])], [WIRE, BUMP]
    )
    assert [row.status for row in result] == ["found", "missed", "invented"]
    assert result[1].true is BUMP and result[2].found is not None and result[2].found.id == "bump-1"


def test_a_fragment_does_not_displace_the_whole() -> None:
    whole = found("ridge", [[0.02, 0.0501, 0], [0.08, 0.0501, 0]])
    piece = found("ridge", [[0.04, 0.05, 0], [0.05, 0.05, 0]])
    result = rows([piece, whole], [WIRE])
    assert result[0].found is not None and result[0].found.id == "ridge-2"
    assert result[1].status == "invented"


def test_a_groove_is_not_taken_for_a_ridge() -> None:
    assert [row.status for row in rows([found("groove", [[0.02, 0.05, 0], [0.08, 0.05, 0]], -6.5e-4)], [WIRE])] == [
        "missed",
        "invented",
    ]


def test_nothing_found_where_nothing_is_makes_no_rows() -> None:
    assert rows([], []) == ()


def test_a_censored_length_contains_every_longer_truth() -> None:
    seen = found("ridge", [[0.02, 0.05, 0], [0.06, 0.05, 0]])
    object.__setattr__(seen, "length", Interval(0.04, 0.0398, float("inf"), censored=True))
    assert rows([seen], [WIRE])[0].length_inside is True


def test_a_depth_that_is_only_bounded_contains_every_deeper_truth() -> None:
    line = [[0.02, 0.05, 0], [0.08, 0.05, 0]]
    hanging = found("groove", line, -4.25e-4)
    object.__setattr__(hanging, "height", Interval(-4.25e-4, -4.31e-4, -4.23e-4, censored=True))
    kept = {depth: rows([hanging], [TrueFeature("groove", line, -depth)])[0].height_inside for depth in (1e-3, 2e-4)}
    assert kept == {1e-3: True, 2e-4: False}
