"""Refine all: the posteriors of features that disturb one another's traces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mapping.base import Base
from mapping.crest_trace import distances
from mapping.feature import Feature
from mapping.meeting import Meeting, brought_together, meetings
from mapping.noise import Noise
from mapping.problem import Surroundings, sizes_of
from mapping.refine import refine, settle
from mapping.trace import Trace
from mapping.trace_noise import noise_of_trace

FloatArray = NDArray[np.float64]


def refine_all(
    features: Sequence[Feature],
    trace: Trace,
    seed: int,
    *,
    base: Base,
    noise: Noise | None = None,
    tip_sd: float = 0.0,
    confirm: bool = True,
    progress: Callable[[float], None] = lambda share: None,
) -> tuple[Feature, ...]:
    """The features with their posteriors, each beside the others as well as they are known by then.

    Where the disturbances of two overlap, each is laid out first by the optimum of its posterior: what is a neighbour's
    and what its own depends on both. Lines that meet end in one place, which the courses of all of them tell.

    Args:
        features: as detected.
        trace: the whole trace.
        seed: each feature draws from a stream of its own: what one draws does not change the next.
        base: the global model.
        noise: of the samples; None: estimated from the trace.
        tip_sd: standard deviation of the tip's radius, m; above 0 it is a parameter.
        confirm: False to stop at importance sampling where it can be trusted.
        progress: told the share that is done, after each feature.
    """
    tip = trace.tip_radius
    noise = noise or noise_of_trace(trace, base)
    half_widths = [sizes_of(feature, tip).half_width for feature in features]
    met = meetings(features, half_widths)
    detected, known = list(features), list(features)
    crowded = _overlapping(features, half_widths)
    for k in crowded:
        known[k] = settle(detected[k], Surroundings(trace, base, noise, _others(known, k), tip_sd))
    known = brought_together(known, met, half_widths, base, tip)
    detected = _begun_at(detected, known, met)
    for k, feature in enumerate(detected):
        known[k] = refine(
            feature,
            trace,
            np.random.default_rng([seed, k]),
            base=base,
            noise=noise,
            others=_others(known, k),
            tip_sd=tip_sd,
            confirm=confirm,
        )
        progress((k + 1) / len(detected))
    return tuple(brought_together(known, met, half_widths, base, tip))


def _others(features: Sequence[Feature], number: int) -> list[Feature]:
    return [feature for k, feature in enumerate(features) if k != number]


def _overlapping(features: Sequence[Feature], half_widths: Sequence[float]) -> list[int]:
    """Numbers of the features whose disturbance touches another's."""
    return [
        k
        for k, feature in enumerate(features)
        if any(
            distances(feature.axis, other.axis).min() < half_widths[k] + half_widths[m]
            for m, other in enumerate(features)
            if m != k
        )
    ]


def _begun_at(detected: Sequence[Feature], known: Sequence[Feature], met: Sequence[Meeting]) -> list[Feature]:
    """The detected features with their ends where they meet as that is known by now."""
    result = list(detected)
    for number, end in (end for meeting in met for end in meeting.ends):
        axis = result[number].axis.copy()
        axis[end] = known[number].axis[end]
        result[number] = replace(result[number], axis=axis)
    return result
