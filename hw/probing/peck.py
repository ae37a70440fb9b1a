"""Peck tracing: probe down, step on, probe down: a trace from any touch probe.

Only latched positions are recorded: where the probe closed, not where the machine came to rest or was told to go.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hw import FingerError, Move
from hw.grbl import GuardedStage
from mapping import FloatArray


@dataclass(frozen=True, eq=False)
class Touched:
    """Samples in contact, handed on while the sweep is under way.

    Args:
        times: (N,) time.monotonic, s.
        centers: (N, 3) tip centres, m, object frame.
        forces: (N, 3) on the tip, N; None for a touch probe.
    """

    times: FloatArray
    centers: FloatArray
    forces: FloatArray | None = None


# Sweeps get at least so many pecks: detection needs a curve, not a few points
FEWEST_PECKS = 24


@dataclass(frozen=True)
class Peck:
    """How to peck.

    Args:
        step: distance between pecks along the path, m.
        clearance: how far the tip rises between pecks, m.
        speed: of probing, m/s.
        stroke: how far beyond the commanded path to look for the body, m.
    """

    step: float
    clearance: float
    speed: float
    stroke: float

    def trace(self, stage: GuardedStage, move: Move) -> Iterator[Touched]:
        """The latched tip centre of each contact along the sweep, as it is made."""
        path, approach = spaced(move, min(self.step, move.length / FEWEST_PECKS))
        depth = -self.stroke  # of the last contact behind the commanded path, along the approach
        for point, inwards in zip(path, approach, strict=True):
            hover = point + (max(depth, -self.stroke) - self.clearance) * inwards
            stage.go(hover, -inwards, self.clearance)
            where, hit = stage.probe(point + self.stroke * inwards, self.speed)
            if hit:
                depth = float((where - point) @ inwards)
                yield Touched(np.array([time.monotonic()]), where[None, :])
            else:
                depth = min(depth, 0.0)
            stage.move(where - self.clearance * inwards)


def spaced(move: Move, step: float) -> tuple[FloatArray, FloatArray]:
    """Commanded centres (N, 3) at most `step` apart along a move's path, and unit approach directions (N, 3)."""
    lengths = np.linalg.norm(np.diff(move.path, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    count = 1 if along[-1] == 0 else 1 + int(np.ceil(along[-1] / step - 1e-9))
    s = np.linspace(0.0, along[-1], count)
    path, approach = (
        np.column_stack([np.interp(s, along, values[:, k]) for k in range(3)]) for values in (move.path, move.approach)
    )
    norm = np.linalg.norm(approach, axis=1, keepdims=True)
    if (norm < 1e-6).any():
        raise FingerError("the sweep turns its approach by 180 degrees between two waypoints; add waypoints between")
    return path, approach / norm
