"""Fusion: one trace from a stage that says where it is and a sensor that says what it feels, each on its clock."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

import numpy as np

from hw.grbl import Report
from mapping import BoolArray, FloatArray

# A report that took longer than usual by this, s, came late to a busy host: nobody knows when it was true
LATE = 5e-4
# A machine stands on its steps, and the line that it was sent along goes between them: each axis is half a step off at
# either end, and a step between; three axes, in steps
OFF_THE_LINE_STEPS = 2.0
# The noise of a sample and the half of its neighbours' exceeds so many standard deviations once in 1e15
LONE = 8.0 * 1.5**0.5
# A sample is judged by so many before it and behind it
JUDGED_BY = 2


def prompt(reports: Sequence[Report]) -> list[Report]:
    """The reports whose round trip took hardly longer than is usual: those that their stamps can be trusted of."""
    trips = [report.round_trip for report in reports if report.round_trip < np.inf]
    usual = float(np.median(trips)) if trips else 0.0
    return [report for report in reports if report.round_trip <= usual + LATE]


def on_the_way(
    times: FloatArray,
    places: FloatArray,
    sent: FloatArray,
    ends: FloatArray,
    along: FloatArray,
    queued: int,
    off: float,
) -> BoolArray:
    """(M,) which reports are believed: those on the straight ways between the places where it was sent, in order.

    A stage goes exactly where it is sent, and never back along its path; a digit garbled on the way puts it aside, or
    before what it reports next. Of all that disagree in order the fewest are left out.

    Args:
        times, places: (M,) s and (M, 3) m of the reports.
        sent: (K,) when it was sent, s, to each of the places `ends` (K, 3) m in turn; the first is where it stood.
        along: (K,) how far along the path each of these is; never less than before.
        queued: at most so many ways are under way or waiting.
        off: farthest from the line that it was sent along, m.
    """
    last = np.maximum(np.searchsorted(sent, times) - 1, 0)
    nearest, reached = np.full(len(times), np.inf), np.zeros(len(times))
    for back in range(queued):
        end = np.maximum(last - back, 0)
        begin = np.maximum(end - 1, 0)
        way = ends[end] - ends[begin]
        square = np.einsum("ij,ij->i", way, way)
        share = np.einsum("ij,ij->i", places - ends[begin], way) / np.where(square > 0.0, square, 1.0)
        share = np.clip(share, 0.0, 1.0)
        distance = np.linalg.norm(places - ends[begin] - share[:, None] * way, axis=1)
        nearer = distance < nearest
        nearest = np.where(nearer, distance, nearest)
        reached = np.where(nearer, along[begin] + share * (along[end] - along[begin]), reached)
    keep = nearest <= off
    keep[keep] = _rising(reached[keep])
    return keep


def _rising(values: FloatArray) -> BoolArray:
    """(N,) a longest part of the values (N,) that never falls. Reference: Fredman, Discrete Math. 11, 29 (1975)."""
    tails: list[float] = []  # the lowest value at which a rising part of each length ends
    ends: list[int] = []  # and where it stands
    before = np.full(len(values), -1)
    for i, value in enumerate(values.tolist()):
        length = bisect_right(tails, value)
        before[i] = ends[length - 1] if length else -1
        tails[length : length + 1], ends[length : length + 1] = [value], [i]
    keep, i = np.zeros(len(values), dtype=bool), ends[-1] if ends else -1
    while i >= 0:
        keep[i] = True
        i = before[i]
    return keep


def no_spikes(forces: FloatArray, noise: FloatArray) -> BoolArray:
    """(N,) whether a sample (N, 3), N, lies where its neighbours lead, but for their noise (3,): else it was garbled.

    Of the two before it and the two behind it the lowest and the highest say nothing: one of them may be garbled, too.
    What has fewer neighbours on either side cannot be judged, and is not kept.
    """
    keep = np.zeros(len(forces), dtype=bool)
    if len(forces) > 2 * JUDGED_BY:
        near = np.sort(np.stack([forces[:-4], forces[1:-3], forces[3:-1], forces[4:]]), axis=0)[1:3]
        off = np.abs(forces[JUDGED_BY:-JUDGED_BY] - near.mean(axis=0))
        keep[JUDGED_BY:-JUDGED_BY] = (off <= np.ptp(near, axis=0) + LONE * noise).all(axis=1)
    return keep


def positions_at(times: FloatArray, reported: FloatArray, positions: FloatArray) -> FloatArray:
    """(N, 3) stage positions at times (N,) s, between the reports (M,) s, (M, 3) m; NaN outside of them."""
    inside = (times >= reported[0]) & (times <= reported[-1])
    found = np.column_stack([np.interp(times, reported, positions[:, k]) for k in range(3)])
    found[~inside] = np.nan
    return found


def known_at(
    times: FloatArray,
    reported: FloatArray,
    doubts: FloatArray,
    positions: FloatArray,
    normals: FloatArray,
    longest: float,
    apart: float,
) -> BoolArray:
    """(N,) whether the reports tell where the stage was across the surface, and not only where along it.

    Between two reports the stage may have turned, or stood for a while, and a report may have been true sooner than it
    came: that matters as far as they differ along the normal.

    Args:
        times: (N,) s.
        reported, doubts, positions: (M,) s, (M,) s and (M, 3) m of the reports: how much longer than need be each took.
        normals: (N, 3) unit normals of the contact.
        longest: time between two reports that hides nothing, s.
        apart: distance along the normal that hides nothing, m.
    """
    after = np.clip(np.searchsorted(reported, times), 1, len(reported) - 1)
    between = np.abs(np.einsum("ij,ij->i", positions[after] - positions[after - 1], normals))
    lasted, doubt = reported[after] - reported[after - 1], np.maximum(doubts[after], doubts[after - 1])
    hidden = np.where(lasted <= longest, np.minimum(doubt / np.maximum(lasted, 1e-9), 1.0) * between, between)
    return np.asarray(hidden <= apart)


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
