"""Play: an axis that follows only when it is pulled, compiled."""

from __future__ import annotations

from numba import njit


@njit(cache=True)
def play(centers, sweep, half):  # type: ignore[no-untyped-def]
    """(N, 3) places of a stage whose axes hang behind the commanded centers (N, 3) by up to `half`, m.

    Each sweep begins where it was commanded to.
    """
    out = centers.copy()
    for i in range(1, len(centers)):
        if sweep[i] == sweep[i - 1]:
            for k in range(3):
                out[i, k] = min(max(out[i - 1, k], centers[i, k] - half), centers[i, k] + half)
    return out
