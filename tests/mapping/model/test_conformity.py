"""Tolerances: what conforms is proved, what fails is proved, and what was not seen proves nothing."""

from __future__ import annotations

from dataclasses import replace
from math import inf, isnan

import numpy as np
import pytest

from mapping import Feature, Interval, Support
from mapping.model import FAIL, PASS, UNDECIDED, Tolerance, judged

NONE = Interval(0.0, 0.0, 0.0)
RIDGE = Feature(
    kind="ridge",
    axis=np.array([[0.0, 0.0, 0.0], [0.08, 0.0, 0.0]]),
    normals=np.array([[0.0, 0.0, 1.0]] * 2),
    height=Interval.normal(6.5e-4, 1e-5),
    width=Interval.normal(7e-4, 1e-4),
    length=Interval.normal(0.08, 1e-4),
    evidence=Support(30.0, 9),
    curvature_feature=True,
    position_sd=1e-5,
    id="ridge-1",
)
GROOVE = replace(RIDGE, kind="groove", height=Interval.normal(-2.5e-4, 1e-5), id="groove-1")
STEP = replace(RIDGE, kind="step", width=NONE, id="step-1")


def verdict(tolerance: Tolerance, *features: Feature, limit: float = 1e-4, swept: float = 1.0) -> str:
    return judged(features, [tolerance], limit, swept)[0].verdict


def test_a_probability_is_that_of_the_normal_distribution_the_interval_is_of() -> None:
    for sds, share in ((-2.0, 0.02275), (0.0, 0.5), (1.0, 0.84134)):
        below = Tolerance("ridge", "height", 6.5e-4 + sds * 1e-5)
        assert below.probability(RIDGE.height) == pytest.approx(share, abs=1e-5)
    between = Tolerance("ridge", "height", 6.6e-4, 6.4e-4)
    assert between.probability(RIDGE.height) == pytest.approx(0.68269, abs=1e-5)


def test_a_lopsided_interval_keeps_its_own_quantiles() -> None:
    lopsided = Interval(1e-3, 0.9e-3, 1.5e-3)
    for value, share in ((0.9e-3, 0.05), (1e-3, 0.5), (1.5e-3, 0.95)):
        assert Tolerance("any", "width", value).probability(lopsided) == pytest.approx(share, abs=1e-6)


def test_what_is_proved_passes_or_fails_and_the_rest_is_undecided() -> None:
    assert verdict(Tolerance("ridge", "height", 7e-4), RIDGE) == PASS
    assert verdict(Tolerance("ridge", "height", 6e-4), RIDGE) == FAIL
    assert verdict(Tolerance("ridge", "height", 6.55e-4), RIDGE) == UNDECIDED


def test_hollows_are_measured_downwards() -> None:
    assert verdict(Tolerance("groove", "height", inf, 2e-4), GROOVE) == PASS
    assert verdict(Tolerance("groove", "height", inf, 3e-4), GROOVE) == FAIL


def test_one_that_fails_fails_the_part_whatever_others_do() -> None:
    assert verdict(Tolerance("any", "height", 3e-4), RIDGE, GROOVE) == FAIL


def test_many_doubtful_ones_together_prove_nothing() -> None:
    likely = Tolerance("ridge", "height", 6.5e-4 + 1.8e-5)
    assert verdict(likely, RIDGE) == PASS
    assert verdict(likely, *[RIDGE] * 5) == UNDECIDED


def test_what_was_not_seen_does_not_conform() -> None:
    fine = Tolerance("ridge", "height", 5e-5)
    assert verdict(fine) == UNDECIDED
    assert verdict(fine, limit=4e-5) == PASS
    assert verdict(fine, limit=4e-5, swept=0.4) == UNDECIDED
    judgement = judged([], [fine], 1e-4, 0.4)[0]
    assert "lower than 0.1 mm is not seen" in judgement.reason() and "40 % of the surface" in judgement.reason()


def test_a_bound_decides_only_what_lies_beyond_it() -> None:
    bound = Interval(0.05, 0.04, 0.06, censored=True)
    assert Tolerance("ridge", "length", 0.03).probability(bound) <= 0.05
    assert isnan(Tolerance("ridge", "length", 0.05).probability(bound))
    assert verdict(Tolerance("ridge", "length", 0.05), replace(RIDGE, length=bound)) == UNDECIDED


def test_a_size_that_a_kind_has_not_got_is_not_known_of_it_and_not_asked_of_all() -> None:
    assert verdict(Tolerance("step", "width", 1e-3), STEP) == UNDECIDED
    assert judged([STEP, RIDGE], [Tolerance("any", "width", 1e-3)], 1e-4, 1.0)[0].features[0][0] == "ridge-1"


def test_a_record_is_json_and_tells_all() -> None:
    record = judged([RIDGE], [Tolerance("ridge", "height", inf, 6e-4)], 1e-4, 1.0)[0].record()
    assert record["limit"] is None and record["least"] == 6e-4 and record["verdict"] == PASS
    assert record["features"][0]["id"] == "ridge-1" and record["features"][0]["probability"] > 0.99
