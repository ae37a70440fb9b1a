"""SampleWatch: is what a force sensor sends still a measurement? Judged sample by sample, in the thread that reads it.

A sensor that froze, saturated, or lost its supply goes on sending whole frames. What gives it away is physics: noise
never stands still for long, a force never jumps faster than the tip can be moved against its own stiffness.
"""

from __future__ import annotations

from math import isfinite

import numpy as np

from hw import StoppedError
from mapping import FloatArray, IntArray

# Chance of a false stop per sample and axis: one in a thousand sessions of 10 h at 5 kHz (5e8 values)
FALSE_STOP = 2e-12
# So many standard deviations of a difference are noise: a Gaussian exceeds 8 once in 1e15
NOISE_OF_A_DIFFERENCE = 8.0 * 2.0**0.5
# Stick and slip under the tip is faster than the stage: a share of the friction of usual sweeps of 1 N, N
SLIP = 0.3
# The stage's speed may be felt twice over by a tip that rings
RINGING = 2.0
# A count may go on by so many samples at once, or by more if the next sample says so, too: a garbled count would make
# all samples after it look old. With 15 % of the frames lost (1 % of the bytes of 16) eight in a row come once in a day
LOST_TOGETHER = 8
# A run of equal values that was seen while nothing touched may come this much longer, by correlated noise
LONGER_THAN_SEEN = 4
_LARGEST = float(np.finfo(np.float64).max)

Sample = tuple[int, float, float, float]


class SampleWatch:
    """Learns the noise while nothing touches; judges every sample by it, and by how fast a force can change.

    Args:
        bits: width of the sensor's counter or clock.
    """

    def __init__(self, bits: int) -> None:
        self._wrap = 1 << bits
        self.steepest = np.inf
        self.blind = 0.0
        self.noise, self._margins = np.zeros(3), [0.0, 0.0, 0.0]
        self._spacing, self._ticks = 0.0, 1.0
        self._longest = [np.inf] * 3
        self.forget()

    def forget(self) -> None:
        """The next sample is the first: the sensor was lost, or its counter started anew."""
        self._last: Sample | None = None
        self._odd: Sample | None = None
        self._ahead: int | None = None  # a count that went on by too much, and waits for the next one to agree
        self.lone = False
        self._count = 0
        self._equal = [1, 1, 1]
        self.doubtful = 0

    def learn(self, free: FloatArray, ticks: float, spacing: float) -> None:
        """From samples (N, 3), N, without contact: how long a value may stay the same. They are `ticks` counts, and
        `spacing` s, apart.

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
        self._spacing, self._ticks = spacing, ticks
        # until then nobody knows that the sensor is frozen: the axis that changes most tells first
        self.blind = spacing * min(self._longest)
        self.noise = 1.4826 * np.median(np.abs(free - np.median(free, axis=0)), axis=0)
        self._margins = [NOISE_OF_A_DIFFERENCE * float(sd) for sd in self.noise]  # numpy's numbers are slow one by one
        self._equal = [1, 1, 1]

    def judge(self, sample: Sample) -> tuple[int, bool, str | None]:
        """The sample's running count, whether it may be kept, and what is wrong with the sensor, or None.

        `lone` then tells whether it was left out as a jump that the sample before knows nothing of: garbled, no force.
        """
        self.lone = False
        if not isfinite(sample[1] + sample[2] + sample[3]):
            if any(np.isinf(sample[1:])):
                return self._count, False, "is overloaded or saturated; check the path, and what presses on the tip"
            return self._count, False, "sent a value that is no number; switch it off and on, check its amplifier"
        last = self._last
        if last is None:
            self._last, self._count = sample, sample[0]
            return self._count, True, None
        step = (sample[0] - last[0]) % self._wrap
        if step == 0 or step > self._wrap // 2:
            return self._count, False, None  # an old sample again: no news, and without news nothing moves on
        count, ahead = self._count + step, self._ahead
        self._ahead = None
        if self._spacing > 0.0 and step > LOST_TOGETHER * self._ticks and not self._follows(sample, ahead):
            self._ahead, self.lone = sample[0], ahead is None
            return self._count, False, None
        if self.steepest < np.inf and self._far(sample, last, count - self._count):
            fault = self._jump(sample, last, count)
            self.lone = not fault
            return count, False, fault or None
        self._odd = None
        self._last, self._count = sample, count
        equal = self._equal
        for axis in (0, 1, 2):
            if sample[axis + 1] != last[axis + 1]:
                equal[axis] = 1
                continue
            equal[axis] += 1
            if equal[axis] > self._longest[axis]:
                self.doubtful = self._equal[axis]  # so many of the samples kept are the frozen value
                what = (
                    f"sends the same {'xyz'[axis]} value {self._equal[axis]} times, at most {self._longest[axis]:.0f} "
                )
                return count, False, what + "are noise: it is frozen or saturated; switch it off and on, run again"
        return count, True, None

    def judge_all(
        self, counts: IntArray, forces: FloatArray, zero: tuple[float, float, float]
    ) -> tuple[int, float] | None:
        """The running count of the last of these samples, counts (N,) and forces (N, 3), N, if all may be kept, and the
        largest force above `zero`, N.

        None, and nothing has changed: there may be something about one of them, so each is to be judged by itself.
        The rules are `judge`'s, of a block at a time: 5000 samples a second would take a twentieth of a core else.
        """
        last = self._last
        if last is None or self._odd is not None or self._ahead is not None or not self._spacing > 0.0:
            return None
        from hw.sensors.sample_kernels import judge_block

        # a force that is no number, or infinite, differs by no number that is within the largest
        most = RINGING * self.steepest * self._spacing + SLIP if self.steepest < np.inf else _LARGEST
        u, v, w = self._margins
        limits = np.array(((most + u, most + v, most + w), self._longest, last[1:], zero))
        state = np.array((last[0], *self._equal))
        together = min(int(LOST_TOGETHER * self._ticks), self._wrap // 2)
        # of one type and layout: for another the loop would be compiled anew, in the midst of a motion
        block = np.ascontiguousarray(counts, dtype=np.int64), np.ascontiguousarray(forces, dtype=np.float64)
        advance, strongest = judge_block(*block, limits, state, self._wrap, together)
        if advance < 0:
            return None
        count, *self._equal = state.tolist()
        x, y, z = limits[2].tolist()
        self._last = (count, x, y, z)
        self._count += advance
        return self._count, strongest

    def _follows(self, sample: Sample, ahead: int | None) -> bool:
        return ahead is not None and 0 < (sample[0] - ahead) % self._wrap <= LOST_TOGETHER * self._ticks

    def _jump(self, sample: Sample, last: Sample, count: int) -> str:
        """ "": a lone one, perhaps garbled; else what is wrong: it stays there, or goes on jumping.

        At 1 % of garbled bytes one frame in a thousand passes a sum of 16 bytes with a wrong force: two in a row come
        once in half an hour at 1 kHz.
        """
        if self._odd is None:
            self._odd = sample
            return ""
        self._odd = None
        change = max(abs(a - b) for a, b in zip(sample[1:], last[1:], strict=True))
        self._last, self._count = sample, count
        return (
            f"jumped by {change:.2f} N, faster than the stage can move the tip: its gain, sign or zero changed; "
            "check its cable and supply, run again"
        )

    def _far(self, sample: Sample, last: Sample, steps: int) -> bool:
        most = RINGING * self.steepest * self._spacing * max(1.0, steps / self._ticks) + SLIP
        _, x, y, z = sample
        _, u, v, w = last
        noise = self._margins
        return abs(x - u) > most + noise[0] or abs(y - v) > most + noise[1] or abs(z - w) > most + noise[2]


def _longest_run(equal: FloatArray) -> int:
    """Longest run of equal values, from whether each neighbour (N - 1,) is equal."""
    changes = np.flatnonzero(np.concatenate([[True], ~equal.astype(bool), [True]]))
    return int(np.diff(changes).max())
