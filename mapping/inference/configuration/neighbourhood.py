"""Neighbourhood: the inspected places around some features, and how likely heights there are under any of them."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from mapping import BoolArray, Feature, FloatArray, IntArray
from mapping.base import over_levels
from mapping.detection import Crossing
from mapping.geometry.mesh import distances
from mapping.inference.families import Sizes, Surroundings, tells_of_line
from mapping.inference.joint import JoinedShape
from mapping.inference.kinds import kind_of, rise_of, sizes_of
from mapping.inference.likelihood import Likelihood, Shape, Window, build_likelihood
from mapping.instrument import Noise

# How wrong the shapes of a configuration may be about a real detail, in shares of its height: which of these it is the
# data say. In parts of a fifteenth of a half-width w the mean of what is the higher of two crests is off by up to the
# change of slope times an eighth of a part, (2 H / w) (w / 15) / 8 = 0.02 H, in one part of a crossing; facets of a
# round crest (24 to its circle) are 0.004 H inside it; 0.04 is SHAPE_ERROR, what crests that were touched showed.
# Coarse facets, which turn by up to 13 degrees under a groove of the double ring, put the ball up to a sixth of the
# depth off what a smooth base would let it feel: 0.08 is twice the rms of that along the groove
MISFIT_SHARES = (0.01, 0.04, 0.08)
# Places so many half-widths beside a crest belong to its window: as many again as it disturbs, which tell the base
NEIGHBOURHOOD_REACH = 2.0
# Parts of a bin: where the higher of two crests changes within one, the mean of both heights misses a ninth of what it
# would in the whole bin
PARTS_OF_BIN = 3
# Places that can tell a feature from another: what the smallest has parameters
FEWEST_PLACES = 8
# Share of its height by which a detail may differ from the level that it is: the next one is at least twice the noise
# away (see mapping.base.terraces), and what is half as high has a wall of its own
SAME_LEVEL = 0.25
# Faces whose normals differ by less are one plane
SAME_PLANE = 1e-9


@dataclass(frozen=True, eq=False)
class Places:
    """Mean heights at places along sweeps, in the order in which each sweep passed them.

    Args:
        points, normals: (M, 3) on the base, m, and outward.
        height: (M,) mean heights over the base, m.
        samples: (M,) samples behind each.
        sweep: (M,) number of the sweep.
        spacing: distance between neighbours along a sweep, m.
        stepped: (M,) of a base with levels the heights over its lowest, where `height` is over the level that each
            place stands on; none: it has one level.
        jumped: (M,) standard deviation of what each mean is off where the height jumps between samples, m; none: 0.
    """

    points: FloatArray
    normals: FloatArray
    height: FloatArray
    samples: IntArray
    sweep: IntArray
    spacing: float
    stepped: FloatArray = field(default_factory=lambda: np.zeros(0))
    jumped: FloatArray = field(default_factory=lambda: np.zeros(0))

    @property
    def path(self) -> float:
        """Length that was inspected, m."""
        return self.spacing * int((self.samples > 0).sum())


@dataclass(frozen=True, eq=False)
class Neighbourhood:
    """What configurations of one neighbourhood are weighed on: the same places, noise and base for all.

    Args:
        window: the places as bins.
        fine: the same with PARTS_OF_BIN bins for each one: shapes are laid on it.
        around: trace, base and noise.
        levels: likelihood under each of MISFIT_SHARES, and the log of its normalisation.
        half_width: of the narrowest disturbance, m.
        told: (M, 3) places where single sweeps detected something, m.
        false_alarms_per_metre: false features that are accepted, 1/m of path.
        held: details of other neighbourhoods that reach into this one, and stay as they are.
        theirs: the parameters of these in a row.
        elsewhere: details that the log shows in other neighbourhoods.
        path: that was inspected in all, m.
    """

    window: Window
    fine: Window
    around: Surroundings
    levels: tuple[tuple[Likelihood, float], ...]
    half_width: float
    told: FloatArray
    false_alarms_per_metre: float
    held: tuple[Shape, ...] = ()
    theirs: FloatArray = field(default_factory=lambda: np.zeros(0))
    elsewhere: int = 0
    path: float = np.inf

    def log_company(self, details: int) -> float:
        """Log of how much more probable so many details are here than at the accepted rate of false alarms a, by what
        the log shows elsewhere.

        How many details a body bears on a metre of path is not known by its order of magnitude, but that it is a at
        least: of a rate λ with p(λ) ~ 1/λ the marginal of Poisson's law makes one more beside n others in a path of
        length L n/L times as probable as it is long, where that exceeds a.
        """
        beside = np.arange(self.elsewhere, self.elsewhere + details) / self.path
        return float(np.log(np.maximum(beside / self.false_alarms_per_metre, 1.0)).sum())

    def joined(self, shapes: Sequence[Shape]) -> JoinedShape:
        """Some shapes over `fine` and what reaches into the neighbourhood, as they are felt together."""
        return JoinedShape(shapes, len(self.window), PARTS_OF_BIN, self.held, self.theirs)


def neighbourhood(
    features: Sequence[Feature],
    crossings: Sequence[Crossing],
    places: Places,
    around: Surroundings,
    false_alarms_per_metre: float,
    beside: Sequence[Feature] = (),
    elsewhere: int = 0,
) -> Neighbourhood | None:
    """The neighbourhood of some features and crossings, with others beside, and so many elsewhere; None where too few
    places tell of it."""
    tip = around.trace.tip_radius
    sizes = [sizes_of(feature, tip) for feature in features]
    widths = [size.half_width for size in sizes] + [thin_half_width(crossing, tip) for crossing in crossings]
    axes = [feature.axis for feature in features] + [crossing.point[None] for crossing in crossings]
    near = np.zeros(len(places.points), dtype=bool)
    for axis, width in zip(axes, widths, strict=True):
        near |= distances(places.points, axis) < NEIGHBOURHOOD_REACH * width
    near &= ~_ended(features, widths, places)
    near &= places.samples > 0
    parts_levels = len(places.stepped) > 0 and any(
        goes_on(feature) or _is_level(feature, size, around) for feature, size in zip(features, sizes, strict=True)
    )
    if parts_levels:  # an edge between two levels is nothing to one who stands on both
        places = replace(places, height=places.stepped)
    if near.sum() < FEWEST_PLACES:
        return None
    window = window_of(places, near)
    if not len(window):  # of sweeps with a few samples each no run of places is left
        return None
    if parts_levels:
        window = replace(window, height=over_levels(window.height, window.starts[1:-1], around.base.levels))
    height = max([size.height for size in sizes] or [abs(crossing.height) for crossing in crossings])
    half_width = min([size.half_width for size in sizes] or widths)
    nuisance = around.nuisance(height, rise_of(beside))
    levels = []
    for share in MISFIT_SHARES:
        noise = with_waves(around.noise, share * height, half_width)
        likelihood = build_likelihood(window, noise, nuisance, 1e-9 * height)
        constant = np.log(likelihood.filter.scale).sum() + 0.5 * np.log1p(-likelihood.shrink).sum()
        levels.append((likelihood, float(constant)))
    told = np.array([crossing.point for crossing in crossings]).reshape(-1, 3)
    return Neighbourhood(
        window, _finer(window), around, tuple(levels), half_width, told, false_alarms_per_metre,
        elsewhere=elsewhere, path=places.path,
    )  # fmt: skip


def _ended(features: Sequence[Feature], widths: Sequence[float], places: Places) -> BoolArray:
    """(M,) True of places where a line that has no ends of its own had ended, and no other feature is."""
    ended = np.zeros(len(places.points), dtype=bool)
    about = [
        distances(places.points, feature.axis) < NEIGHBOURHOOD_REACH * width
        for feature, width in zip(features, widths, strict=False)
    ]
    for feature, width, near in zip(features, widths, about, strict=False):
        if goes_on(feature) and not feature.closed:
            index = np.flatnonzero(near)
            run = np.cumsum((np.diff(index, prepend=-2) > 1) | (np.diff(places.sweep[index], prepend=-1) != 0))
            tells = tells_of_line(feature.axis, feature.normals, places.points[index], run, width)
            ended[index[~tells]] = True
    for feature, near in zip(features, about, strict=True):
        ended &= goes_on(feature) | ~near
    return ended


def goes_on(feature: Feature) -> bool:
    """True of a line that has no ends of its own, as an edge between two levels."""
    return kind_of(feature).line and not kind_of(feature).has_ends


def _is_level(feature: Feature, size: Sizes, around: Surroundings) -> bool:
    """True of a hollow or ridge whose bottom or top one of the base's levels is: as high, and wider than what the ball
    rounds off beside its walls."""
    rounded = 2.0 * float(np.sqrt(2.0 * around.trace.tip_radius * size.height))
    apart = np.abs(np.delete(around.base.levels, 0) - feature.height.median)
    return feature.width.low > rounded and bool((apart < SAME_LEVEL * size.height).any())


def thin_half_width(crossing: Crossing, tip: float) -> float:
    """Half-width of the disturbance of a sharp crest as high as a crossing, m."""
    return float(np.sqrt(2.0 * tip * abs(crossing.height)))


def with_waves(noise: Noise, sd: float, length: float) -> Noise:
    """A noise together with errors that are correlated over a length (m): what a shape gets wrong it gets wrong over a
    part of itself. Both correlated parts are joined into one of the same variance and the same weight in long means."""
    own, more = noise.correlated**2, sd**2
    joined = (own * noise.length + more * length) / max(own + more, np.finfo(float).tiny)
    return replace(noise, correlated=float(np.sqrt(own + more)), length=joined)


def _finer(window: Window) -> Window:
    """The window with each bin cut into PARTS_OF_BIN; a single sample was felt at a point, not all over its bin."""
    share = np.tile((np.arange(PARTS_OF_BIN) - 0.5 * (PARTS_OF_BIN - 1)) * 2.0 / PARTS_OF_BIN, len(window))
    feet, normals, tangents = (
        np.repeat(each, PARTS_OF_BIN, axis=0) for each in (window.feet, window.normals, window.tangents)
    )
    extent = np.where(window.count > 1, window.half, 0.0)
    half, place = np.repeat(extent, PARTS_OF_BIN), np.repeat(window.place, PARTS_OF_BIN)
    return replace(
        window,
        feet=feet + (share * half)[:, None] * tangents,
        normals=normals,
        tangents=tangents,
        height=np.repeat(window.height, PARTS_OF_BIN),
        count=np.repeat(window.count, PARTS_OF_BIN),
        place=place + share * half,
        last=place + share * half,
        half=half / PARTS_OF_BIN,
        starts=PARTS_OF_BIN * window.starts,
        jumped=np.repeat(np.broadcast_to(window.jumped, len(window)), PARTS_OF_BIN),
    )


def window_of(places: Places, keep: BoolArray) -> Window:
    """The chosen places as bins: a run ends where a sweep does, or where it leaves them.

    Places that lie closer together than a sweep's samples have none at every second of them: that ends no run, else
    nothing would be left of pecks.
    """
    index = np.flatnonzero(keep & (places.samples > 0))
    felt = np.cumsum(places.samples > 0)
    jump = (np.diff(felt[index]) > 1) | (np.diff(places.sweep[index]) != 0)
    apart = np.linalg.norm(np.diff(places.points[index], axis=0), axis=1)
    gaps = apart > 3.0 * places.spacing * np.diff(index)
    starts = np.concatenate([[0], np.flatnonzero(jump | gaps) + 1, [len(index)]]).astype(np.int64)
    # a run of a place or two tells the base alone
    long = np.repeat(np.diff(starts) > 3, np.diff(starts))
    starts = np.concatenate([[0], np.cumsum(np.diff(starts)[np.diff(starts) > 3])]).astype(np.int64)
    index = index[long]
    points, normals = places.points[index], places.normals[index]
    tangents, place = np.zeros_like(points), np.zeros(len(index))
    for start, stop in itertools.pairwise(starts):
        along = np.gradient(points[start:stop], axis=0)
        tangents[start:stop] = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), np.finfo(float).tiny)
        place[start:stop] = places.spacing * (index[start:stop] - index[start])
    flat = len(index) > 0 and float(np.ptp(normals, axis=0).max()) < SAME_PLANE
    half = np.full(len(index), 0.5 * places.spacing)
    count = places.samples[index].astype(np.int64)
    jumped = places.jumped[index] if len(places.jumped) else 0.0
    return Window(points, normals, tangents, places.height[index], count, place, place + half, half, starts,
                  int(count.sum()), bool(flat), jumped=jumped)  # fmt: skip
