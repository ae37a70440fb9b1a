"""Compiled heights of a ball over bells: bumps of revolution whose flank runs out, where they stand in space."""

# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import numpy as np
from numba import njit

from mapping import FloatArray
from mapping.geometry.templates.smooth_kernels import GAUSSIAN, GONE, TABLE_PLACES, section_scale, smooth_trace

# The ball's centre is sought along the foot's normal, which leans from the bell's axis by a tenth or so: each round
# leaves about that part, times the trace's slope, of what it was off by, until that is so small a part of the height
CENTRE_ROUNDS, CENTRE_SETTLED = 6, 1e-5
# A hollow base has at least this share of the ball's curvature to spare, or the reach would be no bound
LEAST_ROOM = 0.01
# Share by which the table goes further than the furthest of the bins
TABLE_SPARE = 0.05
# Share by which a bound is widened that leaves places out: what it leaves out is zero to the last digit
BOUND_MARGIN = 1e-9
# Tangents of angles up to which so many terms of the arc tangent's series are exact to rounding
SLIGHT, SLIGHT_TERMS = 0.3, 13


@njit(cache=True, error_model="numpy", inline="always")
def _reach(height, half, taper, curvature, tip):  # type: ignore[no-untyped-def]
    """Distance from the axis beyond which the ball on the base touches no more of a bell than is GONE, m."""
    scale, level = section_scale(half, taper), -np.log(GONE)
    out = scale * np.sqrt(level if abs(taper) < GAUSSIAN else np.expm1(taper * level) / taper)
    return out + np.sqrt(height * (2.0 * tip + height) / max(1.0 + curvature * tip, LEAST_ROOM))


@njit(cache=True, error_model="numpy", inline="always")
def _place(level, square, curvature):  # type: ignore[no-untyped-def]
    """Distance from the axis, along the ball that a bell stands on, and height over it, m, of a place in space.

    It is `level` up the axis, m, and the root of `square` away from where the bell stands. The distance holds where the
    tangent of its angle, the last that is returned, is SLIGHT at most: there is no branch, so that several places are
    taken at once.
    """
    aside = np.sqrt(max(square - level * level, 0.0))
    toward = 1.0 + curvature * level
    over = (2.0 * level + curvature * square) / (
        np.sqrt(toward * toward + (curvature * aside) * (curvature * aside)) + 1.0
    )
    flat = aside / toward
    tangent = curvature * flat
    series = 0.0
    for k in range(SLIGHT_TERMS, 0, -1):
        series = tangent * tangent * (1.0 / (2.0 * k + 1.0) - series)
    return flat * (1.0 - series), over, abs(tangent) if toward > 0.0 else np.inf


@njit(cache=True, error_model="numpy")
def _place_anywhere(level, square, curvature):  # type: ignore[no-untyped-def]
    """The distance of `_place`, however far round the ball."""
    place, _, tangent = _place(level, square, curvature)
    if tangent <= SLIGHT:
        return place
    aside = np.sqrt(max(square - level * level, 0.0))
    return np.arctan2(curvature * aside, 1.0 + curvature * level) / curvature


@njit(cache=True, error_model="numpy", inline="always")
def _tangent_beyond(place, curvature):  # type: ignore[no-untyped-def]
    """Square of `aside` over `toward` (see `_place`), m^2, above which a place in space lies further along the ball
    that a bell stands on than so many m."""
    angle = abs(curvature) * place
    if angle >= 0.5 * np.pi:
        return np.inf
    reach = np.tan(angle) / abs(curvature) if angle > 0.0 else place
    return (1.0 + BOUND_MARGIN) * reach * reach


@njit(cache=True, error_model="numpy", inline="always")
def _between(table, k, x):  # type: ignore[no-untyped-def]
    """Of a table at a share x of the way from place k to the next: cubic, with the slopes of its neighbours."""
    here, there = table[k], table[k + 1]
    before = table[k - 1] if k > 0 else there
    after = table[k + 2] if k + 2 < len(table) else -np.inf
    if before == -np.inf or after == -np.inf:
        return here + x * (there - here)
    start, stop = 0.5 * (there - before), 0.5 * (after - here)
    bow = (1.0 - x) * (start - (there - here)) + x * ((there - here) - stop)
    return here + x * (there - here) + x * (1.0 - x) * bow


@njit(cache=True, error_model="numpy", nogil=True)
def bell_heights(
    nodes: FloatArray,
    normals: FloatArray,
    points: FloatArray,
    axes: FloatArray,
    curvature: float,
    heights: FloatArray,
    halves: FloatArray,
    tapers: FloatArray,
    tip: float,
    out: FloatArray,
) -> None:
    """Heights (W, n) of W bells over n bins.

    The bell stands on a ball of a curvature. A mesh has facets instead: its feet and normals say where the tip's centre
    is, and what the bell does not lift rests on the mesh.

    Args:
        nodes: (n, q, 3) feet within each bin, m, and normals (n, 3) there.
        points, axes: (W, 3) places on the base, m, and unit axes of the bells.
        curvature: of the base under them, 1/m, positive where it is convex.
        heights, halves, tapers: (W,) m, m (half width at half height), and 1: the sections of `smooth_trace`.
        tip: m.
    """
    walkers, (bins, count) = len(out), nodes.shape[:2]
    size = bins * count
    centres, upright = np.empty((3, size)), np.empty((3, size))
    for m in range(size):
        for c in range(3):
            upright[c, m] = normals[m // count, c]
            centres[c, m] = nodes[m // count, m % count, c] + tip * upright[c, m]
    # arrays of their own: of rows of one it is not seen that none overlaps another
    levels, squares, alongs, upwards = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    rises, places, overs, tangents = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    asked, lifted, table = np.empty(size, np.int64), np.empty(size), np.empty(TABLE_PLACES)
    for w in range(walkers):
        _about(centres, upright, points[w], axes[w], levels, squares, alongs, upwards)
        far, widest = 1e-3 * tip, -1.0
        for m in range(0, size, count):  # nodes of one bin lie closer together than the table has to spare
            toward, flat = 1.0 + curvature * levels[m], squares[m] - levels[m] * levels[m]
            # places are in the order of the tangents of their angles, which are quicker told
            if toward <= 0.0 or flat > widest * (toward * toward):
                far = max(far, _place_anywhere(levels[m], squares[m], curvature))
                widest = flat / (toward * toward) if toward > 0.0 else widest
        far = min((1.0 + TABLE_SPARE) * far + heights[w], _reach(heights[w], halves[w], tapers[w], curvature, tip))
        spacing = far / (TABLE_PLACES - 2)
        smooth_trace(heights[w], halves[w], tapers[w], tip, curvature, table, spacing)
        last = TABLE_PLACES - 1
        while last > 0 and table[last] == -np.inf:
            last -= 1
        beyond, left = _tangent_beyond(last * spacing, curvature), 0
        for m in range(size):
            lifted[m] = 0.0
            toward, flat = 1.0 + curvature * levels[m], squares[m] - levels[m] * levels[m]
            if beyond < np.inf and (toward <= 0.0 or flat > beyond * (toward * toward)):
                continue  # most nodes are further away than the bell is felt
            levels[left], squares[left], alongs[left], upwards[left] = levels[m], squares[m], alongs[m], upwards[m]
            asked[left], rises[left] = m, 0.0
            left += 1
        for _ in range(CENTRE_ROUNDS):
            _standing(levels, squares, alongs, upwards, rises, left, curvature, spacing, places, overs, tangents)
            unsettled = 0
            for j in range(left):
                rise = rises[j]
                if tangents[j] > SLIGHT:
                    level, square = levels[j] + rise * upwards[j], squares[j] + rise * (2.0 * alongs[j] + rise)
                    places[j] = _place_anywhere(level, square, curvature) / spacing
                place = places[j]
                k = int(place)
                if k >= TABLE_PLACES - 1 or table[k] == -np.inf or table[k + 1] == -np.inf:
                    lifted[asked[j]] = 0.0
                    continue
                more = _between(table, k, place - k) - (overs[j] - tip)
                lifted[asked[j]] = rise + more
                if abs(more) < CENTRE_SETTLED * heights[w]:
                    continue
                levels[unsettled], squares[unsettled] = levels[j], squares[j]
                alongs[unsettled], upwards[unsettled] = alongs[j], upwards[j]
                asked[unsettled], rises[unsettled] = asked[j], rise + more
                unsettled += 1
            left = unsettled
        for i in range(bins):
            total = 0.0
            for q in range(count):
                total += max(lifted[i * count + q], 0.0)
            out[w, i] = total / count


@njit(cache=True, error_model="numpy", nogil=True)
def _about(centres, upright, point, axis, levels, squares, alongs, upwards):  # type: ignore[no-untyped-def]
    """Of the tip's centres (3, N) on the base how high they are up an axis, m, their squared distance from where that
    stands, m^2, its part along their normals (3, N), m, and the cosine of these with the axis; written."""
    px, py, pz = point[0], point[1], point[2]
    ax, ay, az = axis[0], axis[1], axis[2]
    for m in range(len(levels)):
        x, y, z = centres[0, m] - px, centres[1, m] - py, centres[2, m] - pz
        nx, ny, nz = upright[0, m], upright[1, m], upright[2, m]
        levels[m], squares[m] = x * ax + y * ay + z * az, x * x + y * y + z * z
        alongs[m], upwards[m] = x * nx + y * ny + z * nz, nx * ax + ny * ay + nz * az


@njit(cache=True, error_model="numpy", nogil=True)
def _standing(  # type: ignore[no-untyped-def]
    levels, squares, alongs, upwards, rises, count, curvature, spacing, places, overs, tangents
):
    """`_place` of the first so many centres, each risen along its normal, distances in spacings; written to the last
    three."""
    for j in range(count):
        rise = rises[j]
        level, square = levels[j] + rise * upwards[j], squares[j] + rise * (2.0 * alongs[j] + rise)
        place, overs[j], tangents[j] = _place(level, square, curvature)
        places[j] = place / spacing
