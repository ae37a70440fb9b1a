"""Compiled traces of lines with a polygon for a section, averaged over the nodes of each bin."""

# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import numpy as np
from numba import njit

from mapping import FloatArray

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
    across: FloatArray,
    up: FloatArray,
    tip: float,
    out: FloatArray,
) -> None:
    """Heights (W, n) of W lines over bins with q nodes; written to `out`.

    Half of the section, which is the same on both sides, has the corners `across` (W, K), from the middle outwards,
    and `up` (W, K), which falls from the crest. The ball rests on the top, on a corner (an arc of its own radius) or on
    a flank (a line parallel to it), whichever holds it highest: dilation distributes over unions. Beyond an end, cut
    square, what touches is the circle in which the ball crosses the end's plane. On a curved base heights over it are
    felt as a ball of curvature 1/r + k feels them over a plane, k being the base's in that direction.

    Args:
        s, lateral: (n, q) places of the nodes along and across the chart, m.
        basis: (m, n, q) lateral modes there.
        bend, bend_along: (n, q) curvatures of the base across and along the line, 1/m.
        courses: (W, m) coefficients of the modes.
        ends: (W, 2) where the line begins and ends along the chart, m.
        across, up: (W, K) corners, m.
        tip: radius of the fingertip, m.
        out: (W, n) heights, m.
    """
    walkers, bins = out.shape
    modes, nodes, corners = basis.shape[0], s.shape[1], across.shape[1]
    nearest, widest, sway = np.empty(bins), np.empty(bins), np.zeros((bins, modes))
    # balls over a plane that are felt as the tip is over the base, across the line and along it
    beside, beyond_end, longest = np.empty((bins, nodes)), np.empty((bins, nodes)), np.zeros(bins)
    first, last = np.full(bins, np.inf), np.full(bins, -np.inf)
    runs, falls, flanks = np.empty(corners), np.empty(corners), np.empty(corners)
    for i in range(bins):
        nearest[i], lowest = np.inf, np.inf
        for q in range(nodes):
            nearest[i], lowest = min(nearest[i], abs(lateral[i, q])), min(lowest, bend[i, q])
            beside[i, q] = tip / max(1.0 + tip * bend[i, q], 1e-3)
            beyond_end[i, q] = tip / max(1.0 + tip * bend_along[i, q], 1e-3)
            longest[i] = max(longest[i], beyond_end[i, q])
            first[i], last[i] = min(first[i], s[i, q]), max(last[i], s[i, q])
            for m in range(modes):
                sway[i, m] = max(sway[i, m], abs(basis[m, i, q]))
        widest[i] = tip / max(1.0 + tip * lowest, 1e-3)
    for w in range(walkers):
        top, crest = across[w, 0], up[w, 0]
        least = (1.0 + BOUND_MARGIN) * 2.0 * crest
        for k in range(corners - 1):
            runs[k], falls[k] = across[w, k + 1] - across[w, k], up[w, k] - up[w, k + 1]
            flanks[k] = np.sqrt(runs[k] * runs[k] + falls[k] * falls[k])
        for i in range(bins):
            beyond = max(ends[w, 0] - last[i], first[i] - ends[w, 1])
            if beyond > 0.0 and (beyond >= min(longest[i], tip) or beyond * beyond > least * longest[i]):
                out[w, i] = 0.0
                continue
            # a ball of radius R at x beside all corners stands x^2 / 2 R lower than on the crest, at least
            gap = nearest[i] - across[w, corners - 1]
            for m in range(modes):
                gap -= abs(courses[w, m]) * sway[i, m]
            if gap > 0.0 and gap * gap > least * widest[i]:
                out[w, i] = 0.0
                continue
            total = 0.0
            for q in range(nodes):
                beyond = max(ends[w, 0] - s[i, q], s[i, q] - ends[w, 1])
                ball, drop = beside[i, q], 0.0
                if beyond > 0.0:
                    along = beyond_end[i, q]
                    if beyond >= min(along, tip) or beyond * beyond > least * along:
                        continue
                    drop = beyond * beyond / (along + np.sqrt((along - beyond) * (along + beyond)))
                    circle = np.sqrt((tip - beyond) * (tip + beyond))
                    ball = circle / max(1.0 + circle * bend[i, q], 1e-3)
                aside = lateral[i, q]
                for m in range(modes):
                    aside -= courses[w, m] * basis[m, i, q]
                aside = abs(aside)
                best = drop
                if aside <= top:
                    best = max(best, crest)
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
                total += best - drop
            out[w, i] = total / nodes
