"""Faint search: ridges and grooves that only many sweeps together show, sought by a closer survey.

The survey is looked at sweep by sweep as it goes on, under the noise that its own sweeps tell.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from mapping import Feature, Trace
from mapping.assembly import with_faint_lines
from mapping.base import Base
from mapping.detection import DIP, Crossing, Detections, detect
from mapping.instrument import Noise, StatedNoise
from planners import Outcome, Plan
from planners.follow import DECISIVE, FaintLead
from planners.survey import Survey

# A line may lie anywhere and run in any direction: together its crossings must say so much more (in squares of the
# signal-to-noise ratio) than a single crossing that is detected
ANYWHERE = 1.3
# Share of these crossings that shows where a line may lie, if so many false leads are put up with: passes over a lead
# cost seconds, a closer survey minutes
LEADS, FALSE_LEADS = 0.75, 3.0
# A need of fewer sweeps more, once the noise is known better, is not seen to
FEW_MORE = 0.1


@dataclass(frozen=True, eq=False)
class CloserLook:
    """What a closer survey shows: lines seen by no single sweep, the clearest first, crossings that one shows, and
    the noise of its samples."""

    leads: tuple[FaintLead, ...] = ()
    crossings: tuple[Crossing, ...] = ()
    noise: Noise | None = None


@dataclass(frozen=True, eq=False)
class FaintSearch:
    """Crossed sweeps so close that every line of the span asked for is crossed often enough.

    The signal-to-noise ratio of a crossing grows with the height to the power 5/4 (theory equation 11.2: the square of
    the height times the half-width), that of k crossings together with the root of k.

    Args:
        survey: that was made already.
        limit: least height that a single sweep of it detects, m.
        noise: of the samples.
        false_alarms_per_metre: accepted rate of false lines, 1/m.
        learns: True if the noise was learnt from the survey, and may be learnt better.
        stated: what is known of the noise before; None: nothing.
    """

    survey: Survey
    limit: float
    noise: Noise
    false_alarms_per_metre: float
    learns: bool = True
    stated: StatedNoise | None = None

    @property
    def crossings(self) -> int:
        """Crossings that a line as low as the smallest asked for needs; 1 if a single one shows it."""
        return self._needed(self.limit)

    def plan(self) -> Plan:
        """Make the sweeps; the outcome's value is a CloserLook."""
        look = SweepBySweep(
            self.survey.base,
            self.noise,
            self.limit,
            self.false_alarms_per_metre,
            learnt=not self.learns,
            stated=self.stated,
        )
        planned = self._planned(self.limit)
        yield from self._sweep(planned, look)
        look.learn()
        more = self._planned(look.limit) - planned
        if more > FEW_MORE * planned:
            yield from self._sweep(more, look)
        if not look.felt:
            return Outcome("no contact", value=CloserLook())
        every = Detections.together(look.seen)
        if every.inspected_length == 0.0:
            return Outcome("no contact", "no sweep felt enough to be looked at", CloserLook())
        rate = FALSE_LEADS / every.inspected_length
        lines = with_faint_lines([], every, Trace.concatenate(look.felt), look.base, rate)
        leads = tuple(lead(line, every, look.base, self.survey.tip_radius) for line in lines)
        return Outcome(
            "done", f"{len(lines)} lines seen by no single sweep", CloserLook(leads, every.crossings, look.noise)
        )

    def _needed(self, limit: float) -> int:
        ratio = limit / self.survey.smallest
        return 1 if ratio <= 1.0 else int(np.ceil(ANYWHERE * ratio**2.5))

    def _planned(self, limit: float) -> int:
        return max(2, int(np.ceil(LEADS * self._needed(limit))))

    def _sweep(self, crossings: int, look: SweepBySweep) -> Plan:
        for move in replace(self.survey, crossings=crossings).sweeps():
            look.take((yield move))
        return Outcome("done")


def lead(line: Feature, seen: Detections, base: Base, tip_radius: float) -> FaintLead:
    """Where to begin following a faint ridge or groove: in its middle, by passes that follow from its height."""
    from scipy.special import ndtri

    way = (line.axis[-1] - line.axis[0]) / np.linalg.norm(line.axis[-1] - line.axis[0])
    middle = base.nearest.query(line.axis.mean(axis=0)[None])
    point, normal, height = middle.points[0], middle.normals[0], line.height.median
    half_width = float(np.sqrt(2.0 * tip_radius * abs(height)))
    share = (abs(height) / seen.detection_limit) ** 1.25 * (1.0 if height > 0 else DIP)
    one = share * float(seen.threshold + ndtri(seen.probability))
    seed = Crossing(
        sweep=-1,
        t=0.0,
        point=point,
        normal=normal,
        tangent=np.cross(normal, way),
        kind="convex" if height > 0 else "concave",
        height=height,
        height_sd=(line.height.high - line.height.low) / 3.29,
        position_sd=line.position_sd,
        half_width=half_width,
        trace_curvature=-2.0 * height / half_width**2,
        snr=one,
        curvature_feature=line.curvature_feature,
        start=0,
        stop=0,
    )
    passes = int(np.ceil(DECISIVE / one**2))
    return FaintLead(seed, way, passes, float(np.linalg.norm(line.axis[-1] - line.axis[0])))


# Path that tells the noise, in tip radii
NOISE_LEARNING_PATH = 200.0


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
        stated: what is known of the noise before; None: nothing.
        felt: traces of the sweeps.
        seen: what they show.
    """

    base: Base
    noise: Noise
    limit: float
    false_alarms_per_metre: float
    learnt: bool
    stated: StatedNoise | None = None
    felt: list[Trace] = field(default_factory=list)
    seen: list[Detections] = field(default_factory=list)

    def take(self, trace: Trace) -> None:
        """Look at a sweep's trace, if it touched anything."""
        if len(trace) == 0:
            return
        self.felt.append(trace)
        self.seen.append(self._detected(trace, self.noise))
        if (
            not self.learnt
            and sum(part.inspected_length for part in self.seen) > NOISE_LEARNING_PATH * trace.tip_radius
        ):
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
        rate = self.false_alarms_per_metre
        return detect(trace, self.base, noise=noise, stated=self.stated, false_alarms_per_metre=rate)
