"""Compiled trace of grooves that cross: the ball rests on the nearest ground that none of them took, or on a bottom."""

# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import numpy as np
from numba import njit

from mapping import FloatArray
from mapping.geometry.templates.hollow_kernels import rim

# Beyond every distance: a line without ends reaches so far
ENDLESS = 1e300
# What is known of a groove at one place: where that lies in it, the unit direction of its course, half of its width,
# the base's curvature across and along it, and its depth
ASIDE, BEFORE, AFTER, COS, SIN, HALF, BEND, BEND_ALONG, DEPTH = range(9)


@njit(cache=True, error_model="numpy", nogil=True)
def crossing_heights(
    places: FloatArray, bends: FloatArray, halves: FloatArray, depths: FloatArray, tip: float, out: FloatArray
) -> None:
    """What G grooves together leave at N places more than the sum of what each leaves alone, (W, N), m, >= 0.

    At each place a groove is a rectangle in the plane that touches the base. The ball rests where the height of the
    ground, less what the ball dips over the distance to it, is greatest. Ground that lies as high as the bottom of one
    groove, or higher, is missing only where deeper ones are: one distance is asked for each depth, to the nearest place
    outside of the union of these.

    Args:
        places: (4, G, W, N) how far each place lies beside each course, positive to the left of it, how far from its
            beginning and its end, positive between them, m, and the course's direction, from one direction of the
            place towards its left, rad.
        bends: (2, G, N) curvatures of the base across and along each course, 1/m.
        halves: (G, W) half widths of the mouths, m.
        depths: (G, W) m.
        tip: radius of the ball, m.
        out: (W, N).
    """
    _, grooves, walkers, count = places.shape
    near = np.empty((grooves, 9))
    for w in range(walkers):
        order, far = np.argsort(depths[:, w]), halves[:, w].max()
        for i in range(count):
            m, inside = 0, False
            for g in order:
                within = min(halves[g, w] - abs(places[0, g, w, i]), places[1, g, w, i], places[2, g, w, i])
                inside = inside or within > 0.0
                if within > -far:  # the rim nearest to a place in a groove lies no farther than half of its width
                    near[m, :COS] = places[:3, g, w, i]
                    near[m, COS], near[m, SIN] = np.cos(places[3, g, w, i]), np.sin(places[3, g, w, i])
                    near[m, HALF], near[m, DEPTH] = halves[g, w], depths[g, w]
                    near[m, BEND], near[m, BEND_ALONG] = bends[0, g, i], bends[1, g, i]
                    m += 1
            out[w, i] = _union(near, m, tip) - _sum(near, m, tip) if m > 1 and inside else 0.0


@njit(cache=True, error_model="numpy", nogil=True)
def _sum(near, m, tip):  # type: ignore[no-untyped-def]
    """Heights that each of m grooves leaves without the others, m."""
    total = 0.0
    for g in range(m):
        across, along = near[g, HALF] - abs(near[g, ASIDE]), min(near[g, BEFORE], near[g, AFTER])
        if across > 0.0 and along > 0.0:
            beside = rim(across, tip, near[g, DEPTH], near[g, BEND])
            total += max(beside, rim(along, tip, near[g, DEPTH], near[g, BEND_ALONG]))
    return total


@njit(cache=True, error_model="numpy", nogil=True)
def _union(near, m, tip):  # type: ignore[no-untyped-def]
    """Height that m grooves leave together, the shallowest first, m."""
    highest = -near[m - 1, DEPTH]
    for k in range(m):
        level = 0.0 if k == 0 else -near[k - 1, DEPTH]
        away, bend = _ground_left(near, k, m)
        if away <= tip:
            highest = max(highest, level + rim(away, tip, ENDLESS, bend))
    return highest


@njit(cache=True, error_model="numpy", nogil=True)
def _ground_left(near, first, last):  # type: ignore[no-untyped-def]
    """Distance to the nearest place outside of the union of some grooves, m, and how the base bends towards it, 1/m.

    It lies on a side or an end of one of them, outside of all others.
    """
    outside = True
    for g in range(first, last):
        outside = outside and min(near[g, HALF] - abs(near[g, ASIDE]), near[g, BEFORE], near[g, AFTER]) <= 0.0
    if outside:
        return 0.0, 0.0
    best, bend = ENDLESS, 0.0
    for g in range(first, last):
        cos, sin, aside, half = near[g, COS], near[g, SIN], near[g, ASIDE], near[g, HALF]
        for edge in range(4):
            if edge < 2:  # a side: so far to the left, from its beginning to its end
                off = (half if edge == 0 else -half) - aside
                foot_x, foot_y, way_x, way_y = -off * sin, off * cos, cos, sin
                low, high = -near[g, BEFORE], near[g, AFTER]
            else:  # an end
                off = near[g, AFTER] if edge == 2 else -near[g, BEFORE]
                foot_x, foot_y, way_x, way_y = off * cos, off * sin, -sin, cos
                low, high = -half - aside, half - aside
            if abs(off) >= best:
                continue
            along = _nearest_free(near, first, last, g, foot_x, foot_y, way_x, way_y, low, high)
            away = np.sqrt(off * off + along * along)
            if away < best:
                across = off if edge < 2 else along
                share = (across / away) ** 2 if away > 0.0 else 1.0
                best, bend = away, share * near[g, BEND] + (1.0 - share) * near[g, BEND_ALONG]
    return best, bend


@njit(cache=True, error_model="numpy", nogil=True)
def _nearest_free(near, first, last, own, foot_x, foot_y, way_x, way_y, low, high):  # type: ignore[no-untyped-def]
    """The parameter nearest to 0, from low to high, at which a line is in no groove but its own; ENDLESS if none is.

    Such a line begins at a foot and goes a unit way. What is nearest is 0, a limit, or where one of the others ends.
    """
    best = ENDLESS
    for h in range(first - 1, last):
        if h == own:
            continue
        if h < first:
            start = stop = min(max(0.0, low), high)
        else:
            start, stop = _stretch_inside(near, h, foot_x, foot_y, way_x, way_y)
        for t in (start, stop):
            if abs(t) >= abs(best) or t < low or t > high:
                continue
            free = True
            for other in range(first, last):
                if other not in (own, h):
                    begin, end = _stretch_inside(near, other, foot_x, foot_y, way_x, way_y)
                    free = free and not begin < t < end
            if free:
                best = t
    return best


@njit(cache=True, error_model="numpy", nogil=True)
def _stretch_inside(near, g, foot_x, foot_y, way_x, way_y):  # type: ignore[no-untyped-def]
    """Parameters between which a line is inside a groove; the first is the greater one where it never is."""
    cos, sin = near[g, COS], near[g, SIN]
    aside, place = near[g, ASIDE] - sin * foot_x + cos * foot_y, cos * foot_x + sin * foot_y
    begin, end = _between(aside, -sin * way_x + cos * way_y, -near[g, HALF], near[g, HALF])
    first, last = _between(place, cos * way_x + sin * way_y, -near[g, BEFORE], near[g, AFTER])
    return max(begin, first), min(end, last)


@njit(cache=True, error_model="numpy", inline="always")
def _between(value, rate, low, high):  # type: ignore[no-untyped-def]
    """Parameters between which a value that changes at a rate lies between limits."""
    if rate == 0.0:
        return (-ENDLESS, ENDLESS) if low < value < high else (ENDLESS, -ENDLESS)
    one, other = (low - value) / rate, (high - value) / rate
    return min(one, other), max(one, other)
