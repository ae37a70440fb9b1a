"""Pursuit: which thin crests, instead of some of a configuration's details, would explain best what is felt.

Where two lines cross, or a bump stands beside a line, one line that bends is an optimum of its own: no detail that is
added or taken away makes it likelier, for it explains most of what each of the two leaves. Crests whose place and
height are read off the trace need no fit to be weighed: hundreds are tried in the place of any detail, and others
beside the likeliest of them, until none pays for itself (matching pursuit; Mallat and Zhang, IEEE Transactions on
Signal Processing 41, 1993). The likeliest answers are then fitted like any other proposal.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from mapping import BoolArray, FloatArray, IntArray
from mapping.inference.configuration.configuration import PEAK_SDS, Configuration, laid
from mapping.inference.configuration.neighbourhood import Neighbourhood
from mapping.inference.families import StepShape
from mapping.inference.likelihood import Likelihood

# Tops that lines are drawn through, two by two, and that square times places: a bound on time, some fits of one detail,
# and memory, five arrays of 24 MB
MOST_TOPS, MOST_HEIGHTS = 32, 2_000_000
# Likeliest crests that are gone on from, in the place of each detail. Of twelve building plates that nothing else
# explains (`bench odds --counts --building`, seeds 1309 to 1544) 8 are right with 3 and with 6, 5 with 1
GONE_ON_FROM = 3
# Half-widths by which ends are shifted, and factors of heights, one round after the other: without them 3 of the twelve
# are right. The second round, or the factors, may go without harm on these, not both: of 100 plates (building seeds
# 1100 to 1199) 89 are right then instead of 93, and 5 left open instead of 1
SHIFTS, HEIGHT_FACTORS = (1.0, 0.4), (0.85, 1.0, 1.15)
# Half-widths beside its run that a spot may lie: 2 of the twelve are left open, with two places or none 3
BESIDE_RUN = (-0.7, -0.35, 0.35, 0.7)
# Half-widths about a top within which its height is the mean of what its run felt there; with 0.2 as many are right,
# with 0.8 one less
TOP = 0.4


@dataclass(frozen=True, eq=False)
class Crests:
    """Thin crests that may be there.

    Args:
        axes: (K, 2, 3) both ends on the base, m; of a spot they are one.
        heights: (K,) over the base, m.
        traces: (K, n) heights over the base at which the ball rests on each alone, m.
    """

    axes: FloatArray
    heights: FloatArray
    traces: FloatArray

    def __len__(self) -> int:
        return len(self.heights)

    def some(self, numbers: list[int]) -> Crests:
        """Those of some numbers."""
        return Crests(self.axes[numbers], self.heights[numbers], self.traces[numbers])


@dataclass(frozen=True, eq=False)
class Answer:
    """What may be there instead.

    Args:
        kept: numbers of the details that stay.
        crests: what is there beside them.
        gain: log odds that this gains before a fit.
    """

    kept: tuple[int, ...]
    crests: Crests
    gain: float


def pursued(now: Configuration) -> list[Answer]:
    """What the trace of a configuration may be made of, that which gains most first."""
    crests, place, every = crests_of(now), now.place, tuple(range(len(now.parts)))
    if not len(crests):
        return []
    likelihood = place.levels[-1][0]  # what is not fitted is off by as much as the most misfit
    # of one detail more, before the data: as many false ones are accepted on the path over which it is felt
    cost = max(-float(np.log(place.false_alarms_per_metre * 2.0 * place.half_width)), 0.0)
    found: dict[tuple[tuple[int, ...], tuple[int, ...]], Answer] = {}
    own = float(likelihood.log_density(now.template[None])[0]) - cost * len(every)
    # a change of level is none of crests, however many explain it
    steps = tuple(k for k in every if isinstance(now.parts[k].shape, StepShape))
    fewer = itertools.combinations(every, max(len(every) - 1, 0))
    for kept in dict.fromkeys([every, *(some for some in fewer if set(steps) <= set(some)), steps]):
        felt = laid([now.parts[k] for k in kept], place).template
        odds = likelihood.log_density(np.maximum(felt, crests.traces))
        for first in _likeliest(odds, crests, place.half_width):
            chosen, best, together = [first], float(odds[first]), np.maximum(felt, crests.traces[first])
            while True:
                more = likelihood.log_density(np.maximum(together, crests.traces))
                k = int(np.argmax(more))
                if more[k] <= best + cost:
                    break
                chosen.append(k)
                best, together = float(more[k]), np.maximum(together, crests.traces[k])
            names = kept, tuple(sorted(chosen))
            if names not in found:
                some, best = _shifted(crests.some(chosen), felt, place, likelihood)
                found[names] = Answer(kept, some, best - cost * (len(kept) + len(chosen)) - own)
    return sorted(found.values(), key=lambda answer: -answer.gain)


def _shifted(crests: Crests, ground: FloatArray, place: Neighbourhood, likelihood: Likelihood) -> tuple[Crests, float]:
    """Some crests with the ends and heights that are likeliest of a few about theirs, one after the other, over what
    others leave (n,), m; and the log density then. Beneath a higher crest no top shows where a line ends."""
    axes, heights, traces, best = crests.axes.copy(), crests.heights.copy(), crests.traces.copy(), -np.inf
    window = place.window
    for step in SHIFTS:
        for k in range(len(crests)):
            rest = np.maximum(ground, np.delete(traces, k, axis=0).max(axis=0, initial=-np.inf))
            way = axes[k, 1] - axes[k, 0]
            length = float(np.linalg.norm(way))
            if length > 0.0:  # each end along the line
                ways = np.eye(2)[..., None] * way / length
            else:  # a spot along its run and across
                near = int(np.linalg.norm(window.feet - axes[k, 0], axis=1).argmin())
                across = np.cross(window.normals[near], window.tangents[near])
                ways = np.array([[window.tangents[near]] * 2, [across] * 2])
            first, second, factor = (each.ravel() for each in np.meshgrid((-1, 0, 1), (-1, 0, 1), HEIGHT_FACTORS))
            some = axes[k] + step * place.half_width * np.tensordot(np.stack([first, second], axis=1), ways, axes=1)
            onward = (some[:, 1] - some[:, 0]) @ way >= 0.0  # no line turns over
            some, high = some[onward], heights[k] * factor[onward]
            own = _traces(some, high, place)
            odds = likelihood.log_density(np.maximum(rest, own))
            m = int(np.argmax(odds))
            axes[k], heights[k], traces[k], best = some[m], high[m], own[m], float(odds[m])
    return Crests(axes, heights, traces), best


def _likeliest(odds: FloatArray, crests: Crests, half_width: float) -> list[int]:
    """Numbers of the likeliest crests, each with an end that is half_width (m) and more off those of the others."""
    chosen: list[int] = []
    for k in np.argsort(-odds):
        apart = [float(np.abs(crests.axes[k] - crests.axes[m]).max()) for m in chosen]
        if min(apart, default=np.inf) > half_width:
            chosen.append(int(k))
        if len(chosen) == GONE_ON_FROM:
            break
    return chosen


def crests_of(now: Configuration) -> Crests:
    """Spots at the tops of what each run felt, over the base and over the configuration, beside and between these;
    straight lines from any top to any other, as high as both in the mean, and as the lower one."""
    place, tip = now.place, now.place.around.trace.tip_radius
    at, height = _tops(now)
    feet = place.window.feet[at]
    run = np.searchsorted(place.window.starts, at, side="right")
    i, j = np.triu_indices(len(at), 1)
    across = feet[j] - feet[i]
    length = np.linalg.norm(across, axis=1)
    # a spot of height h between two rows is felt h - d^2 / 2R on each, which says how far it is from both
    radius = tip + 0.5 * np.maximum(height[i], height[j])
    share = 0.5 + radius * (height[j] - height[i]) / np.maximum(length**2, np.finfo(float).tiny)
    inside = (run[i] != run[j]) & (np.abs(share - 0.5) < 0.5)
    inside &= length < 2.0 * np.sqrt(2.0 * tip * np.maximum(height[i], height[j]))
    between = feet[i] + share[:, None] * across
    raised = height[i] + (share * length) ** 2 / (2.0 * radius)
    # where another crest hides it on one of the rows, the other alone tells it, as high as it is far
    off = np.array(BESIDE_RUN)[:, None] * place.half_width
    across_run = np.cross(place.window.normals[at], place.window.tangents[at])
    beside = (feet + off[..., None] * across_run).reshape(-1, 3)
    higher = (height + off**2 / (2.0 * tip)).ravel()
    long = length > 0.5 * place.half_width
    spots, lines = np.concatenate([feet, between[inside], beside]), np.stack([feet[i], feet[j]], axis=1)[long]
    axes = np.concatenate([np.stack([spots, spots], axis=1), lines, lines])
    mean, low = 0.5 * (height[i] + height[j]), np.minimum(height[i], height[j])
    heights = np.concatenate([height, raised[inside], higher, mean[long], low[long]])
    return Crests(axes, heights, _traces(axes, heights, place))


def _tops(now: Configuration) -> tuple[IntArray, FloatArray]:
    """(T,) places where a thin crest stands out most along its run, of the bare base and of the configuration, and the
    (T,) heights that are felt there, m."""
    window, tip, half = now.place.window, now.place.around.trace.tip_radius, now.place.half_width
    strength = np.zeros(len(window))
    for off in (laid([], now.place).standing_off, now.standing_off):
        top = _highest(off, window.starts)
        strength[top] = np.maximum(strength[top], off[top])
    most = min(MOST_TOPS, int(np.sqrt(MOST_HEIGHTS / len(window))))
    at = np.flatnonzero(strength > PEAK_SDS)
    at = np.sort(at[np.argsort(-strength[at])][:most])
    heights, felt = np.zeros(len(at)), now.felt
    for k, place in enumerate(at):
        number = int(np.searchsorted(window.starts, place, side="right"))
        own = slice(int(window.starts[number - 1]), int(window.starts[number]))
        square = ((window.feet[own] - window.feet[place]) ** 2).sum(axis=1)
        near = square <= (TOP * half) ** 2
        heights[k] = (felt[own][near] + square[near] / (2.0 * tip)).mean()
    stands = heights > 0.0
    return at[stands], heights[stands]


def _highest(values: FloatArray, starts: IntArray) -> BoolArray:
    """(n,) True where values (n,) are higher than at both neighbours along a run."""
    top = np.zeros(len(values), dtype=bool)
    for start, stop in itertools.pairwise(starts):
        own = np.concatenate([[-np.inf], values[start:stop], [-np.inf]])
        top[start:stop] = (own[1:-1] >= own[:-2]) & (own[1:-1] > own[2:])
    return top


def _traces(axes: FloatArray, heights: FloatArray, place: Neighbourhood) -> FloatArray:
    """(K, n) heights over the base at which the ball rests on thin crests of such axes (K, 2, 3) and heights (K,), m:
    their height less d^2 / 2R at a distance d, R the sum of both radii."""
    feet, tip = place.window.feet, place.around.trace.tip_radius
    middle = feet.mean(axis=0)
    feet, first, way = feet - middle, axes[:, 0] - middle, axes[:, 1] - axes[:, 0]
    square = (way**2).sum(axis=1)[:, None]
    # in place: there are thousands of crests, and as many places
    onward = way @ feet.T
    onward -= (way * first).sum(axis=1)[:, None]
    share = onward / np.maximum(square, np.finfo(float).tiny)
    np.clip(share, 0.0, 1.0, out=share)
    apart = first @ feet.T
    apart *= -2.0
    apart += (feet**2).sum(axis=1)
    apart += (first**2).sum(axis=1)[:, None]
    onward *= -2.0
    onward += share * square
    onward *= share
    apart += onward
    apart /= -(2.0 * tip + heights[:, None])
    apart += heights[:, None]
    return np.asarray(apart)
