"""Recovery: crests of the detection limit are put into the quiet path of the log itself, and looked for again.

What is promised of a detection is measured where it is promised: with this log's noise, path, sampling and base, all
of the detection repeated but for the sizes of what is found elsewhere (injection and recovery, as searches for
gravitational waves state their sensitivity: Biswas, Brady, Creighton and Fairhurst, Classical and Quantum Gravity 26,
175009, 2009).
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np

from mapping import BoolArray, FloatArray, Trace, length_text
from mapping.base import LaidTrace
from mapping.detection.detect import Detections, detect

# Crests put in at once, and the fewest that say anything: with twenty, one in three hundred logs in which half are
# found would pass for one in which 95 % are.
INJECTED, FEWEST_INJECTED = 60, 20
# Half-widths of a crest between one and the next, so that they change the noise little (a twelfth of the path), and
# between a crest and what is no quiet path.
APART, ASIDE = 24.0, 2.0
# Factors by which the height rises while too few are found, or far too few, and how often.
RISE, STEEP_RISE, RISES = 1.12, 1.4, 8
FAR_TOO_FEW = 0.75
# Probability with which a true limit would be taken for a false one.
WRONGLY_RAISED = 0.05


def recovered(
    detections: Detections, laid: LaidTrace, rng: np.random.Generator, share: Any = lambda _: None, **settings: Any
) -> Detections:
    """The detections with the limit that was measured, and how many crests of that height were found.

    Args:
        detections: of the trace.
        laid: the trace on its base.
        rng: chooses the places.
        share: told the share done.
        settings: of `detect`, with which the trace was detected in.
    """
    height, tip = detections.detection_limit, laid.tip_radius
    if not np.isfinite(height) or height <= 0:
        return detections
    probability, found, injected = detections.probability, 0, 0
    for rise in range(RISES + 1):
        share(rise / (RISES + 1))
        half_width = float(np.sqrt(2 * tip * height))
        places = _places(detections, laid, half_width, rng)
        if len(places) < FEWEST_INJECTED and injected:
            break
        if len(places) < FEWEST_INJECTED:
            room = f"has room for {len(places)} of the {FEWEST_INJECTED} crests that this takes"
            short = f"the limit is computed, not measured: the quiet path {room}"
            return replace(detections, left_out=(*detections.left_out, short))
        again = detect(
            _with_crests(laid, places, height), laid.base, about=_about(laid, places, half_width), **settings
        )
        found = _count_found(again, laid, places, half_width)
        injected = len(places)
        if found >= _fewest(injected, probability):
            break
        height *= RISE if found > FAR_TOO_FEW * len(places) else STEEP_RISE
    remarks = detections.remarks
    if height > detections.detection_limit:
        enough = "" if found >= _fewest(injected, probability) else "at least "
        limits = [length_text(each, 2) for each in (detections.detection_limit, height)]
        remarks = (
            *remarks,
            f"the detection limit was raised from {limits[0]}, as computed, to {enough}{limits[1]}: {found} of the "
            f"last {injected} crests that were put into this log were found",
        )
    return replace(detections, detection_limit=height, recovered=found, injected=injected, remarks=remarks)


def _fewest(count: int, probability: float) -> int:
    """The fewest of so many that are found with probability 1 - WRONGLY_RAISED if each is with this probability."""
    from scipy.special import bdtr  # not scipy.stats, whose import takes 0.4 CPU s more

    return int(np.searchsorted(bdtr(np.arange(count + 1.0), count, probability), WRONGLY_RAISED))


def _places(
    detections: Detections, laid: LaidTrace, half_width: float, rng: np.random.Generator
) -> list[tuple[int, float]]:
    """(index of the sweep, arclength in m) of at most INJECTED places, far enough from all that is known."""
    places: list[tuple[int, float]] = []
    for number, sweep in enumerate(laid.laid_sweeps):
        s, quiet = sweep.arclength, np.ones(len(sweep.trace), dtype=bool)
        if len(s) < 2:
            continue
        for c in detections.crossings:
            if c.sweep == sweep.number:
                low, high = s[min(c.start, len(s) - 1)], s[min(c.stop, len(s)) - 1]
                quiet[(s > low - ASIDE * half_width) & (s < high + ASIDE * half_width)] = False
        candidates = np.arange(s[0] + rng.uniform(ASIDE, 0.5 * APART) * half_width, s[-1], APART * half_width)
        places += [(number, float(p)) for p in candidates if _clear(s, quiet, p, ASIDE * half_width)]
    if len(places) > INJECTED:
        places = [places[i] for i in np.sort(rng.choice(len(places), INJECTED, replace=False))]
    return places


def _clear(s: FloatArray, quiet: BoolArray, place: float, reach: float) -> bool:
    """True if the sweep covers so much path to both sides of a place, without a gap, and all of it is quiet."""
    low, high = np.searchsorted(s, [place - reach, place + reach])
    if low == 0 or high == len(s):
        return False
    return bool(quiet[low:high].all() and np.diff(s[low - 1 : high + 1]).max() < 0.25 * reach)


def _with_crests(laid: LaidTrace, places: list[tuple[int, float]], height: float) -> Trace:
    """The trace as if a sharp crest of this height crossed it at each place: sqrt(2 r D) wide to either side."""
    centers = laid.centers.copy()
    half_width = float(np.sqrt(2 * laid.tip_radius * height))
    begins = np.cumsum([0, *(len(sweep.trace) for sweep in laid.laid_sweeps)])
    for number, place in places:
        sweep = laid.laid_sweeps[number]
        low, high = np.searchsorted(sweep.arclength, [place - half_width, place + half_width])
        lift = height - (sweep.arclength[low:high] - place) ** 2 / (2 * laid.tip_radius)
        normals = sweep.feet(slice(low, high)).normals
        centers[begins[number] + low : begins[number] + high] += np.maximum(lift, 0.0)[:, None] * normals
    own = {each.name: getattr(laid, each.name) for each in fields(Trace) if each.init}
    return Trace(**(own | {"centers": centers}))


def _about(laid: LaidTrace, places: list[tuple[int, float]], half_width: float) -> dict[int, FloatArray]:
    """By the number of each sweep the intervals of arclength (M, 2), m, where the middle of a crest counts as found."""
    about: dict[int, list[tuple[float, float]]] = {}
    for number, place in places:
        about.setdefault(laid.laid_sweeps[number].number, []).append((place - half_width, place + half_width))
    return {sweep: np.array(intervals) for sweep, intervals in about.items()}


def _count_found(found: Detections, laid: LaidTrace, places: list[tuple[int, float]], half_width: float) -> int:
    """How many places have a crest in their middle."""
    crests = [c for c in found.crossings if c.height > 0]
    count = 0
    for number, place in places:
        sweep = laid.laid_sweeps[number]
        s = sweep.arclength
        middles = [
            0.5 * (s[min(c.start, len(s) - 1)] + s[min(c.stop, len(s)) - 1]) for c in crests if c.sweep == sweep.number
        ]
        count += any(abs(middle - place) < half_width for middle in middles)
    return count
