"""Fusion: one trace from a stage that says where it is and a sensor that says what it feels, each on its clock."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

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
) -> tuple[BoolArray, FloatArray]:
    """(M,) which reports are believed: those on the straight ways between the places where it was sent, in order.

    And (M,) how many of these ways lie behind each; a share of a way counts.

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
    nearest, reached, gone = np.full(len(times), np.inf), np.zeros(len(times)), np.zeros(len(times))
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
        gone = np.where(nearer, begin + share * (end - begin), gone)
    keep = nearest <= off
    keep[keep] = _rising(reached[keep])
    return keep, gone


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


@dataclass(frozen=True)
class Progress:
    """How many of the ways that a stage was sent lay behind it at N times, and from where to where it may have been.

    Args:
        likely, least, most: (N,); a share of a way counts. NaN outside of the reports.
    """

    likely: FloatArray
    least: FloatArray
    most: FloatArray


def progress_at(
    times: FloatArray, reported: FloatArray, doubts: FloatArray, ways: FloatArray, period: float
) -> Progress:
    """How far a stage was at times (N,), s, between its reports.

    A way takes one period or more, and what was reported was true when it was asked for or later: so it cannot have
    gone further than this allows since the report before, nor less if it is to be where the next one found it. Where it
    never stood, both are the same.

    Args:
        reported, doubts: (M,) s, when the reports were asked for, and how much longer than need be each took.
        ways: (M,) how many ways lay behind each.
        period: shortest time for a way, s.
    """
    after = np.clip(np.searchsorted(reported, times), 1, len(reported) - 1)
    before = after - 1
    most = np.minimum(ways[after], ways[before] + (times - reported[before]) / period)
    least = np.minimum(
        most,
        np.maximum(*(ways[k] - np.maximum(reported[k] + doubts[k] - times, 0.0) / period for k in (before, after))),
    )
    likely = np.clip(np.interp(times, reported, ways), least, most)
    outside = (times < reported[0]) | (times > reported[-1])
    for values in (likely, least, most):
        values[outside] = np.nan
    return Progress(likely, least, most)


def rows_at(where: FloatArray, known: FloatArray, rows: FloatArray) -> FloatArray:
    """(N, 3) rows between those (M, 3) that are known at rising values (M,), for each of `where` (N,)."""
    return np.column_stack([np.interp(where, known, rows[:, k]) for k in range(3)])


def places_at(ways: FloatArray, ends: FloatArray) -> FloatArray:
    """(N, 3) where a stage was, m, that had gone so many ways (N,) of those that end at `ends` (K, 3), m."""
    return rows_at(ways, np.arange(float(len(ends))), ends)


def known_at(progress: Progress, ends: FloatArray, normals: FloatArray, apart: float) -> BoolArray:
    """(N,) whether it is known where the stage was across the surface, and not only where along it.

    Wherever it may have been on its ways, which end at `ends` (K, 3), m: no two of these places lie further apart than
    `apart`, m, along the normals (N, 3) of the contact.
    """
    inside = np.isfinite(progress.likely)
    least, most, normals = progress.least[inside], progress.most[inside], normals[inside]
    low, high = np.full(len(least), np.inf), np.full(len(least), -np.inf)
    joints = int(np.max(np.ceil(most) - np.floor(least), initial=0.0))
    for ways in (least, most, *(np.clip(np.floor(least) + k, least, most) for k in range(1, joints))):
        height = np.einsum("ij,ij->i", places_at(ways, ends), normals)
        low, high = np.minimum(low, height), np.maximum(high, height)
    known = np.zeros(len(inside), dtype=bool)
    known[inside] = high - low <= apart
    return known


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
