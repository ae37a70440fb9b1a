"""Peck tracing: probe down, step on, probe down: a trace from any touch probe.

Only latched positions are recorded: where the probe closed, not where the machine came to rest or was told to go.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hw import FingerError, LinkError, Move, NotFeltError, StoppedError
from hw.grbl import GuardedStage
from mapping import FloatArray


@dataclass(frozen=True, eq=False)
class Touched:
    """Samples in contact, handed on while the sweep is under way.

    Args:
        times: (N,) time.monotonic, s.
        centers: (N, 3) tip centres, m, object frame.
        forces: (N, 3) on the tip, N; None for a touch probe.
    """

    times: FloatArray
    centers: FloatArray
    forces: FloatArray | None = None


# Sweeps get at least so many pecks: detection needs a curve, not a few points
FEWEST_PECKS = 24
# A contact that lies this far off the line through the two before it is made again, m: on a tip of 5 mm and pecks
# 0.5 mm apart a smooth body bends by s^2 / R = 50 um. Two touches of one place agree to AGREE, m: four standard
# deviations of the difference of two touches with a scatter of 3.5 um
UNEXPECTED, AGREE = 5e-5, 2e-5
# A peck asks the controller so often (two probes with two reports of the probe before, two of the place before and
# after; a move), and a question takes this long at least, s: the status of 60 bytes at 115200 baud
ASKINGS, LEAST_ASKING = 18, 0.005
# A place is touched so often to find two touches that agree; so many places in a row may be left out for none
MOST_TOUCHES, MOST_LEFT_OUT = 4, 3


@dataclass(frozen=True)
class Peck:
    """How to peck.

    Args:
        step: distance between pecks along the path, m.
        clearance: how far the tip rises between pecks, m.
        speed: of probing, m/s.
        stroke: how far beyond the commanded path to look for the body, m.
    """

    step: float
    clearance: float
    speed: float
    stroke: float

    def places(self, move: Move) -> tuple[FloatArray, FloatArray]:
        """Commanded centres (N, 3) of the pecks at a sweep, m, and unit approach directions (N, 3)."""
        return spaced(move, min(self.step, move.length / FEWEST_PECKS))

    def seconds(self, stage: GuardedStage, move: Move) -> float:
        """About how long a sweep takes, s: up, on and down at their speeds, and what asking takes."""
        guarded = stage.guarded_speed
        on, down = np.hypot(self.step, self.clearance) / guarded, self.clearance / min(self.speed, guarded)
        up = self.clearance / stage.speed
        return len(self.places(move)[0]) * float(
            on + down + up + ASKINGS * max(stage.controller.round_trip, LEAST_ASKING)
        )

    def trace(self, stage: GuardedStage, move: Move) -> Iterator[Touched]:
        """The latched tip centre of each contact along the sweep, as it is made."""
        path, approach = self.places(move)
        depth = -self.stroke  # of the last contact behind the commanded path, along the approach
        known: list[FloatArray] = []  # contacts before this one
        left_out = 0
        for point, inwards in zip(path, approach, strict=True):
            hover = point + (max(depth, -self.stroke) - self.clearance) * inwards
            stage.go(hover, -inwards, self.clearance)
            where, hit, agreed = self._touch(stage, point + self.stroke * inwards, inwards, known)
            if hit and agreed:
                depth, left_out = float((where - point) @ inwards), 0
                known = [*known[-1:], where]
                yield Touched(np.array([time.monotonic()]), where[None, :])
            elif hit:
                left_out += 1
                if left_out == MOST_LEFT_OUT:
                    raise StoppedError(
                        f"{left_out} places in a row where no two of {MOST_TOUCHES} touches agree to {1e6 * AGREE:.0f} "
                        "um: check the probe, its cable and its shield"
                    )
            else:
                depth = min(depth, 0.0)
            stage.move(where - self.clearance * inwards)

    def _touch(
        self, stage: GuardedStage, target: FloatArray, inwards: FloatArray, known: list[FloatArray]
    ) -> tuple[FloatArray, bool, bool]:
        """Where the probe closed on the way to the target, whether it did, and whether that may be believed.

        A contact that its neighbours led to expect is believed; another must come twice at the same place.
        """
        touches: list[FloatArray] = []
        garbled = 0
        while len(touches) < MOST_TOUCHES:
            try:
                where, hit = self._felt(stage, target, inwards, known)
            except LinkError:
                garbled += 1
                if garbled == MOST_TOUCHES or not stage.controller.link.is_open:
                    raise
                stage.move(stage.resting() - self.clearance * inwards)
                continue
            if not hit:
                return where, False, True
            if len(known) == 2 and not touches:
                expected = known[1] + (known[1] - known[0])
                if abs(float((where - expected) @ inwards)) <= UNEXPECTED:
                    return where, True, True
            if any(abs(float((where - other) @ inwards)) <= AGREE for other in touches):
                return where, True, True
            touches.append(where)
            if len(touches) < MOST_TOUCHES:
                stage.move(where - self.clearance * inwards)
        return where, True, False

    def _felt(
        self, stage: GuardedStage, target: FloatArray, inwards: FloatArray, known: list[FloatArray]
    ) -> tuple[FloatArray, bool]:
        """Probe; where the model has a body and none is felt, see on the last contact whether the probe still lives."""
        try:
            return stage.probe(target, self.speed)
        except NotFeltError:
            if not known:
                raise
            here = stage.resting()
            stage.lift(-inwards, self.stroke)
            above = known[-1] - self.clearance * inwards
            stage.go(above, -inwards, self.clearance)
            if not stage.probe(known[-1] + stage.over_travel * inwards, self.speed)[1]:
                raise
            stage.move(above)
            stage.go(here - self.clearance * inwards, -inwards, self.clearance)
            with stage.unbounded():
                return stage.probe(target, self.speed)


def spaced(move: Move, step: float) -> tuple[FloatArray, FloatArray]:
    """Commanded centres (N, 3) at most `step` apart along a move's path, and unit approach directions (N, 3)."""
    lengths = np.linalg.norm(np.diff(move.path, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    count = 1 if along[-1] == 0 else 1 + int(np.ceil(along[-1] / step - 1e-9))
    s = np.linspace(0.0, along[-1], count)
    path, approach = (
        np.column_stack([np.interp(s, along, values[:, k]) for k in range(3)]) for values in (move.path, move.approach)
    )
    norm = np.linalg.norm(approach, axis=1, keepdims=True)
    if (norm < 1e-6).any():
        raise FingerError("the sweep turns its approach by 180 degrees between two waypoints; add waypoints between")
    return path, approach / norm
