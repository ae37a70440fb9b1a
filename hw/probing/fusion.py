"""Fusion: one trace from a stage that says where it is and a sensor that says what it feels, each on its clock."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hw.grbl import Report
from mapping import BoolArray, FloatArray

# A report that took longer than usual by this, s, came late to a busy host: nobody knows when it was true
LATE = 5e-4
# A machine that stands may be reported so far aside, report units (mm, or inches: then more is let pass): two steps of
# usual motors
STILL = 0.008


def prompt(reports: Sequence[Report]) -> list[Report]:
    """The reports whose round trip took hardly longer than is usual: those that their stamps can be trusted of."""
    usual = float(np.median([report.round_trip for report in reports])) if reports else 0.0
    return [report for report in reports if report.round_trip <= usual + LATE]


def smooth(reports: Sequence[Report]) -> list[Report]:
    """The reports that lie between their neighbours: a digit garbled on the way puts the machine aside for one report.

    Off is what lies farther from the middle between its neighbours than these are apart, and STILL.
    """
    if len(reports) < 3:
        return list(reports)
    places = np.array([report.status.position for report in reports])
    apart = np.linalg.norm(places[2:] - places[:-2], axis=1)
    off = np.linalg.norm(places[1:-1] - 0.5 * (places[2:] + places[:-2]), axis=1)
    keep = np.concatenate([[True], off <= apart + STILL, [True]])
    return [report for report, good in zip(reports, keep, strict=True) if good]


def positions_at(times: FloatArray, reported: FloatArray, positions: FloatArray) -> FloatArray:
    """(N, 3) stage positions at times (N,) s, between the reports (M,) s, (M, 3) m; NaN outside of them."""
    inside = (times >= reported[0]) & (times <= reported[-1])
    found = np.column_stack([np.interp(times, reported, positions[:, k]) for k in range(3)])
    found[~inside] = np.nan
    return found


def known_at(
    times: FloatArray, reported: FloatArray, positions: FloatArray, normals: FloatArray, longest: float, apart: float
) -> BoolArray:
    """(N,) whether the reports tell where the stage was across the surface, and not only where along it.

    Between two reports the stage may have turned, or stood for a while: that matters as far as they differ along
    the normal.

    Args:
        times: (N,) s.
        reported, positions: (M,) s and (M, 3) m of the reports.
        normals: (N, 3) unit normals of the contact.
        longest: time between two reports that hides nothing, s.
        apart: distance along the normal that hides nothing, m.
    """
    after = np.clip(np.searchsorted(reported, times), 1, len(reported) - 1)
    between = np.einsum("ij,ij->i", positions[after] - positions[after - 1], normals)
    return np.asarray((reported[after] - reported[after - 1] <= longest) | (np.abs(between) <= apart))


def rigid_centers(positions: FloatArray, forces: FloatArray, stiffness: float) -> FloatArray:
    """(N, 3) where a rigid ball's centre would be: the tip's carrier, put back by what the tip yields (F / k)."""
    return np.asarray(positions + forces / stiffness)


def estimate_delay(
    reported: FloatArray, heights: FloatArray, times: FloatArray, forces: FloatArray, threshold: float
) -> float:
    """How much later the force is stamped than the position, s, from going into contact and out of it again.

    Contact begins and ends at the same height; a delay makes the one appear lower and the other higher. The
    delay is the shift of the force's time axis that brings the two together.

    Args:
        reported, heights: (M,) times of the stage's reports, s, and heights along the way out of the body, m.
        times, forces: (N,) times of the sensor's samples, s, and force along that way, N.
        threshold: force that counts as contact, N, well above the noise.

    Raises:
        ValueError: the force does not rise above the threshold and fall below it again.
    """
    up, down = _crossings(times, forces, threshold)
    # the speeds are taken on the free side, where the way has not turned yet
    before, after = (reported > up - 0.22) & (reported < up), (reported > down) & (reported < down + 0.22)
    if before.sum() < 2 or after.sum() < 2:
        raise ValueError("the stage must report its position while it goes into contact and out of it")
    speed_in, speed_out = (
        float(np.polyfit(reported[near] - when, heights[near], 1)[0]) for near, when in ((before, up), (after, down))
    )
    gap = float(np.interp(down, reported, heights) - np.interp(up, reported, heights))
    return gap / (speed_out - speed_in)


def _crossings(times: FloatArray, forces: FloatArray, threshold: float) -> tuple[float, float]:
    above = forces > threshold
    rising = np.flatnonzero(~above[:-1] & above[1:])
    falling = np.flatnonzero(above[:-1] & ~above[1:])
    if len(rising) == 0 or len(falling) == 0 or falling[-1] <= rising[0]:
        raise ValueError(f"the force does not rise above {threshold:g} N and fall below it again")
    at: Sequence[int] = (int(rising[0]), int(falling[-1]))
    share = [(threshold - forces[i]) / (forces[i + 1] - forces[i]) for i in at]
    up, down = (float(times[i] + w * (times[i + 1] - times[i])) for i, w in zip(at, share, strict=True))
    return up, down
