"""Felt alone: what a single sweep shows plainly is there, though no family of shapes explains it.

Existence is not shape. A groove along a sweep leaves one long dip on it and nothing on its neighbours, which no pit
does: under the noise that a pit must be given to fit there is nothing. The free section of the sweep (`free_sections`)
says under the measured noise that there is. Against it speak sweeps that passed the same place and felt less than a
ball must: one that has sunk by h stands in a mouth at least a = sqrt(2 r h) to either side, and beside it, within that,
sinks by h (1 - d / a)^2 at least; one that was held up by h is held up by h - d^2 / (2 r) at a distance d.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapping import Feature, FloatArray, Interval, length_text
from mapping.assembly.free.free_sections import FreeSection, free_sections, free_spot
from mapping.base import LaidTrace, SweepHeights
from mapping.detection import Detections
from mapping.geometry.mesh import distances
from mapping.inference.kinds import sizes_of
from mapping.instrument import Noise

# Most places of a section that its distance from what is told is taken at: two to the reach of a detail, of one that
# reaches a hundredth of the section's extent or more
PLACES_OF_SECTION = 200


def felt_alone(detections: Detections, trace: LaidTrace, features: Sequence[Feature]) -> list[Feature]:
    """Spots of no family where single sweeps show what no feature disturbs, and no other sweep denies it.

    Args:
        detections: of the trace.
        trace: laid on a base that was fitted to it.
        features: that all sweeps speak for.
    """
    found = list[Feature]()
    for section in sorted(free_sections(detections, trace)[0], key=lambda each: -each.crossing.snr):
        if section.inside and not any(_disturbs(each, section, trace.tip_radius) for each in [*features, *found]):
            spot = _spot(section, detections, trace)
            if spot.evidence.likely:
                found.append(spot)
    return found


def _disturbs(feature: Feature, section: FreeSection, tip_radius: float) -> bool:
    """True if what was felt of a feature reaches into a section."""
    free, half = feature.details.free_section, 0.5 * feature.width.high
    reach = half if free else sizes_of(feature, tip_radius).half_width
    # so near to each other that no line runs through between two of them
    count = 2 + int(min(2.0 * section.extent / max(reach, np.finfo(float).tiny), PLACES_OF_SECTION))
    crossing = section.crossing
    places = crossing.point + np.linspace(-0.5, 0.5, count)[:, None] * section.extent * crossing.tangent
    return bool(distances(places, feature.axis).min() < reach)


def _spot(section: FreeSection, detections: Detections, trace: LaidTrace) -> Feature:
    """What a section shows, with bounds: it may be a line along its sweep as well as a spot."""
    tip, hollow = trace.tip_radius, section.sign < 0.0
    spot, sizes = free_spot(section, detections.algorithm), section.sizes
    surely = min(max(Interval.normal(sizes.height, sizes.height_sd).low, 0.0), tip)
    least = 2.0 * float(np.sqrt(surely * (2.0 * tip - surely))) if hollow else 0.0
    most = max(spot.width.high, least)
    misfit = (
        f"no {spot.kind} fits the trace within its noise: a single sweep shows it over {length_text(section.extent, 2)}"
        ", and a line along that sweep may be what it is"
    )
    odds = section.log_odds + _log_odds_of_others(section, detections.noise, trace)
    return replace(
        spot,
        height=replace(spot.height, censored=hollow),
        width=Interval(least, least, most, censored=True, bounded=True),
        evidence=replace(spot.evidence, log_odds=odds),
        notes=(misfit,),
        details=replace(spot.details, misfit=misfit),
    )


def _log_odds_of_others(section: FreeSection, noise: Noise, trace: LaidTrace) -> float:
    """Log likelihood ratio, on all other sweeps, of the least that they must have felt against nothing."""
    odds = 0.0
    for sweep in trace.laid_sweeps:
        if sweep.number != section.crossing.sweep:
            for piece in sweep.heights(section.piece.spacing):
                least = _least_felt(section, piece, trace.tip_radius)
                if least.any():
                    of_means = noise.scaled(white=max(piece.samples, 1.0) ** -0.5)
                    expected, seen = (of_means.whiten(each, piece.s)[0] for each in (least, piece.height))
                    odds += float(expected @ seen - 0.5 * expected @ expected)
    return odds


def _least_felt(section: FreeSection, piece: SweepHeights, tip_radius: float) -> FloatArray:
    """(n,) heights that another sweep's bins must have at least, by what was felt beside them, m."""
    crossing, own, sign = section.crossing, section.piece, section.sign
    offset = piece.centers - crossing.point
    along, aside = offset @ crossing.tangent, np.abs(offset @ np.cross(crossing.normal, crossing.tangent))
    inside = np.abs(along) < 0.5 * section.extent
    at = section.sizes.middle + along
    felt = np.where(inside, np.maximum(sign * np.interp(at, own.s, own.height), 0.0), 0.0)
    if sign > 0.0:
        return np.asarray(np.maximum(felt - aside**2 / (2.0 * tip_radius), 0.0))
    mouth = np.sqrt(2.0 * tip_radius * np.maximum(felt, np.finfo(float).tiny))
    return np.asarray(-felt * np.maximum(1.0 - aside / mouth, 0.0) ** 2)
