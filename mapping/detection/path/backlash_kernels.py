"""Play of an axis: it follows only when it is pulled, compiled."""

from __future__ import annotations

from numba import njit


@njit(cache=True)
def hang_behind(path, half):  # type: ignore[no-untyped-def]
    """(N, 3) by how much a stage whose axes have a play of 2 `half`, m, is off a path (N, 3); it begins midway."""
    behind = path * 0.0
    for i in range(1, len(path)):
        for k in range(3):
            moved = behind[i - 1, k] + path[i - 1, k] - path[i, k]
            behind[i, k] = min(max(moved, -half), half)
    return behind
