"""Move: one commanded motion of the fingertip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hw.errors import MoveError
from mapping import FloatArray, lengths

PURPOSES = ("travel", "approach", "sweep", "retreat")
# These begin and end in free space, where nothing is to back off from
THROUGH_SPACE = ("travel", "retreat")


@dataclass(frozen=True, eq=False)
class Move:
    """A path for the centre of the fingertip.

    For a sweep or an approach the path is where the centre would run if nothing were in the way; the
    finger presses along `approach` and the contact decides where the centre really goes. For travel and
    retreat the path is followed through free space.

    Args:
        path: (K, 3) waypoints of the tip centre, m, object frame, K >= 1.
        approach: (3,) or (K, 3) unit directions in which the finger presses (towards the body); one row
            per waypoint after construction, interpolated between waypoints.
        speed: tangential speed, m/s.
        force: normal force to hold, N.
        purpose: one of PURPOSES.

    Raises:
        MoveError: wrong shapes, values that are not finite, directions of no length, an unknown purpose.
    """

    path: FloatArray
    approach: FloatArray
    speed: float = 0.03
    force: float = 1.0
    purpose: str = "sweep"

    def __post_init__(self) -> None:
        path = np.array(self.path, dtype=np.float64, ndmin=2)
        if path.ndim != 2 or path.shape[1] != 3 or len(path) == 0 or not np.isfinite(path).all():
            raise MoveError(f"a move's path must be finite waypoints of shape (K, 3), K >= 1; found shape {path.shape}")
        approach = np.array(self.approach, dtype=np.float64)
        if approach.shape not in ((3,), path.shape):
            raise MoveError(f"approach must have shape (3,) or {path.shape}; found {approach.shape}")
        approach = np.array(np.broadcast_to(approach, path.shape))
        norm = np.linalg.norm(approach, axis=1, keepdims=True)
        if not np.isfinite(approach).all() or (norm == 0).any():
            raise MoveError("approach directions must be finite and of non-zero length")
        approach /= norm
        if self.purpose not in PURPOSES:
            raise MoveError(f"unknown purpose {self.purpose!r}; possible: {', '.join(PURPOSES)}")
        if not (self.speed > 0 and np.isfinite(self.speed)):
            raise MoveError(f"speed must be positive and finite (m/s); found {self.speed}")
        for name, array in (("path", path), ("approach", approach)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @property
    def length(self) -> float:
        """Length of the path, m."""
        return float(lengths(np.diff(self.path, axis=0)).sum())

    @property
    def duration(self) -> float:
        """Time of the path at the commanded speed, s."""
        return self.length / self.speed
