"""What half and double the finger's time would have led to."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from explore3d.analysis.forecast import forecast, worst_errors
from explore3d.analysis.truth import Comparison, TrueFeature
from explore3d.report.account import _what_time_buys
from mapping.feature import Feature, Interval, Support
from mapping.instrument.noise import Noise
from mapping.trace import Trace

RIDGE = Feature(
    "ridge", np.array([[0.0, 0, 0], [0.01, 0, 0]]), np.tile([0.0, 0, 1], (2, 1)), Interval.normal(1e-3, 1e-5),
    Interval(1e-3, 5e-4, 2e-3), Interval.normal(0.01, 1e-4), Support(50.0, 5), True, 3e-5,
)  # fmt: skip


def analysis(curve: tuple[tuple[float, float], ...] = (), features: tuple[Feature, ...] = (RIDGE,)) -> Any:
    trace = Trace(np.linspace(0.0, 80.0, 9), np.zeros((9, 3)), np.zeros(9), 0.01)
    return SimpleNamespace(
        trace=trace, model=SimpleNamespace(features=features, provenance={}), time_curve=curve,
        detections=SimpleNamespace(noise=Noise(1e-4)),
    )  # fmt: skip


def test_without_the_truth_the_largest_standard_deviation_falls_as_the_root_of_the_time():
    found = forecast(analysis())
    assert found is not None
    assert (found.seconds, found.error, found.exponent) == (80.0, 3e-5, 0.5)
    assert found.half == pytest.approx(3e-5 * np.sqrt(2))
    assert found.double == pytest.approx(3e-5 / np.sqrt(2))
    assert "root of the time" in found.how


def test_with_the_truth_the_run_s_own_curve_tells_the_slope():
    curve = tuple((t, 1e-2 / t) for t in (10.0, 20.0, 40.0, 80.0))
    found = forecast(analysis(curve))
    assert found is not None
    assert found.exponent == pytest.approx(1.0)
    assert (found.half, found.error, found.double) == pytest.approx((2.5e-4, 1.25e-4, 6.25e-5))


def test_an_error_that_grows_is_not_predicted_to_fall():
    found = forecast(analysis(tuple((t, 1e-6 * t) for t in (10.0, 20.0, 40.0, 80.0))))
    assert found is not None
    assert found.half == found.error == found.double


def test_nothing_found_has_no_forecast():
    assert forecast(analysis(features=())) is None


def test_the_worst_errors_are_those_of_what_was_found():
    true = TrueFeature("ridge", RIDGE.axis, 1e-3)
    rows = [Comparison("found", true, RIDGE, axis_rms=2e-5, height_error=-3e-5), Comparison("missed", true)]
    assert worst_errors(rows) == {"found": 1, "missed": 1, "invented": 0, "axis_rms": 2e-5, "height_error": 3e-5}
    assert worst_errors([]) is None
    assert worst_errors([replace(rows[0], axis_rms=4e-5), rows[0]])["axis_rms"] == 4e-5  # type: ignore[index]


def test_where_nobody_recorded_times_no_time_is_told() -> None:
    untimed = analysis()
    untimed.model.provenance["timed"] = False
    found = forecast(untimed)
    assert found is not None and found.seconds is None and found.samples == 9
    assert found.record()["finger_seconds"] is None and found.half == pytest.approx(3e-5 * np.sqrt(2))
    text = " ".join(_what_time_buys(untimed))
    assert "half the path (predicted)" in text and "samples" in text and "min" not in text and " s<" not in text
