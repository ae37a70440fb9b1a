"""Sections by evidence: the families that remain likely for a line, and the sizes that hold for all of them.

A ball of 10 mm feels the top of a line and bridges its flanks: a round wire, a bar and a roof may leave one trace. Each
family's weight is its evidence; heights are drawn from all that remain likely, and where a flank was not touched in
them the width is a bound. Where the round section alone remains, its width is a number, as that of a wire is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapping import Feature, FloatArray, Interval, Posterior, length_text
from mapping.inference.families import PosteriorProblem, TrapezoidShape, with_nominal_tip
from mapping.inference.kinds import kind_of
from mapping.inference.likelihood import Shape

# A family whose probability is below this one leaves every 90 % interval as it is, to within half of its tail
UNLIKELY_FAMILY = 0.05
AVERAGED_DRAWS = 4000


def probabilities(log_evidences: list[float]) -> FloatArray:
    """Of families that were equally probable beforehand."""
    weights = np.exp(np.array(log_evidences) - max(log_evidences))
    return np.asarray(weights / weights.sum())


def averaged(feature: Feature, likely: Sequence[tuple[float, PosteriorProblem, Posterior]]) -> Feature:
    """The feature with the sizes that all likely families agree on.

    Args:
        feature: as its most probable family describes it.
        likely: weight, problem and posterior of each family, the most probable one first.
    """
    kind = kind_of(feature)
    if len(likely) == 1 and not isinstance(_shape(likely[0][1]), TrapezoidShape):
        return feature
    total = sum(share for share, _, _ in likely)
    parts = []
    for share, problem, posterior in likely:
        shape = _shape(problem)
        draws = posterior.samples[:, : len(shape.names)]
        count = round(AVERAGED_DRAWS * share / total)
        some = draws[np.linspace(0, len(draws) - 1, count).astype(np.int64)]
        parts.append(np.column_stack([kind.draws_of_height(shape, some), *kind.widths_felt(shape, some)]))
    height, touched, bridged = np.concatenate(parts).T
    interval = Interval.from_draws(height)
    if np.mean(bridged > touched) <= UNLIKELY_FAMILY:
        return replace(feature, height=interval, width=Interval.from_draws(touched))
    low, median = np.quantile(touched, [0.05, 0.5])
    width = Interval(float(median), float(low), float(np.quantile(bridged, 0.95)), censored=True, bounded=True)
    names = ", ".join(f"{name_of(problem)} {100 * share / total:.0f} %" for share, problem, _ in likely)
    note = (
        f"the tip bridged its flanks: it touched a width of {length_text(float(median), 2)}, and the foot may be "
        f"anything up to {length_text(width.high, 2)} wide (sections that leave this trace: {names})"
    )
    return replace(feature, height=interval, width=width, notes=(*feature.notes, note))


def name_of(problem: PosteriorProblem) -> str:
    """What people call a problem's section."""
    shape = _shape(problem)
    if not isinstance(shape, TrapezoidShape):
        return "round"
    return "triangular" if shape.roof else "flat-topped"


def _shape(problem: PosteriorProblem) -> Shape:
    return with_nominal_tip(problem).target.shape
