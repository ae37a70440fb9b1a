"""The account of a recorded path: inspected, and left out for what reason."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mapping import BoolArray
from mapping.detection import SHORTEST_SWEEP_SAMPLES, Detections
from mapping.detection.path.sound_sweeps import JUMP_STEPS, SoundSweeps

# A share of the path that is left out and not worth a line
WORTH_A_LINE = 1e-4
# The share of a recorded path that may be left out without a word on the terminal
SHORTFALL = 0.02


@dataclass(frozen=True)
class PathLedger:
    """What became of the path that was recorded.

    Args:
        recorded: length of the recorded path in contact, m; where no sample was taken nothing was touched.
        inspected: length in which a crest would have been found, m.
        left_out: (reason, length in m) of the rest.
        cuts: (reason, number) of the places where sweeps were cut.
    """

    recorded: float
    inspected: float
    left_out: tuple[tuple[str, float], ...] = ()
    cuts: tuple[tuple[str, int], ...] = ()

    @property
    def shortfall(self) -> float:
        """Share of the recorded path that was not inspected."""
        return max(0.0, 1.0 - self.inspected / self.recorded) if self.recorded > 0 else 0.0

    @property
    def is_short(self) -> bool:
        """True if more is left out than goes without saying."""
        return self.shortfall > SHORTFALL

    def record(self) -> dict[str, Any]:
        """JSON values, lengths in m."""
        return {
            "recorded": self.recorded,
            "inspected": self.inspected,
            "left_out": [{"reason": reason, "length": length} for reason, length in self.left_out],
            "cuts": [{"reason": reason, "number": number} for reason, number in self.cuts],
        }


def path_ledger(
    sound: SoundSweeps,
    detections: Detections,
    beyond: int = 0,
    apart: int = 0,
    refused: bool = False,
    felt: BoolArray | None = None,
) -> PathLedger:
    """The account of a trace that was inspected.

    Args:
        sound: what was looked at.
        detections: of that.
        beyond: samples that were recorded beyond the base's border, and not looked at.
        apart: samples on parts that the body has and its model has not, or the other way round, and not looked at.
        refused: whether the model is wrong beyond repair, and nothing was looked for over it.
        felt: (N,) False for samples of that trace that no ball on any surface can give; None: all were felt.
    """
    inspected_of = dict(detections.inspected_sweeps)
    felt = np.ones(len(sound.trace), dtype=bool) if felt is None else felt
    path = few = inspected = unfelt = 0.0
    begin = 0
    for sweep in sound.trace.laid_sweeps:
        own = felt[begin : begin + len(sweep.trace)]
        begin += len(sweep.trace)
        steps = np.diff(sweep.arclength)
        usual = float(np.median(steps)) if len(steps) else 0.0
        # over a gap that the times tell of nothing was touched
        touched = steps <= JUMP_STEPS * usual
        length = float(steps[touched].sum())
        path += length
        if sweep.number in inspected_of:
            # bins may reach past a sweep's ends, and over lone samples that were not felt
            seen = min(inspected_of[sweep.number], length)
            inspected += seen
            unfelt += min(float(steps[touched & ~(own[1:] & own[:-1])].sum()), length - seen)
        else:
            few += length
    outside = {
        "beyond the base's border": path * beyond / max(len(sound.trace), 1),
        "where the body departs from its model": path * apart / max(len(sound.trace), 1),
    }
    lost = outside | {
        f"sweeps of fewer than {SHORTEST_SWEEP_SAMPLES} samples": few,
        "readings that no ball of this radius gives, or that do not change": unfelt,
        "ends of sweeps, and pieces too short for the smallest crest": path - few - inspected - unfelt,
    }
    recorded = path + sum(outside.values())
    if refused:
        inspected, lost = 0.0, {"over a model that is wrong beyond repair": recorded}
    left_out = tuple((reason, length) for reason, length in lost.items() if length > WORTH_A_LINE * recorded)
    return PathLedger(recorded, inspected, left_out, sound.cuts)
