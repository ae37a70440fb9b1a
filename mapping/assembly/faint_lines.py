"""Faint lines: ridges and grooves too low to be seen by any one sweep, but not by many together.

A line of height H crossed by k sweeps stands out of the noise sqrt(k) times as clearly as one crossing. The heights
of all inspected places are matched with a straight crest or hollow at every place, in every direction and of every
length (a Radon transform, theory section 6.8, weighted by the line's own section), and the best is accepted only if
noise alone would hardly ever reach its signal-to-noise ratio anywhere.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from mapping import BoolArray, FloatArray, IntArray
from mapping.assembly.linking import Inspection
from mapping.geometry.mesh import distances
from mapping.geometry.templates import crest_trace

# Half-widths of the sections looked for, against that of the smallest crest which a single sweep detects.
SECTIONS = (1.0, 0.65)
# Lines are sought within circles of so many half-widths, whose places face the same way within 30 degrees.
TILE = 30.0
LIKE_NORMAL_COSINE = 0.87
# Bins across and along the line, in half-widths; lengths of lines, in bins along.
BIN_WIDTH_ACROSS, BIN_LENGTH_ALONG = 1.0 / 3.0, 2.0
LINE_LENGTHS = (4, 7, 12, 20)
# Places at the crest of a line, at least: fewer say nothing of its height.
LEAST_POWER = 2.0
# Places that can show a line
FEWEST_LINE_PLACES = 16
# Half-widths by which the ends of the longest line may lie beside the nearest direction that is tried.
DIRECTION_END_OFFSET = 0.5
# Sweeps that must agree; without the one that says most this share of what the others should say must remain, and
# so many standard deviations.
FEWEST_AGREEING_SWEEPS, WITHOUT_BEST, OTHERS = 4, 0.75, 3.0
# The number of straight lines that noise can choose from is larger than that of lines without common places: the
# field of lines is continuous in place, direction, beginning and end. Set by simulation.
CONTINUUM = 30.0
MOST_LINES = 8
# Times that a line which one sweep alone makes is looked for again without that sweep: it may have run along a line
# that all others cross, and drawn the best direction to its own.
WITHOUT = 3
# Times that a line is turned, moved and lengthened.
POLISHINGS = 2


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
    inspection: Inspection,
    normals: FloatArray,
    masked: BoolArray,
    half_width: float,
    inflation: float,
    alarms: float,
    doubt: float = 1.0,
) -> tuple[FaintLine, ...]:
    """The lines that all sweeps together show, the clearest first.

    Args:
        inspection: heights of the inspected places.
        normals: (M, 3) outward unit normals there.
        masked: (M,) places that known features explain.
        half_width: of the smallest crest that a single sweep detects, m.
        inflation: standard deviation of a mean over a crossing, against that of independent places.
        alarms: accepted number of false lines.
        doubt: factor of a threshold for what is not known of the noise.
    """
    found: list[FaintLine] = []
    free = ~masked
    needed = doubt * threshold(len(inspection.points) * inspection.spacing, inspection.pitch, half_width, alarms)
    tiles = _tiles(inspection, normals, free, half_width)
    search = partial(_clearest_of_each, inspection, normals, half_width, inflation, needed)
    lines = dict(enumerate(search(tiles)))
    for _ in range(MOST_LINES):
        best = max((line for line in lines.values() if line is not None), key=lambda line: line.snr, default=None)
        if best is None or best.snr < needed:
            break
        rough = best
        for _ in range(POLISHINGS):
            best = _polished(best, inspection, free, inflation)
        if best.snr >= needed:  # noise fits the cells of the search better than a line
            found.append(best)
        # where it was before it was polished, too, or its remains would be found again
        for axis in (rough.axis, best.axis):
            near = inspection.near(axis, 1.5 * best.half_width)
            free[near[distances(inspection.points[near], axis) <= 1.5 * best.half_width]] = False
        changed = [k for k, tile in enumerate(tiles) if not free[tile].all()]
        for k in changed:
            tiles[k] = tiles[k][free[tiles[k]]]
        lines.update(zip(changed, search([tiles[k] for k in changed]), strict=True))
    return tuple(found)


def threshold(path: float, pitch: float, half_width: float, alarms: float) -> float:
    """The signal-to-noise ratio that noise alone reaches in fewer than `alarms` inspections of such a path.

    An area A holds pi A / (2 w^2) lines of any one length that share no half-width; both signs and all lengths count.
    """
    from scipy.special import ndtri

    area = path * max(min(pitch, 10 * half_width), half_width)
    lines = 0.5 * np.pi * area / half_width**2 * len(LINE_LENGTHS) * len(SECTIONS)
    return float(-ndtri(min(alarms / (2 * CONTINUUM * max(lines, 1.0)), 0.1)))


def _tiles(inspection: Inspection, normals: FloatArray, free: BoolArray, half_width: float) -> list[IntArray]:
    """Overlapping circles of places that face the same way as their first one; together they hold all free places."""
    tiles, left = [], free.copy()
    for centre in range(len(left)):
        if not left[centre]:
            continue
        near = inspection.near(inspection.points[centre][None], TILE * half_width)
        near = near[normals[near] @ normals[centre] > LIKE_NORMAL_COSINE]
        gap = np.linalg.norm(inspection.points[near] - inspection.points[centre], axis=1)
        left[near[gap < 0.8 * TILE * half_width]] = False
        left[centre] = False
        near, gap = near[free[near]], gap[free[near]]
        tiles.append(np.append(centre, near[(gap < TILE * half_width) & (near != centre)]))
    return tiles


def _clearest_of_each(
    inspection: Inspection,
    normals: FloatArray,
    half_width: float,
    inflation: float,
    needed: float,
    tiles: list[IntArray],
) -> list[FaintLine | None]:
    """The clearest line of each tile; they are independent, and the kernel leaves other threads free to work."""
    with ThreadPoolExecutor() as pool:
        return list(pool.map(lambda tile: _clearest(inspection, tile, normals, half_width, inflation, needed), tiles))


def _clearest(
    inspection: Inspection, tile: IntArray, normals: FloatArray, half_width: float, inflation: float, needed: float
) -> FaintLine | None:
    """The clearest line of any section among the places of one tile."""
    if len(tile) == 0:
        return None
    lines = [_agreed_in(inspection, tile, normals[tile[0]], w * half_width, inflation, needed) for w in SECTIONS]
    return max((line for line in lines if line is not None), key=lambda line: line.snr, default=None)


def _agreed_in(
    inspection: Inspection, tile: IntArray, normal: FloatArray, half_width: float, inflation: float, needed: float
) -> FaintLine | None:
    """The clearest line of one section among the places of one tile that enough sweeps agree on."""
    for _ in range(1 + WITHOUT):
        if (
            len(tile) < FEWEST_LINE_PLACES
            or (found := _clearest_in(inspection, tile, normal, half_width, inflation)) is None
        ):
            return None
        line, support = found
        if support.agreed(inspection.level * inflation):
            return line
        if line.snr < needed:
            return None
        tile = tile[inspection.sweep[tile] != support.loudest]
    return None


def _clearest_in(
    inspection: Inspection, tile: IntArray, normal: FloatArray, half_width: float, inflation: float
) -> tuple[FaintLine, _Support] | None:
    """The clearest line of one section among the places of one tile, and what each sweep says of it."""
    from mapping.assembly.faint_kernels import best_segment

    origin = inspection.points[tile].mean(axis=0)
    frame = _frame(normal, np.eye(3)[np.abs(normal).argmin()])
    flat = (inspection.points[tile] - origin) @ frame.T
    height = inspection.height[tile]
    size = 2 * float(np.linalg.norm(flat, axis=1).max())
    angles = np.arange(0.0, np.pi, 4 * DIRECTION_END_OFFSET / (LINE_LENGTHS[-1] * BIN_LENGTH_ALONG))
    cell_u, cell_v = BIN_LENGTH_ALONG * half_width, BIN_WIDTH_ACROSS * half_width
    section = crest_trace(np.arange(-2.0, 3.0) * cell_v, 1.0, half_width)
    sd, lengths = inspection.sd[tile], np.array(LINE_LENGTHS)
    best = best_segment(
        flat, height / sd, inspection.level / sd, angles, size, cell_u, cell_v, section, lengths, LEAST_POWER
    )
    if best[0] == 0.0:
        return None
    _, angle, row, begin, end = best
    way, aside = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    inside = (flat @ way >= begin) & (flat @ way <= end) & (np.abs(flat @ aside - row) < half_width)
    worth = (inspection.level / sd[inside]) ** 2
    support = _Support.of(height[inside], worth, flat[inside] @ aside - row, inspection.sweep[tile][inside], half_width)
    crest_sd = inspection.level * inflation / float(np.sqrt(support.square.sum()))
    crest = float(support.signal.sum() / support.square.sum())
    ends = np.array([at * way + row * aside for at in (begin, end)]) @ frame
    snr, sweeps = abs(crest) / crest_sd, len(support.signal)
    return FaintLine(origin + ends, normal, crest, crest_sd, half_width, snr, sweeps), support


def load_faint_kernel() -> None:
    """Compile or load the kernel now: whether a run looks for faint lines depends on what it feels."""
    from mapping.assembly.faint_kernels import best_segment

    place, one = np.zeros((1, 2)), np.ones(1)
    size = 2.0 * float(LINE_LENGTHS[-1])
    best_segment(place, one, one, one, size, 1.0, 1.0, np.ones(3), np.array(LINE_LENGTHS), LEAST_POWER)


def _frame(normal: FloatArray, way: FloatArray) -> FloatArray:
    """(2, 3) orthonormal tangents: the first square to the normal and to `way`."""
    first = np.cross(normal, way)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])


def _polished(line: FaintLine, inspection: Inspection, free: BoolArray, inflation: float) -> FaintLine:
    """The line turned and moved aside by less than what was tried, and as long as all free places along it say."""
    middle, length = line.axis.mean(axis=0), float(np.linalg.norm(line.axis[1] - line.axis[0]))
    frame = _frame(line.normal, np.cross(line.normal, line.axis[1] - line.axis[0]))
    reach = max(length, LINE_LENGTHS[-1] * BIN_LENGTH_ALONG * line.half_width)
    near = inspection.near(middle + reach / length * (line.axis - line.axis[::-1]), 3.0 * line.half_width)
    near = near[free[near]]
    flat, worth = (inspection.points[near] - middle) @ frame.T, (inspection.level / inspection.sd[near]) ** 2
    edges = np.arange(-reach, reach + line.half_width, line.half_width)
    widest, step = (
        2.0 * DIRECTION_END_OFFSET * line.half_width / length,
        2.0 * DIRECTION_END_OFFSET * line.half_width / reach,
    )
    best = (0.0, 0.0, 0.0, *(frame @ (line.axis - middle).T)[0], 0.0)
    for angle in np.arange(-widest, widest + step, step):
        along = flat @ [np.cos(angle), np.sin(angle)]
        across = flat @ [-np.sin(angle), np.cos(angle)]
        for row in np.linspace(-1.0, 1.0, 7) * BIN_WIDTH_ACROSS * line.half_width:
            shape = crest_trace(across - row, np.sign(line.height), line.half_width)
            terms = (worth * shape * inspection.height[near], worth * shape**2)
            sums = [np.histogram(along, edges, weights=term)[0] for term in terms]
            signal, square = (np.append(0.0, np.cumsum(values)) for values in sums)
            power = np.maximum(square[None] - square[:, None], LEAST_POWER)
            match = np.triu(signal[None] - signal[:, None], LINE_LENGTHS[0]) / np.sqrt(power)
            first, last = np.unravel_index(match.argmax(), match.shape)
            if match[first, last] <= 0.0:  # all that lies there speaks against a line of this sign, or nothing does
                continue
            touched = np.flatnonzero(sums[1][first:last] > 0)
            first, last = first + touched[0], first + touched[-1] + 1
            height = float(match[first, last] / np.sqrt(power[first, last]))
            best = max(best, (float(match[first, last]), float(angle), float(row), edges[first], edges[last], height))
    match, angle, row, begin, end, height = best
    if match == 0.0:
        return line
    way, aside = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    axis = middle + np.array([at * way + row * aside for at in (begin, end)]) @ frame
    sd = inspection.level * inflation * height / match
    return replace(line, axis=axis, height=np.sign(line.height) * height, height_sd=sd, snr=height / sd)


@dataclass(frozen=True, eq=False)
class _Support:
    """What each sweep says of a line: its match with the section, and the section's own square; both weighted by
    what its places are worth, in places of the usual standard deviation."""

    numbers: IntArray
    signal: FloatArray
    square: FloatArray

    @classmethod
    def of(
        cls, height: FloatArray, worth: FloatArray, across: FloatArray, sweep: IntArray, half_width: float
    ) -> _Support:
        shape = crest_trace(across, 1.0, half_width)
        numbers, place = np.unique(sweep, return_inverse=True)
        signal, square = (np.bincount(place, worth * term) for term in (shape * height, shape**2))
        return cls(numbers, np.asarray(signal), np.asarray(square))

    @property
    def loudest(self) -> int:
        """Number of the sweep with the largest share of the line's signal-to-noise ratio."""
        return int(self.numbers[(np.sign(self.signal.sum()) * self.signal).argmax()])

    def agreed(self, sd: float) -> bool:
        """True if enough sweeps show the line, and it stands without the one that shows it best.

        A sweep that runs at a slant over the line has more places on it than the others, and may.
        """
        if len(self.signal) < FEWEST_AGREEING_SWEEPS:
            return False
        sign, rest = float(np.sign(self.signal.sum())), self.numbers != self.loudest
        height = sign * float(self.signal.sum() / self.square.sum())
        others = sign * float(self.signal[rest].sum()) / max(float(self.square[rest].sum()), np.finfo(float).tiny)
        certain = others * float(np.sqrt(self.square[rest].sum())) / sd
        return certain > OTHERS and others > WITHOUT_BEST * height
