"""Levels: by how much a recording's noise is louder and quieter than its law from place to place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from mapping import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Levels:
    """The level of the noise along each sweep, over that of its law.

    Args:
        of_sweeps: by the sweep's number: (n,) times, ascending, and (n,) standard deviations over the law's there.
    """

    of_sweeps: dict[int, tuple[FloatArray, FloatArray]]

    @classmethod
    def of(cls, parts: Sequence[tuple[int, FloatArray, FloatArray]]) -> Self | None:
        """Of pieces of sweeps: number, times and levels of each; None if all are of one level."""
        if not parts or np.ptp(np.concatenate([level for _, _, level in parts])) == 0.0:
            return None
        pieces: dict[int, list[tuple[FloatArray, FloatArray]]] = {}
        for number, t, level in parts:
            pieces.setdefault(number, []).append((t, level))
        joined = {}
        for number, own in pieces.items():
            t, level = (np.concatenate(columns) for columns in zip(*own, strict=True))
            order = np.argsort(t, kind="stable")
            joined[number] = t[order], level[order]
        return cls(joined)

    def at(self, sweep: IntArray, t: FloatArray) -> FloatArray:
        """(N,) of samples of the sweeps with these numbers (N,) at times (N,); 1 where nothing is known."""
        level = np.ones(len(t))
        for number in np.unique(sweep):
            if (known := self.of_sweeps.get(int(number))) is not None:
                own = sweep == number
                level[own] = np.interp(t[own], *known)
        return level

    def beside(self, share: float) -> Self:
        """Of this noise and a part of one level everywhere that makes a share of the variance of both."""
        parts = self.of_sweeps.items()
        return type(self)({n: (t, np.sqrt((1.0 - share) * level**2 + share)) for n, (t, level) in parts})
