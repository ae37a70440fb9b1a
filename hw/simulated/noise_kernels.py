"""Compiled recursion of correlated noise (scipy.signal takes longer to import than a sweep to simulate)."""

# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def decaying_sum(values: NDArray, keep: float) -> None:  # type: ignore[type-arg]
    """Each row of values (N, M) becomes itself plus `keep` times what the row before became; in place."""
    for i in range(1, values.shape[0]):
        for j in range(values.shape[1]):
            values[i, j] += keep * values[i - 1, j]
