"""Found: what an exploration knows so far."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mapping import FloatArray
from mapping.detection import Crossing
from mapping.instrument import Noise
from planners.follow import AxisTrack, BumpSize, FaintLead, is_step, slender
from planners.paths import tangential

# Standard deviations by which a crossing must be lower than what is asked for to be none of it
LOWER_SDS = 2.0


@dataclass
class Found:
    """What the exploration knows so far; the outcome's value.

    `surveyed` says whether the survey was finished; `actions` names everything that was done after it, with its
    outcome; `left_out` what was not, `unseen` what the survey may have missed. `asked` is the height (m) that the
    smallest feature asked for shows at least on some sweep; `reported` the signal-to-noise ratio from which on the
    analysis of all sweeps may report a crossing.
    """

    tip_radius: float
    surveyed: bool = False
    asked: float = 0.0
    reported: float = 0.0
    noise: Noise | None = None
    tracks: list[AxisTrack] = field(default_factory=list)
    bumps: list[BumpSize] = field(default_factory=list)
    crossings: list[Crossing] = field(default_factory=list)
    leads: list[FaintLead] = field(default_factory=list)
    tried: list[Crossing] = field(default_factory=list)
    sharpened: set[tuple[int, int]] = field(default_factory=set)
    actions: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    unseen: list[str] = field(default_factory=list)

    def unexplained(self) -> list[Crossing]:
        """Crossings that no track or bump accounts for, that were not looked into yet, and that are worth it.

        The highest come first, but those that are wider than a wire of their height would be come later: they
        were met at a slant, or beside a neighbour.
        """
        rest = [c for c in self._open() if self._worth_a_look(c)]
        return sorted(rest, key=lambda c: -abs(c.height) * min(1.0, slender(c, self.tip_radius)))

    def passed_over(self) -> int:
        """How many crossings are not worth a look."""
        return sum(not self._worth_a_look(c) for c in self._open())

    def _open(self) -> list[Crossing]:
        """Crossings that no track or bump accounts for and that were not looked into yet."""
        known: list[AxisTrack | BumpSize] = [*self.tracks, *self.bumps]
        return [c for c in self.crossings if not any(k.explains(c) for k in known) and not self._tried(c)]

    def _worth_a_look(self, crossing: Crossing) -> bool:
        """True for what may be a feature asked for, and for whatever else would be reported.

        What is asked for shows somewhere as high as `asked`; what is lower there by two standard deviations is none,
        and most often noise: more false alarms are let through to here than in the end.
        """
        highest = abs(crossing.height) * (1.0 + LOWER_SDS / max(crossing.snr, LOWER_SDS))
        return highest >= self.asked or crossing.snr >= self.reported

    def step_heading(self, seed: Crossing, reach: float) -> FloatArray | None:
        """Direction from a step to the nearest one on another sweep, or None if the seed is no open step.

        A sweep crosses the edge of an open step once; along a ridge it goes up at one end and down at the other.
        """
        steps = [c for c in self.crossings if is_step(c)]
        sweeps = [c.sweep for c in steps]
        if not is_step(seed) or sweeps.count(seed.sweep) != 1:
            return None
        others = [c for c in steps if c.sweep != seed.sweep and sweeps.count(c.sweep) == 1]
        others = [c for c in others if 0 < np.linalg.norm(c.point - seed.point) < reach]
        if not others:
            return None
        nearest = min(others, key=lambda c: float(np.linalg.norm(c.point - seed.point)))
        return tangential(nearest.point - seed.point, seed.normal)

    def _tried(self, crossing: Crossing) -> bool:
        return any(
            crossing is other or np.linalg.norm(crossing.point - other.point) < 0.7 * other.half_width
            for other in self.tried
        )
