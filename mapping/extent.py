"""Extent: whether the ends of an axis were seen, or only that it goes at least so far."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mapping.problem import Problem

FloatArray = NDArray[np.float64]

# An end that may as well lie at the limit of what was looked at was not seen: no more log density against it.
UNSEEN = 3.0
GOES_ON = "the axis goes on beyond what was explored"


def explored(problem: Problem, draws: FloatArray) -> tuple[bool, bool]:
    """For the first and the last end: True if the data say that the axis does not go on.

    The best of the draws is moved out to the limit of the end's prior; if the density hardly drops, nothing was
    measured that could have shown the end, and the length is only bounded from below (a censored value).
    """
    target = problem.target
    best = draws[int(np.argmax(target.log_density(draws)))]
    at_limit = np.tile(best, (3, 1))
    columns = len(best) - 4, len(best) - 3
    at_limit[1, columns[0]] = target.low[columns[0]]
    at_limit[2, columns[1]] = target.high[columns[1]]
    value = target.log_density(at_limit)
    return bool(value[0] - value[1] > UNSEEN), bool(value[0] - value[2] > UNSEEN)


def with_open_ends(notes: Sequence[str], seen: Sequence[bool]) -> tuple[str, ...]:
    """The notes of a line with the one that says which of its ends (first, last) were not seen, if any."""
    open_ends = [name for name, known in zip(("first", "last"), seen, strict=True) if not known]
    note = f"{GOES_ON} at its {' and its '.join(open_ends)} point: at least this long"
    rest = tuple(each for each in notes if not each.startswith(GOES_ON))
    return (*rest, note) if open_ends else rest
