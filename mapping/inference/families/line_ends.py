"""What tells of a line that has no ends of its own: not what other sweeps felt where it had ended."""

from __future__ import annotations

import numpy as np

from mapping import BoolArray, FloatArray, IntArray
from mapping.geometry.mesh import arclengths, nearest_on

# A run that passes nearer to where a line was last felt may have felt it still, in half-widths. Pockets and bosses
# under rows 0.4 and 0.8 half-widths apart are told alike with 0.25, 0.5 and 1
LAST_FELT = 0.5
# Runs over a line that tell its course
FEWEST_RUNS = 2


def tells_of_line(
    axis: FloatArray, normals: FloatArray, points: FloatArray, run: IntArray, half_width: float
) -> BoolArray:
    """(n,) True of places that tell of a line whose family has no ends, as that of a step has none.

    Where runs pass over what would be the line, and nothing was felt there, it has ended: at a corner of a pocket, say,
    where another wall begins. What that is the family does not know, and what is felt within a half-width of the end is
    its as well.

    Args:
        axis, normals: (K, 3) where the line was felt, m, and outward there.
        points: (n, 3) places on the base along runs, m.
        run: (n,) number of the run of each.
        half_width: of the line's disturbance, m.
    """
    tells = np.ones(len(points), dtype=bool)
    if len(axis) < 2 or not len(points):
        return tells
    on, along = nearest_on(points, axis)
    length = float(arclengths(axis)[-1])
    for end, before, from_end in ((0, 1, along), (-1, -2, length - along)):
        out = axis[end] - axis[before]
        out = out / max(float(np.linalg.norm(out)), np.finfo(float).tiny)
        offset = points - axis[end]
        aside, beyond = offset @ np.cross(normals[end], out), offset @ out
        over = (run[1:] == run[:-1]) & (aside[1:] * aside[:-1] <= 0.0)
        if (over & (np.minimum(beyond[1:], beyond[:-1]) > LAST_FELT * half_width)).any():
            tells &= from_end > half_width
    near = np.linalg.norm(points - on, axis=1) < LAST_FELT * half_width
    return tells if len(np.unique(run[tells & near])) >= FEWEST_RUNS else np.ones(len(points), dtype=bool)
