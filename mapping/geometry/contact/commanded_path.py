"""CommandedPath: where the ball is sent, and the direction in which it is pressed on the way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mapping import ContactError, FloatArray, lengths

MOST_PATH_SAMPLES = 100_000_000


@dataclass(frozen=True, eq=False)
class CommandedPath:
    """A polyline of ball centres with a direction of pressing.

    Args:
        corners: (K, 3) corners, m, K >= 1.
        approach: (3,) or (K, 3) directions of pressing, of any length but zero; between the corners they are
            interpolated linearly and normalised.

    Raises:
        ContactError: wrong shapes, values that are not finite, an approach of length zero.
    """

    corners: FloatArray
    approach: FloatArray

    def __init__(self, corners: ArrayLike, approach: ArrayLike) -> None:
        points = checked_points(corners, "the corners of a path")
        if len(points) == 0:
            raise ContactError("a path needs at least one corner; found none")
        object.__setattr__(self, "corners", points)
        object.__setattr__(self, "approach", np.broadcast_to(unit_directions(approach, len(points)), points.shape))

    def places(self, spacing: float) -> FloatArray:
        """(N,) samples no further than `spacing` apart: 2.25 is a quarter of the way from corner 2 to corner 3.

        Raises:
            ContactError: a spacing that is not positive or asks for more than 1e8 samples.
        """
        if not (np.isfinite(spacing) and spacing > 0):
            raise ContactError(f"spacing along a path must be a positive length in metres; found {spacing!r}")
        lengths = np.linalg.norm(np.diff(self.corners, axis=0), axis=1)
        parts = np.maximum(np.ceil(lengths / spacing), 1.0)
        if not parts.sum() < MOST_PATH_SAMPLES:
            raise ContactError(f"{lengths.sum():g} m at {spacing:g} m make {parts.sum():g} samples; at most 1e8 do")
        counts = parts.astype(np.int64)
        segment = np.repeat(np.arange(len(counts)), counts)
        within = np.arange(len(segment)) - np.repeat(np.cumsum(counts) - counts, counts)
        return np.append(segment + within / np.maximum(counts[segment], 1), float(len(lengths)))

    def at(self, places: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(N, 3) centres, m, and (N, 3) unit directions of pressing at the places (N,).

        Raises:
            ContactError: the approach vanishes between corners of opposite approach.
        """
        before = np.minimum(places.astype(np.int64), max(len(self.corners) - 2, 0))
        after = np.minimum(before + 1, len(self.corners) - 1)
        share = (places - before)[:, None]
        points = self.corners[before] * (1.0 - share) + self.corners[after] * share
        way = self.approach[before] * (1.0 - share) + self.approach[after] * share
        return points, np.broadcast_to(unit_directions(way, len(way)), way.shape)


def unit_directions(directions: ArrayLike, count: int) -> FloatArray:
    """(count, 3) or (1, 3) unit vectors along the directions.

    Raises:
        ContactError: wrong shape, values that are not finite, a direction of length zero.
    """
    array = np.atleast_2d(np.asarray(directions, dtype=np.float64))
    if array.shape not in ((count, 3), (1, 3)):
        raise ContactError(f"directions must have shape (3,) or ({count}, 3); found {np.shape(directions)}")
    x, y, z = np.abs(array).T
    largest = np.maximum(np.maximum(x, y), z)[:, None]  # along rows of three numpy's own maximum is slow
    bad = ~(np.isfinite(largest) & (largest > 0.0))
    if bad.any():
        first = int(bad.argmax())
        raise ContactError(f"directions must be finite and not zero; number {first} is {array[first].tolist()}")
    array = np.ldexp(array, 1 - np.frexp(largest)[1])  # so that squares neither over- nor underflow
    return np.ascontiguousarray(array / lengths(array)[:, None])


def checked_points(points: ArrayLike, name: str) -> FloatArray:
    """Points as a contiguous (N, 3) array.

    Raises:
        ContactError: wrong shape, or values that are not finite.
    """
    array = np.ascontiguousarray(points, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ContactError(f"{name} must have shape (N, 3); found {array.shape}")
    if not np.isfinite(array).all():
        bad = ~np.isfinite(array).all(axis=1)
        raise ContactError(f"{name} must be finite; {int(bad.sum())} are not, the first is number {int(bad.argmax())}")
    return array
