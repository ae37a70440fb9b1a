"""False alarms: how often a bank of matched filters is fooled by noise alone, and the threshold for a given rate.

Outputs above a threshold come in clumps: neighbouring places and widths see the same noise. The rate of clumps is
the rate of single exceedances, each counted by one over the size of its clump (Aldous, Probability Approximations
via the Poisson Clumping Heuristic, 1989).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from mapping.clumps import BankClumps, clumps_of
from mapping.matched_filter import LADDER, Bank, build_bank, colour_in_bins, rung
from mapping.noise import Noise

# Threshold at which clump sizes are measured; they change slowly with it.
TYPICAL_THRESHOLD = 5.0
# Thresholds this near have clumps of the same size, to one or two per cent: a thousandth of the threshold.
THRESHOLD_STEP = 0.125
# Steps an octave of the ladder of banks that thresholds are remembered for.
COARSE = 16
# Relative uncertainty of the noise that changes a threshold by less than one part in a thousand.
NEGLIGIBLE = 5e-3


def threshold_for(bank: Bank, false_alarms_per_metre: float, uncertainty: float = 0.0) -> float:
    """The signal-to-noise ratio that noise alone exceeds, in either sign, as often per metre as asked.

    The threshold changes by less than a thousandth where the bank changes by one per cent, so it is worked out
    for the nearest bank of a ladder of 4 % steps and remembered: sweep after sweep has the same one.

    Where the level of the noise itself is uncertain, signal over estimated noise is distributed as Student's t
    instead of normally, and noise alone exceeds a higher threshold as often.

    Args:
        bank: of filters.
        false_alarms_per_metre: 1/m.
        uncertainty: relative standard deviation of the filters' noise.
    """
    colour, _ = colour_in_bins(bank.noise, bank.spacing, bank.samples)
    sizes = (
        min(rung(colour.correlated, COARSE), 1.0),
        rung(colour.length, COARSE) if colour.correlated else 0.0,
        rung(bank.filters[0].half_width / bank.spacing, COARSE),
    )

    def solved(near: float) -> float:
        return _solve(_intensity(*sizes, len(bank.filters), bank.drift, near), false_alarms_per_metre * bank.spacing)

    normal = solved(round(solved(TYPICAL_THRESHOLD) / THRESHOLD_STEP) * THRESHOLD_STEP)
    if uncertainty < NEGLIGIBLE:
        return normal
    from scipy.special import ndtr, stdtrit

    # the square of an estimated level with n degrees of freedom has the relative variance 2 / n
    return float(-stdtrit(0.5 / uncertainty**2, float(ndtr(-normal))))


@lru_cache(maxsize=256)
def _intensity(correlated: float, length: float, smallest: float, count: int, drift: int, threshold: float) -> float:
    """Intensity of the clumps of a bank in units of its bins and its noise, remembered."""
    return _clumps(correlated, length, smallest, count, drift).intensity(threshold)


@lru_cache(maxsize=2)
def _clumps(correlated: float, length: float, smallest: float, count: int, drift: int) -> BankClumps:
    """The clumps of a bank in such units: one threshold is asked for after another."""
    noise = Noise(float(np.sqrt(1.0 - correlated**2)), correlated, length or 1.0)
    return clumps_of(build_bank(noise, 1.0, 1.0, smallest, smallest * LADDER ** (count - 1), drift))


def false_alarm_rate(bank: Bank, threshold: float) -> float:
    """Expected number of clumps of exceedances per metre of path, 1/m."""
    from scipy.special import ndtr

    return float(2 * ndtr(-threshold) * clumps_of(bank).intensity(threshold))


def _solve(intensity: float, rate: float) -> float:
    """u with 2 Q(u) intensity = rate; never under 1.5, where everything would be one clump."""
    from scipy.special import ndtri

    return float(max(-ndtri(min(rate / (2 * intensity), 0.5)), 1.5))
