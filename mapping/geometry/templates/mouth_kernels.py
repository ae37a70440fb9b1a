"""Compiled traces of lines that are cut off at an edge of the body, where the ball rolls over that edge or rests on the
wall behind it."""

# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import numpy as np
from numba import njit

from mapping import FloatArray

# Share of the distance on a plane, sqrt(2 r H), from which what stands H over a base is touched: on one that is hollow
# with a radius R it is 1 / sqrt(1 - r / R), 1.41 where R is two balls' radii
BESIDE_CRESTS = 1.5
# Squared sine of the angle between two directions that are taken for one: closer than a millionth they meet a million
# times farther off than they are apart, and rounding (1e-16) would be told as 1e-10 of that
ALONG_THE_EDGE = 1e-12


@njit(cache=True, error_model="numpy", inline="always")
def _exit(square, along, gap):  # type: ignore[no-untyped-def]
    """How far along a ray it leaves what lies within a distance of a point or of a line; -inf where it never meets it.

    Args:
        square: of the ray's direction, 1 but for the part of it that runs along the line.
        along: its direction times the way from the point or line to where it begins, m.
        gap: square of that way less that of the distance, m^2.
    """
    under = along * along - square * gap
    if under < 0.0 or square < ALONG_THE_EDGE:
        return -np.inf
    return (np.sqrt(under) - along) / square


@njit(cache=True, error_model="numpy", nogil=True)
def mouth_heights(
    points: FloatArray,
    ways: FloatArray,
    wall: FloatArray,
    bend: float,
    aside: FloatArray,
    slopes: FloatArray,
    across: FloatArray,
    up: FloatArray,
    tip: float,
    out: FloatArray,
) -> None:
    """Heights (W, n) over the base's trace, m, of W lines that an edge of the body cuts off; written to `out`.

    The body is the union of slices along the line, each as high as the section is there and cut by the wall: a quarter
    of a plane, with a corner at the mouth. The ball rests on whichever of them holds it highest, on its top, on its
    corner or on the wall below that (dilation distributes over unions).

    Args:
        points: (n, q, 3) feet on the bare base: out along the chart from where it meets the edge, beside it, and over
            it, m.
        ways: (n, 3) directions from there to the ball's centre, in the same frame.
        wall: (3,) outward unit normal of the wall, in the same frame.
        bend: curvature of the base along the edge, 1/m, positive where it bulges outward.
        aside, slopes: (W,) where the course meets the edge beside the chart, m, and by how much it goes aside for each
            metre out.
        across, up: (W, J) half of the section, which is the same on both sides: distances from the middle outwards and
            heights over the base, m. Beyond the last of them there is the bare base.
        tip: radius of the fingertip, m.
    """
    rows, bins = out.shape
    nodes, slices = points.shape[1], across.shape[1]
    for w in range(rows):
        stretch = np.sqrt(1.0 + slopes[w] * slopes[w])
        way_x, way_y = 1.0 / stretch, slopes[w] / stretch
        # the wall, and the line in it that a slice ends in: out along the course, across it, and up
        wall_u, wall_v = wall[0] * way_x + wall[1] * way_y, wall[1] * way_x - wall[0] * way_y
        if wall_u * wall_u < ALONG_THE_EDGE:  # it runs along the edge: nothing cuts it off
            out[w, :] = 0.0
            continue
        down = np.sqrt(wall_u * wall_u + wall[2] * wall[2])
        down_u, down_z = wall[2] / down, -wall_u / down
        outer = across[w, slices - 1]
        hollow = up[w, 0] < 0.0
        # a ball on the base touches what stands H over it from sqrt(2 r H) beside; on a hollow base from farther
        reach = outer if hollow else outer + min(BESIDE_CRESTS * np.sqrt(2.0 * tip * up[w, 0]), tip)
        for i in range(bins):
            n_u, n_v = ways[i, 0] * way_x + ways[i, 1] * way_y, ways[i, 1] * way_x - ways[i, 0] * way_y
            n_z = ways[i, 2]
            n_down = n_u * down_u + n_z * down_z
            total = 0.0
            for q in range(nodes):
                x, y, z = points[i, q, 0], points[i, q, 1] - aside[w], points[i, q, 2]
                u, v = x * way_x + y * way_y, y * way_x - x * way_y
                best = -np.inf
                # where the base under the ball is left it rests on that, and no slice of a hollow holds it higher
                deepest = up[w, 0] - 0.5 * bend * (x * x + points[i, q, 1] * points[i, q, 1])
                if not hollow or abs(v) >= outer or z <= deepest:
                    best = 0.0
                if abs(v) < reach and not (hollow and z <= deepest):
                    for j in range(2 * slices):
                        k = j // 2
                        # heights stand on the base, which leans the more the farther along the edge
                        at = across[w, k] * (1.0 + bend * up[w, k])
                        at = at if j % 2 == 0 else -at
                        beside = v - at
                        if beside * beside > tip * tip:
                            continue
                        # the corner lies in the wall, whose plane the edge's point of the chart is in
                        corner = -(aside[w] * wall[1] + at * wall_v) / wall_u
                        out_x, out_y = corner * way_x - at * way_y, aside[w] + corner * way_y + at * way_x
                        square = bend * (out_x * out_x + out_y * out_y)
                        high = up[w, k] * (1.0 - 0.5 * bend * square) - 0.5 * square
                        corner -= high * wall[2] / wall_u
                        over, beyond = z - high, u - corner
                        felt = _exit(
                            n_v * n_v + n_z * n_z, beside * n_v + over * n_z, beside * beside + over * over - tip * tip
                        )
                        if felt > -np.inf and beyond + felt * n_u <= 0.0:
                            best = max(best, felt - tip)
                            continue
                        square = beside * beside + over * over + beyond * beyond
                        along = beside * n_v + over * n_z + beyond * n_u
                        below = beyond * down_u + over * down_z
                        felt = _exit(1.0 - n_down * n_down, along - below * n_down, square - below * below - tip * tip)
                        if felt > -np.inf and below + felt * n_down >= 0.0:
                            best = max(best, felt - tip)
                            continue
                        felt = _exit(1.0, along, square - tip * tip)
                        if felt > -np.inf:
                            best = max(best, felt - tip)
                total += best if best > -np.inf else up[w, 0]
            out[w, i] = total / nodes
