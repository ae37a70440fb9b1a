"""Sweeps over a reference sphere: the lines along which a tip is calibrated and a finger tested."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from hw.moves import Move


def meridians(
    center: ArrayLike,
    radius: float,
    tip_radius: float,
    lines: int,
    *,
    reach: float = np.pi / 3,
    speed: float = 0.03,
    force: float = 1.0,
) -> list[Move]:
    """Sweeps from one side of a sphere over its top (+z) to the other.

    Args:
        center: (3,) of the sphere, m, object frame.
        radius: of the sphere, m.
        lines: how many, evenly turned about z.
        reach: how far down they go from the top, rad.
    """
    angle = np.linspace(-reach, reach, 121)
    moves = []
    for number in range(lines):
        turn = np.pi * number / lines
        unit = np.column_stack([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.cos(angle)])
        unit = unit if number % 2 == 0 else unit[::-1]
        path = np.asarray(center) + (radius + 0.98 * tip_radius) * unit
        moves.append(Move(path, -unit, speed=speed, force=force))
    return moves
