"""Compiled traces of bells and of hollows whose flanks run out into the base, dilated by the ball across them."""

# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import numpy as np
from numba import njit

from mapping import FloatArray
from mapping.geometry.templates.course_kernels import lay_about_course

# Places of the table of the trace: between them it errs by 1e-5 of the height or less where the trace is smooth.
TABLE_PLACES = 500
# A step along the section turns it by so much at most, rad, and is at most this share of the length over which it
# changes: the cubics between the points then err by 1e-6 of its height, 2e-5 at worst, against steps of 1e-3, and on
# needles of a hundredth of the tip's radius, too, where 600 steps by one rule erred by 1e-2. A shallow one takes 60.
TURN_A_STEP = 0.03
SHARE_A_STEP = 0.07
# Beyond the place where so small a part of the height is left there is nothing to walk.
GONE = 1e-8
# Tables for balls of so many curvatures, between which the trace changes evenly: where they differ by a half of the
# ball's own it errs by 1.2e-3 of the depth at most (five sections, five places)
TABLE_BENDS = 5
# Share of the way to the edge of a section that has one that a step covers at most, lest it oversteps: shares of 0.1,
# 0.25 and 0.5 err alike, by 8e-7 of the depth (tapers -0.65 and -0.4, four sections)
SHARE_TO_EDGE = 0.25
# Places of half of a section at which a ball may rest, and halvings of the stretch in which it changes from one to the
# next: both are then known to a few thousandths of the ball's half-width
PLACES_OF_FLANK, FLANK_HALVINGS = 400, 12
# A place is touched where no other one lifts the ball off it by more than rounding, in parts of the height
TOUCHING = 1e-9
# Below this taper a power of 1/taper loses digits, eps/taper; the first two terms of its series lose taper^2. Both err
# by 5e-11 of the depth at most there
GAUSSIAN = 1e-5


@njit(cache=True, error_model="numpy", inline="always")
def share_left(square, taper):  # type: ignore[no-untyped-def]
    """The part of the depth that is left at a squared distance in scales, and the base of its power."""
    base = 1.0 + taper * square
    if abs(taper) < GAUSSIAN:
        return np.exp(-square * (1.0 - 0.5 * taper * square)), base
    if base <= 0.0:
        return 0.0, 0.0
    return base ** (-1.0 / taper), base


@njit(cache=True, error_model="numpy", inline="always")
def section_scale(half, taper):  # type: ignore[no-untyped-def]
    """The scale w of a section that has half of its height at u = `half`."""
    doubled = np.log(2.0) if abs(taper) < GAUSSIAN else np.expm1(taper * np.log(2.0)) / taper
    return half / np.sqrt(doubled)


@njit(cache=True, error_model="numpy", nogil=True)
def smooth_trace(
    height: float, half: float, taper: float, tip: float, curvature: float, table: FloatArray, spacing: float
) -> None:
    """Heights of the ball over the base at distances 0, spacing, ... along it from the middle, written to `table`.

    The section z = H (1 + k u^2 / w^2)^(-1/k) of taper k has half of its height H, negative of a hollow, at u = `half`:
    a cosine nearly at k = -0.4, a Gaussian at 0, the paper's bump at 1. It stands on a circle of `curvature`, 1/m,
    positive where the base is convex. It is walked from the middle outwards; the ball's centre over each point is on
    the parallel curve (paper, equation 11; theory 4.10b), and where that crosses itself the highest branch is the trace
    (interference points). What is beyond the middle touches lower, for both sides are alike. Where the ball meets
    nothing of the section the table is -inf.
    """
    table[:] = -np.inf
    last = spacing * (len(table) - 1)
    scale = section_scale(half, taper)
    edge = scale / np.sqrt(-taper) if taper < 0.0 else np.inf
    u, rho0, t0, slope0 = 0.0, 0.0, height, 0.0
    base, left = 1.0, 1.0
    while min(u, rho0) < last and left > GONE:
        square = (u / scale) ** 2
        bend = -2.0 * height * left / (scale * scale * base) * (1.0 - 2.0 * (1.0 + taper) * square / base)
        slope = -2.0 * height * left * u / (scale * scale * base)
        step = min(SHARE_A_STEP * scale * np.sqrt(base), SHARE_TO_EDGE * (edge - u))
        if step * abs(bend) > TURN_A_STEP * (1.0 + slope * slope):
            step = TURN_A_STEP * (1.0 + slope * slope) / abs(bend)
        u += step
        square = (u / scale) ** 2
        left, base = share_left(square, taper)
        slope = -2.0 * height * left * u / (scale * scale * base) / (1.0 + curvature * height * left)
        stretch = np.sqrt(1.0 + slope * slope)
        # the centre, along the base and over the point's foot, less the ball's radius: r/c - r in the form that keeps
        # its digits on a flat wall
        aside = -tip * slope / stretch
        over = height * left - tip * slope * slope / (stretch * (1.0 + stretch))
        square = (1.0 + curvature * (tip + over)) ** 2 + (curvature * aside) ** 2
        t = 2.0 * over * (1.0 + curvature * tip) + curvature * (over * over + aside * aside)
        t /= np.sqrt(square) + 1.0 + curvature * tip
        rho, turned = u + aside, 0.0
        if curvature != 0.0:
            turned = curvature * aside / (1.0 + curvature * (tip + over))
            rho = u + np.arctan(turned) / curvature
        slope = (1.0 + curvature * (tip + t)) * (slope + turned) / (1.0 - slope * turned)
        run = rho - rho0
        for k in range(max(int(np.ceil(min(rho0, rho) / spacing)), 0), len(table)):
            if k * spacing > max(rho0, rho):
                break
            # a cubic: the parallel curve has the slope of the section, and few points over a sharp crest
            x = (k * spacing - rho0) / run if run != 0.0 else 0.0
            bow = (1.0 - x) * (slope0 * run - (t - t0)) + x * ((t - t0) - slope * run)
            table[k] = max(table[k], t0 + x * (t - t0) + x * (1.0 - x) * bow)
        rho0, t0, slope0 = rho, t, slope


@njit(cache=True, error_model="numpy", fastmath={"nnan", "nsz", "reassoc"})
def _range(values):  # type: ignore[no-untyped-def]
    """The least and the largest of values (N,) that are all numbers: nothing is rounded, so in any order."""
    low, high = np.inf, -np.inf
    for i in range(len(values)):
        low, high = min(low, values[i]), max(high, values[i])
    return low, high


@njit(cache=True, error_model="numpy", nogil=True)
def _means(
    away: FloatArray, toward: FloatArray, height: float, half: float, taper: float, tip: float, out: FloatArray
) -> None:
    """Mean heights (n,) over nodes (n, q), one after the other, `away` (n q,) from the middle, where the base bends by
    `toward` (n q,), 1/m, towards it."""
    bins, nodes = len(out), len(away) // len(out)
    # a hollow base as tight as the ball has no trace of its own
    least = -0.999 / tip
    low, high = _range(toward)
    low, high, far = max(low, least), max(high, least), max(_range(away)[1], 1e-3 * tip)
    bends = TABLE_BENDS if (high - low) * tip > 1e-6 else 1
    gap = (high - low) / (bends - 1) if bends > 1 else 1.0
    table, spacing = np.zeros((bends, TABLE_PLACES)), far / (TABLE_PLACES - 2)
    for b in range(bends):
        smooth_trace(height, half, taper, tip, low + b * gap, table[b], spacing)
        for k in range(TABLE_PLACES):
            if table[b, k] == -np.inf or (height > 0.0 and table[b, k] < 0.0):
                table[b, k] = 0.0  # on the base
    for i in range(bins):
        total = 0.0
        for q in range(i * nodes, (i + 1) * nodes):
            place = away[q] / spacing
            k = min(int(place), TABLE_PLACES - 2)
            x = place - k
            if bends == 1:
                total += table[0, k] + x * (table[0, k + 1] - table[0, k])
                continue
            way = min(max((toward[q] - low) / gap, 0.0), bends - 1.0)
            b = int(way)
            felt = table[b, k] + x * (table[b, k + 1] - table[b, k])
            if b + 1 < bends:
                beside = table[b + 1, k] + x * (table[b + 1, k + 1] - table[b + 1, k])
                felt += (way - b) * (beside - felt)
            total += felt
        out[i] = total / nodes


@njit(cache=True, error_model="numpy", nogil=True)
def smooth_line_heights(
    s: FloatArray,
    lateral: FloatArray,
    basis: FloatArray,
    bend: FloatArray,
    bend_along: FloatArray,
    courses: FloatArray,
    ends: FloatArray,
    heights: FloatArray,
    halves: FloatArray,
    tapers: FloatArray,
    tip: float,
    out: FloatArray,
) -> None:
    """Heights (W, n) of W smooth lines over bins with q nodes; the first arguments as for `groove_heights`.

    An end is half of a pit, or of a bell, with the same section.

    Args:
        heights (negative of grooves), halves, tapers: (W,) m, m, and 1: see `smooth_trace`.
    """
    count, modes = s.size, basis.shape[1]
    place, aside, stretch = np.empty(count), np.empty(count), np.empty(count)
    away, toward = np.empty(count), np.empty(count)
    s, lateral, basis = s.reshape(count), lateral.reshape(count), basis.reshape((2, modes, count))
    bend, bend_along = bend.reshape(count), bend_along.reshape(count)
    for w in range(len(out)):
        lay_about_course(s, lateral, basis, courses[w], place, aside, stretch)
        start, end = ends[w]
        for i in range(count):
            beyond = stretch[i] * max(start - place[i], place[i] - end, 0.0)
            square = aside[i] * aside[i] + beyond * beyond
            turned = beyond * beyond / square if square > 0.0 else 0.0
            away[i] = np.sqrt(square)
            toward[i] = (1.0 - turned) * bend[i] + turned * bend_along[i]
        _means(away, toward, heights[w], halves[w], tapers[w], tip, out[w])


@njit(cache=True, error_model="numpy", nogil=True)
def smooth_point_heights(
    x: FloatArray,
    y: FloatArray,
    bends: FloatArray,
    places: FloatArray,
    heights: FloatArray,
    halves: FloatArray,
    tapers: FloatArray,
    tip: float,
    out: FloatArray,
) -> None:
    """Heights (W, n) of W bells, or smooth pits of negative heights; the first arguments as for `pit_heights`."""
    count = x.size
    x, y = x.reshape(count), y.reshape(count)
    away, toward = np.empty(count), np.empty(count)
    for w in range(len(out)):
        middle_x, middle_y = places[w]
        for i in range(count):
            along, across = x[i] - middle_x, y[i] - middle_y
            square = along * along + across * across
            share = along * along / square if square > 0.0 else 0.5
            away[i] = np.sqrt(square)
            toward[i] = share * bends[0] + (1.0 - share) * bends[1]
        _means(away, toward, heights[w], halves[w], tapers[w], tip, out[w])


@njit(cache=True, error_model="numpy", inline="always")
def _rest(level, spacing, middle, tip):  # type: ignore[no-untyped-def]
    """Number of the place of a section, of heights `level` at 0, spacing, ..., that holds a ball highest, and how high
    over the base, m, if its centre is `middle` beside the section's."""
    best, at = -np.inf, 0
    for k in range(len(level)):
        gap = abs(k * spacing - middle)
        if gap < tip:
            held = level[k] - gap * gap / (tip + np.sqrt((tip - gap) * (tip + gap)))
            if held > best:
                best, at = held, k
    return at, best


@njit(cache=True, error_model="numpy", nogil=True)
def half_ways_touched(heights: FloatArray, halves: FloatArray, tapers: FloatArray, tip: float, out: FloatArray) -> None:
    """Distances (W, 2), m, from the middle of W bells on a plane between which they have half of their height, as far
    as the ball knows.

    Both are the bell's own where the ball touches it there. Else the ball that leaves the flank above comes to rest
    below at once, and whatever lies between those two places leaves one trace.
    """
    level = np.empty(PLACES_OF_FLANK)
    for w in range(len(heights)):
        height, half, taper = heights[w], halves[w], tapers[w]
        out[w, :] = half
        scale, least = section_scale(half, taper), min(height, tip)
        # what holds a ball above half of the height lies no farther from where it then comes to rest
        spacing = (half + np.sqrt(least * (2.0 * tip - least))) / (PLACES_OF_FLANK - 1)
        for k in range(PLACES_OF_FLANK):
            level[k] = height * share_left((k * spacing / scale) ** 2, taper)[0]
        left, base = share_left((half / scale) ** 2, taper)
        slope = 2.0 * height * left * half / (scale * scale * base)
        stretch = np.sqrt(1.0 + slope * slope)
        beside = half + tip * slope / stretch
        touching = height * left - tip * slope * slope / (stretch * (1.0 + stretch))
        if _rest(level, spacing, beside, tip)[1] <= touching + TOUCHING * height:
            continue
        low, high = 0.0, (PLACES_OF_FLANK - 1) * spacing
        for _ in range(FLANK_HALVINGS):
            middle = 0.5 * (low + high)
            at = _rest(level, spacing, middle, tip)[0] * spacing
            if at < half:
                low, out[w, 0] = middle, at
            else:
                high, out[w, 1] = middle, at
