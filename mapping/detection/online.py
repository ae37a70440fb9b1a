"""Online detection: crossings while the sweep is still running, with a bounded delay."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mapping import FloatArray, Trace
from mapping.base import Base
from mapping.detection.crossing import Crossing
from mapping.detection.detect import detect
from mapping.instrument import Noise

# In half-widths of the widest feature: what must lie behind a crest before it is reported, the path between two
# looks, and what is remembered.
BEHIND, HOP, REMEMBERED_HALF_WIDTHS = 2.0, 2.0, 8.0


class OnlineDetector:
    """Sees one sweep sample by sample and reports each crossing once.

    Every HOP widest half-widths of path the detector looks at the last REMEMBERED_HALF_WIDTHS of them exactly as
    `detect` would, and reports the crests that have BEHIND of them behind.

    Args:
        base: the known global model.
        tip_radius: m.
        spacing: distance between samples, m (speed over rate).
        noise: of single samples.
        false_alarms_per_metre: 1/m.
        largest: half-width of the widest feature, m; None: one tip radius.
        sweep: number of the sweep, for the crossings.

    Attributes:
        delay: longest path between a crest and its report, m.
    """

    def __init__(
        self,
        base: Base,
        tip_radius: float,
        spacing: float,
        noise: Noise,
        *,
        false_alarms_per_metre: float = 0.01,
        largest: float | None = None,
        sweep: int = 0,
    ) -> None:
        widest = tip_radius if largest is None else largest
        self._base, self._tip, self._noise = base, tip_radius, noise
        self._rate, self._widest, self._sweep = false_alarms_per_metre, widest, sweep
        self._hop = max(16, int(HOP * widest / spacing))
        self._behind = int(BEHIND * widest / spacing)
        self._keep = self._behind + self._hop + int(REMEMBERED_HALF_WIDTHS * widest / spacing)
        self._t: list[float] = []
        self._centers: list[FloatArray] = []
        self._fresh = 0
        self._seen_until = -np.inf
        self.delay = (self._behind + self._hop) * spacing

    def push(self, t: float, center: ArrayLike) -> tuple[Crossing, ...]:
        """One sample (s; (3,) m); the crossings that became certain with it."""
        self._t.append(float(t))
        self._centers.append(np.asarray(center, dtype=np.float64))
        self._fresh += 1
        if self._fresh < self._hop:
            return ()
        return self._look(self._behind)

    def finish(self) -> tuple[Crossing, ...]:
        """The crossings of the last stretch, once the sweep is over."""
        return self._look(0) if len(self._t) >= 16 else ()

    def _look(self, behind: int) -> tuple[Crossing, ...]:
        self._fresh = 0
        trace = Trace(
            np.array(self._t), np.array(self._centers), np.full(len(self._t), self._sweep, dtype=np.int64), self._tip
        )
        found = detect(
            trace,
            self._base,
            noise=self._noise,
            false_alarms_per_metre=self._rate,
            largest=self._widest,
        )
        until = self._t[-1 - behind] if len(self._t) > behind else -np.inf
        new = tuple(c for c in found.crossings if self._seen_until < c.t <= until)
        self._seen_until = max(self._seen_until, until)
        excess = len(self._t) - self._keep
        if excess > 0:
            del self._t[:excess], self._centers[:excess]
        return new
