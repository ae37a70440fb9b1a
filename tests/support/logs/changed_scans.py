"""Two profiles over one row of crests of which some have changed, and what did."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from explore3d.log.own.record import Log
from mapping.trace import Trace

TIP = 10e-6
STEP = 0.5e-6
PITCH = 120e-6
NOISE = 20e-9


@dataclass(frozen=True)
class Pair:
    """Two scans, and the places (m, in the first's frame) of crests by what became of them."""

    first: Log
    second: Log
    truth: dict[str, np.ndarray]


def scan(places: np.ndarray, heights: np.ndarray, rng: np.random.Generator, count: int, shift: float = 0.0) -> Log:
    """A profile over round crests; `shift` is by how much its frame lies off."""
    x = STEP * np.arange(int(count * PITCH / STEP))
    z = np.zeros(len(x))
    for place, height in zip(places, heights, strict=True):
        z = np.maximum(z, height - (x - place) ** 2 / (2.0 * (TIP + 10e-6)))
    z += 2e-3 * x + NOISE * rng.standard_normal(len(x))
    centers = np.column_stack([x - shift, np.zeros_like(x), TIP + z])
    return Log(Trace(1e-3 * np.arange(len(x)), centers, np.zeros(len(x), dtype=np.int64), TIP))


def changed_pair(seed: int, crests: int = 100, changes: int = 30) -> Pair:
    """Of the crests a fifth of the changes each: gone, new, grown, shrunk, moved; the second frame is shifted."""
    rng = np.random.default_rng(seed)
    each = changes // 5
    places = PITCH * (np.arange(crests + each) + 0.5 + 0.15 * rng.uniform(-1, 1, crests + each))
    heights = 1e-6 * rng.uniform(0.6, 1.5, crests + each)
    order = rng.permutation(crests + each)
    new, gone, grown, shrunk, moved = (order[k * each : (k + 1) * each] for k in range(5))
    first = np.setdiff1d(np.arange(crests + each), new)
    second = np.setdiff1d(np.arange(crests + each), gone)
    later_places, later_heights = places.copy(), heights.copy()
    later_heights[grown] *= 1.0 + rng.uniform(0.1, 0.3, each)
    later_heights[shrunk] *= 1.0 - rng.uniform(0.1, 0.3, each)
    later_places[moved] += rng.choice([-1, 1], each) * rng.uniform(2e-6, 6e-6, each)
    names = {"new": new, "gone": gone, "grown": grown, "shrunk": shrunk, "moved": moved}
    return Pair(
        scan(places[first], heights[first], rng, crests + each),
        scan(later_places[second], later_heights[second], rng, crests + each, shift=7.3e-6),
        {name: places[which] for name, which in names.items()},
    )


def errors(pair: Pair, found: list[tuple[str, float]]) -> tuple[int, int]:
    """Of the changes (kind, place) that were found: how many are true, how many false; a place within half a pitch."""
    true = 0
    for kind, places in pair.truth.items():
        for place in places:
            true += any(name == kind and abs(where - place) < 0.3 * PITCH for name, where in found)
    return true, len(found) - true
