"""Forecast: the error that half and twice the finger's time would have led to, and how that is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from explore3d.analysis.result import Analysis
from explore3d.analysis.truth import Comparison
from mapping import Feature

# Width of a central 90 % interval of a Gaussian, in standard deviations
SDS_PER_90_INTERVAL = 3.2897
# Points of the run's own curve that a slope needs, and the slopes that are believed
FEWEST_SLOPE_POINTS = 4
STEEPEST_ERROR_SLOPE = 2.0


@dataclass(frozen=True)
class Forecast:
    """Errors over the finger's time.

    Args:
        seconds: of the finger, as it was; None where nobody recorded times.
        samples: as it was.
        error: then, m: the true one where the truth is known, else the largest standard deviation of a feature's
            place or height.
        half, double: the same for half and twice the time, m.
        exponent: error ~ time^-exponent.
        how: one sentence on how it was predicted.
    """

    seconds: float | None
    samples: int
    error: float
    half: float
    double: float
    exponent: float
    how: str

    def record(self) -> dict[str, Any]:
        """JSON values for the model's record."""
        return {
            "finger_seconds": self.seconds, "samples": self.samples,
            "error": self.error, "error_at_half_the_time": self.half,
            "error_at_double_the_time": self.double, "exponent": self.exponent, "how": self.how,
        }  # fmt: skip


def forecast(analysis: Analysis) -> Forecast | None:
    """The forecast of a run or a log; None where nothing was found, or the clock stood.

    Of a log without times the finger's time is not known: what counts is how many samples it gave.
    """
    trace = analysis.trace
    length = float(trace.t[-1] - trace.t[0]) if len(trace) else 0.0
    if not analysis.model.features or length <= 0:
        return None
    spent = (length if analysis.model.provenance.get("timed", True) else None, len(trace))
    curve = [(t, e) for t, e in analysis.time_curve if t > 0 and e > 0]
    if len(curve) >= FEWEST_SLOPE_POINTS:
        t, e = np.log(np.array(curve)).T
        exponent = float(np.clip(-np.polyfit(t, e, 1)[0], 0.0, STEEPEST_ERROR_SLOPE))
        how = f"by the slope of this run's own error over time, {len(curve)} moments of it"
        return _spread(spent, curve[-1][1], exponent, how)
    sd = _largest_sd(analysis.model.features)
    if not (np.isfinite(sd) and sd > 0):
        return None
    how = "from the standard deviations of the posteriors: noise averages out as the root of the time"
    if analysis.detections.noise.correlated_sd > analysis.detections.noise.white:
        how += "; much of this noise is correlated, so that only new passes count, not slower ones"
    return _spread(spent, sd, 0.5, how)


def worst_errors(errors: Sequence[Comparison]) -> dict[str, float] | None:
    """The largest errors of the features that were found, m; None where no truth is known."""
    found = [row for row in errors if row.status == "found"]
    if not errors:
        return None
    worst = {
        name: [abs(value) for row in found if np.isfinite(value := getattr(row, name))]
        for name in ("axis_rms", "axis_max", "end_error", "height_error", "width_error", "length_error")
    }
    counts = {status: float(sum(row.status == status for row in errors)) for status in ("found", "missed", "invented")}
    return counts | {name: float(max(values)) for name, values in worst.items() if values}


def _spread(spent: tuple[float | None, int], error: float, exponent: float, how: str) -> Forecast:
    return Forecast(*spent, error, error * 2.0**exponent, error * 2.0**-exponent, exponent, how)


def _largest_sd(features: Sequence[Feature]) -> float:
    """The largest standard deviation (m) of a place or a height."""
    sizes = [(each.height.high - each.height.low) / SDS_PER_90_INTERVAL for each in features]
    places = [each.position_sd for each in features]
    return float(max(value for value in (*sizes, *places) if np.isfinite(value)))
