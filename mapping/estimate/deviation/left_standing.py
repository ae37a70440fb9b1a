"""Left standing: what stands off a base that was fitted to many sweeps, and is wider than fine features are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray
from mapping.base import LaidTrace, SweepHeights
from mapping.base.profiles import SHORTEST_BEND, isolated_rest
from mapping.instrument import neighbour_scatter

# Places of a sweep that are looked at: the count that the thresholds of isolated bends were simulated with
_PLACES = 480
# Places across the narrowest that counts
_PER_WIDTH = 4.0


@dataclass(frozen=True, eq=False)
class LeftStanding:
    """A hollow or a hump: height (signed), m, width at half of it along a sweep, m, place (3,), m, sweeps over it."""

    height: float
    width: float
    place: FloatArray
    sweeps: int


def left_standing(trace: LaidTrace) -> list[LeftStanding]:
    """What fine features are sought on, and is none of them and not of the base's family: the highest first.

    Args:
        trace: laid on its base, and searched: the heights are those that are known by now.
    """
    found: list[LeftStanding] = []
    numbers: list[int] = []
    for sweep in trace.laid_sweeps:
        for piece in sweep.known_heights():
            found += _of_piece(piece, trace.tip_radius)
            numbers += [sweep.number] * (len(found) - len(numbers))
    if not found:
        return []
    places = np.array([each.place for each in found])
    heights, widths = (np.array([getattr(each, name) for each in found]) for name in ("height", "width"))
    chosen, left = [], np.ones(len(found), dtype=bool)
    for top in np.argsort(-np.abs(heights), kind="stable"):
        if not left[top]:
            continue
        together, left[top] = [top], False
        for one in together:  # which grows: neighbours of neighbours make a long hollow one
            beside = left & (heights * heights[one] > 0.0)
            beside[beside] = np.linalg.norm(places[beside] - places[one], axis=1) < widths[beside] + widths[one]
            left[beside] = False
            together += np.flatnonzero(beside).tolist()
        over = len({numbers[k] for k in together})
        chosen.append(LeftStanding(found[top].height, float(np.median(widths[together])), found[top].place, over))
    return chosen


def _of_piece(piece: SweepHeights, tip_radius: float) -> list[LeftStanding]:
    narrowest = SHORTEST_BEND * tip_radius
    size = max(1, int(min(piece.length / _PLACES, narrowest / _PER_WIDTH) / piece.spacing))
    count = len(piece.height) // size
    if count < 4:
        return []
    x = _means(piece.s, size, count)
    z = _means(piece.height, size, count)
    noise = neighbour_scatter(z)
    return [
        LeftStanding(bend.height, bend.width, piece.centers[int(np.abs(piece.s - bend.place).argmin())], 1)
        for bend in isolated_rest(x, z, np.zeros_like(z), noise, narrowest)
    ]


def _means(values: FloatArray, size: int, count: int) -> FloatArray:
    return np.asarray(values[: size * count].reshape(count, size).mean(axis=1))
