"""Sparse samples: readings further apart than the ball is wide, so that between two of them it may touch anything."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from mapping import Trace, length_text
from mapping.detection.path.rolled_out import usual_step


@dataclass(frozen=True)
class SparseSamples:
    """A recording that does not show what lies between its samples, however high it is.

    A thin detail of the height H is felt from as far aside as the ball touches it, sqrt(H (2 r - H)), and from r at
    most. So one between two samples s apart is felt by neither up to r - sqrt(r^2 - s^2 / 4), and at any height where
    s exceeds 2 r (theory section 4.3).

    Args:
        step: usual distance of neighbouring samples, m.
        tip_radius: m.
        unfelt: width up to which a detail of any height lies unfelt between two of them, m.
    """

    step: float
    tip_radius: float
    unfelt: float

    def record(self) -> dict[str, Any]:
        """JSON values, SI units."""
        return asdict(self) | {"sentence": self.sentence()}

    def sentence(self) -> str:
        """What is not seen, for people."""
        return (
            f"the samples lie {length_text(self.step, 2)} apart, {self.step / self.tip_radius:.2g} radii of the tip of "
            f"{length_text(self.tip_radius)}: between two of them such a ball may miss a detail of any height that is "
            f"up to {length_text(self.unfelt, 2)} wide"
        )


def sparse_samples(trace: Trace) -> SparseSamples | None:
    """What the usual step along the sweeps leaves unfelt; None if every detail high enough is felt by some sample."""
    steps = [usual_step(sweep.centers) for _, sweep in trace.sweeps() if len(sweep) > 1]
    moving = [step for step in steps if step > 0.0]
    unfelt = float(np.median(moving)) - 2.0 * trace.tip_radius if moving else 0.0
    return SparseSamples(unfelt + 2.0 * trace.tip_radius, trace.tip_radius, unfelt) if unfelt > 0.0 else None
