"""BrokenRidgeShape: two ridges in one line, of one section, with a gap between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray
from mapping.inference.families.ridge import RidgeShape
from mapping.inference.likelihood import Prior, Uniform

# Gaps from this share of the half width of the disturbance: narrower ones are not felt.
NARROWEST = 0.1


@dataclass(frozen=True, eq=False)
class BrokenRidgeShape:
    """An open ridge, and the middle and log width of a gap in it.

    Args:
        whole: the ridge without the gap.
        half_width: of its disturbance, m: the scale of gaps.
    """

    whole: RidgeShape
    half_width: float

    @property
    def names(self) -> tuple[str, ...]:
        return ("gap middle", "log gap", *self.whole.names)

    @property
    def units(self) -> tuple[str, ...]:
        return ("m", "ln m", *self.whole.units)

    @property
    def priors(self) -> tuple[Prior, ...]:
        low, high = float(self.whole.chart.s[0]), float(self.whole.chart.s[-1])
        narrow = NARROWEST * self.half_width
        gap = Uniform(float(np.log(narrow)), float(np.log(max(high - low, 2.0 * narrow))))
        return (Uniform(low, high), gap, *self.whole.priors)

    @property
    def start(self) -> FloatArray:
        middle = 0.5 * (self.whole.start[-4] + self.whole.start[-3])
        return np.concatenate([[middle, np.log(self.half_width)], self.whole.start])

    @property
    def step(self) -> FloatArray:
        return np.concatenate([[0.1 * self.half_width, 0.05], self.whole.step])

    def templates(self, theta: FloatArray) -> FloatArray:
        """(W, n) heights over the base's trace, m: the higher of the two parts' (dilation distributes over unions)."""
        half = 0.5 * np.exp(theta[:, 1])
        parts = []
        for column, place in ((-3, theta[:, 0] - half), (-4, theta[:, 0] + half)):
            part = theta[:, 2:].copy()
            low, high = part[:, -4].copy(), part[:, -3].copy()
            part[:, column] = np.clip(place, low, high)
            heights = self.whole.templates(part)
            # A gap that takes in an end leaves nothing of that part.
            gone = part[:, -3] <= part[:, -4]
            parts.append(np.where(gone[:, None], 0.0, heights))
        return np.maximum(*parts)
