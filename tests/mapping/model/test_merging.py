"""Joining the features of two logs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mapping.base.base import Base
from mapping.feature import Feature, Interval, Support
from mapping.model.merging import associate, merge_intervals, merge_model
from mapping.model.object_model import ObjectModel
from mapping.surface import Surface

UP = np.array([0.0, 0.0, 1.0])


def plate():
    corners = np.array([[-0.1, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.1, 0], [-0.1, 0.1, 0]])
    return Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))


def ridge(y, sd=20e-6, x=(-0.02, 0.02), height=0.65e-3, censored=False):
    axis = np.array([[x[0], y, 0], [x[1], y, 0]])
    length = replace(Interval.normal(x[1] - x[0], 0.1e-3), censored=censored)
    sizes = Interval.normal(height, 10e-6), Interval.normal(height, 100e-6), length
    return Feature("ridge", axis, np.tile(UP, (2, 1)), *sizes, Support(30.0, 4, (3,)), True, sd)


def test_the_same_ridge_is_updated_and_another_one_is_added():
    model = ObjectModel.attach(plate(), [ridge(0.0), ridge(0.008)])
    merged = merge_model(model, [ridge(0.00003), ridge(0.02)], "second log")
    assert [feature.id for feature in merged.features] == ["ridge-1", "ridge-2", "ridge-3"]
    first, second, third = merged.features
    assert first.position_sd == pytest.approx(20e-6 / np.sqrt(2))
    assert first.evidence.crossings == 8
    assert first.extra["history"][0]["source"] == "second log"
    assert "history" not in second.extra and third.extra["history"][0]["first seen"]
    assert merged.provenance["merged"] == ["second log"]


def test_the_merged_axis_lies_between_the_two_by_their_precisions():
    model = ObjectModel.attach(plate(), [ridge(0.0, sd=10e-6)])
    new = ridge(40e-6, sd=20e-6, x=(0.02, -0.01))
    merged = merge_model(model, [new], "second log").features[0]
    # weights 4 to 1: 8 um; where the other does not reach, as at its end
    np.testing.assert_allclose(merged.axis[:, 1], 8e-6, atol=1e-12)
    np.testing.assert_allclose(merged.axis[:, 0], [-0.02, 0.02])
    assert merged.position_sd == pytest.approx(20e-6 / np.sqrt(5))


def test_bodies_that_would_share_half_of_themselves_are_one_with_a_doubt():
    # 0.2 mm apart, 0.65 mm wide: 7 standard deviations, but two wires cannot be there
    model = ObjectModel.attach(plate(), [ridge(0.0)])
    (merged,) = merge_model(model, [ridge(0.2e-3)], "second log").features
    assert any("standard deviations apart" in note for note in merged.notes)
    assert merged.position_sd == pytest.approx(0.1e-3, rel=0.01)
    assert len(merge_model(model, [ridge(0.4e-3)], "second log").features) == 2


def test_nothing_is_removed_by_an_empty_log():
    model = ObjectModel.attach(plate(), [ridge(0.0)])
    assert len(merge_model(model, [], "empty").features) == 1


def test_two_ridges_in_one_line_stay_two():
    assert associate([ridge(0.0, x=(-0.05, -0.01))], [ridge(0.0, x=(0.01, 0.05))])[0].known is None


def test_direction_of_travel_does_not_matter():
    new = ridge(0.0)
    turned = replace(new, axis=new.axis[::-1].copy())
    assert associate([new], [turned])[0].known == 0


def test_each_known_feature_is_used_once_and_by_the_closest():
    pairs = associate([ridge(0.0)], [ridge(50e-6), ridge(10e-6)])
    assert [pair.known for pair in pairs] == [None, 0]


def test_a_pose_uncertainty_widens_the_search():
    assert associate([ridge(0.0)], [ridge(0.5e-3)])[0].known is None
    assert associate([ridge(0.0)], [ridge(0.5e-3)], pose_sd=0.5e-3)[0].known == 0


def test_intervals_of_two_logs_have_the_sd_of_their_mean():
    both = merge_intervals(Interval.normal(1.0, 0.1), Interval.normal(1.2, 0.1))
    assert both.median == pytest.approx(1.1)
    assert both.high - both.low == pytest.approx(2 * 1.6448536 * 0.1 / np.sqrt(2))


def test_a_measured_length_replaces_a_bound_and_the_higher_bound_wins():
    bound, value = Interval(1.0, 0.9, 1.1, censored=True), Interval.normal(2.0, 0.1)
    assert merge_intervals(bound, value) is value
    higher = Interval(1.5, 1.4, 1.6, censored=True)
    assert merge_intervals(bound, higher) is higher


def test_merging_twice_keeps_the_whole_history():
    model = ObjectModel.attach(plate(), [ridge(0.0)])
    for name in ("second", "third"):
        model = merge_model(model, [ridge(0.0)], name)
    assert [entry["source"] for entry in model.features[0].extra["history"]] == ["second", "third"]
    assert model.features[0].position_sd == pytest.approx(20e-6 / np.sqrt(3))
