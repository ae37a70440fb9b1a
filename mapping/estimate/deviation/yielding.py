"""Yielding: a finger gives way to what it is pressed with, and is recorded deeper than its tip is.

Where forces were recorded, heights over level ground go down as far as the finger is pressed harder: of every newton by
the compliance of the tip and of all that carries it. What is the same all along is the base's own level, so only how
the pressing varies tells: a Gaussian compliance beside a level, whose marginal likelihoods have closed forms, under
noise that is white and correlated along sweeps. The recorded forces put back, a crest that the finger was pressed on
less, or more, than on the ground before it has its height again.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from mapping import FloatArray, Trace, length_text
from mapping.base import LaidTrace
from mapping.estimate.deviation.blocks import Blocks
from mapping.estimate.deviation.evidence import LEAST_GAIN, Whitened, best_fit, every_law, whitened
from mapping.estimate.deviation.explain import EXPECTED_SHARE, FEWEST_BLOCKS, LIKELY_CAUSE
from mapping.geometry.mesh import distances


@dataclass(frozen=True)
class Yielding:
    """What a finger yields by.

    Args:
        compliance: of the tip and of what carries it, m/N.
        sd: standard deviation of it, m/N.
        pressed: the usual force, N.
        outward: 1.0 if the recorded forces act on the finger, out of the body; -1.0 if they act on the body.
        gain: logarithm of how much more probable the heights are with it.
    """

    compliance: float
    sd: float
    pressed: float
    outward: float
    gain: float

    def without(self, trace: Trace) -> Trace:
        """The trace where the tip was: alike stiff in all directions, it yields along the force.

        Raises:
            ValueError: the trace has no forces.
        """
        if trace.force is None:
            raise ValueError("what a finger yields by cannot be put back without recorded forces")
        shift = self.outward * self.compliance * trace.force
        contacts = None if trace.contacts is None else trace.contacts + shift
        centers = trace.centers + shift
        return Trace(
            trace.t, centers, trace.sweep, trace.tip_radius, trace.normals, contacts, trace.force, trace.resolution
        )

    def height_sd(self, trace: Trace, axis: FloatArray, height: float) -> float:
        """Standard deviation that it leaves to the height of a feature: of what is pressed otherwise there, m.

        Args:
            trace: with forces, where the tip was.
            axis: (K, 3) of the feature on the body, m.
            height: of it, m.
        """
        if trace.force is None:
            return 0.0
        near = 0.25 * np.sqrt(2.0 * trace.tip_radius * abs(height))
        on = distances(trace.centers, axis) < np.hypot(near, trace.tip_radius + abs(height))
        if not on.any():
            return 0.0
        here = float(np.median(np.linalg.norm(trace.force[on], axis=1)))
        return self.sd * abs(here - self.pressed)

    def record(self) -> dict[str, Any]:
        """JSON values, SI units."""
        return asdict(self) | {"sentence": self.sentence()}

    def sentence(self) -> str:
        """What was found and done, for people."""
        usual = length_text(self.compliance * self.pressed, 2)
        return (
            f"the finger yields, by {usual} under its usual {self.pressed:.2g} N ({1e-3 / self.compliance:.2g} N/mm, "
            f"± {100.0 * self.sd / self.compliance:.1g} %): that was put back"
        )


def yielding(laid: LaidTrace) -> Yielding | None:
    """By how much the finger yields; None if no forces were recorded, or if the heights hardly speak for it.

    Args:
        laid: the trace on its base, as recorded.
    """
    if laid.force is None:
        return None
    blocks = Blocks.of(laid)
    keep = blocks.smooth(blocks.height)
    if keep.sum() < FEWEST_BLOCKS:
        return None
    force = _pressing(laid, blocks)[keep]
    usual = float(np.median(force))
    if not abs(usual) > 0.0 or not float(np.ptp(force)) > 0.0:
        return None
    columns = np.column_stack([blocks.height[keep], np.ones(len(force)), force - force.mean()])
    seen = whitened(columns, blocks.piece[keep], blocks.place[keep], blocks.weight[keep], blocks.step)
    expected = EXPECTED_SHARE * laid.tip_radius
    prior = np.array([max(expected, float(np.abs(blocks.height[keep]).max())), expected / abs(usual)])
    stiff, gives = (best_fit(seen, np.arange(n), prior[:n], blocks.noise, every_law()) for n in (1, 2))
    gain = gives.log_evidence - stiff.log_evidence + float(np.log(LIKELY_CAUSE))
    outward = float(np.sign(usual))
    compliance = -outward * float(gives.coefficients[1])
    if gain < LEAST_GAIN or not compliance > 0.0:
        return None
    return Yielding(compliance, _sd(seen[gives.law], prior, gives.noise), abs(usual), outward, gain)


def _pressing(laid: LaidTrace, blocks: Blocks) -> FloatArray:
    """(B,) mean force of each block along the normal of the base, N."""
    force, half = np.zeros((len(blocks), 3)), 0.5 * blocks.step
    for sweep in laid.laid_sweeps:
        own = blocks.sweep == sweep.number
        if not own.any() or sweep.trace.force is None:
            continue
        sums = np.concatenate([np.zeros((1, 3)), np.cumsum(sweep.trace.force, axis=0)])
        first = np.searchsorted(sweep.arclength, blocks.place[own] - half)
        last = np.maximum(np.searchsorted(sweep.arclength, blocks.place[own] + half), first + 1)
        last = np.minimum(last, len(sums) - 1)
        first = np.minimum(first, last - 1)
        force[own] = (sums[last] - sums[first]) / (last - first)[:, None]
    return np.asarray((force * blocks.normals).sum(axis=1))


def _sd(seen: Whitened, prior: FloatArray, noise: float) -> float:
    """Posterior standard deviation of the last coefficient."""
    precision = seen.gram / noise**2 + np.diag(prior**-2.0)
    return float(np.sqrt(np.linalg.inv(precision)[-1, -1]))
