"""SensorClock: when a sensor's samples were taken, on the host's clock."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray, IntArray

# A clock may be off what is known of its period by so much; a host is this late, s, as a rule. What comes later than
# both tell was held back in a buffer while nobody read, for as long as that may have been: it says nothing of the clock
CLOCK_UNSURE, USUALLY_LATE = 0.02, 0.05


@dataclass(frozen=True)
class SensorClock:
    """host time = offset + period * ticks.

    Args:
        period: host seconds per tick of the sensor's counter or clock.
        offset: host time of tick 0, s, by the samples that came with the least delay. What delay these have
            too cannot be known from the sensor alone (see hw.probing.fusion.estimate_delay).
        jitter: standard deviation of the arrivals about it, s.
    """

    period: float
    offset: float
    jitter: float

    def times(self, ticks: FloatArray) -> FloatArray:
        """(N,) host times of ticks, s."""
        return np.asarray(self.offset + self.period * ticks)

    @classmethod
    def estimate(cls, ticks: FloatArray, arrivals: FloatArray, nominal: float) -> SensorClock:
        """From ticks (N,) and host times of arrival (N,), s.

        A sample can only come late, so the line lies under all arrivals: its slope is that of the earliest
        arrivals of the stretch's first and last fifth, its offset the least that keeps it below all.

        Args:
            nominal: period to assume while the stretch is too short to tell, s.
        """
        span = float(ticks[-1] - ticks[0]) if len(ticks) > 1 else 0.0
        period = nominal
        if len(ticks) >= 50:
            late = arrivals - nominal * ticks
            soon = late <= late.min() + CLOCK_UNSURE * float(np.ptp(arrivals)) + USUALLY_LATE
            ticks, arrivals, late = ticks[soon], arrivals[soon], late[soon]
            fifth = max(1, len(ticks) // 5)
            first, last = int(late[:fifth].argmin()), len(ticks) - fifth + int(late[-fifth:].argmin())
            if ticks[last] > ticks[first]:
                period = float((arrivals[last] - arrivals[first]) / (ticks[last] - ticks[first]))
        late = arrivals - period * ticks
        jitter = float(np.std(late)) if span > 0 else 0.0
        return cls(period, float(late.min()), jitter)


def unwrapped(counter: IntArray, bits: int) -> IntArray:
    """(N,) running count from a counter (N,) that starts anew after 2^bits."""
    steps = np.diff(counter) % (1 << bits)
    return np.concatenate([counter[:1], counter[0] + np.cumsum(steps)]) if len(counter) else counter


def missing(ticks: IntArray) -> int:
    """How many samples are missing between ticks (N,): by the most common step."""
    if len(ticks) < 3:
        return 0
    steps = np.diff(ticks)
    steps = steps[steps > 0]
    values, counts = np.unique(steps, return_counts=True)
    usual = int(values[counts.argmax()])
    return int(np.round(steps / usual - 1.0).sum())
