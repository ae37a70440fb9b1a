"""Crossings that are none: four ways in which one sweep misleads.

Unseen: it claims to be clear, but the mean heights of its own sweep do not show it. Plateau end: the sweep came down
from a crest to the base, taken for a hollow in the crest's level. Open crest: the sweep began or ended in the
disturbance, which may as well be a step seen from above. Cut off: it began or ended before the extreme.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapping import Feature, lengths
from mapping.assembly.free import CLEAR_SDS
from mapping.assembly.linking import Inspection, groups, uphill
from mapping.detection import Crossing
from mapping.geometry.mesh import distances
from mapping.geometry.templates import crest_trace

# Only crossings of at least this signal-to-noise ratio are tested, for this share of it.
CLAIM, SEEN_CLAIM_SHARE = 20.0, 0.3


def is_unseen(crossing: Crossing, inspection: Inspection) -> bool:
    """True if a clear crossing's section is not found in the heights, neither over the base nor over those beside.

    A detection's signal-to-noise ratio is of the whole stretch that was fitted together; a low crossing beside a high
    one may get all of it from the other. Times the standard deviation of the height, of the same fit under the same
    noise, it is the height that is claimed, whatever that noise is.
    """
    if crossing.snr < CLAIM or crossing.half_width < 1.2 * inspection.spacing:
        return False
    own = inspection.of_sweep(crossing.sweep)
    heights, gap = inspection.height[own], lengths(inspection.points[own] - crossing.point)
    inside, beside = gap < crossing.half_width, (gap > 1.2 * crossing.half_width) & (gap < 3 * crossing.half_width)
    if not inside.any():
        return False
    shape = np.sign(crossing.height) * crest_trace(gap[inside], np.sign(crossing.height), crossing.half_width)
    level = float(np.median(heights[beside])) if beside.any() else 0.0
    seen = [np.sign(crossing.height) * (shape @ (heights[inside] - base)) / (shape @ shape) for base in (0.0, level)]
    return bool(max(seen) < SEEN_CLAIM_SHARE * crossing.snr * crossing.height_sd)


# A hollow is felt below the base by this share of its depth ...
FELT_HOLLOW_SHARE = 0.2
# ... and a plateau stands above it by this share, within so many half-widths of the crossing.
PLATEAU, PLATEAU_REACH = 0.5, 2.0


def is_plateau_end(crossing: Crossing, inspection: Inspection) -> bool:
    """True if the sweep was at the base's level in the middle of a supposed hollow or crest, and off it on the other
    side beside: what was detected is the end of what the sweep ran along."""
    own = inspection.of_sweep(crossing.sweep)
    heights = np.sign(crossing.height) * inspection.height[own]
    gap = lengths(inspection.points[own] - crossing.point)
    middle = gap < 0.5 * crossing.half_width
    if not middle.any():
        return False
    tall = abs(crossing.height)
    beside = heights[gap < PLATEAU_REACH * crossing.half_width]
    felt = bool(
        heights[middle].mean() + 3 * inspection.sd[own][middle].mean() / np.sqrt(middle.sum())
        > FELT_HOLLOW_SHARE * tall
    )
    return not felt and bool(np.sort(-beside)[-2:].min() > PLATEAU * tall)


# Share of the crest at which a sweep that ends so high is still up.
STILL_UP = 0.25
# Places of a sweep whose heights are looked at, to a half-width w of a sharp crest of the typical height: its top lies
# w / 10 from one of them at most, where a parabola is lower by (1 / 10)^2, a hundredth
PLACES_OF_HALF = 5.0
# A crest is that of what was felt if it is half as high there, at least: half-way between it and nothing.
OUTERMOST = 0.5
# What is higher than this many heights of a step is more than the step.
HIGHER = 1.3


def is_open(crossing: Crossing, inspection: Inspection) -> bool:
    """True if the sweep's height had not come back to the base at its first or last place."""
    own = inspection.of_sweep(crossing.sweep)
    heights = np.sign(crossing.height) * inspection.height[own]
    if len(heights) < 4:
        return True
    sides = (heights[:2].mean(), heights[-2:].mean())
    up = max(STILL_UP * abs(crossing.height), 4 * float(np.median(inspection.sd[own])))
    # the two ends of the disturbance itself, in places of this sweep
    nearest = int(lengths(inspection.points[own] - crossing.point).argmin())
    return any(
        side > up and bool((part > 0.5 * up).all())
        for side, part in zip(sides, (heights[: nearest + 1], heights[nearest:]), strict=True)
    )


def cut_off(crossings: Sequence[Crossing], inspection: Inspection) -> list[Crossing]:
    """Crests and hollows of which only one flank was felt, by all sweeps that they are linked with: the rim of a plate
    that the rows begin on, a ridge or a step leave the same trace, and nothing tells how high what is beyond goes.

    Args:
        crossings: all that was detected.
        inspection: heights over the base's own levels, PLACES_OF_HALF to a half-width of theirs.
    """
    crests = [c for c in crossings if not c.is_step]
    cut = {id(c) for c in crests if is_cut(c, inspection)}
    found: list[Crossing] = []
    for sign in (1.0, -1.0) if cut else ():
        alike = [c for c in crests if c.height * sign > 0.0]
        for members in groups(alike, inspection, PLACES_OF_HALF * inspection.spacing) if alike else []:
            group = [alike[k] for k in members]
            found += group if all(id(c) in cut for c in group) else []
    return found


def is_cut(crossing: Crossing, inspection: Inspection) -> bool:
    """True if a sweep had not passed the extreme when it began or ended: its outermost place is as far off as any up to
    the crossing, but for noise."""
    own = inspection.of_sweep(crossing.sweep)
    gap = lengths(inspection.points[own] - crossing.point)
    nearest = int(gap.argmin())
    heights, sd = np.sign(crossing.height) * inspection.height[own], inspection.sd[own]
    for side in (slice(0, nearest + 1), slice(len(own) - 1, nearest - 1 if nearest else None, -1)):
        way, far = heights[side], gap[side]
        doubt = CLEAR_SDS * float(np.hypot(sd[side][0], sd[side][way.argmax()]))
        if far[0] < crossing.half_width and way[0] > OUTERMOST * abs(crossing.height) and way.max() - way[0] < doubt:
            return True
    return False


def comes_down(edge: Crossing, inspection: Inspection) -> bool:
    """True if the sweep was felt at the lower level beyond a step, and not only up to its own end."""
    own = inspection.of_sweep(edge.sweep)
    beyond = (inspection.points[own] - edge.point) @ uphill(edge) * -np.sign(edge.height) > 0
    low = np.abs(inspection.height[own][beyond]) < 0.5 * abs(edge.height)
    return bool(low.sum() >= 2)


def on_a_step(crest: Crossing, edges: Sequence[Crossing], steps: Sequence[Feature]) -> bool:
    """True if a crest is no higher than a step, and lies on its displaced side or over its edge."""
    for step in steps:
        if abs(crest.height) > HIGHER * step.height.median:
            continue
        own = [c for c in edges if distances(c.point[None], step.axis)[0] < c.half_width]
        if not own:
            continue
        nearest = min(own, key=lambda c: float(np.linalg.norm(c.point - crest.point)))
        side = np.sign(crest.height) * float((crest.point - nearest.point) @ _normal_to(step, nearest))
        if side > -2 * nearest.half_width:
            return True
    return False


def _normal_to(step: Feature, edge: Crossing) -> np.ndarray:
    """(3,) unit direction across a step's axis near one of its crossings, uphill."""
    k = int(np.linalg.norm(step.axis - edge.point, axis=1).argmin())
    way = step.axis[min(k + 1, len(step.axis) - 1)] - step.axis[max(k - 1, 0)]
    across = np.cross(edge.normal, way)
    norm = float(np.linalg.norm(across))
    rise = uphill(edge)
    return rise if norm == 0 else across / norm * (1.0 if across @ rise > 0 else -1.0)
