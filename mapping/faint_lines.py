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

from mapping.crest_trace import crest_trace
from mapping.inspection import Inspection

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

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
    for _ in range(MOST_LINES):
        best = _clearest(inspection, normals, free, half_width, inflation)
        if best is None or best.snr < needed:
            break
        found.append(best)
        start, way = best.axis[0], best.axis[1] - best.axis[0]
        offset = inspection.points - start
        share = np.clip(offset @ way / (way @ way), 0.0, 1.0)
        free = free & (np.linalg.norm(offset - share[:, None] * way, axis=1) > 1.5 * best.half_width)
    return tuple(found)


def threshold(path: float, pitch: float, half_width: float, alarms: float) -> float:
    """The signal-to-noise ratio that noise alone reaches in fewer than `alarms` inspections of such a path.

    An area A holds pi A / (2 w^2) lines of any one length that share no half-width; both signs and all lengths count.
    """
    from scipy.special import ndtri

    area = path * max(min(pitch, 10 * half_width), half_width)
    lines = 0.5 * np.pi * area / half_width**2 * len(LENGTHS) * len(SECTIONS)
    return float(-ndtri(min(alarms / (2 * CONTINUUM * max(lines, 1.0)), 0.1)))


def _clearest(
    inspection: Inspection, normals: FloatArray, free: BoolArray, half_width: float, inflation: float
) -> FaintLine | None:
    best: FaintLine | None = None
    left = free.copy()
    while left.any():
        centre = int(left.argmax())
        gap = np.linalg.norm(inspection.points - inspection.points[centre], axis=1)
        facing = normals @ normals[centre] > FACING
        tile = np.flatnonzero(facing & free & (gap < TILE * half_width))
        left &= ~(facing & (gap < 0.8 * TILE * half_width))
        left[centre] = False
        for section in SECTIONS:
            line = _clearest_in(inspection, tile, normals[centre], section * half_width, inflation)
            if line is not None and (best is None or line.snr > best.snr):
                best = line
    return best


def _clearest_in(
    inspection: Inspection, tile: NDArray[np.int64], normal: FloatArray, half_width: float, inflation: float
) -> FaintLine | None:
    """The clearest line among the places of one tile."""
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
    best = (0.0, 0.0, 0.0, 0.0, 0.0)
    for angle in np.arange(0.0, np.pi, 2.4 / (LENGTHS[2] * ALONG)):
        way = np.array([np.cos(angle), np.sin(angle)])
        u, v = flat @ way, flat @ [-way[1], way[0]]
        snr, row, begin, end = _best_segment(u, v, height / inspection.sd, size, half_width)
        best = max(best, (snr, float(angle), row, begin, end), key=lambda line: abs(line[0]))
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
    def of(cls, height: FloatArray, across: FloatArray, sweep: NDArray[np.int64], half_width: float) -> _Support:
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


def _best_segment(
    u: FloatArray, v: FloatArray, height: FloatArray, size: float, half_width: float
) -> tuple[float, float, float, float]:
    """(signal-to-noise, place across, beginning, end) of the clearest segment along u."""
    cell_v, cell_u = ACROSS * half_width, ALONG * half_width
    rows, columns = int(size / cell_v) + 3, int(size / cell_u) + 3
    low_v, low_u = -0.5 * rows * cell_v, -0.5 * columns * cell_u
    index = ((v - low_v) / cell_v).astype(np.int64) * columns + ((u - low_u) / cell_u).astype(np.int64)
    total = np.bincount(index, height, rows * columns).reshape(rows, columns)
    count = np.bincount(index, minlength=rows * columns).reshape(rows, columns).astype(np.float64)
    offsets = np.arange(-2.0, 3.0) * cell_v
    section = crest_trace(offsets, 1.0, half_width)
    signal = sum(w * total[2 + k : rows - 2 + k] for w, k in zip(section, range(-2, 3), strict=True))
    square = sum(w**2 * count[2 + k : rows - 2 + k] for w, k in zip(section, range(-2, 3), strict=True))
    signal = np.concatenate([np.zeros((rows - 4, 1)), np.cumsum(signal, axis=1)], axis=1)
    square = np.concatenate([np.zeros((rows - 4, 1)), np.cumsum(square, axis=1)], axis=1)
    best = (0.0, 0.0, 0.0, 0.0)
    for length in LENGTHS:
        if length > columns:
            break
        power = square[:, length:] - square[:, :-length]
        snr = np.where(power > 2.0, (signal[:, length:] - signal[:, :-length]) / np.sqrt(np.maximum(power, 1e-9)), 0.0)
        k = int(np.abs(snr).argmax())
        row, column = divmod(k, snr.shape[1])
        if abs(snr[row, column]) > abs(best[0]):
            begin = low_u + column * cell_u
            best = (float(snr[row, column]), low_v + (row + 2.5) * cell_v, begin, begin + length * cell_u)
    return best
