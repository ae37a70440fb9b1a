"""Summits: the tops of what was felt together, and which places are nearer to which of them than a saddle between.

Two details whose disturbances touch leave a saddle between their tops: crossings are linked over it, and no place of it
is lower than half of both. The places about each top, down to the saddles, are the basins of a watershed.

Reference: Vincent and Soille, Watersheds in digital spaces, IEEE PAMI 13, 1991; saddles are told from noise by the
height of the lower top over them, its persistence (Edelsbrunner, Letscher and Zomorodian, 2002).
"""

from __future__ import annotations

import numpy as np

from mapping import FloatArray, IntArray
from mapping.assembly.linking.inspection import Inspection
from mapping.geometry.templates import CREST_OUTLIER_SDS, SHAPE_ERROR

# Places of other sweeps that a place is next to: three of the sweep on either side. Of 144 simulated braille dots (see
# details.py) 2, 4 and this many tell 139, this many with the fewest pieces beside; 10, which skip sweeps, tell 131
NEIGHBOURS_ASIDE = 6


def summits(places: IntArray, sign: float, inspection: Inspection) -> list[IntArray]:
    """Places of each basin, the place of its top first; the highest top first.

    Args:
        places: (M,) indices of the places that are parted.
        sign: 1 for what stands out, -1 for hollows.
        inspection: their heights.
    """
    height, sd = sign * inspection.height[places], inspection.sd[places]
    near = _next_to(inspection.points[places], inspection.sweep[places])
    of = np.full(len(places), -1)
    into: dict[int, int] = {}

    def basin(i: int) -> int:
        i = int(of[i])
        while into[i] != i:
            i = into[i]
        return i

    for i in np.argsort(-height, kind="stable").tolist():
        beside = sorted({basin(j) for j in near[i] if of[j] >= 0}, key=lambda top: -height[top])
        of[i] = beside[0] if beside else i
        if not beside:
            into[i] = i
        for top in beside[1:]:
            least = CREST_OUTLIER_SDS * float(np.hypot(sd[top], sd[i])) + SHAPE_ERROR * float(height[top])
            if height[top] - height[i] < least:
                into[top] = beside[0]
    own = np.array([basin(i) for i in range(len(places))], dtype=np.int64)
    tops = sorted(set(own.tolist()), key=lambda top: -height[top])
    return [
        places[np.concatenate([[top], np.flatnonzero((own == top) & (np.arange(len(own)) != top))])] for top in tops
    ]


def _next_to(points: FloatArray, sweep: IntArray) -> list[list[int]]:
    """Of each place those before and behind it on its sweep, and the nearest of other sweeps."""
    from scipy.spatial import cKDTree

    behind = np.flatnonzero(sweep[1:] == sweep[:-1])
    one, other = [behind], [behind + 1]
    for number in np.unique(sweep):
        own, others = np.flatnonzero(sweep == number), np.flatnonzero(sweep != number)
        if len(others):
            found = cKDTree(points[others]).query(points[own], min(NEIGHBOURS_ASIDE, len(others)))[1].ravel()
            one.append(np.repeat(own, len(found) // len(own)))
            other.append(others[found])
    pairs = np.array([np.concatenate([*one, *other]), np.concatenate([*other, *one])])
    place, near = np.divmod(np.unique(pairs[0] * len(points) + pairs[1]), len(points))
    return [each.tolist() for each in np.split(near, np.searchsorted(place, np.arange(1, len(points))))]
