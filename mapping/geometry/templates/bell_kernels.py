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
# Tangents of angles up to which five terms of the arc tangent's series are exact to rounding: t^11 / 11 of t
SLIGHT = 0.04


@njit(cache=True, error_model="numpy", inline="always")
def _reach(height, half, taper, curvature, tip):  # type: ignore[no-untyped-def]
    """Distance from the axis beyond which the ball on the base touches no more of a bell than is GONE, m."""
    scale, level = section_scale(half, taper), -np.log(GONE)
    out = scale * np.sqrt(level if abs(taper) < GAUSSIAN else np.expm1(taper * level) / taper)
    return out + np.sqrt(height * (2.0 * tip + height) / max(1.0 + curvature * tip, LEAST_ROOM))


@njit(cache=True, error_model="numpy", inline="always")
def _place(level, square, curvature):  # type: ignore[no-untyped-def]
    """Distance from the axis, along the ball that a bell stands on, and height over it, m, of a place in space.

    It is `level` up the axis, m, and the root of `square` away from where the bell stands.
    """
    aside = np.sqrt(max(square - level * level, 0.0))
    toward = 1.0 + curvature * level
    over = (2.0 * level + curvature * square) / (np.sqrt(toward**2 + (curvature * aside) ** 2) + 1.0)
    if curvature == 0.0:
        return aside, over
    if toward > 0.0 and abs(curvature) * aside < SLIGHT * toward:  # nearly everywhere, at a third of the time
        t = curvature * aside / toward
        u = t * t
        series = 1.0 - u * (1.0 / 3.0 - u * (1.0 / 5.0 - u * (1.0 / 7.0 - u * (1.0 / 9.0))))
        return aside / toward * series, over
    return np.arctan2(curvature * aside, toward) / curvature, over


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
    walkers, bins = out.shape
    count, table = nodes.shape[1], np.empty(TABLE_PLACES)
    for w in range(walkers):
        px, py, pz = points[w, 0], points[w, 1], points[w, 2]
        ax, ay, az = axes[w, 0], axes[w, 1], axes[w, 2]
        far, widest = 1e-3 * tip, -1.0
        for i in range(bins):  # nodes of one bin lie closer together than the table has to spare
            x = nodes[i, 0, 0] + tip * normals[i, 0] - px
            y = nodes[i, 0, 1] + tip * normals[i, 1] - py
            z = nodes[i, 0, 2] + tip * normals[i, 2] - pz
            level, square = x * ax + y * ay + z * az, x * x + y * y + z * z
            toward = 1.0 + curvature * level
            # places are in the order of the tangents of their angles, which are quicker told
            if toward <= 0.0 or square - level * level > widest * (toward * toward):
                far = max(far, _place(level, square, curvature)[0])
                widest = (square - level * level) / (toward * toward) if toward > 0.0 else widest
        far = min((1.0 + TABLE_SPARE) * far + heights[w], _reach(heights[w], halves[w], tapers[w], curvature, tip))
        spacing = far / (TABLE_PLACES - 2)
        smooth_trace(heights[w], halves[w], tapers[w], tip, curvature, table, spacing)
        last = TABLE_PLACES - 1
        while last > 0 and table[last] == -np.inf:
            last -= 1
        beyond = _tangent_beyond(last * spacing, curvature)
        for i in range(bins):
            nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
            upward, total = nx * ax + ny * ay + nz * az, 0.0
            for q in range(count):
                x, y, z = nodes[i, q, 0] + tip * nx - px, nodes[i, q, 1] + tip * ny - py, nodes[i, q, 2] + tip * nz - pz
                level, square, along = x * ax + y * ay + z * az, x * x + y * y + z * z, x * nx + y * ny + z * nz
                toward = 1.0 + curvature * level
                if beyond < np.inf and (toward <= 0.0 or square - level * level > beyond * (toward * toward)):
                    continue  # most nodes are further away than the bell is felt
                rise = 0.0
                for _ in range(CENTRE_ROUNDS):
                    place, over = _place(level + rise * upward, square + rise * (2.0 * along + rise), curvature)
                    place /= spacing
                    k = int(place)
                    if k >= TABLE_PLACES - 1 or table[k] == -np.inf or table[k + 1] == -np.inf:
                        rise = 0.0
                        break
                    more = _between(table, k, place - k) - (over - tip)
                    rise += more
                    if abs(more) < CENTRE_SETTLED * heights[w]:
                        break
                total += max(rise, 0.0)
            out[w, i] = total / count
