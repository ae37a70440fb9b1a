"""Locate: a few sweeps all over the model tell where the object really stands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray, Trace, TraceError, length_text
from mapping.base import Base, estimate_pose
from planners import Outcome, Plan
from planners.explore.warm_up import get_ready
from planners.survey import Survey

# Sweeps that locate
LOCATING_SWEEPS = 8
# A pose beyond what was allowed by this factor is not believed
BEYOND = 1.25


@dataclass(frozen=True, eq=False, kw_only=True)
class Locate:
    """Some sweeps of the survey, spread over the model, and the pose that explains them.

    Args:
        base: the model as given.
        tip_radius: m.
        smallest: height of the smallest feature to be found, m: of the survey.
        sides: (S, 3) outward directions of the sides to be swept; None: all.
        shift, turn: how far the object may stand off its model, m and rad.
        speed, force: of the sweeps, m/s and N.
    """

    base: Base
    tip_radius: float
    smallest: float
    sides: FloatArray | None = None
    shift: float = 3e-3
    turn: float = float(np.radians(2.0))
    speed: float = 0.03
    force: float = 1.0

    def plan(self) -> Plan:
        """The outcome's value is the Pose, or None if the object was not met or stands further off than allowed."""
        get_ready(self.tip_radius)
        survey = Survey(
            base=self.base,
            tip_radius=self.tip_radius,
            smallest=self.smallest,
            speed=self.speed,
            force=self.force,
            sides=self.sides,
        )
        moves = list(survey.sweeps())
        felt = []
        for index in np.unique(np.linspace(0, len(moves) - 1, LOCATING_SWEEPS + 2)[1:-1].round().astype(int)):
            trace = yield moves[index]
            if len(trace):
                felt.append(trace)
        try:
            pose = estimate_pose(Trace.concatenate(felt), self.base, shift=self.shift, turn=self.turn)
        except TraceError as error:
            return Outcome("lost", f"the object was not met where its model is: {error}")
        off = f"{length_text(float(np.linalg.norm(pose.shift)))} and {np.degrees(pose.turn):.2f} degrees off its model"
        if not pose.within(BEYOND * self.shift, BEYOND * self.turn):
            allowed = f"{1e3 * self.shift:g} mm and {np.degrees(self.turn):g} degrees"
            return Outcome("misplaced", f"the object stands {off}; the scene allows {allowed}")
        return Outcome("done", f"the object stands {off}; {pose.observable} of 6 motions were observed", pose)
