"""Sampling a commanded path, with the direction in which the finger presses at every sample."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mapping.errors import ContactError

FloatArray = NDArray[np.float64]

MOST_SAMPLES = 100_000_000


def sample_path(path: ArrayLike, approach: ArrayLike, spacing: float) -> tuple[FloatArray, FloatArray]:
    """Points on a polyline, no further than `spacing` apart, its corners among them; and the approach at each.

    Args:
        path: (K, 3) corners, m, K >= 1.
        approach: (3,) or (K, 3) directions of pressing, of any length but zero; between the corners they
            are interpolated linearly and normalised.
        spacing: largest distance of neighbours, m, positive.

    Returns:
        (N, 3) points, m, and (N, 3) unit vectors.

    Raises:
        ContactError: wrong shapes, values that are not finite, neighbours of opposite approach, a spacing
            that is not positive or asks for more than 1e8 samples.
    """
    corners = checked_points(path, "a path")
    if len(corners) == 0:
        raise ContactError("a path needs at least one point; found none")
    if not (np.isfinite(spacing) and spacing > 0):
        raise ContactError(f"spacing along a path must be a positive length in metres; found {spacing!r}")
    pressing = np.broadcast_to(unit_directions(approach, len(corners)), corners.shape)
    place = _places(np.linalg.norm(np.diff(corners, axis=0), axis=1), spacing)
    return _interpolate(corners, place), unit_directions(_interpolate(pressing, place), len(place))


def _places(lengths: FloatArray, spacing: float) -> FloatArray:
    """Samples as numbers: 2.25 is a quarter of the way from corner 2 to corner 3."""
    parts = np.maximum(np.ceil(lengths / spacing), 1.0)
    if not parts.sum() < MOST_SAMPLES:
        raise ContactError(f"a path of {lengths.sum():g} m at {spacing:g} m has {parts.sum():g} samples; at most 1e8")
    counts = parts.astype(np.int64)
    segment = np.repeat(np.arange(len(counts)), counts)
    within = np.arange(len(segment)) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.append(segment + within / np.maximum(counts[segment], 1), float(len(lengths)))


def _interpolate(values: FloatArray, place: FloatArray) -> FloatArray:
    before = np.minimum(place.astype(np.int64), max(len(values) - 2, 0))
    after = np.minimum(before + 1, len(values) - 1)
    share = (place - before)[:, None]
    return np.asarray(values[before] * (1.0 - share) + values[after] * share)


def unit_directions(directions: ArrayLike, count: int) -> FloatArray:
    """(count, 3) or (1, 3) unit vectors along the directions.

    Raises:
        ContactError: wrong shape, values that are not finite, a direction of length zero.
    """
    array = np.atleast_2d(np.asarray(directions, dtype=np.float64))
    if array.shape not in ((count, 3), (1, 3)):
        raise ContactError(f"directions must have shape (3,) or ({count}, 3); found {np.shape(directions)}")
    largest = np.abs(array).max(axis=1, keepdims=True)
    bad = ~(np.isfinite(largest) & (largest > 0.0))
    if bad.any():
        first = int(bad.argmax())
        raise ContactError(f"directions must be finite and not zero; number {first} is {array[first].tolist()}")
    array = np.ldexp(array, 1 - np.frexp(largest)[1])  # so that squares neither over- nor underflow
    return np.ascontiguousarray(array / np.linalg.norm(array, axis=1, keepdims=True))


def checked_points(points: ArrayLike, name: str) -> FloatArray:
    """Points as a contiguous (N, 3) array.

    Raises:
        ContactError: wrong shape, or values that are not finite.
    """
    array = np.ascontiguousarray(points, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ContactError(f"{name} must have shape (N, 3); found {array.shape}")
    bad = ~np.isfinite(array).all(axis=1)
    if bad.any():
        raise ContactError(f"{name} must be finite; {int(bad.sum())} are not, the first is number {int(bad.argmax())}")
    return array
