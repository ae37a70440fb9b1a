"""Zero: where a force sensor's zero was while the tip pressed, from what it says in free air before and after."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hw.sensors import FreeAir
from mapping import FloatArray


@dataclass(frozen=True, eq=False)
class ZeroLine:
    """The zero moves evenly from one reading in free air to the next.

    Nobody sees it meanwhile. It may have jumped at once, and is off by all that it moved; but where the drift of both
    readings leads from one to the other, it went on as it began, and is off by what they miss each other.
    """

    before: FreeAir
    after: FreeAir

    def offsets(self, times: FloatArray) -> FloatArray:
        """(N, 3) by how much the zero has moved since `before`, N, at times (N,), s."""
        share = (times - self.before.at) / (self.after.at - self.before.at)
        return np.asarray(np.clip(share, 0.0, 1.0)[:, None] * (self.after.force - self.before.force))

    @property
    def moved(self) -> float:
        """By how much in all, N."""
        return float(np.linalg.norm(self.after.force - self.before.force))

    @property
    def doubt(self) -> float:
        """By how much the offsets may be wrong, N."""
        lasted = self.after.at - self.before.at
        ahead = self.before.force + lasted * self.before.drift - self.after.force
        back = self.after.force - lasted * self.after.drift - self.before.force
        return min(self.moved, max(float(np.linalg.norm(ahead)), float(np.linalg.norm(back))))


@dataclass
class ZerosMoved:
    """Over all sweeps: the largest move of the zero that was taken off, and the largest doubt of one, N."""

    moved: float = 0.0
    doubt: float = 0.0

    def learn(self, line: ZeroLine) -> None:
        """One sweep more."""
        self.moved, self.doubt = max(self.moved, line.moved), max(self.doubt, line.doubt)
