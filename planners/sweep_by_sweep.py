"""Sweep by sweep: crossings of a long survey, looked for as it goes on, under a noise that its own sweeps tell."""

from __future__ import annotations

from dataclasses import dataclass, field

from mapping.base import Base
from mapping.detectors import Detections, detect
from mapping.noise import Noise
from mapping.trace import Trace

# Path that tells the noise, in tip radii
LEARNING = 200.0


@dataclass
class SweepBySweep:
    """What was felt so far, and what each sweep shows by itself.

    Sweeps are looked at one by one, so that the finger need not wait for all of them in the end. What was felt before
    told the noise from a short path; these sweeps tell it better.

    Args:
        base: the global model.
        noise: as far as it is known.
        limit: least height that a single sweep detects, m.
        false_alarms_per_metre: accepted rate of false crossings, 1/m.
        learnt: True if the noise need not be learnt, or was.
        felt: traces of the sweeps.
        seen: what they show.
    """

    base: Base
    noise: Noise
    limit: float
    false_alarms_per_metre: float
    learnt: bool
    felt: list[Trace] = field(default_factory=list)
    seen: list[Detections] = field(default_factory=list)

    def take(self, trace: Trace) -> None:
        """Look at a sweep's trace, if it touched anything."""
        if len(trace) == 0:
            return
        self.felt.append(trace)
        self.seen.append(self._detected(trace, self.noise))
        if not self.learnt and sum(part.inspected_length for part in self.seen) > LEARNING * trace.tip_radius:
            self.learn()

    def learn(self) -> None:
        """The noise from all that was felt so far, and what that shows; once is enough."""
        if self.learnt or not self.felt:
            return
        together = self._detected(Trace.concatenate(self.felt), None)
        if together.inspected_length > 0.0:
            self.noise, self.limit, self.seen = together.noise, together.detection_limit, [together]
        self.learnt = True

    def _detected(self, trace: Trace, noise: Noise | None) -> Detections:
        return detect(trace, self.base, noise=noise, false_alarms_per_metre=self.false_alarms_per_metre)
