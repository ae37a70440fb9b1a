"""The path of one sweep along its base, rolled out into a plane, and its directions there.

A sweep that runs straight on over a curved body, or over an edge, is a straight line in that plane: what turns there
was turned by who led the finger.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import BoolArray, ComplexArray, FloatArray, IntArray, Trace, lengths
from mapping.base import Base, Feet
from mapping.instrument import robust_scale

# Blocks that the reach of a turn is cut into: a turn is placed to an eighth of it
BLOCKS_PER_REACH = 8
# Noise of a turn that the angle judged must stand out of, in standard deviations: one false turn in a million places
CERTAIN_TURN_SDS = 5.0
# A finger that advances by less than this share of the way that it usually goes waits, and has no direction. Round a
# corner of the angle a it advances by cos(a / 2): up to 151 degrees a corner is no waiting, and what turns further back
# shows its turn before and after
WAITS = 0.25
# Distances over k samples grow by at least this factor when k doubles, where noise no longer makes them: 2 without
# any, 1.41 if nothing but noise
GROWS = 1.8


@dataclass(frozen=True, eq=False)
class RolledOut:
    """Block means of a sweep, those left out in which the finger waits.

    Args:
        first: (K,) index of each block's first sample.
        size: samples in a block.
        plane: (K,) places in the plane as complex numbers, m.
        places: (K, 3) the same places on the base's own trace, m.
        height: (K,) over the base, m.
        span: blocks over which a direction is taken.
        round: (K,) angle by which the base's normal has turned forwards since the beginning, rad: 2 pi once round.
    """

    first: IntArray
    size: int
    plane: ComplexArray
    places: FloatArray
    height: FloatArray
    span: int
    round: FloatArray

    def turns(self, span: int) -> tuple[FloatArray, FloatArray]:
        """At each place (K,): change of the chord of unit length over `span` places, and angle of its turn, rad.

        Nearer to an end than that a direction is taken from what there is, but from no less than half.
        """
        here = np.arange(len(self.plane))
        own = np.minimum(np.minimum(here, len(here) - 1 - here), span)
        enough = own >= max(1, (span + 1) // 2)
        before, after = self.plane - self.plane[here - own], self.plane[here + own] - self.plane
        angle = np.where(enough, np.abs(np.angle(after * np.conj(before))), 0.0)
        return np.where(enough, np.abs(after - before) / np.maximum(own, 1), 0.0), angle

    def turn_sd(self) -> float:
        """Standard deviation of a turn over `span` by the noise, rad: an even bend has none."""
        k, z = max(1, self.span // 2), self.plane
        if len(z) <= 3 * k:
            return 0.0
        forth = z[3 * k :] - z[: -3 * k]
        away = z[3 * k :] - 3 * z[2 * k : -k] + 3 * z[k : -2 * k] - z[: -3 * k]
        # across the path: an uneven speed turns nothing. Third differences have 20 times the variance of a place, a
        # turn (1, -2, 1) / span has 6 times
        across = np.imag(away * np.conj(forth)) / np.maximum(np.abs(forth), np.finfo(float).tiny)
        length = np.median(np.abs(z[self.span :] - z[: -self.span])) if len(z) > self.span else np.abs(forth).max()
        return float(robust_scale(across) * np.sqrt(6 / 20) / max(length, np.finfo(float).tiny))

    def directions(self, begin: int, end: int) -> FloatArray:
        """Directions over `span` of the places from `begin` to `end`, rad, without jumps by a whole turn."""
        part = self.plane[begin : end + 1]
        return np.unwrap(np.angle(part[self.span :] - part[: -self.span]))


def usual_step(centers: FloatArray) -> float:
    """Distance from a sample (N, 3) to the next without the noise's share, m; 0 if the samples stand still."""
    k, usual = 1, _median_distance(centers, 1)
    while len(centers) > 4 * k:
        longer = _median_distance(centers, 2 * k)
        if usual > 0 and longer >= GROWS * usual:
            break
        usual, k = longer, 2 * k
    return usual / k


def runs_straight(centers: FloatArray, reach: float, step: float, sharp: float, widest: float) -> bool:
    """True of a path of centres (N, 3) that needs no base to be seen to be straight.

    Args:
        reach: length over which a direction is taken, m.
        step: between samples, m.
        sharp: angle by which it turns nowhere, rad.
        widest: angle within which all its directions lie, rad.
    """
    size = max(1, int(reach / step))
    blocks = block_medians(centers, size)
    if len(blocks) < 3:
        return False
    chord = np.diff(blocks, axis=0)
    length = np.linalg.norm(chord, axis=1)
    along = (blocks[-1] - blocks[0]) / max(float(np.linalg.norm(blocks[-1] - blocks[0])), np.finfo(float).tiny)
    # two neighbouring chords see all of a turn, or at least half of one between them
    advance = chord @ along
    turn = np.einsum("ij,ij->i", chord[1:], chord[:-1])
    even = turn > np.cos(0.5 * sharp) * length[1:] * length[:-1]
    # a path that turns back within one block is shorter there
    return bool((advance > np.cos(0.5 * widest) * length).all() and even.all() and 2 * length.min() > length.max())


def rolled_out(
    trace: Trace, base: Base, step: float, reach: float, sharp: float, known: Feet | None = None
) -> RolledOut | None:
    """Roll a sweep out into a plane; None if it hardly moves, or not for as long as one block.

    Blocks and the reach are made longer until the scatter of the blocks leaves a turn by `sharp` certain. Independent
    samples that scatter by sigma need a reach of (BLOCKS_PER_REACH 6 (CERTAIN_TURN_SDS sigma / sharp)^2 step)^(1/3);
    that is not computed but measured, for the noise may be correlated.

    Args:
        trace: of one sweep.
        base: the global model.
        step: distance of its samples, m.
        reach: length over which a direction is taken, at least, m.
        sharp: the turn to be judged, rad.
        known: where the samples stand over the base, if that is known; else the blocks are laid on it.
    """
    size = max(1, int(reach / (BLOCKS_PER_REACH * step)))
    if len(trace) < size:
        return None
    # medians bear readings that are thrown off for a moment
    if known is None:
        feet = base.foot(block_medians(trace.centers, size), trace.tip_radius)
        places, normals, height = feet.points + trace.tip_radius * feet.normals, feet.normals, feet.height
    else:
        places = block_medians(known.points + trace.tip_radius * known.normals, size)
        normals = block_medians(known.normals, size)
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        height = block_medians(known.height, size)
    first = size * np.arange(len(places))
    span = max(1, round(reach / (size * step)))
    while True:
        moves = ~_waits(places, span, size * step)
        if moves.sum() < 3:
            return None
        own, up = places[moves], normals[moves]
        path = RolledOut(first[moves], size, _plane(own, up), own, height[moves], span, _round(own, up))
        if size == span == 1 or CERTAIN_TURN_SDS * path.turn_sd() < sharp or len(places) < 8 * span:
            return path
        places, normals, height = _halved(places), _halved(normals), _halved(height)
        first, size = first[: len(first) // 2 * 2 : 2], 2 * size


def block_medians(points: FloatArray, size: int) -> FloatArray:
    """(K, 3) medians of whole blocks of so many of the points (N, 3); of values (N,) likewise (K,)."""
    count = len(points) // size
    blocks = points[: count * size].reshape(count, size, *points.shape[1:])
    return blocks[:, 0] if size == 1 else np.asarray(np.median(blocks, axis=1))


def _halved(values: FloatArray) -> FloatArray:
    whole = values[: len(values) // 2 * 2]
    return np.asarray(0.5 * (whole[::2] + whole[1::2]))


def _waits(places: FloatArray, span: int, step: float) -> BoolArray:
    """(K,) True where a finger hardly moves over `span` blocks, and where it did not move at all."""
    here, half = np.arange(len(places)), max(1, span // 2)
    low, high = np.maximum(here - half, 0), np.minimum(here + half, len(here) - 1)
    moved = np.linalg.norm(places[high] - places[low], axis=1)
    waits = moved < WAITS * (high - low) * step
    waits[1:] |= (places[1:] == places[:-1]).all(axis=1)
    waits[[0, -1]] = False
    return np.asarray(waits)


def _plane(places: FloatArray, normals: FloatArray) -> ComplexArray:
    """Places (K, 3) on a body with its normals there, rolled out.

    Each step is compared with the one before it, carried over by the least rotation between the normals; what lengths
    and turns are, they stay.
    """
    along = np.diff(places, axis=0)
    middle = normals[1:] + normals[:-1]
    middle /= np.maximum(np.linalg.norm(middle, axis=1, keepdims=True), np.finfo(float).tiny)
    length = np.linalg.norm(along, axis=1)
    along = along - np.einsum("ij,ij->i", along, middle)[:, None] * middle
    before, after, n, m = along[:-1], along[1:], middle[:-1], middle[1:]
    # the least rotation that takes m to n, of a vector v normal to m: v - (m + n) (n . v) / (1 + m . n)
    both = m + n
    cosine = np.einsum("ij,ij->i", m, n)
    share = np.einsum("ij,ij->i", n, after) / np.maximum(1 + cosine, 1e-9)
    carried = after - share[:, None] * both
    turn = np.einsum("ij,ij->i", before, carried) + 1j * np.einsum("ij,ij->i", n, np.cross(before, carried))
    direction = np.concatenate([[0.0], np.cumsum(np.angle(turn))])
    return np.concatenate([[0.0], np.cumsum(length * np.exp(1j * direction))])


def _round(places: FloatArray, normals: FloatArray) -> FloatArray:
    """Angles (K,) by which the normals (K, 3) have turned the way that the places (K, 3) advance."""
    along = np.diff(places, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), np.finfo(float).tiny)
    chord = np.einsum("ij,ij->i", np.diff(normals, axis=0), along)
    return np.concatenate([[0.0], np.cumsum(2.0 * np.arcsin(np.clip(0.5 * chord, -1.0, 1.0)))])


def _median_distance(centers: FloatArray, k: int) -> float:
    # every thousandth part tells the median
    begin = np.arange(0, len(centers) - k, max(1, len(centers) // 1000))
    return float(np.median(lengths(centers[begin + k] - centers[begin]))) if len(begin) else 0.0
