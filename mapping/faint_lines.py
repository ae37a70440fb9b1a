"""Faint lines: ridges and grooves too low to be seen by any one sweep, but not by many together.

A line of height H crossed by k sweeps stands out of the noise sqrt(k) times as clearly as one crossing. The heights
of all inspected places are matched with a straight crest or hollow at every place, in every direction and of every
length (the Radon transform of Detection theory, weighted by the line's own section), and the best is believed only if
noise alone would hardly ever look so like a line anywhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapping.crest_trace import crest_trace, distances
from mapping.inspection import Inspection

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]

# Half-widths of the sections looked for, against that of the smallest crest which a single sweep detects.
SECTIONS = (1.0, 0.65)
# Lines are sought within circles of so many half-widths, whose places face the same way within 30 degrees.
TILE = 30.0
FACING = 0.87
# Bins across and along the line, in half-widths; lengths of lines, in bins along.
ACROSS, ALONG = 1.0 / 3.0, 2.0
LENGTHS = (4, 7, 12, 20)
# Sweeps that must agree, and the share of the evidence that must remain without the one that says most.
SWEEPS, WITHOUT_BEST = 4, 0.75
# The number of straight lines that noise can choose from is larger than that of lines without common places: the
# field of lines is continuous in place, direction, beginning and end. Set by simulation.
CONTINUUM = 30.0
MOST_LINES = 8


@dataclass(frozen=True, eq=False)
class FaintLine:
    """A straight line that the places along it support together.

    Args:
        axis: (2, 3) its ends, m.
        normal: (3,) outward.
        height: signed height of the crest on the trace, m.
        height_sd: its standard deviation, m.
        half_width: of the section, m.
        snr: of all places together.
        sweeps: number of sweeps that crossed it.
    """

    axis: FloatArray
    normal: FloatArray
    height: float
    height_sd: float
    half_width: float
    snr: float
    sweeps: int


def faint_lines(
    inspection: Inspection, normals: FloatArray, masked: BoolArray, half_width: float, inflation: float, alarms: float
) -> tuple[FaintLine, ...]:
    """The lines that all sweeps together show, the clearest first.

    Args:
        inspection: heights of the inspected places.
        normals: (M, 3) outward unit normals there.
        masked: (M,) places that known features explain.
        half_width: of the smallest crest that a single sweep detects, m.
        inflation: standard deviation of a mean over a crossing, against that of independent places.
        alarms: accepted number of false lines.
    """
    found: list[FaintLine] = []
    free = ~masked
    needed = threshold(len(inspection.points) * inspection.spacing, inspection.pitch, half_width, alarms)
    tiles = _tiles(inspection, normals, free, half_width)
    lines = [_clearest(inspection, tile, normals, half_width, inflation) for tile in tiles]
    for _ in range(MOST_LINES):
        best = max((line for line in lines if line is not None), key=lambda line: line.snr, default=None)
        if best is None or best.snr < needed:
            break
        found.append(best)
        near = inspection.near(best.axis, 1.5 * best.half_width)
        free[near[distances(inspection.points[near], best.axis) <= 1.5 * best.half_width]] = False
        for k, tile in enumerate(tiles):
            if not free[tile].all():
                tiles[k] = tile[free[tile]]
                lines[k] = _clearest(inspection, tiles[k], normals, half_width, inflation)
    return tuple(found)


def threshold(path: float, pitch: float, half_width: float, alarms: float) -> float:
    """The signal-to-noise ratio that noise alone reaches in fewer than `alarms` inspections of such a path.

    An area A holds pi A / (2 w^2) lines of any one length that share no half-width; both signs and all lengths count.
    """
    from scipy.special import ndtri

    area = path * max(min(pitch, 10 * half_width), half_width)
    lines = 0.5 * np.pi * area / half_width**2 * len(LENGTHS) * len(SECTIONS)
    return float(-ndtri(min(alarms / (2 * CONTINUUM * max(lines, 1.0)), 0.1)))


def _tiles(inspection: Inspection, normals: FloatArray, free: BoolArray, half_width: float) -> list[IntArray]:
    """Overlapping circles of places that face the same way as their first one; together they hold all free places."""
    tiles, left = [], free.copy()
    for centre in range(len(left)):
        if not left[centre]:
            continue
        near = inspection.near(inspection.points[centre][None], TILE * half_width)
        near = near[normals[near] @ normals[centre] > FACING]
        gap = np.linalg.norm(inspection.points[near] - inspection.points[centre], axis=1)
        left[near[gap < 0.8 * TILE * half_width]] = False
        left[centre] = False
        near, gap = near[free[near]], gap[free[near]]
        tiles.append(np.append(centre, near[(gap < TILE * half_width) & (near != centre)]))
    return tiles


def _clearest(
    inspection: Inspection, tile: IntArray, normals: FloatArray, half_width: float, inflation: float
) -> FaintLine | None:
    """The clearest line of any section among the places of one tile."""
    if len(tile) == 0:
        return None
    lines = [_clearest_in(inspection, tile, normals[tile[0]], w * half_width, inflation) for w in SECTIONS]
    return max((line for line in lines if line is not None), key=lambda line: line.snr, default=None)


def _clearest_in(
    inspection: Inspection, tile: IntArray, normal: FloatArray, half_width: float, inflation: float
) -> FaintLine | None:
    """The clearest line among the places of one tile."""
    from mapping.faint_kernels import best_segment

    if len(tile) < 16:
        return None
    origin = inspection.points[tile].mean(axis=0)
    helper = np.eye(3)[np.abs(normal).argmin()]
    first = np.cross(normal, helper)
    first /= np.linalg.norm(first)
    frame = np.stack([first, np.cross(normal, first)])
    flat = (inspection.points[tile] - origin) @ frame.T
    height = inspection.height[tile]
    size = 2 * float(np.linalg.norm(flat, axis=1).max())
    angles = np.arange(0.0, np.pi, 2.4 / (LENGTHS[2] * ALONG))
    cell_u, cell_v = ALONG * half_width, ACROSS * half_width
    section = crest_trace(np.arange(-2.0, 3.0) * cell_v, 1.0, half_width)
    best = best_segment(flat, height / inspection.sd, angles, size, cell_u, cell_v, section, np.array(LENGTHS))
    if best[0] == 0.0:
        return None
    _, angle, row, begin, end = best
    way, aside = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    inside = (flat @ way >= begin) & (flat @ way <= end) & (np.abs(flat @ aside - row) < half_width)
    line = _Support.of(height[inside], flat[inside] @ aside - row, inspection.sweep[tile][inside], half_width)
    if not line.agreed():
        return None
    sd = inspection.sd * inflation / float(np.sqrt(line.square.sum()))
    crest = float(line.signal.sum() / line.square.sum())
    ends = np.array([at * way + row * aside for at in (begin, end)]) @ frame
    return FaintLine(origin + ends, normal, crest, sd, half_width, abs(crest) / sd, len(line.signal))


@dataclass(frozen=True, eq=False)
class _Support:
    """What each sweep says of a line: its match with the section, and the section's own square."""

    signal: FloatArray
    square: FloatArray

    @classmethod
    def of(cls, height: FloatArray, across: FloatArray, sweep: IntArray, half_width: float) -> _Support:
        shape = crest_trace(across, 1.0, half_width)
        number = np.unique(sweep, return_inverse=True)[1]
        return cls(np.asarray(np.bincount(number, shape * height)), np.asarray(np.bincount(number, shape**2)))

    def agreed(self) -> bool:
        """True if enough sweeps show the line, and it stands without the one that shows it best."""
        if len(self.signal) < SWEEPS:
            return False
        sign = float(np.sign(self.signal.sum()))
        rest = np.arange(len(self.signal)) != int((sign * self.signal).argmax())
        whole = sign * float(self.signal.sum() / np.sqrt(self.square.sum()))
        return sign * float(self.signal[rest].sum() / np.sqrt(self.square[rest].sum())) > WITHOUT_BEST * whole
