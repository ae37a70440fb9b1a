"""Refine all: the posteriors of features that disturb one another's traces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from mapping import Feature, Interval, Trace
from mapping.base import Base
from mapping.inference import noise_of_trace, refine, settle
from mapping.inference.families import Surroundings, window_reach
from mapping.inference.joint.blocks import blocks_of, gaps
from mapping.inference.joint.junctions import Meeting, brought_together, meetings
from mapping.inference.joint.neighbours import MOST_TOGETHER, NeighboursDoubt, laid_together
from mapping.inference.kinds import kind_of, sizes_of
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

    Where the disturbances of some that several sweeps saw overlap, they are laid out first where they are likeliest
    together: what is a neighbour's and what its own depends on both, and what is not known of one is doubt of the
    other. What fewer sweeps saw is judged beside them, and counts as their neighbour only if it is likely then. Lines
    that meet end in one place, which the courses of all of them tell. Free sections are measured already, and come back
    as they are.

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
    half_widths = [sizes_of(feature, tip).half_width for feature in features]
    met = meetings(features, half_widths)
    beside = _beside(features, half_widths)
    certain = [k for k, feature in enumerate(features) if feature.evidence.crossings >= FEWEST_CERTAIN_CROSSINGS]
    doubtful = [k for k in range(len(features)) if k not in certain]
    known, doubts = list(features), dict[int, NeighboursDoubt]()
    for group in _groups(certain, [features[k] for k in certain], tip):
        rest = [known[m] for m in certain if m not in group]
        around = Surroundings(trace, base, noise, rest, tip_sd)
        together = laid_together([features[k] for k in group], around)
        if together is None:
            for k in group:
                beside_it = [known[m] for m in certain if m != k]
                known[k] = settle(features[k], replace(around, others=beside_it))
            continue
        for number, k in enumerate(group):
            known[k], doubts[k] = together.features[number], together.doubt_beside(number)
    known = brought_together(known, met, half_widths, base, tip)
    detected = _begun_at(features, known, met)

    def refined(k: int, others: Sequence[int]) -> Feature:
        near, rng = [known[m] for m in others if m != k], np.random.default_rng([seed, k])
        return refine(
            detected[k],
            trace,
            rng,
            base=base,
            noise=noise,
            others=near,
            tip_sd=tip_sd,
            confirm=confirm,
            widened=doubts[k].widened if k in doubts else None,
        )

    for done, k in enumerate([*certain, *doubtful]):
        known[k] = refined(k, certain if k in certain else range(len(features)))
        progress((done + 1) / len(features))
    true = [k for k in range(len(features)) if known[k].evidence.likely]
    for k in certain:
        if beside[k].intersection(true, doubtful):
            known[k] = refined(k, true)
    found = brought_together(known, met, half_widths, base, tip)
    return tuple(sorted([*measured, *found], key=lambda feature: -feature.evidence.snr) if measured else found)


def _with_tip_doubt(feature: Feature, tip_sd: float) -> Feature:
    """A free section whose flanks are doubtful by the tip's radius: by r tan(a/2) <= r each (theory section 5.4)."""
    return replace(feature, width=feature.width.with_doubt(2.0 * tip_sd))


def _beside(features: Sequence[Feature], half_widths: Sequence[float]) -> list[set[int]]:
    """For each feature the numbers of those whose disturbances touch its own."""
    touches = gaps(features, half_widths) < 0.0
    return [set(np.flatnonzero(own).tolist()) - {k} for k, own in enumerate(touches)]


def _groups(numbers: Sequence[int], features: Sequence[Feature], tip: float) -> list[list[int]]:
    """The numbers of features whose disturbances touch, as wide as they may be, directly or by others between them, in
    blocks of MOST_TOGETHER that lie nearest together; none of one alone.

    A step goes on to wherever its level does: one whose wall lies in the window of another one touches it.
    """
    wide = [replace(feature, width=Interval(*(feature.width.high,) * 3)) for feature in features]
    sizes = [sizes_of(feature, tip) for feature in wide]
    reaches = [
        0.5 * (window_reach(size, tip) + size.half_width) if kind_of(feature).sided else size.half_width
        for feature, size in zip(wide, sizes, strict=True)
    ]
    gap = gaps(wide, reaches)
    blocks = blocks_of(gap, range(len(features)), lambda block: len(block) > MOST_TOGETHER)
    return [sorted(numbers[k] for k in block) for block in blocks if len(block) > 1]


def _begun_at(detected: Sequence[Feature], known: Sequence[Feature], met: Sequence[Meeting]) -> list[Feature]:
    """The detected features with their ends where they meet as that is known by now."""
    result = list(detected)
    for number, end in (end for meeting in met for end in meeting.ends):
        axis = result[number].axis.copy()
        axis[end] = known[number].axis[end]
        result[number] = replace(result[number], axis=axis)
    return result
