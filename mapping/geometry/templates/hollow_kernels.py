"""Compiled traces of grooves, pits and steps, averaged over the nodes of each bin (the forms of shapes.py)."""

# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import numpy as np
from numba import njit

from mapping import FloatArray
from mapping.geometry.templates.course_kernels import about_course, lay_about_course


@njit(cache=True, error_model="numpy", inline="always")
def rim(distance, tip, depth, bend):  # type: ignore[no-untyped-def]
    """Height (negative) of a ball at a distance inside the rim of a hollow, as in shapes.rim_height."""
    if distance <= 0.0:
        return 0.0
    if distance > tip:
        return -depth
    square = distance * distance
    dip = square / (tip + np.sqrt((tip - distance) * (tip + distance))) + 0.5 * bend * square
    return -min(dip, depth)


@njit(cache=True, error_model="numpy", nogil=True)
def groove_heights(
    s: FloatArray,
    lateral: FloatArray,
    basis: FloatArray,
    bend: FloatArray,
    bend_along: FloatArray,
    courses: FloatArray,
    ends: FloatArray,
    rounded: FloatArray,
    widths: FloatArray,
    depths: FloatArray,
    tip: float,
    out: FloatArray,
) -> None:
    """Heights (W, n) of W grooves over bins with q nodes; `s` to `courses` as for `about_course`, `ends` (W, 2).

    The corners of the mouth are arcs of the radius `rounded` (W,), up to half of the width, m; as everywhere only the
    distance to the rim counts.
    `bend` and `bend_along` (n, q), curvatures of the base across and along the line, 1/m: the ball dips under a long
    rim by the first, under the rim at an end by the second, and rests on whichever holds it highest.
    """
    walkers, bins = out.shape
    nodes, count, modes = s.shape[1], s.size, basis.shape[1]
    place, aside, stretch = np.empty(count), np.empty(count), np.empty(count)
    s, lateral, basis = s.reshape(count), lateral.reshape(count), basis.reshape((2, modes, count))
    bend, bend_along = bend.reshape(count), bend_along.reshape(count)
    for w in range(walkers):
        half, first, last = 0.5 * widths[w], ends[w, 0], ends[w, 1]
        lay_about_course(s, lateral, basis, courses[w], place, aside, stretch)
        for i in range(bins):
            total = 0.0
            for j in range(i * nodes, (i + 1) * nodes):
                along, across = stretch[j] * min(place[j] - first, last - place[j]), half - abs(aside[j])
                if along <= 0.0 or across <= 0.0:
                    continue
                out_along, out_across = rounded[w] - along, rounded[w] - across
                if out_along > 0.0 and out_across > 0.0:
                    square = out_along * out_along + out_across * out_across
                    bent = bend[j] + out_along * out_along / square * (bend_along[j] - bend[j])
                    total += rim(rounded[w] - np.sqrt(square), tip, depths[w], bent)
                else:
                    beside = rim(across, tip, depths[w], bend[j])
                    total += max(beside, rim(along, tip, depths[w], bend_along[j]))
            out[w, i] = total / nodes


@njit(cache=True, error_model="numpy", nogil=True)
def pit_heights(
    x: FloatArray,
    y: FloatArray,
    bends: FloatArray,
    places: FloatArray,
    widths: FloatArray,
    depths: FloatArray,
    tip: float,
    out: FloatArray,
) -> None:
    """Heights (W, n) of W round pits over bins with nodes at tangent coordinates x, y (n, q); `places` (W, 2).

    `bends` (2,) are the base's curvatures along x and y, 1/m: the rim nearest to the ball lies in its own direction.
    """
    walkers, bins = out.shape
    nodes = x.shape[1]
    for w in range(walkers):
        for i in range(bins):
            total = 0.0
            for q in range(nodes):
                along, across = x[i, q] - places[w, 0], y[i, q] - places[w, 1]
                away = np.sqrt(along * along + across * across)
                share = (along / away) ** 2 if away > 0.0 else 0.5
                bend = share * bends[0] + (1.0 - share) * bends[1]
                total += rim(0.5 * widths[w] - away, tip, depths[w], bend)
            out[w, i] = total / nodes


@njit(cache=True, error_model="numpy", nogil=True)
def step_heights(
    lateral: FloatArray,
    basis: FloatArray,
    bend: FloatArray,
    courses: FloatArray,
    heights: FloatArray,
    runs: FloatArray,
    high_side: float,
    tip: float,
    out: FloatArray,
) -> None:
    """Heights (W, n) of W steps over bins with nodes at lateral distances (n, q) from the chart.

    `basis` and `courses` are as for `about_course`; `bend` (n, q) is the curvature of the base across the edge, 1/m.
    A step climbs evenly over its run (W,), m, about the course; 0: upright (see `step_height`).
    """
    walkers, bins = out.shape
    nodes = lateral.shape[1]
    for w in range(walkers):
        for i in range(bins):
            total = 0.0
            for q in range(nodes):
                _, aside, _ = about_course(lateral, lateral, basis, courses[w], i, q)
                inside, felt = max(0.5 * runs[w] - high_side * aside, 0.0), 0.0
                if inside < tip:  # farther off the ball does not touch the edge, however high it is
                    square = inside * inside
                    drop = square / (tip + np.sqrt((tip - inside) * (tip + inside))) + 0.5 * bend[i, q] * square
                    felt = max(heights[w] - drop, 0.0)
                if runs[w] > 0.0:
                    ball = tip / max(1.0 + tip * bend[i, q], 1e-3)
                    flank = np.sqrt(runs[w] * runs[w] + heights[w] * heights[w])
                    at = high_side * aside + 0.5 * runs[w] + ball * heights[w] / flank
                    if at >= 0.0 and at <= runs[w]:
                        lift = ball * heights[w] * heights[w] / (flank * (flank + runs[w]))
                        felt = max(felt, at * heights[w] / runs[w] - lift)
                total += felt
            out[w, i] = total / nodes
