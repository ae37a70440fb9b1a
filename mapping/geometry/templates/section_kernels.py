"""Compiled traces of lines with a polygon for a section, averaged over the nodes of each bin."""

# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import numpy as np
from numba import njit

from mapping import FloatArray, IntArray
from mapping.geometry.templates.course_kernels import lay_about_course

# Share by which a bound is widened that leaves places out: what it leaves out is zero to the last digit
BOUND_MARGIN = 1e-9


@njit(cache=True, error_model="numpy", nogil=True)
def section_heights(
    s: FloatArray,
    lateral: FloatArray,
    basis: FloatArray,
    bend: FloatArray,
    bend_along: FloatArray,
    courses: FloatArray,
    ends: FloatArray,
    rounded: FloatArray,
    across: FloatArray,
    up: FloatArray,
    shoulders: FloatArray,
    tip: float,
    out: FloatArray,
) -> None:
    """Heights (W, n) of W lines over bins with q nodes; written to `out`.

    Half of the section, which is the same on both sides, has the corners `across` (W, K), from the middle outwards,
    and `up` (W, K), which falls from the crest. The ball rests on the top, on a corner (an arc of its own radius) or on
    a flank (a line parallel to it), whichever holds it highest: dilation distributes over unions. The section goes on
    round the ends, about a top whose corners are rounded in plan: the ball touches it square to its outline, so that
    only the distance from that counts (theory equation 7.3). A section with round edges is a core that a ball was
    rolled along: what the tip feels of it, a tip that is larger by that ball feels of the core. On a curved base
    heights over it are felt as a ball of curvature 1/r + k feels them over a plane, k being the base's in that
    direction.

    Args:
        s, lateral, basis: of the nodes, as for `about_course`.
        bend, bend_along: (n, q) curvatures of the base across and along the line, 1/m.
        courses: (W, m) coefficients of the modes.
        ends: (W, 2) where the top begins and ends along the chart, m.
        rounded: (W,) radius of the corners of the top in plan, up to half of its width, m.
        across, up: (W, K) corners, m.
        shoulders: (W,) radius by which they are rounded, whose top stands as high as they do, m.
        tip: radius of the fingertip, m.
        out: (W, n) heights, m.
    """
    nodes, modes, corners = s.shape[1], basis.shape[1], across.shape[1]
    near = _near(s, lateral, basis, bend, bend_along, courses, ends, across, up, tip + shoulders.max())
    count, first = len(near) * nodes, 0
    # arrays of their own: of rows of one it is not seen that none overlaps another
    felt, along, beside = np.empty((2, modes, count)), np.empty(count), np.empty(count)
    bent, bent_along = np.empty(count), np.empty(count)
    for i in near:
        for q in range(nodes):
            along[first], beside[first] = s[i, q], lateral[i, q]
            bent[first], bent_along[first] = bend[i, q], bend_along[i, q]
            for m in range(modes):
                felt[0, m, first], felt[1, m, first] = basis[0, m, i, q], basis[1, m, i, q]
            first += 1
    place, aside, stretch = np.empty(count), np.empty(count), np.empty(count)
    runs, falls, flanks = np.empty((3, corners))
    out[:] = 0.0
    for w in range(len(out)):
        top, crest, radius = across[w, 0], up[w, 0], tip + shoulders[w]
        least, foot = (1.0 + BOUND_MARGIN) * 2.0 * crest, across[w, corners - 1]
        for k in range(corners - 1):
            runs[k], falls[k] = across[w, k + 1] - across[w, k], up[w, k] - up[w, k + 1]
            flanks[k] = np.sqrt(runs[k] * runs[k] + falls[k] * falls[k])
        lay_about_course(along, beside, felt, courses[w], place, aside, stretch)
        _about_top(bent, bent_along, ends[w], top, rounded[w], radius, place, aside, stretch)
        for b in range(len(near)):
            total = 0.0
            for j in range(b * nodes, (b + 1) * nodes):
                away, ball, best = aside[j], stretch[j], 0.0
                if away > foot and (away - foot) * (away - foot) > least * ball:
                    continue
                if away <= top:
                    best = crest
                for k in range(corners):
                    if up[w, k] <= best:  # neither this corner nor what is below it holds the ball higher
                        break
                    gap = abs(away - across[w, k])
                    if gap < ball and gap * gap <= least * ball:
                        best = max(best, up[w, k] - gap * gap / (ball + np.sqrt((ball - gap) * (ball + gap))))
                    if k + 1 < corners:
                        run, fall, flank = runs[k], falls[k], flanks[k]
                        # most flanks are too steep to be touched: that is told without a division
                        touched = (away - across[w, k]) * flank >= (1.0 - BOUND_MARGIN) * ball * fall
                        if run > 0.0 and fall > 0.0 and touched:
                            at = away - ball * fall / flank - across[w, k]
                            if at >= 0.0 and at <= run:
                                # R (run / flank - 1) without the difference of near numbers
                                lift = -ball * fall * fall / (flank * (flank + run))
                                best = max(best, up[w, k] - at * fall / run + lift)
                total += best
            out[w, near[b]] = total / nodes


@njit(cache=True, error_model="numpy", nogil=True)
def _near(  # type: ignore[no-untyped-def]
    s, lateral, basis, bend, bend_along, courses, ends, across, up, radius
) -> IntArray:
    """The bins that some of the lines may be felt in; `radius` is the largest of a ball, m.

    A ball of radius R at x beside all corners stands x^2 / 2 R lower than on the crest, at least.
    """
    bins, modes = len(s), basis.shape[1]
    most, foot, flank = np.zeros(modes), across[:, -1].max(), (across[:, -1] - across[:, 0]).max()
    for m in range(modes):
        most[m] = np.abs(courses[:, m]).max()
    start, stop, least = ends[:, 0].min(), ends[:, 1].max(), (1.0 + BOUND_MARGIN) * 2.0 * up[:, 0].max()
    near, count = np.empty(bins, np.int64), 0
    for i in range(bins):
        nearest, farthest, lowest, first, last = np.inf, 0.0, np.inf, np.inf, -np.inf
        for q in range(s.shape[1]):
            nearest, farthest = min(nearest, abs(lateral[i, q])), max(farthest, abs(lateral[i, q]))
            lowest = min(lowest, bend[i, q], bend_along[i, q])
            first, last = min(first, s[i, q]), max(last, s[i, q])
        swayed, turned = 0.0, 0.0
        for m in range(modes):
            sway, turn = 0.0, 0.0
            for q in range(s.shape[1]):
                sway, turn = max(sway, abs(basis[0, m, i, q])), max(turn, abs(basis[1, m, i, q]))
            swayed, turned = swayed + most[m] * sway, turned + most[m] * turn
        beyond = max(start - last, first - stop) - turned * (farthest + swayed) - flank
        gap = max((nearest - swayed) / np.sqrt(1.0 + turned * turned) - foot, beyond)
        # the ball over a plane, at most, that is felt as the tip is over the base
        near[count] = i
        count += 0 if gap > 0.0 and gap * gap > least * radius / max(1.0 + radius * lowest, 1e-3) else 1
    return near[:count]


@njit(cache=True, error_model="numpy", nogil=True)
def _about_top(bend, bend_along, ends, top, rounded, radius, place, aside, stretch):  # type: ignore[no-untyped-def]
    """Distances (N,) across the section of nodes about a course, m, for their `aside`, and for their `stretch` radii of
    the balls over a plane that are felt as the tip is there, m."""
    start, stop, core = ends[0], ends[1], top - rounded
    for j in range(len(place)):
        around = stretch[j] * max(start - place[j], place[j] - stop) + rounded
        beside = abs(aside[j])
        # the distance of a rectangle that is smaller by the corners' radius all round
        side = max(beside - core, 0.0)
        away = np.sqrt(around * around + side * side)
        share = around / away
        bent = bend[j] + share * share * (bend_along[j] - bend[j])
        aside[j] = core + away if around > 0.0 else beside
        stretch[j] = radius / max(1.0 + radius * (bent if around > 0.0 else bend[j]), 1e-3)
