"""Refine all: the posteriors of features that disturb one another's traces."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from mapping import Feature, Interval, Trace
from mapping.base import Base
from mapping.geometry.mesh import distances, nearest_on
from mapping.inference.families import Surroundings
from mapping.inference.feature_posterior import refine, settle
from mapping.inference.junctions import NORMAL_QUANTILE_95, Meeting, brought_together, meetings
from mapping.inference.kinds import Kind, kind_made_of, kind_of, sizes_of
from mapping.inference.trace_noise import noise_of_trace
from mapping.instrument import Noise

# What fewer crossings show may be false, and would explain a part of a true neighbour's trace and be supported by it
# alone
FEWEST_CERTAIN_CROSSINGS = 3


def refine_all(
    features: Sequence[Feature],
    trace: Trace,
    seed: int,
    *,
    base: Base,
    noise: Noise | None = None,
    tip_sd: float = 0.0,
    confirm: bool | None = True,
    progress: Callable[[float], None] = lambda share: None,
) -> tuple[Feature, ...]:
    """The features with their posteriors, each beside the others as well as they are known by then.

    Where the disturbances of two that several sweeps saw overlap, both are laid out first by the optima of their
    posteriors: what is a neighbour's and what its own depends on both. What fewer sweeps saw is judged beside them, and
    counts as their neighbour only if it is likely then. Lines that meet end in one place, which the courses of all of
    them tell. Free sections are measured already, and come back as they are.

    Args:
        features: as detected.
        trace: the whole trace.
        seed: each feature draws from a stream of its own: what one draws does not change the next.
        base: the global model.
        noise: of the samples; None: estimated from the trace.
        tip_sd: standard deviation of the tip's radius, m; above 0 it is a parameter.
        confirm: False to stop at importance sampling where it can be trusted, None to stop there in any case.
        progress: told the share that is done, after each feature.
    """
    tip = trace.tip_radius
    noise = noise or noise_of_trace(trace, base)
    measured = [_with_tip_doubt(feature, tip_sd) for feature in features if feature.details.free_section]
    features = [feature for feature in features if not feature.details.free_section]
    features = _facing_as_one(features, Surroundings(trace, base, noise, features, tip_sd), seed)
    half_widths = [sizes_of(feature, tip).half_width for feature in features]
    met = meetings(features, half_widths)
    beside = _beside(features, half_widths)
    certain = [k for k, feature in enumerate(features) if feature.evidence.crossings >= FEWEST_CERTAIN_CROSSINGS]
    doubtful = [k for k in range(len(features)) if k not in certain]
    known = list(features)
    for k in certain:
        if beside[k].intersection(certain):
            around = Surroundings(trace, base, noise, [known[m] for m in certain if m != k], tip_sd)
            known[k] = settle(features[k], around)
    known = brought_together(known, met, half_widths, base, tip)
    detected = _begun_at(features, known, met)

    def refined(k: int, others: Sequence[int]) -> Feature:
        near, rng = [known[m] for m in others if m != k], np.random.default_rng([seed, k])
        return refine(detected[k], trace, rng, base=base, noise=noise, others=near, tip_sd=tip_sd, confirm=confirm)

    for done, k in enumerate([*certain, *doubtful]):
        known[k] = refined(k, certain if k in certain else range(len(features)))
        progress((done + 1) / len(features))
    true = [k for k in range(len(features)) if known[k].evidence.likely]
    for k in certain:
        if beside[k].intersection(true, doubtful):
            known[k] = refined(k, true)
    together = brought_together(known, met, half_widths, base, tip)
    return tuple(sorted([*measured, *together], key=lambda feature: -feature.evidence.snr) if measured else together)


def _with_tip_doubt(feature: Feature, tip_sd: float) -> Feature:
    """A free section whose flanks are doubtful by the tip's radius: by r tan(a/2) <= r each (theory section 5.4)."""
    sd = np.hypot((feature.width.high - feature.width.low) / (2.0 * NORMAL_QUANTILE_95), 2.0 * tip_sd)
    return replace(feature, width=Interval.normal(feature.width.median, float(sd)))


def _facing_as_one(features: Sequence[Feature], around: Surroundings, seed: int) -> list[Feature]:
    """The features, with two edges that face each other nearer than their disturbances reach taken for one line.

    An edge up and an edge down of one bar are one detail. The line takes their place if it fits within the noise: two
    edges could then fit no better, and have a height and a course more to pay for.
    """
    kept = list(features)
    sided = [feature for feature in features if kind_of(feature).sided and len(feature.axis) > 1]
    for first, second in itertools.combinations(sided, 2):
        if not any(first is each for each in kept) or not any(second is each for each in kept):
            continue
        if not _faces(first, second, around.trace.tip_radius):
            continue
        others = [each for each in kept if each is not first and each is not second]
        for crossings in ("convex", "concave"):
            line = _between(first, second, kind_made_of(crossings, line=True))
            found = refine(line, around.trace, np.random.default_rng([seed, len(features)]), base=around.base,
                           noise=around.noise, others=others, tip_sd=around.tip_sd, confirm=False)  # fmt: skip
            if found.details.misfit is None and found.evidence.likely:
                kept = [line if each is first else each for each in kept if each is not second]
                break
    return kept


def _faces(first: Feature, second: Feature, tip_radius: float) -> bool:
    """True if two lines run beside each other, nearer everywhere than both of their disturbances reach."""
    reach = sum(sizes_of(each, tip_radius).half_width for each in (first, second))
    apart = [distances(one.axis, other.axis) for one, other in ((first, second), (second, first))]
    return bool(max(np.quantile(each, 0.8) for each in apart) < reach)


def _between(first: Feature, second: Feature, kind: Kind) -> Feature:
    """The line midway between two edges."""
    across = nearest_on(first.axis, second.axis)[0] - first.axis
    width = float(np.median(np.linalg.norm(across, axis=1)))
    height = float(np.hypot(first.height.median, second.height.median)) / np.sqrt(2.0)
    return replace(
        first,
        kind=kind.name,
        axis=first.axis + 0.5 * across,
        height=Interval(kind.sign * height, *sorted((kind.sign * 0.9 * height, kind.sign * 1.1 * height))),
        width=Interval(width, 0.5 * width, 2.0 * width),
        evidence=replace(first.evidence, snr=float(np.hypot(first.evidence.snr, second.evidence.snr))),
    )


def _beside(features: Sequence[Feature], half_widths: Sequence[float]) -> list[set[int]]:
    """For each feature the numbers of those whose disturbances touch its own."""
    return [
        {
            m
            for m, other in enumerate(features)
            if m != k and distances(feature.axis, other.axis).min() < half_widths[k] + half_widths[m]
        }
        for k, feature in enumerate(features)
    ]


def _begun_at(detected: Sequence[Feature], known: Sequence[Feature], met: Sequence[Meeting]) -> list[Feature]:
    """The detected features with their ends where they meet as that is known by now."""
    result = list(detected)
    for number, end in (end for meeting in met for end in meeting.ends):
        axis = result[number].axis.copy()
        axis[end] = known[number].axis[end]
        result[number] = replace(result[number], axis=axis)
    return result
