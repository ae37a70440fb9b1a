"""SampleWatch: is what a force sensor sends still a measurement? Judged sample by sample, in the thread that reads it.

A sensor that froze, saturated, or lost its supply goes on sending whole frames. What gives it away is physics: noise
never stands still for long, a force never jumps faster than the tip can be moved against its own stiffness.
"""

from __future__ import annotations

from math import isfinite
from typing import NamedTuple

import numpy as np

from hw import StoppedError
from mapping import FloatArray, IntArray
from mapping.instrument import MAD_TO_SD

# Chance of a false stop per sample and axis: one in a thousand sessions of 10 h at 5 kHz (5e8 values)
FALSE_STOP = 2e-12
# So many standard deviations of a difference are noise: a Gaussian exceeds 8 once in 1e15
NOISE_OF_A_DIFFERENCE = 8.0 * 2.0**0.5
# Stick and slip under the tip is faster than the stage: a share of the friction of usual sweeps of 1 N, N
SLIP = 0.3
# The stage's speed may be felt twice over by a tip that rings
RINGING = 2.0
# A count goes on by the usual step to so much of it, or to so many standard deviations of the steps in free air. A
# clock that is read wrong by 0.1 ms at 1 kHz puts a stage that moves at 10 mm/s wrong by 1 um
STEP_SLACK, STEPS_APART = 0.1, 8.0
# So many forces in a row that cannot have come about are no garbled ones. At 1 % of lost bytes one line in 200 passes
# its parity with such a force, often with the same one (a digit is missing): two in a row came once in a minute, three
# come once in hours
JUMPS = 3
# A run of equal values that was seen while nothing touched may come this much longer, by correlated noise
LONGER_THAN_SEEN = 4
_LARGEST = float(np.finfo(np.float64).max)

Sample = tuple[int, float, float, float]


class Verdict(NamedTuple):
    """What a sample led to.

    Args:
        kept: samples that may be kept now, each with its time of arrival: none, this one, or the one before and this.
        newest: running count of the last one kept.
        fault: what is wrong with the sensor, or None.
    """

    kept: tuple[tuple[float, Sample], ...]
    newest: int
    fault: str | None


class SampleWatch:
    """Learns the noise while nothing touches; judges every sample by it, and by how fast a force can change.

    A sum or a parity tells garbled bytes by a few bits: of 1 % wrong ones a frame in a thousand passes it, of text a
    line in a hundred. So no sample stands by its own word: its count follows on from the one before, or the next one
    follows on from it; and a force that cannot have come about is one only if the next ones cannot, either.

    Args:
        bits: width of the sensor's counter or clock.
    """

    def __init__(self, bits: int) -> None:
        self._wrap = 1 << bits
        self.steepest = np.inf
        self.blind = 0.0
        self.noise, self._margins = np.zeros(3), [0.0, 0.0, 0.0]
        self.spacing, self._ticks, self._slack = 0.0, 1.0, 0.0
        self._longest = [np.inf] * 3
        self.forget()

    def forget(self) -> None:
        """The next sample is the first: the sensor was lost, or its counter started anew."""
        self._last: Sample | None = None
        self._waiting: tuple[float, Sample] | None = None  # whose count does not follow on; when it came, s
        self._odds = 0
        self._count = 0
        self._equal = [1, 1, 1]
        self.doubtful = 0

    def learn(self, free: FloatArray, ticks: float, spacing: float, uneven: float = 0.0) -> None:
        """From samples (N, 3), N, without contact: how long a value may stay the same. They are `ticks` counts, and
        `spacing` s, apart; `uneven` is the standard deviation of the counts between them.

        Equal neighbours have the probability p, by the rule of three at most (seen + 3) / (N + 3); a run of n by
        chance p^(n - 1), which is FALSE_STOP at the longest run. An axis that never changed says nothing: a sensor
        of one axis sends zeros for the others.

        Raises:
            StoppedError: no axis changes.
        """
        equal = np.diff(free, axis=0) == 0.0
        share = (equal.sum(axis=0) + 3.0) / (len(free) + 3.0)
        alive = ~equal.all(axis=0) if len(equal) else np.zeros(3, bool)
        if not alive.any() and len(free) > 2:
            raise StoppedError(
                f"the force sensor sent the same value {len(free)} times while nothing touched: it is frozen, or so "
                "quiet that nobody could tell; switch it off and on, take out its filter or dead band, run again"
            )
        runs = np.array([LONGER_THAN_SEEN * _longest_run(column) for column in equal.T])
        longest = np.maximum(runs, 2.0 + np.log(FALSE_STOP) / np.log(np.minimum(share, 0.999)))
        self._longest = [float(n) if on else np.inf for n, on in zip(longest, alive, strict=True)]
        self.spacing, self._ticks = spacing, ticks
        self._slack = max(STEP_SLACK * ticks, STEPS_APART * uneven)
        # until then nobody knows that the sensor is frozen: the axis that changes most tells first
        self.blind = spacing * min(self._longest)
        self.noise = MAD_TO_SD * np.median(np.abs(free - np.median(free, axis=0)), axis=0)
        self._margins = [NOISE_OF_A_DIFFERENCE * float(sd) for sd in self.noise]  # numpy's numbers are slow one by one
        self._equal = [1, 1, 1]

    def judge(self, sample: Sample, at: float = 0.0) -> Verdict:
        """What may be kept now that this sample came, at `at` s, and what is wrong with the sensor."""
        last, waiting = self._last, self._waiting
        self._waiting = None
        known = self.spacing > 0.0
        if self._follows(sample, last) or (last is None and not known):
            return self._in_turn((at, sample))
        if waiting is not None and self._follows(sample, waiting[1]):
            forward = last is None or 0 < (waiting[1][0] - last[0]) % self._wrap <= self._wrap // 2
            if self._far(sample, waiting[1], 1):
                if (fault := self._jump(sample, waiting[1])) is not None:
                    return Verdict((), self._count, fault)
            elif forward or not known:  # the first of all may have been garbled
                return self._in_turn(waiting, (at, sample))
        # an old one again follows on from none: it is no news, and without news nothing moves on
        self._waiting = at, sample
        return Verdict((), self._count, None)

    def _in_turn(self, *samples: tuple[float, Sample]) -> Verdict:
        """Of samples whose counts are believed."""
        kept: list[tuple[float, Sample]] = []
        for each in samples:
            sound, fault = self._judged(each[1])
            if fault is not None:
                return Verdict(tuple(kept), self._count, fault)
            if sound:
                kept.append(each)
        return Verdict(tuple(kept), self._count, None)

    def _follows(self, sample: Sample, last: Sample | None) -> bool:
        if last is None:
            return False
        step = (sample[0] - last[0]) % self._wrap
        return abs(step - self._ticks) <= self._slack if self.spacing > 0.0 else 0 < step <= self._wrap // 2

    def _judged(self, sample: Sample) -> tuple[bool, str | None]:
        """Whether a sample may be kept, whose count may, and what is wrong with the sensor."""
        last = self._last
        steps = 0 if last is None else (sample[0] - last[0] + self._wrap // 2) % self._wrap - self._wrap // 2
        if not isfinite(sum(sample[1:])) or (last is not None and self._far(sample, last, steps)):
            return False, self._jump(sample, last)
        self._odds = 0
        self._last, self._count = sample, sample[0] if last is None else self._count + steps
        if last is None:
            return True, None
        equal = self._equal
        for axis in (0, 1, 2):
            if sample[axis + 1] != last[axis + 1]:
                equal[axis] = 1
                continue
            equal[axis] += 1
            if equal[axis] > self._longest[axis]:
                self.doubtful = self._equal[axis]  # so many of the samples kept are the frozen value
                return False, (
                    f"sends the same {'xyz'[axis]} value {self._equal[axis]} times, at most {self._longest[axis]:.0f} "
                    "are noise: it is frozen or saturated; switch it off and on, run again"
                )
        return True, None

    def judge_all(
        self, counts: IntArray, forces: FloatArray, zero: tuple[float, float, float]
    ) -> tuple[int, float] | None:
        """The running count of the last of these samples, counts (N,) and forces (N, 3), N, if all may be kept, and the
        largest force above `zero`, N.

        None, and nothing has changed: there may be something about one of them, so each is to be judged by itself.
        The rules are `judge`'s, of a block at a time: 5000 samples a second would take a twentieth of a core else.
        """
        last = self._last
        if last is None or self._odds > 0 or self._waiting is not None or not self.spacing > 0.0:
            return None
        from hw.sensors.sample_kernels import judge_block

        # a force that is no number, or infinite, differs by no number that is within the largest
        most = RINGING * self.steepest * self.spacing + SLIP if self.steepest < np.inf else _LARGEST
        u, v, w = self._margins
        limits = np.array(((most + u, most + v, most + w), self._longest, last[1:], zero))
        state = np.array((last[0], *self._equal))
        # of one type and layout: for another the loop would be compiled anew, in the midst of a motion
        block = np.ascontiguousarray(counts, dtype=np.int64), np.ascontiguousarray(forces, dtype=np.float64)
        advance, strongest = judge_block(*block, limits, state, self._wrap, self._ticks, self._slack)
        if advance < 0:
            return None
        count, *self._equal = state.tolist()
        x, y, z = limits[2].tolist()
        self._last = (count, x, y, z)
        self._count += advance
        return self._count, strongest

    def _jump(self, sample: Sample, before: Sample | None) -> str | None:
        """None: a lone one, perhaps garbled; else what is wrong: it stays there, or goes on jumping."""
        self._odds += 1
        if self._odds < JUMPS:
            return None
        self._odds = 0
        if any(np.isinf(sample[1:])):
            return "is overloaded or saturated; check the path, and what presses on the tip"
        if before is None or not isfinite(sum(sample[1:])):
            return "sent a value that is no number; switch it off and on, check its amplifier"
        change = max(abs(a - b) for a, b in zip(sample[1:], before[1:], strict=True))
        return (
            f"jumped by {change:.2f} N, faster than the stage can move the tip: its gain, sign or zero changed; "
            "check its cable and supply, run again"
        )

    def _far(self, sample: Sample, last: Sample, steps: int) -> bool:
        if self.steepest == np.inf:
            return False
        most = RINGING * self.steepest * self.spacing * max(1.0, steps / self._ticks) + SLIP
        _, x, y, z = sample
        _, u, v, w = last
        noise = self._margins
        return abs(x - u) > most + noise[0] or abs(y - v) > most + noise[1] or abs(z - w) > most + noise[2]


def _longest_run(equal: FloatArray) -> int:
    """Longest run of equal values, from whether each neighbour (N - 1,) is equal."""
    changes = np.flatnonzero(np.concatenate([[True], ~equal.astype(bool), [True]]))
    return int(np.diff(changes).max())
