"""Compiled traces of lines with a polygon for a section, averaged over the nodes of each bin."""

# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import numpy as np
from numba import njit

from mapping import FloatArray
from mapping.geometry.templates.course_kernels import about_course

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
    walkers, bins = out.shape
    modes, nodes, corners = basis.shape[1], s.shape[1], across.shape[1]
    nearest, farthest, lowest = np.empty(bins), np.zeros(bins), np.full(bins, np.inf)
    sway, turn = np.zeros((bins, modes)), np.zeros((bins, modes))
    first, last = np.full(bins, np.inf), np.full(bins, -np.inf)
    runs, falls, flanks = np.empty(corners), np.empty(corners), np.empty(corners)
    for i in range(bins):
        nearest[i] = np.inf
        for q in range(nodes):
            nearest[i], farthest[i] = min(nearest[i], abs(lateral[i, q])), max(farthest[i], abs(lateral[i, q]))
            lowest[i] = min(lowest[i], bend[i, q], bend_along[i, q])
            first[i], last[i] = min(first[i], s[i, q]), max(last[i], s[i, q])
            for m in range(modes):
                sway[i, m] = max(sway[i, m], abs(basis[0, m, i, q]))
                turn[i, m] = max(turn[i, m], abs(basis[1, m, i, q]))
    for w in range(walkers):
        top, crest, radius = across[w, 0], up[w, 0], tip + shoulders[w]
        least = (1.0 + BOUND_MARGIN) * 2.0 * crest
        for k in range(corners - 1):
            runs[k], falls[k] = across[w, k + 1] - across[w, k], up[w, k] - up[w, k + 1]
            flanks[k] = np.sqrt(runs[k] * runs[k] + falls[k] * falls[k])
        for i in range(bins):
            swayed, turned = 0.0, 0.0
            for m in range(modes):
                swayed += abs(courses[w, m]) * sway[i, m]
                turned += abs(courses[w, m]) * turn[i, m]
            # a ball of radius R at x beside all corners stands x^2 / 2 R lower than on the crest, at least
            foot = across[w, corners - 1]
            beyond = max(ends[w, 0] - last[i], first[i] - ends[w, 1]) - turned * (farthest[i] + swayed) - (foot - top)
            gap = max((nearest[i] - swayed) / np.sqrt(1.0 + turned * turned) - foot, beyond)
            # the ball over a plane, at most, that is felt as the tip is over the base
            if gap > 0.0 and gap * gap > least * radius / max(1.0 + radius * lowest[i], 1e-3):
                out[w, i] = 0.0
                continue
            total = 0.0
            for q in range(nodes):
                place, aside, stretch = about_course(s, lateral, basis, courses[w], i, q)
                beyond = stretch * max(ends[w, 0] - place, place - ends[w, 1])
                aside, around = abs(aside), beyond + rounded[w]
                bent = bend[i, q]
                if around > 0.0:
                    # the distance of a rectangle that is smaller by the corners' radius all round
                    core = top - rounded[w]
                    side = max(aside - core, 0.0)
                    away = np.sqrt(around * around + side * side)
                    bent += (around / away) ** 2 * (bend_along[i, q] - bent)
                    aside = core + away
                ball, best = radius / max(1.0 + radius * bent, 1e-3), 0.0
                if aside <= top:
                    best = crest
                for k in range(corners):
                    if up[w, k] <= best:  # neither this corner nor what is below it holds the ball higher
                        break
                    gap = abs(aside - across[w, k])
                    if gap < ball and gap * gap <= least * ball:
                        best = max(best, up[w, k] - gap * gap / (ball + np.sqrt((ball - gap) * (ball + gap))))
                    if k + 1 < corners:
                        run, fall, flank = runs[k], falls[k], flanks[k]
                        # most flanks are too steep to be touched: that is told without a division
                        touched = (aside - across[w, k]) * flank >= (1.0 - BOUND_MARGIN) * ball * fall
                        if run > 0.0 and fall > 0.0 and touched:
                            at = aside - ball * fall / flank - across[w, k]
                            if at >= 0.0 and at <= run:
                                # R (run / flank - 1) without the difference of near numbers
                                lift = -ball * fall * fall / (flank * (flank + run))
                                best = max(best, up[w, k] - at * fall / run + lift)
                total += best
            out[w, i] = total / nodes
