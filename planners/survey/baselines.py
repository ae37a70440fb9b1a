"""Baselines: ways to sweep a body that look at nothing they feel, to compare exploring with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping.base import Base
from mapping.detection import face_samples
from planners import Outcome, Plan
from planners.paths import Strokes
from planners.survey.survey import Survey


@dataclass(frozen=True, eq=False, kw_only=True)
class Raster:
    """Parallel sweeps a fixed pitch (m) apart all over the base."""

    base: Base
    tip_radius: float
    pitch: float
    speed: float = 0.03
    force: float = 1.0

    def plan(self, rng: np.random.Generator | None = None) -> Plan:
        """Every sweep once; nothing is random."""
        visible = 0.5
        smallest = self.pitch**2 / (8.0 * (1.0 - visible) * self.tip_radius)
        survey = Survey(
            base=self.base,
            tip_radius=self.tip_radius,
            smallest=smallest,
            visible=visible,
            speed=self.speed,
            force=self.force,
        )
        yield from survey.sweeps()
        return Outcome("done")


@dataclass(frozen=True, eq=False, kw_only=True)
class RandomSweeps:
    """Straight sweeps of half the body's size through random places in random directions, for `seconds`."""

    base: Base
    tip_radius: float
    seconds: float
    speed: float = 0.03
    force: float = 1.0

    def plan(self, rng: np.random.Generator) -> Plan:
        """Sweeps until the time is spent; places are uniform over the surface's area."""
        surface = self.base.surface
        strokes = Strokes(self.base, self.tip_radius, self.speed, self.force)
        samples = face_samples(surface, self.tip_radius)
        points, share = samples.points, surface.face_areas[samples.owner] * samples.share
        spent, half = 0.0, 0.25 * surface.size
        while spent < self.seconds:
            middle = points[rng.choice(len(points), p=share / share.sum())]
            move = strokes.line(middle, rng.standard_normal(3), half, half)
            if len(move.path) < 2 or move.length == 0:
                continue
            spent += move.duration
            yield move
        return Outcome("done")
