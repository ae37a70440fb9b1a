"""Pace: how fast sweeps may be that still show the smallest feature asked for."""

from __future__ import annotations

import numpy as np

from mapping.instrument import Noise

# Standard deviations that a crest must stand out by: a usual threshold of detection, and 1.645 to be found in 95 of 100
CERTAIN_CREST_SDS = 6.5
# Height asked for, in heights that are just found
HEIGHT_MARGIN = 1.25
TRIED_SPEEDS = 24


def fastest_speed(
    noise: Noise, rate: float, tip_radius: float, smallest: float, slowest: float, fastest: float
) -> float:
    """The fastest speed (m/s) at which a sweep across the smallest feature finds it.

    Samples of a faster sweep lie further apart, so white noise averages less; correlated noise is the same. Where no
    single sweep finds it, many must: fast ones tell more per second, for correlated noise averages over sweeps only.

    Args:
        noise: of a sample.
        rate: samples per second.
        tip_radius: m.
        smallest: height of a sharp crest, m.
        slowest, fastest: between which to choose, m/s.
    """
    speeds = np.geomspace(fastest, slowest, TRIED_SPEEDS)
    found = (
        v for v in speeds if HEIGHT_MARGIN * least_height(noise, v / rate, tip_radius, CERTAIN_CREST_SDS) <= smallest
    )
    return float(next(found, fastest))


def least_height(noise: Noise, spacing: float, tip_radius: float, ratio: float) -> float:
    """Height of the smallest sharp crest whose matched filter has a signal-to-noise ratio, m.

    A crest of height h disturbs w = sqrt(2 r h) to either side, as the cap T = h (1 - (x / w)^2).

    Args:
        spacing: of the samples, Delta, m.

    Reference: theory section 6.
    """
    heights = np.geomspace(1e-7, 1.0, 800) * tip_radius
    width = np.sqrt(2.0 * tip_radius * heights)
    seen = heights >= ratio * noise.cap_sd(width, spacing)
    return float(heights[seen.argmax()] if seen.any() else heights[-1])
