"""Disturbance: one crest, dip or plateau of a height profile, measured."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Disturbance:
    """What one stretch of a profile holds.

    Args:
        place: arclength of the crest, or of the plateau's middle, m.
        start, stop: arclengths between which the profile is disturbed, m.
        height: signed height of the crest, m.
        height_sd, place_sd: standard deviations, m.
        half_width: of the fitted cap, m.
        flat: half-length of the flat top, m; 0 for a crest.
        curvature: of the trace at the crest (of the flanks for a plateau), 1/m.
        snr: signal-to-noise ratio.
    """

    place: float
    start: float
    stop: float
    height: float
    height_sd: float
    place_sd: float
    half_width: float
    flat: float
    curvature: float
    snr: float
