"""Of the maxima of all filters those count that nothing stronger overlaps."""

from __future__ import annotations

import numpy as np
import pytest

from mapping.detection.candidates import _dominant


@pytest.mark.parametrize("seed", range(5))
def test_of_overlapping_candidates_the_strongest_is_kept_and_what_was_taken_blocks(seed):
    rng = np.random.default_rng(seed)
    snr, place = np.sort(rng.uniform(3.0, 9.0, 60))[::-1], rng.integers(0, 400, 60)
    candidates = np.column_stack([snr, place, rng.uniform(1.0, 9.0, 60), rng.normal(size=60), rng.integers(0, 9, 60)])
    taken = [
        (int(place), float(half)) for place, half in zip(rng.integers(0, 400, 3), rng.uniform(1, 9, 3), strict=True)
    ]
    blocked, kept = list(taken), []
    for row in candidates.tolist():
        if all(abs(row[1] - other) >= row[2] + half for other, half in blocked):
            kept.append(tuple(row))
        blocked.append((row[1], row[2]))
    assert _dominant(candidates, taken) == kept and 3 < len(kept) < 60
    assert _dominant(candidates[:0], taken) == []
