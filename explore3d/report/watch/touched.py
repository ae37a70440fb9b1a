"""Where a fingertip touched, as a view draws it: at once, before anything is known of the body."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from explore3d.log import Piece
from mapping import FloatArray, IntArray

# Samples that share one direction of pressing: 10 ms of a finger that reports 5000 a second
PRESSED_TOGETHER = 50


def touched(piece: Piece, tip_radius: float, chosen: IntArray) -> FloatArray:
    """(K, 3) places of contact, m: as recorded; else the ball's centre, moved by its radius against the normal that was
    felt; else by its radius to where the move pressed; of a move that is under way the centres alone.

    Args:
        piece: samples, with the move that gave them.
        tip_radius: m.
        chosen: (K,) which of the samples, one after another in the same steps.
    """
    samples, names = piece.samples[chosen], piece.samples.dtype.names or ()
    if "cx" in names:
        return _columns(samples, "cx", "cy", "cz")
    centers = _columns(samples, "x", "y", "z")
    if "nx" in names:
        return centers - tip_radius * _columns(samples, "nx", "ny", "nz")
    if piece.move is None or not len(samples):
        return centers
    path, approach = (np.asarray(piece.move.data[name], dtype=np.float64) for name in ("path", "approach"))
    together = max(1, PRESSED_TOGETHER * len(chosen) // len(piece.samples))
    middles = np.minimum(np.arange(0, len(centers), together) + together // 2, len(centers) - 1)
    # |centre - waypoint|^2 without the centre's own square, which is the same for all waypoints
    origin = path.mean(axis=0)
    away = np.einsum("ij,ij->i", path - origin, path - origin) - 2.0 * (centers[middles] - origin) @ (path - origin).T
    pressed = approach[away.argmin(axis=1)]
    return centers + tip_radius * np.repeat(pressed, together, axis=0)[: len(centers)]


def _columns(samples: NDArray[np.void], *names: str) -> FloatArray:
    return np.column_stack([samples[name] for name in names]).astype(np.float64, copy=False)
